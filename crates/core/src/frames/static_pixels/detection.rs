//! Detection of static pixels from the temporal statistics and the motion of the wall.

use super::motion_field::MotionField;
use super::temporal_statistics::TemporalStatistics;
use super::{constant_areas, outline, ridges};
use crate::frames::mask::Mask;
use image::{GrayImage, Luma};

/// Largest share of the picture that is believed to be an overlay. Beyond it the statistic of the
/// wall, a median over the picture, would be that of the overlay.
const MAX_SHARE: f64 = 0.4;

/// Pixels that do not move with the wall.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum StaticPixels {
    /// There are some, which the mask hides.
    Found(Mask),
    /// There are none.
    Absent,
    /// The wall looks alike from frame to frame and cannot be told from them.
    WallRepeats,
}

/// Finds the pixels that do not move with the wall.
///
/// The nominal rate of false alarms is 10⁻⁵ per survey. The ridges of the wall's temporal mean are
/// nearly Gaussian, being means over many frames; at seven standard deviations, a picture of
/// 480 × 360 px with three scales and two directions has one of that rate, and three such
/// pixels side by side are needed.
pub fn find_static_pixels(statistics: &TemporalStatistics, motion: &MotionField) -> StaticPixels {
    let [width, height] = statistics.size();
    let Some(strength) = ridges::ridge_strength(statistics, motion) else {
        return StaticPixels::WallRepeats;
    };
    let thin = outline::grow_seeds(&strength, statistics);
    let wide = constant_areas::constant_areas(statistics);
    let both = GrayImage::from_fn(width as u32, height as u32, |u, v| {
        Luma([thin.get_pixel(u, v).0[0].max(wide.get_pixel(u, v).0[0])])
    });
    let closed = outline::close(&both);
    let hidden = closed.iter().filter(|value| **value > 0).count();
    let share = hidden as f64 / (width * height) as f64;
    if hidden > 0 && share <= MAX_SHARE {
        StaticPixels::Found(statistics.full_size_mask(&closed))
    } else {
        StaticPixels::Absent
    }
}
