//! Options of drawing: interpolation, choice of frames, blending, super-resolution.

use crate::numerics::kernel::Interpolation;
use serde::Serialize;

/// Which frames a pixel of the panorama shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Mode {
    /// The frame that shows the wall best there; frames change along seams where they agree.
    #[default]
    BestView,
    /// The mean of all frames, weighted by `tent(u) tent(v)`: 1 in the middle of a frame, 0 at its
    /// edge.
    Average,
    /// The median of all frames: what most of them show.
    Median,
}

/// How frames become a panorama.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RenderOptions {
    /// How frames are sampled between their pixels.
    pub interpolation: Interpolation,
    /// Which frames a pixel shows.
    pub mode: Mode,
    /// Whether exposure is undone and light levelled out over seams; else frames keep the values
    /// they have.
    pub blend: bool,
    /// Whether the wall is solved from all frames, finer than any of them
    /// ([`crate::super_resolve`]); exposure must be undone for it.
    pub super_resolve: bool,
}

impl Default for RenderOptions {
    fn default() -> Self {
        Self {
            interpolation: Interpolation::default(),
            mode: Mode::default(),
            blend: true,
            super_resolve: false,
        }
    }
}

impl RenderOptions {
    /// Whether small pictures of all frames are needed before the first tile is drawn.
    pub(crate) fn needs_thumbnails(&self) -> bool {
        self.blend || self.mode == Mode::BestView
    }
}
