//! The image pyramid of a frame.

use super::GreyImage;
use super::contrast::subdued;

/// A frame at full size (level 0) and halved again and again, from level 1 on without its extremes
/// ([`super::contrast::subdued`]).
#[derive(Clone, Debug)]
pub struct Pyramid {
    levels: Vec<GreyImage>,
}

impl Pyramid {
    /// Builds `levels` levels (at least one).
    pub fn new(image: GreyImage, levels: usize) -> Self {
        let mut pyramid = vec![image];
        while pyramid.len() < levels {
            let next = pyramid[pyramid.len() - 1].halved();
            pyramid.push(subdued(&next));
        }
        Self { levels: pyramid }
    }

    /// The image at `level`; 0 is full size.
    pub fn level(&self, level: usize) -> &GreyImage {
        &self.levels[level]
    }
}
