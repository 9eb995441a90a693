//! Interface of an effect on frames.

use tunnelstitch_core::frames::GreyImage;

/// Step between the light of the scene and the picture, in grey levels.
pub(crate) trait FrameEffect: Send + Sync {
    /// Applies the effect to the image of frame number `frame`.
    fn apply(&self, frame: usize, image: GreyImage) -> GreyImage;
}
