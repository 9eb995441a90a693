//! Length of a step on the wall, and feasibility of an estimate.

use crate::parameters::calibration::{BEND_INDEX, BEND_PARAMETERS, INTRINSIC_PARAMETERS, Kappa};
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::problem::photometric_problem::PhotometricProblem;
use tunnelstitch_geometry::surface::{bend_jacobian, lens_jacobian, sighted_wall, wall_jacobian};

/// Largest log-gain of a feasible estimate, standard deviations of its prior. No frame has such a
/// gain; one that fits nowhere could lower its cost by a gain near 0.
const MAX_LOG_GAIN_SIGMAS: f64 = 10.0;

impl PhotometricProblem<'_> {
    /// True if the camera is inside the tunnel and the log-gain within [`MAX_LOG_GAIN_SIGMAS`].
    pub fn is_feasible(&self, estimate: &FrameEstimate) -> bool {
        let max_log_gain = MAX_LOG_GAIN_SIGMAS * self.context.prior.log_gain_sigma;
        let inside = self.context.surface.check_inside(&estimate.pose.t_wc);
        inside.is_ok() && estimate.log_gain.abs() <= max_log_gain
    }

    /// Size of a pixel of the pyramid level, in pixels of full size.
    pub fn pixel_px(&self) -> f64 {
        2f64.powi(self.sampling.level as i32)
    }

    /// Motion of the wall in each active frame's image by a step, in pixels of full size: the
    /// largest over the image's centre and corners. `shared`: step of the shared parameters.
    pub fn wall_step_px(
        &self,
        active: &[FrameEstimate],
        step: &[FrameStep],
        shared: &Kappa,
    ) -> Vec<f64> {
        let frames = self.active.clone().zip(active.iter().zip(step));
        frames
            .map(|(k, (estimate, step))| {
                self.frame_step_px((k, estimate), step, shared) * self.pixel_px()
            })
            .collect()
    }

    /// Motion of the wall in one frame's image, in pixels of the level.
    fn frame_step_px(
        &self,
        (frame, estimate): (usize, &FrameEstimate),
        step: &FrameStep,
        shared: &Kappa,
    ) -> f64 {
        let camera = self.cameras.of(frame);
        let xi: nalgebra::Vector6<f64> = step.fixed_rows::<6>(0).into();
        let pose = &estimate.pose;
        let straightened = self.context.surface.straightened(pose);
        let intrinsics = shared.fixed_rows::<INTRINSIC_PARAMETERS>(0);
        let curvature = shared.fixed_rows::<BEND_PARAMETERS>(BEND_INDEX);
        (camera.corner_and_centre_rays().into_iter())
            .filter_map(|ray_c| {
                let surface = self.context.surface.as_ref();
                let hit = sighted_wall(surface, camera, pose, &ray_c).ok()?;
                let wall = self.context.surface.frame(hit.wall);
                let a = wall_jacobian(pose, &wall);
                let mut motion = a * xi;
                if self.estimates_shared {
                    let x_c = ray_c * hit.range;
                    motion += lens_jacobian(pose, &a, self.context.cameras.of(frame), &x_c)
                        * intrinsics
                        + bend_jacobian(pose, &straightened, &a, &x_c) * curvature;
                }
                Some(motion.norm() * camera.vertical_focal_px() / hit.range)
            })
            .fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::problem::test_ring::Ring;
    use tunnelstitch_geometry::surface::Surface;

    #[test]
    fn cameras_outside_and_vanishing_gains_are_infeasible() {
        let ring = Ring::new(1e-4);
        let problem = ring.problem();
        let estimate = ring.estimates[2];
        assert!(problem.is_feasible(&estimate));
        let mut outside = estimate;
        outside.pose.t_wc.z += 2.0 * ring.wall.circle.perimeter_m() / std::f64::consts::TAU;
        assert!(!problem.is_feasible(&outside));
        let vanishing = FrameEstimate {
            log_gain: -14.0,
            ..estimate
        };
        assert!(!problem.is_feasible(&vanishing));
    }
}
