//! State of unfinished files, as a checkpoint keeps it.

use crate::output::gaps::Coverage;
use crate::output::panorama::Panorama;
use crate::output::preview::Preview;
use crate::output::raster_target::RasterState;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;

/// Name of the state in the checkpoint.
pub(super) const STATE: &str = "files";

/// Name of the panorama's compressed tiles in the checkpoint.
pub(super) const PANORAMA: &str = "panorama";

/// State of all files; by default nothing has begun.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct FilesState<'a> {
    /// Bands that all files have received.
    pub(super) bands: usize,
    pub(super) coverage: Option<Cow<'a, Coverage>>,
    pub(super) picture: Option<Cow<'a, Panorama>>,
    pub(super) cog: Option<RasterState<'a>>,
    pub(super) dzi: Option<RasterState<'a>>,
    pub(super) maps: Option<MapsState<'a>>,
}

/// State of the maps.
#[derive(Default, Serialize, Deserialize)]
pub(super) struct MapsState<'a> {
    pub(super) coverage: Option<RasterState<'a>>,
    pub(super) frames: Option<RasterState<'a>>,
    pub(super) preview: Option<Cow<'a, Preview>>,
}
