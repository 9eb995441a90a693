//! Parts of the image and of the wall that are left out.

use crate::surface::WallPoint;
use crate::survey::Survey;
use serde::Serialize;

/// Numbers of points around and along the axis at which the ignored share is sampled.
const GRID_POINTS: [u32; 2] = [360, 200];

/// Parts of the image and of the wall that are left out.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct MaskCheck {
    /// Share of every frame that the mask hides, 0–1.
    pub hidden_share: f64,
    /// Number of ignored parts of the wall.
    pub ignored: usize,
    /// Their share of the wall between the first and the last camera, 0–1.
    pub ignored_share: f64,
}

impl MaskCheck {
    /// Measures the mask, and the ignored parts on a regular grid of wall points.
    pub(super) fn of(survey: &Survey) -> Self {
        let surface = survey.surface.as_ref();
        let initial = survey.initial.iter();
        let chainage = initial.map(|stamped| surface.chainage_m(&stamped.pose.t_wc));
        let from_m = chainage.clone().fold(f64::INFINITY, f64::min);
        let to_m = chainage.fold(f64::NEG_INFINITY, f64::max);
        let share = |k: u32, of: u32| (f64::from(k) + 0.5) / f64::from(of);
        let [around, along] = GRID_POINTS;
        let point = |k: u32| WallPoint {
            s_m: share(k % around, around) * surface.perimeter_m(),
            h_m: from_m + share(k / around, along) * (to_m - from_m),
        };
        let points = around * along;
        let ignored = (0..points).filter(|k| survey.ignored.contains(&point(*k)));
        Self {
            hidden_share: survey.frames.masks().masked_fraction(),
            ignored: survey.file.tunnel.ignore.len(),
            ignored_share: ignored.count() as f64 / f64::from(points),
        }
    }
}
