//! Self-calibration: what all frames have in common and nobody has measured well enough.
//!
//! The shared unknowns are deviations from what was given,
//! `κ = (ln f, cx, cy, k1, k2, ln r, τ_x, τ_z, o_x, o_z, ρ)`.
//!
//! - Focal length (fx and fy alike), principal point and distortion enter through the rays, so
//!   pixels see them ([`crate::camera::Camera::intrinsics_jacobian`]).
//! - Pictures stay as they are when the radius and all positions grow together. So poses are
//!   estimated in the tunnel of the radius given, and the radius is `exp(ln r)` times that: only
//!   the prior, which is in metres, sees it.
//! - Pictures show how the cameras stand in the tunnel, whatever frame the initial poses are in. So
//!   where that frame has the axis is seen by the prior alone, too: two tilts τ and two offsets o
//!   (turning about the axis and shifting along it are the gauge).
//!
//! The latter five are [`Metric`]. The last, ρ, is the time from reading a frame's first row to
//! reading its last; it is free only to ask whether the frames want another one ([`crate::refine::uncertainty::rolling_shutter_test`]).
//! Every unknown has a Gaussian prior around 0; one that the data leave nearly as uncertain as that
//! is unobservable ([`crate::refine::uncertainty::observability`]).

use crate::camera::Camera;
use crate::survey::{CalibrateSection, CalibrationGroup};
use crate::trajectory::{Jitter, JitterModel, Pose, so3};
use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};

/// Number of shared unknowns.
pub const SHARED: usize = 11;
/// The first of them belong to the camera.
pub const LENS: usize = 5;
/// So many after them belong to [`Metric`].
pub const METRIC: usize = 5;
/// Place of the logarithm of the radius among them.
pub const RADIUS: usize = 5;
/// Place of the readout time, seconds.
pub const READOUT: usize = LENS + METRIC;

/// The shared unknowns κ, or a step of them.
pub type Kappa = SVector<f64, SHARED>;

/// Which shared unknowns are estimated, and around what.
#[derive(Clone, Copy, Debug)]
pub struct Calibration {
    /// The camera as given.
    pub given: Camera,
    /// Time from reading a frame's first row to reading its last as given, seconds.
    pub readout_s: f64,
    /// Prior 1-σ of κ.
    pub sigma: Kappa,
    /// Which are estimated; the others stay 0.
    pub free: [bool; SHARED],
    /// Chainage about which the axis tilts, metres: the middle of the initial poses.
    pub middle_h_m: f64,
}

impl Calibration {
    /// Estimates nothing.
    pub fn none(camera: &Camera) -> Self {
        Self {
            given: *camera,
            readout_s: 0.0,
            sigma: Kappa::repeat(1.0),
            free: [false; SHARED],
            middle_h_m: 0.0,
        }
    }

    /// Estimates the `groups`, with the prior of `section`.
    pub fn new(
        groups: &[CalibrationGroup],
        section: &CalibrateSection,
        camera: &Camera,
        initial: &[Pose],
    ) -> Self {
        use CalibrationGroup::{Axis, Centre, Distortion, Focal, Radius};
        let centre_px = 0.01 * section.centre_sigma_percent * f64::from(camera.width);
        let tilt_rad = section.axis_tilt_sigma_deg.to_radians();
        let offset_m = section.axis_offset_sigma_m;
        let all = [
            (Focal, 0.01 * section.focal_sigma_percent),
            (Centre, centre_px),
            (Centre, centre_px),
            (Distortion, section.k1_sigma),
            (Distortion, section.k2_sigma),
            (Radius, 0.01 * section.radius_sigma_percent),
            (Axis, tilt_rad),
            (Axis, tilt_rad),
            (Axis, offset_m),
            (Axis, offset_m),
        ];
        let sum: f64 = initial.iter().map(|pose| pose.t_wc.y).sum();
        Self {
            given: *camera,
            readout_s: 0.0,
            sigma: Kappa::from_fn(|k, _| all.get(k).map_or(1.0, |(_, sigma)| *sigma)),
            free: std::array::from_fn(|k| {
                all.get(k).is_some_and(|(group, _)| groups.contains(group))
            }),
            middle_h_m: sum / initial.len().max(1) as f64,
        }
    }

    /// The same, but of the camera alone: a stretch of the survey says too little about the rest.
    pub fn of_camera(mut self) -> Self {
        self.free[LENS..].fill(false);
        self
    }

    /// The noise of the initial poses as long as radius and axis are not known better than given:
    /// `σ² + δ²`, with δ how far they may carry a pose (or a step, where errors add up) off.
    /// `arm_m`: length of the longest step, or distance of the farthest pose from the middle.
    pub fn widened(&self, jitter: &Jitter, arm_m: f64) -> Jitter {
        let sigma = |k: usize| if self.free[k] { self.sigma[k] } else { 0.0 };
        let tilt = sigma(6).hypot(sigma(7));
        let (turned, carried) = match jitter.model {
            JitterModel::RandomWalk => (0.0, 0.0),
            JitterModel::Independent => (tilt, sigma(8).hypot(sigma(9))),
        };
        let moved = (arm_m * sigma(RADIUS).hypot(tilt)).hypot(carried);
        Jitter {
            rotation_sigma_rad: jitter.rotation_sigma_rad.hypot(turned),
            translation_sigma_m: jitter.translation_sigma_m.map(|sigma| sigma.hypot(moved)),
            ..*jitter
        }
    }

    /// True if anything is estimated.
    pub fn any(&self) -> bool {
        self.free.contains(&true)
    }

    /// The camera at κ; None where its lens would fold the picture.
    pub fn camera(&self, kappa: &Kappa) -> Option<Camera> {
        let mut camera = self.given;
        camera.fx *= kappa[0].exp();
        camera.fy *= kappa[0].exp();
        camera.cx += kappa[1];
        camera.cy += kappa[2];
        let [k1, k2] = camera.lens.k1_k2();
        camera.lens = camera.lens.with_k1_k2(k1 + kappa[3], k2 + kappa[4]);
        // Without a change of the lens, and so usually, nothing is to be asked.
        let shows = camera.lens == self.given.lens
            || camera.visible_fraction() >= self.given.visible_fraction();
        shows.then_some(camera)
    }

    /// The readout time at κ, seconds.
    pub fn readout_s(&self, kappa: &Kappa) -> f64 {
        self.readout_s + kappa[READOUT]
    }

    /// How the initial poses lie in the tunnel at κ.
    pub fn metric(&self, kappa: &Kappa) -> Metric {
        let tilt = Vector3::new(kappa[6], 0.0, kappa[7]);
        let pivot = Vector3::new(0.0, self.middle_h_m, 0.0);
        Metric {
            scale: kappa[RADIUS].exp(),
            turn: so3::exp(&tilt),
            tilt,
            pivot,
            offset: Vector3::new(kappa[8], 0.0, kappa[9]),
        }
    }

    /// Half the squared distance of κ from its prior, over the free unknowns.
    pub fn prior_cost(&self, kappa: &Kappa) -> f64 {
        let free = (0..SHARED).filter(|k| self.free[*k]);
        free.map(|k| 0.5 * (kappa[k] / self.sigma[k]).powi(2)).sum()
    }
}

/// How metres and the initial poses' frame lie to the tunnel in which poses are estimated.
#[derive(Clone, Copy, Debug)]
pub struct Metric {
    /// Metres per estimated metre: the true radius over the one given.
    pub scale: f64,
    /// Turns the initial poses' frame into the tunnel's, about the pivot.
    turn: UnitQuaternion<f64>,
    /// The same as a rotation vector.
    tilt: Vector3<f64>,
    pivot: Vector3<f64>,
    /// Added after the turn, metres.
    offset: Vector3<f64>,
}

impl Metric {
    /// An initial pose in the tunnel's frame, metres: `R_G R`, `R_G (t − p) + p + o`.
    pub fn place(&self, initial: &Pose) -> Pose {
        // In this order nothing changes, to the last bit, if nothing is tilted and offset.
        let pivot = self.pivot - self.turn * self.pivot + self.offset;
        Pose::new(self.turn * initial.r_wc, self.turn * initial.t_wc + pivot)
    }

    /// The same in the tunnel of the radius given.
    pub fn place_nominal(&self, initial: &Pose) -> Pose {
        let placed = self.place(initial);
        Pose::new(placed.r_wc, placed.t_wc / self.scale)
    }

    /// An estimated pose in metres.
    pub fn in_metres(&self, pose: &Pose) -> Pose {
        Pose::new(pose.r_wc, pose.t_wc * self.scale)
    }

    /// From the pivot, as placed, to a placed initial position, metres.
    pub fn arm(&self, placed: &Pose) -> Vector3<f64> {
        placed.t_wc - self.pivot - self.offset
    }

    /// `J` with `exp(J δτ) R_G` the turn after a change δτ of the tilt.
    pub fn tilt_jacobian(&self) -> Matrix3<f64> {
        // The left Jacobian is the right one of the opposite rotation; it is singular only at a
        // whole turn.
        so3::right_jacobian_inverse(&-self.tilt)
            .try_inverse()
            .unwrap_or_else(Matrix3::identity)
    }

    /// The tunnel's axis in the initial poses' frame: its point at the middle of the poses, metres,
    /// and its direction.
    pub fn axis(&self) -> (Vector3<f64>, Vector3<f64>) {
        let back = self.turn.inverse();
        (self.pivot - back * self.offset, back * Vector3::y())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration() -> Calibration {
        Calibration {
            middle_h_m: 4.0,
            ..Calibration::none(&Camera::from_vertical_fov(160, 120, 1.0))
        }
    }

    #[test]
    fn nothing_changes_at_zero_to_the_last_bit() {
        let calibration = calibration();
        let zero = Kappa::zeros();
        assert_eq!(calibration.camera(&zero), Some(calibration.given));
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.3, -0.8, 0.1)),
            Vector3::new(0.123, 4.567, -0.891),
        );
        assert_eq!(calibration.metric(&zero).place(&pose), pose);
        assert_eq!(calibration.metric(&zero).place_nominal(&pose), pose);
    }

    /// Points of the axis as reported are carried onto the tunnel's axis.
    #[test]
    fn the_axis_is_where_the_frame_has_it() {
        let mut kappa = Kappa::zeros();
        (kappa[6], kappa[7]) = (0.02, -0.03);
        (kappa[8], kappa[9]) = (0.1, -0.2);
        let metric = calibration().metric(&kappa);
        let (point, direction) = metric.axis();
        for along in [-2.0, 0.0, 5.0] {
            let on_axis = Pose::new(UnitQuaternion::identity(), point + direction * along);
            let placed = metric.place(&on_axis).t_wc;
            assert!(placed.x.hypot(placed.z) < 1e-12);
            assert!((placed.y - 4.0 - along).abs() < 1e-12);
        }
    }

    #[test]
    fn noise_is_widened_only_by_what_is_estimated() {
        let jitter = Jitter {
            model: JitterModel::Independent,
            rotation_sigma_rad: 0.03,
            translation_sigma_m: [0.003; 3],
        };
        let mut calibration = calibration();
        let same = calibration.widened(&jitter, 5.0);
        assert_eq!(same, jitter);
        (calibration.free[RADIUS], calibration.sigma[RADIUS]) = (true, 0.01);
        let wide = calibration.widened(&jitter, 0.4);
        assert!((wide.translation_sigma_m[1] - 0.005).abs() < 1e-12);
        assert_eq!(wide.rotation_sigma_rad, 0.03);
    }

    #[test]
    fn a_lens_that_folds_the_picture_is_no_camera() {
        let mut kappa = Kappa::zeros();
        kappa[3] = -2.0;
        assert!(calibration().camera(&kappa).is_none());
    }
}
