//! Self-calibration: the parameters κ that all frames share.
//!
//! They are deviations from the given values,
//!
//! `κ = (ln f, cx, cy, k1, k2, ln r, τ_x, τ_z, o_x, o_z, ρ, c_x, c_z)`.
//!
//! | parameters | meaning, unit | constrained by |
//! | --- | --- | --- |
//! | `ln f` | focal length, fx and fy alike, over the given one, 1 | pixels, through the rays |
//! | `cx, cy` | principal point, px | pixels |
//! | `k1, k2` | radial distortion, 1 | pixels |
//! | `ln r` | radius over the given one, 1 | prior of the poses |
//! | `τ_x, τ_z` | tilt of the tunnel's axis in the initial poses' frame, rad | prior of the poses |
//! | `o_x, o_z` | offset of the tunnel's axis there, m | prior of the poses |
//! | `ρ` | readout time of a frame, s | pixels |
//! | `c_x, c_z` | curvature of the tunnel, 1/m ([`Bend`]) | pixels |
//!
//! The first five are the intrinsics
//! ([`tunnelstitch_geometry::camera::Camera::intrinsics_jacobian`]), of which a lens model without
//! k1 and k2 has the first three ([`tunnelstitch_geometry::camera::Lens::has_k1_k2`]). The readout
//! time is free in the rolling-shutter test alone ([`crate::uncertainty::rolling_shutter_test`]),
//! the curvature where a straight tunnel's shape is estimated ([`crate::stages::shape`]). With a
//! curvature all poses are those in the bent tunnel, and a step of it carries them along
//! ([`Calibration::carry`]).
//!
//! The images do not change if the radius and all positions are scaled together. Poses are
//! therefore estimated in the tunnel of the given radius, and only the prior, which is in metres,
//! depends on the scale `exp(ln r)`. The images show the cameras relative to the tunnel, whatever
//! frame the initial poses are given in, so tilt and offset of that frame enter through the prior
//! alone as well. (Rotation about the axis and shift along it are the gauge.) These five
//! parameters, `ln r` to `o_z`, are the [`Datum`].
//!
//! Every parameter has a Gaussian prior around 0. A parameter whose posterior is nearly as wide as
//! its prior is unobservable ([`crate::uncertainty::observability`]).

use nalgebra::{Matrix3, SVector, UnitQuaternion, Vector3};
use tunnelstitch_core::survey::{CalibrateSection, CalibrationGroup};
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::surface::{Bend, GaugeMotion};
use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, Pose, so3};

/// Number of shared parameters.
pub const SHARED_PARAMETERS: usize = 13;
/// Number of intrinsic parameters of the camera; they come first in κ.
pub const INTRINSIC_PARAMETERS: usize = 5;
/// Indices of k1 and k2 in κ.
const DISTORTION_INDICES: std::ops::Range<usize> = 3..5;
/// Number of datum parameters ([`Datum`]); they follow the intrinsics in κ.
pub const DATUM_PARAMETERS: usize = 5;
/// Index of `ln f` in κ.
pub const FOCAL_INDEX: usize = 0;
/// Index of `ln r` in κ.
pub const RADIUS_INDEX: usize = 5;
/// Index of the readout time ρ in κ, seconds.
pub const READOUT_INDEX: usize = INTRINSIC_PARAMETERS + DATUM_PARAMETERS;
/// Index of `c_x` in κ; `c_z` follows, 1/m.
pub const BEND_INDEX: usize = READOUT_INDEX + 1;
/// Number of components of the curvature.
pub const BEND_PARAMETERS: usize = 2;
/// Number of shared parameters that pixels depend on: the intrinsics, the readout time, and the
/// curvature.
pub const PIXEL_PARAMETERS: usize = INTRINSIC_PARAMETERS + 1 + BEND_PARAMETERS;
/// Their indices in κ.
pub const PIXEL_INDICES: [usize; PIXEL_PARAMETERS] =
    [0, 1, 2, 3, 4, READOUT_INDEX, BEND_INDEX, BEND_INDEX + 1];

/// The shared parameters κ, or a step of them.
pub type Kappa = SVector<f64, SHARED_PARAMETERS>;

/// The choice of estimated shared parameters, with their given values and prior.
#[derive(Clone, Debug)]
pub struct Calibration {
    /// The cameras as given.
    pub given: Cameras,
    /// Given time from reading a frame's first row to reading its last, seconds.
    pub readout_s: f64,
    /// Prior 1-σ of κ.
    pub sigma: Kappa,
    /// True for the parameters that are estimated; the others stay 0.
    pub free: [bool; SHARED_PARAMETERS],
    /// True for the parameters that stay as they are, but whose equations are kept, so that the
    /// solution tells whether they should be free.
    pub tested: [bool; SHARED_PARAMETERS],
    /// Chainage of the pivot of the tilt, metres: the mean of the initial poses.
    pub middle_h_m: f64,
}

impl Calibration {
    /// No shared parameter estimated.
    pub fn none(cameras: impl Into<Cameras>) -> Self {
        Self {
            given: cameras.into(),
            readout_s: 0.0,
            sigma: Kappa::repeat(1.0),
            free: [false; SHARED_PARAMETERS],
            tested: [false; SHARED_PARAMETERS],
            middle_h_m: 0.0,
        }
    }

    /// The parameters of `groups` estimated, with the prior of `section`.
    pub fn new(
        groups: &[CalibrationGroup],
        section: &CalibrateSection,
        cameras: &Cameras,
        initial: &[Pose],
    ) -> Self {
        use CalibrationGroup::{Axis, Centre, Distortion, Focal, Radius};
        let centre_px = 0.01 * section.centre_sigma_percent * f64::from(cameras.size()[0]);
        let tilt_rad = section.axis_tilt_sigma_deg.to_radians();
        let offset_m = section.axis_offset_sigma_m;
        let parameters = [
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
            given: cameras.clone(),
            readout_s: 0.0,
            sigma: Kappa::from_fn(|k, _| parameters.get(k).map_or(1.0, |(_, sigma)| *sigma)),
            free: std::array::from_fn(|k| {
                parameters
                    .get(k)
                    .is_some_and(|(group, _)| groups.contains(group))
                    && (k >= INTRINSIC_PARAMETERS || has_intrinsic(cameras, k))
            }),
            tested: [false; SHARED_PARAMETERS],
            middle_h_m: sum / initial.len().max(1) as f64,
        }
    }

    /// Restricts the estimated parameters to the intrinsics.
    ///
    /// A short part of the survey constrains the datum too little.
    pub fn intrinsics_only(mut self) -> Self {
        self.free[INTRINSIC_PARAMETERS..].fill(false);
        self.tested.fill(false);
        self
    }

    /// The noise of the initial poses, widened by the prior uncertainty of the datum: `σ² + δ²`.
    ///
    /// δ is the 1-σ displacement of a pose (for a random walk, of a step) by the free datum
    /// parameters. `lever_arm_m`: length of the longest step, or distance of the farthest pose from
    /// the pivot, metres ([`crate::model::prior::Prior::lever_arm_m`]).
    pub fn widen_jitter(&self, jitter: &Jitter, lever_arm_m: f64) -> Jitter {
        let sigma = |k: usize| if self.free[k] { self.sigma[k] } else { 0.0 };
        let tilt = sigma(6).hypot(sigma(7));
        let (rotation, offset) = match jitter.model {
            JitterModel::RandomWalk => (0.0, 0.0),
            JitterModel::Independent => (tilt, sigma(8).hypot(sigma(9))),
        };
        let translation = (lever_arm_m * sigma(RADIUS_INDEX).hypot(tilt)).hypot(offset);
        Jitter {
            rotation_sigma_rad: jitter.rotation_sigma_rad.hypot(rotation),
            translation_sigma_m: jitter
                .translation_sigma_m
                .map(|sigma| sigma.hypot(translation)),
            ..*jitter
        }
    }

    /// True if any shared parameter is estimated.
    pub fn has_free_parameters(&self) -> bool {
        self.free.contains(&true)
    }

    /// True if `k` is an intrinsic parameter that can be estimated: one of a single camera, whose
    /// model has it.
    pub fn has_intrinsic(&self, k: usize) -> bool {
        k < INTRINSIC_PARAMETERS && has_intrinsic(&self.given, k)
    }

    /// True if the equations of a parameter are kept.
    pub fn has_equations(&self, k: usize) -> bool {
        self.free[k] || self.tested[k]
    }

    /// The cameras at κ; None if a distortion is not invertible over the image. Those of a rig are
    /// as given: κ has the intrinsics of one camera.
    pub fn cameras(&self, kappa: &Kappa) -> Option<Cameras> {
        match self.given.all() {
            [camera] => Some(Self::camera(camera, kappa)?.into()),
            _ => Some(self.given.clone()),
        }
    }

    /// A camera at κ; None if its distortion is not invertible over the image.
    fn camera(given: &Camera, kappa: &Kappa) -> Option<Camera> {
        let mut camera = *given;
        camera.fx *= kappa[FOCAL_INDEX].exp();
        camera.fy *= kappa[FOCAL_INDEX].exp();
        camera.cx += kappa[1];
        camera.cy += kappa[2];
        let [k1, k2] = camera.lens.k1_k2();
        camera.lens = camera.lens.with_k1_k2(k1 + kappa[3], k2 + kappa[4]);
        // The test is needed only if the distortion changes.
        let is_invertible =
            camera.lens == given.lens || camera.visible_fraction() >= given.visible_fraction();
        is_invertible.then_some(camera)
    }

    /// The readout time at κ, seconds.
    pub fn readout_s(&self, kappa: &Kappa) -> f64 {
        self.readout_s + kappa[READOUT_INDEX]
    }

    /// The bend at κ; None without curvature.
    pub fn bend(&self, kappa: &Kappa) -> Option<Bend> {
        let bend = Bend {
            curvature_per_m: [kappa[BEND_INDEX], kappa[BEND_INDEX + 1]],
            at_h_m: self.middle_h_m,
        };
        (bend.curvature_per_m != [0.0; 2]).then_some(bend)
    }

    /// Carries a pose in the tunnel with the curvature of κ `from` along to that of `to`: in the
    /// section it is in, it stays where it is.
    pub fn carry(&self, pose: &Pose, from: &Kappa, to: &Kappa) -> Pose {
        let is_same = |k: usize| from[k] == to[k];
        if (BEND_INDEX..BEND_INDEX + BEND_PARAMETERS).all(is_same) {
            return *pose;
        }
        let straight = match self.bend(from) {
            Some(bend) => bend.straightened(pose),
            None => *pose,
        };
        match self.bend(to) {
            Some(bend) => bend.bent(&straight),
            None => straight,
        }
    }

    /// The datum at κ.
    pub fn datum(&self, kappa: &Kappa) -> Datum {
        let tilt = Vector3::new(kappa[6], 0.0, kappa[7]);
        let pivot = Vector3::new(0.0, self.middle_h_m, 0.0);
        Datum {
            scale: kappa[RADIUS_INDEX].exp(),
            rotation: so3::exp(&tilt),
            tilt,
            pivot,
            offset: Vector3::new(kappa[8], 0.0, kappa[9]),
            bend: self.bend(kappa),
        }
    }

    /// Negative log-prior of κ, `½ Σ (κ_k/σ_k)²` over the free parameters.
    pub fn prior_cost(&self, kappa: &Kappa) -> f64 {
        let free = (0..SHARED_PARAMETERS).filter(|k| self.free[*k]);
        free.map(|k| 0.5 * (kappa[k] / self.sigma[k]).powi(2)).sum()
    }
}

/// True if it is a single camera that has the parameter: unless it is k1 or k2 of a lens without.
fn has_intrinsic(cameras: &Cameras, k: usize) -> bool {
    !cameras.is_rig() && (!DISTORTION_INDICES.contains(&k) || cameras.of(0).lens.has_k1_k2())
}

/// The similarity transform from the initial poses' frame to the tunnel.
///
/// A position `t̂` of the initial poses is `R_G (t̂ − p) + p + o` in the tunnel, metres, with the
/// tilt `R_G = exp(τ)` about the pivot p. An estimated position t, in the tunnel of the given
/// radius, is `scale · t` metres. In a tunnel that turns out to bend, initial poses are where they
/// were in the straight one ([`Bend::bent`]); a bend is estimated with the others fixed at 0.
#[derive(Clone, Copy, Debug)]
pub struct Datum {
    /// The true radius over the given one.
    pub scale: f64,
    /// `R_G`.
    rotation: UnitQuaternion<f64>,
    /// `τ`, the rotation vector of `R_G`.
    tilt: Vector3<f64>,
    /// p, metres.
    pivot: Vector3<f64>,
    /// o, metres.
    offset: Vector3<f64>,
    /// The bend, if there is one.
    pub bend: Option<Bend>,
}

impl Datum {
    /// The datum after a motion of the tunnel along its gauge.
    pub fn moved(self, motion: &GaugeMotion) -> Self {
        Self {
            bend: self.bend.map(|bend| bend.moved(motion)),
            ..self
        }
    }

    /// Transforms an initial pose to the tunnel, in metres: `R_G R̂`, `R_G (t̂ − p) + p + o`.
    pub fn to_tunnel(self, initial: &Pose) -> Pose {
        // In this order the pose stays the same to the last bit without tilt and offset.
        let pivot = self.pivot - self.rotation * self.pivot + self.offset;
        let straight = Pose::new(
            self.rotation * initial.r_wc,
            self.rotation * initial.t_wc + pivot,
        );
        self.bend.map_or(straight, |bend| bend.bent(&straight))
    }

    /// Transforms an initial pose to the tunnel of the given radius, in which poses are estimated.
    pub fn to_nominal_tunnel(self, initial: &Pose) -> Pose {
        let in_tunnel = self.to_tunnel(initial);
        Pose::new(in_tunnel.r_wc, in_tunnel.t_wc / self.scale)
    }

    /// Scales an estimated pose to metres.
    pub fn to_metres(self, pose: &Pose) -> Pose {
        Pose::new(pose.r_wc, pose.t_wc * self.scale)
    }

    /// `R_G (t̂ − p)` of an initial pose that has been transformed to the tunnel, metres.
    pub fn lever_arm(&self, in_tunnel: &Pose) -> Vector3<f64> {
        in_tunnel.t_wc - self.pivot - self.offset
    }

    /// `J` of `exp(τ + δτ) = exp(J δτ) R_G`, the left Jacobian of the tilt.
    pub fn tilt_jacobian(&self) -> Matrix3<f64> {
        // The left Jacobian is the right one of the opposite rotation. Its inverse is singular only
        // at a whole turn.
        so3::right_jacobian_inverse(&-self.tilt)
            .try_inverse()
            .unwrap_or_else(Matrix3::identity)
    }

    /// A point (metres) and the direction of the tunnel's axis in the initial poses' frame; the
    /// point is at the pivot's chainage.
    pub fn axis(&self) -> (Vector3<f64>, Vector3<f64>) {
        let inverse = self.rotation.inverse();
        (self.pivot - inverse * self.offset, inverse * Vector3::y())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::{DoubleSphere, Lens, Mei};

    fn calibration() -> Calibration {
        Calibration {
            middle_h_m: 4.0,
            ..Calibration::none(Camera::from_vertical_fov(160, 120, 1.0))
        }
    }

    #[test]
    fn zero_parameters_change_nothing_to_the_last_bit() {
        let calibration = calibration();
        let zero = Kappa::zeros();
        assert_eq!(calibration.cameras(&zero), Some(calibration.given.clone()));
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.3, -0.8, 0.1)),
            Vector3::new(0.123, 4.567, -0.891),
        );
        assert_eq!(calibration.datum(&zero).to_tunnel(&pose), pose);
        assert_eq!(calibration.datum(&zero).to_nominal_tunnel(&pose), pose);
    }

    /// Points of the reported axis are transformed onto the tunnel's axis.
    #[test]
    fn the_reported_axis_transforms_to_the_tunnel_axis() {
        let mut kappa = Kappa::zeros();
        (kappa[6], kappa[7]) = (0.02, -0.03);
        (kappa[8], kappa[9]) = (0.1, -0.2);
        let datum = calibration().datum(&kappa);
        let (point, direction) = datum.axis();
        for along in [-2.0, 0.0, 5.0] {
            let on_axis = Pose::new(UnitQuaternion::identity(), point + direction * along);
            let in_tunnel = datum.to_tunnel(&on_axis).t_wc;
            assert!(in_tunnel.x.hypot(in_tunnel.z) < 1e-12);
            assert!((in_tunnel.y - 4.0 - along).abs() < 1e-12);
        }
    }

    #[test]
    fn jitter_is_widened_only_by_free_parameters() {
        let jitter = Jitter {
            model: JitterModel::Independent,
            rotation_sigma_rad: 0.03,
            translation_sigma_m: [0.003; 3],
        };
        let mut calibration = calibration();
        let unchanged = calibration.widen_jitter(&jitter, 5.0);
        assert_eq!(unchanged, jitter);
        (
            calibration.free[RADIUS_INDEX],
            calibration.sigma[RADIUS_INDEX],
        ) = (true, 0.01);
        let wide = calibration.widen_jitter(&jitter, 0.4);
        assert!((wide.translation_sigma_m[1] - 0.005).abs() < 1e-12);
        assert_eq!(wide.rotation_sigma_rad, 0.03);
    }

    #[test]
    fn only_what_the_lens_has_is_estimated() {
        let groups = CalibrationGroup::ALL;
        let free = |lens: Lens| {
            let camera = Camera {
                lens,
                ..Camera::from_vertical_fov(160, 120, 1.0)
            };
            let section = CalibrateSection::default();
            let calibration = Calibration::new(&groups, &section, &camera.into(), &[]);
            let mut kappa = Kappa::zeros();
            (kappa[0], kappa[3]) = (0.01, 0.1);
            let moved = *calibration.cameras(&kappa).unwrap().of(0);
            assert_eq!(moved.lens == lens, !lens.has_k1_k2());
            assert!((moved.fx / camera.fx - 0.01f64.exp()).abs() < 1e-12);
            calibration.free
        };
        let double_sphere = Lens::DoubleSphere(DoubleSphere::new(-0.2, 0.6).unwrap());
        let mei = Lens::Mei(Mei::new(0.9, [-0.1, 0.01], [0.0; 2]).unwrap());
        let mut expected = [true; SHARED_PARAMETERS];
        expected[READOUT_INDEX..].fill(false);
        assert_eq!(free(mei), expected);
        expected[DISTORTION_INDICES].fill(false);
        assert_eq!(free(double_sphere), expected);
    }

    #[test]
    fn a_non_invertible_distortion_gives_no_camera() {
        let mut kappa = Kappa::zeros();
        kappa[3] = -2.0;
        assert!(calibration().cameras(&kappa).is_none());
    }
}
