//! Search grid of a camera that looks along the tunnel.
//!
//! Its picture is a ring of wall. A roll rotates the ring about the tunnel's axis, a translation
//! along the axis moves it along: both are shifts on the unrolled wall. The two tilts of the
//! optical axis distort it: a tilt δ displaces wall at distance d, at the angle α to the axis
//! (`sin α = r/d`), by `δ r/sin² α = δ d²/r` along the tunnel. They are tried one by one.

use crate::model::context::EstimationContext;
use crate::tracking::search_grid::{
    MAX_DEVIATION_SIGMA, SearchGrid, TURN_STEP_SAMPLES, Turns, all_turns, symmetric_steps,
};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use tunnelstitch_geometry::surface::mean_radius_m;
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Tilts, rolls and translations of a camera that looks along the tunnel.
pub struct SearchAlong {
    predicted: Pose,
    /// The tunnel's axis in the camera's frame.
    tunnel_axis: Vector3<f64>,
    /// The axes of the two tilts in the camera's frame.
    tilt_axes: [Vector3<f64>; 2],
    /// σ of a tilt and of the roll, radians.
    sigma_rad: [f64; 2],
    /// σ along the tunnel, metres.
    along_sigma_m: f64,
    /// Tilts about each axis, radians.
    tilts: Vec<f64>,
    /// Step between tilts, radians.
    tilt_step: f64,
    /// Motion of the wall by a radian of roll: the section's radius, metres.
    radius_m: f64,
    /// Largest shifts along s and h, metres.
    reach_m: [f64; 2],
}

impl SearchAlong {
    /// The grid around a pose whose nearest wall is `distance_m` away, for samples `spacing_m`
    /// apart; `tunnel_axis` in the camera's frame. `sigma_rad`: 1-σ of pitch, yaw and roll as
    /// [`super::registration`] states them, a translation across the view counted as a rotation.
    pub fn new(
        context: &EstimationContext,
        predicted: &Pose,
        tunnel_axis: Vector3<f64>,
        sigma_rad: [f64; 3],
        (distance_m, spacing_m): (f64, f64),
    ) -> Self {
        let radius_m = mean_radius_m(context.surface.as_ref());
        let first = tunnel_axis.cross(&Vector3::x());
        let first = first
            .try_normalize(0.5)
            .unwrap_or_else(|| tunnel_axis.cross(&Vector3::y()).normalize());
        let [along, tilt_sigma, roll_sigma] = sigma_rad;
        let along_sigma_m = along * distance_m;
        let tilt_step = tilt_step_rad(radius_m, distance_m, spacing_m);
        let widest_m = 0.5 * context.surface.perimeter_m();
        let reach = |sigma_m: f64| (MAX_DEVIATION_SIGMA * sigma_m + spacing_m).min(widest_m);
        Self {
            predicted: *predicted,
            tunnel_axis,
            tilt_axes: [first, tunnel_axis.cross(&first)],
            sigma_rad: [tilt_sigma, roll_sigma],
            along_sigma_m,
            tilts: symmetric_steps(MAX_DEVIATION_SIGMA * tilt_sigma, tilt_step),
            tilt_step,
            radius_m,
            reach_m: [reach(roll_sigma * radius_m), reach(along_sigma_m)],
        }
    }

    /// The rotation by both tilts.
    fn tilt(&self, turns: Turns) -> UnitQuaternion<f64> {
        let [first, second] = self.tilt_axes;
        so3::exp(&(first * turns[0] + second * turns[1]))
    }
}

/// Step between tilts, radians, for wall of which the nearest is `distance_m` away and samples
/// `spacing_m` apart.
pub fn tilt_step_rad(radius_m: f64, distance_m: f64, spacing_m: f64) -> f64 {
    TURN_STEP_SAMPLES * spacing_m * radius_m / (distance_m * distance_m)
}

impl SearchGrid for SearchAlong {
    fn turns(&self) -> Vec<Turns> {
        all_turns(&self.tilts, &self.tilts)
    }

    fn reach_m(&self) -> [f64; 2] {
        self.reach_m
    }

    fn turned_pose(&self, turns: Turns) -> Pose {
        Pose::new(self.predicted.r_wc * self.tilt(turns), self.predicted.t_wc)
    }

    fn shifted_pose(&self, turns: Turns, shift_m: &Vector2<f64>) -> Option<Pose> {
        let roll = so3::exp(&(self.tunnel_axis * (shift_m.x / self.radius_m)));
        let along_w = self.predicted.r_wc * self.tunnel_axis;
        // The roll is about the tunnel's axis, before the tilts.
        Some(Pose::new(
            self.predicted.r_wc * roll * self.tilt(turns),
            self.predicted.t_wc + along_w * shift_m.y,
        ))
    }

    fn deviation(&self, turns: Turns, shift_m: &Vector2<f64>) -> f64 {
        let [tilt, roll] = self.sigma_rad;
        let normalised = [
            turns[0] / tilt,
            turns[1] / tilt,
            shift_m.x / self.radius_m / roll,
            shift_m.y / self.along_sigma_m,
        ];
        0.5 * normalised.iter().map(|value| value * value).sum::<f64>()
    }

    fn distance(&self, a: (Turns, Vector2<f64>), b: (Turns, Vector2<f64>)) -> (f64, f64) {
        let tilt = (a.0[0] - b.0[0]).hypot(a.0[1] - b.0[1]);
        ((a.1 - b.1).norm(), tilt / self.tilt_step)
    }
}
