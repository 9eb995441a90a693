//! Positions and steps of the initial poses.

use super::statistics::median_or_zero;
use crate::survey::Survey;
use serde::Serialize;

/// Positions and steps of the initial poses.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct PosesCheck {
    /// Smallest and largest chainage, metres.
    pub chainage_m: [f64; 2],
    /// Median distance between consecutive poses of a camera, metres.
    pub step_m: f64,
    /// Median rotation between consecutive poses of a camera, degrees.
    pub step_deg: f64,
    /// Largest distance of a camera from the axis, metres.
    pub off_axis_m: f64,
    /// True if true poses are known.
    pub truth: bool,
}

impl PosesCheck {
    /// Measures the initial poses.
    pub(super) fn of(survey: &Survey) -> Self {
        let poses = survey.initial_poses();
        let cameras = survey.cameras.count();
        let steps = || poses.iter().zip(poses.iter().skip(cameras));
        let straight = || poses.iter().map(|pose| survey.surface.straightened(pose));
        let chainage = || straight().map(|pose| pose.t_wc.y);
        let step_rad = steps().map(|(from, to)| from.r_wc.angle_to(&to.r_wc));
        Self {
            chainage_m: [
                chainage().fold(f64::INFINITY, f64::min),
                chainage().fold(f64::NEG_INFINITY, f64::max),
            ],
            step_m: median_or_zero(steps().map(|(from, to)| (to.t_wc - from.t_wc).norm())),
            step_deg: median_or_zero(step_rad).to_degrees(),
            off_axis_m: straight()
                .map(|pose| pose.t_wc.x.hypot(pose.t_wc.z))
                .fold(0.0, f64::max),
            truth: survey.truth.is_some(),
        }
    }
}
