//! Expected displacement of neighbouring frames by the errors of the initial poses.

use super::overlap::OverlapCheck;
use crate::survey::Survey;
use crate::trajectory::JitterModel;
use serde::Serialize;

/// Errors of the initial poses as displacements in the image.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct JitterCheck {
    /// 1-σ of the displacement between neighbouring frames by pose errors, pixels.
    pub sigma_px: f64,
    /// [`JitterCheck::sigma_px`] as a share of the shorter side of the neighbours' overlap.
    pub share_of_overlap: f64,
}

impl JitterCheck {
    /// 1-σ of the displacement between neighbours, `f σ_R ⊕ σ_t px/m` (⊕: root of the sum of
    /// squares) with focal length `f`; the variance doubles if the errors of the frames are
    /// independent.
    pub(super) fn of(survey: &Survey, px_per_metre: f64, overlap: &OverlapCheck) -> Self {
        let prior = &survey.prior;
        let focal_px = survey.cameras.of(0).focal_px();
        let [x, y, z] = prior.translation_sigma_m;
        let shift_px = px_per_metre * y.max(x).max(z);
        let one_frame_px = (focal_px * prior.rotation_sigma_rad).hypot(shift_px);
        let sigma_px = match prior.model {
            JitterModel::RandomWalk => one_frame_px,
            JitterModel::Independent => one_frame_px * std::f64::consts::SQRT_2,
        };
        let shared_px = overlap.neighbours_width_m * px_per_metre;
        Self {
            sigma_px,
            share_of_overlap: sigma_px / shared_px.max(1e-9),
        }
    }
}
