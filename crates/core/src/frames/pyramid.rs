//! Image pyramids of frames.

use super::grey::GreyImage;
use super::local_contrast::{LocalContrast, clip_outliers, local_contrast, wide_window};
use std::sync::{Arc, OnceLock};

/// A frame at full resolution (level 0) and repeatedly halved; levels from 1 on are clipped
/// ([`crate::frames::local_contrast::clip_outliers`]).
#[derive(Clone, Debug)]
pub struct Pyramid {
    full: GreyImage,
    /// Levels from 1 on, computed on demand.
    halved: Vec<OnceLock<GreyImage>>,
    /// Local contrast of the levels, computed on demand.
    contrasts: Vec<OnceLock<Arc<LocalContrast>>>,
}

impl Pyramid {
    /// Creates a pyramid of `levels` levels (at least one).
    pub fn new(image: GreyImage, levels: usize) -> Self {
        Self {
            full: image,
            halved: vec![OnceLock::new(); levels.saturating_sub(1)],
            contrasts: vec![OnceLock::new(); levels.max(1)],
        }
    }

    /// Number of levels.
    pub fn levels(&self) -> usize {
        self.contrasts.len()
    }

    /// The image at `level`; 0 is full resolution.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn level(&self, level: usize) -> &GreyImage {
        match level.checked_sub(1) {
            None => &self.full,
            Some(finer) => {
                self.halved[finer].get_or_init(|| clip_outliers(&self.level(finer).halved()))
            }
        }
    }

    /// The local contrast at `level` over the window for whole images, computed on demand.
    pub fn contrast(&self, level: usize) -> Arc<LocalContrast> {
        let image = self.level(level);
        let made = self.contrasts[level]
            .get_or_init(|| Arc::new(local_contrast(image, wide_window(image))));
        Arc::clone(made)
    }
}
