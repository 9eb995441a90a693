//! Options of drawing: interpolation, choice of frames, blending, super-resolution.

use serde::Serialize;
use tunnelstitch_geometry::numerics::kernel::Interpolation;

/// Choice of the frames that a pixel of the panorama shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Mode {
    /// Best frame at each place; frames change along seams where they agree.
    #[default]
    BestView,
    /// Mean of all frames, weighted by `tent(u) tent(v)`: 1 in the middle of a frame, 0 at its
    /// edge.
    Average,
    /// Median of all frames: what most of them show.
    Median,
}

/// Options of drawing a panorama.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RenderOptions {
    /// Interpolation of frames between their pixels.
    pub interpolation: Interpolation,
    /// Choice of the frames that a pixel shows.
    pub mode: Mode,
    /// True if exposure is undone and light is blended over seams; else frames keep their values.
    pub blend: bool,
    /// True if the wall is solved from all frames, finer than any of them
    /// ([`tunnelstitch_super_resolve`]); exposure must be undone for it.
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
    /// True if thumbnails of all frames are needed before the first tile is drawn.
    pub(crate) fn needs_thumbnails(&self) -> bool {
        self.blend || self.mode == Mode::BestView
    }
}
