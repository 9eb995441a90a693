//! The image pyramid of a frame.

use super::GreyImage;
use super::contrast::{LocalContrast, local_contrast, subdued, wide_window};
use std::sync::{Arc, OnceLock};

/// A frame at full size (level 0) and halved again and again, from level 1 on without its extremes
/// ([`super::contrast::subdued`]).
#[derive(Clone, Debug)]
pub struct Pyramid {
    levels: Vec<GreyImage>,
    /// What has been asked for.
    contrasts: Vec<OnceLock<Arc<LocalContrast>>>,
}

impl Pyramid {
    /// Builds `levels` levels (at least one).
    pub fn new(image: GreyImage, levels: usize) -> Self {
        let mut pyramid = vec![image];
        while pyramid.len() < levels {
            let next = pyramid[pyramid.len() - 1].halved();
            pyramid.push(subdued(&next));
        }
        Self {
            contrasts: vec![OnceLock::new(); pyramid.len()],
            levels: pyramid,
        }
    }

    /// The image at `level`; 0 is full size.
    pub fn level(&self, level: usize) -> &GreyImage {
        &self.levels[level]
    }

    /// The local contrast at `level`, over a window as wide as light is smooth; made when first asked for.
    pub fn contrast(&self, level: usize) -> Arc<LocalContrast> {
        let image = &self.levels[level];
        let made = self.contrasts[level]
            .get_or_init(|| Arc::new(local_contrast(image, wide_window(image))));
        Arc::clone(made)
    }
}
