//! A frame that observes a tile.

use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::workspace::TileObservation;

/// A frame that observes all of a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// Index of the frame among those of the [`crate::samples::visibility::Visibility`].
    pub frame: u32,
    /// Pixels per sample of the tile in this frame, q: the weight by which every pixel counts once,
    /// however oblique the frame is. It stays constant while the poses move; otherwise a step could
    /// lower the cost by a more oblique view of the wall.
    pub pixels: f32,
    /// The camera's shading V at the tile's centre; constant as well.
    pub shade: f32,
}

impl Observer {
    /// The observation for the work on the tile; `frames` are those of the visibility.
    #[inline(always)]
    pub fn observation<'f>(&self, frames: &'f [SampledFrame<'f>]) -> TileObservation<'f> {
        TileObservation {
            frame: &frames[self.frame as usize],
            pixels: self.pixels,
            shade: self.shade,
        }
    }
}
