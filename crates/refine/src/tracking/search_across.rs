//! Search grid of a camera that looks at the wall.
//!
//! A yaw shifts its picture around the tunnel, a small pitch along it. (A translation of the camera
//! looks nearly like a rotation; refinement tells them apart.) Larger pitches and the rolls distort
//! the picture; they are tried one by one.

use crate::model::context::EstimationContext;
use crate::samples::footprints::RESOLVED_RANGE_RADII;
use crate::thresholds::correlation_search::PITCH_STEP_RAD;
use crate::tracking::search_grid::{
    MAX_DEVIATION_SIGMA, SearchGrid, TURN_STEP_SAMPLES, Turns, all_turns, symmetric_steps,
};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{WallPoint, shortest_arc, wall_jacobian};
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Share of the pitch step to which it shrinks as the frame looks more steeply along the tunnel:
/// the cosine of the angle to the section at which the farthest resolved wall is seen.
const MIN_PITCH_STEP_SHARE: f64 = 1.0 / RESOLVED_RANGE_RADII;

/// Length of a step of the Newton iterations that rotate a pose to look at a wall point, radians:
/// along it the tangent of a view at 45° changes by less than a factor of two.
const MAX_VIEW_STEP_RAD: f64 = 0.3;

/// Number of these iterations: five of full length turn the view by a right angle, three more
/// square the error three times, from a tenth of a radian to 1e-8.
const VIEW_ITERATIONS: usize = 8;

/// Pitches, rolls and shifts of a camera that looks at the wall.
pub struct SearchAcross<'p> {
    context: &'p EstimationContext<'p>,
    predicted: Pose,
    /// σ of pitch, yaw and roll, radians.
    sigma_rad: [f64; 3],
    /// The tunnel's axis in the camera's frame.
    tunnel_axis: Vector3<f64>,
    /// The axis of pitch in the camera's frame.
    pitch_axis: Vector3<f64>,
    /// Motion of the middle of the view along the tunnel by a radian of pitch, metres.
    along_m: f64,
    /// Motion of the middle of the view around the tunnel by a radian about its axis, metres.
    across_m: f64,
    /// Step between rolls, radians.
    roll_step: f64,
    /// Pitches, radians.
    pitches: Vec<f64>,
    /// Rolls, radians.
    rolls: Vec<f64>,
    /// Largest shifts along s and h, metres.
    reach_m: [f64; 2],
}

impl<'p> SearchAcross<'p> {
    /// The grid around a pose, for samples `spacing_m` apart; None if that does not look at the
    /// wall.
    pub fn new(
        context: &'p EstimationContext,
        camera: &Camera,
        predicted: &Pose,
        sigma_rad: [f64; 3],
        spacing_m: f64,
    ) -> Option<Self> {
        let ray = predicted.r_wc * Vector3::z();
        let hit = context.surface.hit(&predicted.t_wc, &ray).ok()?;
        let a = wall_jacobian(predicted, &context.surface.frame(hit.wall));
        let tunnel_axis = tunnel_axis_in_camera(context, predicted);
        let pitch_axis = pitch_axis(&tunnel_axis)?;
        let along_m = (a.fixed_columns::<3>(0) * pitch_axis).norm();
        let across_m = (a.fixed_columns::<3>(0) * tunnel_axis).norm();
        let half_diagonal = 0.5 * f64::from(camera.width).hypot(f64::from(camera.height));
        // The more steeply a frame looks along the tunnel, the faster its picture on the wall
        // stretches with the pitch.
        let steepness = (hit.range / along_m).clamp(MIN_PITCH_STEP_SHARE, 1.0);
        let pitch_reach = MAX_DEVIATION_SIGMA * sigma_rad[0];
        let pitches = symmetric_steps(pitch_reach, PITCH_STEP_RAD * steepness);
        let roll_reach = MAX_DEVIATION_SIGMA * sigma_rad[2];
        let roll_step = TURN_STEP_SAMPLES / half_diagonal;
        let rolls = symmetric_steps(roll_reach, roll_step);
        // Shifts along h make up for half a step of pitch, and a sample more, as a maximum may lie
        // between those of two pitches; shifts along s make up for all of the yaw.
        let along_reach_m = if pitches.len() > 1 {
            0.5 * (pitches[1] - pitches[0]) * along_m + spacing_m
        } else {
            pitch_reach * along_m
        };
        let widest_m = 0.5 * context.surface.perimeter_m();
        Some(Self {
            context,
            predicted: *predicted,
            sigma_rad,
            tunnel_axis,
            pitch_axis,
            along_m,
            across_m,
            roll_step,
            pitches,
            rolls,
            reach_m: [
                (MAX_DEVIATION_SIGMA * sigma_rad[1] * across_m).min(widest_m),
                along_reach_m.min(widest_m),
            ],
        })
    }
}

impl SearchGrid for SearchAcross<'_> {
    fn turns(&self) -> Vec<Turns> {
        all_turns(&self.pitches, &self.rolls)
    }

    fn reach_m(&self) -> [f64; 2] {
        self.reach_m
    }

    fn turned_pose(&self, [pitch, roll]: Turns) -> Pose {
        let turn = so3::exp(&(self.pitch_axis * pitch)) * so3::exp(&(Vector3::z() * roll));
        Pose::new(self.predicted.r_wc * turn, self.predicted.t_wc)
    }

    fn shifted_pose(&self, turns: Turns, shift_m: &Vector2<f64>) -> Option<Pose> {
        shift_view(self.context, &self.turned_pose(turns), shift_m)
    }

    fn deviation(&self, [pitch, roll]: Turns, shift_m: &Vector2<f64>) -> f64 {
        // A camera that pitches up looks towards −h.
        let omega = self.pitch_axis * (pitch - shift_m.y / self.along_m)
            + self.tunnel_axis * (shift_m.x / self.across_m)
            + Vector3::z() * roll;
        let yaw_axis = Vector3::z().cross(&self.pitch_axis);
        [self.pitch_axis, yaw_axis, Vector3::z()]
            .iter()
            .zip(self.sigma_rad)
            .map(|(axis, sigma)| 0.5 * (omega.dot(axis) / sigma).powi(2))
            .sum()
    }

    fn distance(&self, a: (Turns, Vector2<f64>), b: (Turns, Vector2<f64>)) -> (f64, f64) {
        let pitch_m = (a.0[0] - b.0[0]) * self.along_m;
        let along_m = a.1.y - b.1.y - pitch_m;
        let roll = (a.0[1] - b.0[1]).abs();
        (along_m.hypot(a.1.x - b.1.x), roll / self.roll_step)
    }
}

/// The direction of the tunnel's axis at a camera, in the camera's frame.
pub fn tunnel_axis_in_camera(context: &EstimationContext, pose: &Pose) -> Vector3<f64> {
    context.surface.straightened(pose).r_wc.inverse() * Vector3::y()
}

/// The axis of pitch in the camera's frame: a rotation about it moves the middle of the view along
/// the tunnel and nowhere else. None for a camera that looks along the tunnel.
///
/// It is the camera's own x for a camera that is not rolled.
fn pitch_axis(tunnel_axis: &Vector3<f64>) -> Option<Vector3<f64>> {
    tunnel_axis.cross(&Vector3::z()).try_normalize(1e-6)
}

/// Rotates a pose so that its middle looks at a wall point `shift_m` away from where it does; None
/// if it leaves the wall.
///
/// It rotates about the tunnel's axis, which moves the picture along s and does not distort it
/// however steeply the camera looks along the tunnel, and in pitch. Newton's method finds the two
/// angles.
fn shift_view(context: &EstimationContext, pose: &Pose, shift_m: &Vector2<f64>) -> Option<Pose> {
    let hit = |pose: &Pose| {
        let ray = pose.r_wc * Vector3::z();
        context.surface.hit(&pose.t_wc, &ray)
    };
    let from = hit(pose).ok()?.wall;
    let target = WallPoint {
        s_m: from.s_m + shift_m.x,
        h_m: from.h_m + shift_m.y,
    };
    let mut pose = *pose;
    for _ in 0..VIEW_ITERATIONS {
        let wall = hit(&pose).ok()?.wall;
        let remaining_m = Vector2::new(
            shortest_arc(target.s_m - wall.s_m, context.surface.perimeter_m()),
            target.h_m - wall.h_m,
        );
        let a = wall_jacobian(&pose, &context.surface.frame(wall));
        let a: Matrix2x3<f64> = a.fixed_columns::<3>(0).into_owned();
        let axis = tunnel_axis_in_camera(context, &pose);
        let tilt = pitch_axis(&axis)?;
        let jacobian = Matrix2::from_columns(&[a * tilt, a * axis]);
        let step = jacobian.try_inverse()? * remaining_m;
        let step = step * (MAX_VIEW_STEP_RAD / step.norm()).min(1.0);
        pose.r_wc *= so3::exp(&(tilt * step.x + axis * step.y));
    }
    Some(pose)
}
