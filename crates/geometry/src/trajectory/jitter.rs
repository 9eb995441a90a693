//! Pose noise: simulation of the executed trajectory from the planned one.

use super::pose::Pose;
use super::so3;
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// Correlation of the errors of consecutive poses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JitterModel {
    /// Each step composes its own error onto the running pose, so errors accumulate (odometry, a
    /// plan executed blindly; the paper's "after each image capture").
    RandomWalk,
    /// The errors of the poses around the plan are independent (an IMU's attitude, a rail).
    Independent,
}

/// Standard deviations of the pose noise, per step (random walk) or per pose (independent).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jitter {
    /// Correlation of the errors of consecutive poses.
    pub model: JitterModel,
    /// Rotation about each camera axis, radians.
    pub rotation_sigma_rad: f64,
    /// Translation along the world's x, y, z, metres.
    pub translation_sigma_m: [f64; 3],
}

/// Largest volume in which a frame is searched for, cubic degrees (1-σ), as for 20° about each
/// axis: at 320 × 240 px, a frame takes two to three seconds of a processor at this width, and its
/// time grows with the volume.
pub const MAX_SEARCH_VOLUME_DEG3: f64 = 8000.0;

/// Fraction of the lateral offset, and of the tilt against the axis, that a random walk loses at
/// each step, because the carrier steers back to the axis. 2 % keeps their spread below
/// `σ / √(1 − 0.98²) ≈ 5 σ`, for any length.
const STEERING_RATE: f64 = 0.02;

/// Rotates an executed attitude towards the planned one by the fraction [`STEERING_RATE`] of the
/// tilt between their tunnel axes. The rotation about the axis stays.
fn steered(executed: &UnitQuaternion<f64>, planned: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
    let carried = executed * planned.inverse() * Vector3::y();
    match UnitQuaternion::rotation_between(&carried, &Vector3::y()) {
        Some(tilt) => so3::exp(&(so3::log(&tilt) * STEERING_RATE)) * executed,
        // Opposite axes: every direction of rotation is equivalent.
        None => *executed,
    }
}

impl Jitter {
    /// σ of pitch, yaw and roll as they appear in the picture of a wall at `distance_m`, radians:
    /// `√(σ_R² + (σ_y/d)²)`, `√(σ_R² + (max(σ_x, σ_z)/d)²)`, `σ_R`. A translation across the view
    /// looks like a rotation.
    fn picture_sigma_rad(&self, distance_m: f64) -> [f64; 3] {
        let [x, y, z] = self.translation_sigma_m;
        let rotation = self.rotation_sigma_rad;
        let across = |shift_m: f64| rotation.hypot(shift_m / distance_m);
        [across(y), across(x.max(z)), rotation]
    }

    /// Volume in which a frame is searched for, cubic degrees: the product of the 1-σ of pitch, yaw
    /// and roll as they appear in the picture of a wall at `distance_m`, each at most half a turn.
    pub fn search_volume_deg3(&self, distance_m: f64) -> f64 {
        let sigma_rad = self.picture_sigma_rad(distance_m);
        sigma_rad
            .map(|sigma| sigma.min(PI).to_degrees())
            .iter()
            .product()
    }

    /// σ of pitch, yaw and roll of the search for a frame, radians: those in the picture of a wall
    /// at `distance_m` times `scale`, as where frames are missing before it; after a long pause,
    /// those of [`MAX_SEARCH_VOLUME_DEG3`].
    pub fn search_sigma_rad(&self, distance_m: f64, scale: f64) -> [f64; 3] {
        let sigma_rad = self.picture_sigma_rad(distance_m);
        let sigma_rad = sigma_rad.map(|sigma| (scale * sigma).min(PI));
        let volume_deg3: f64 = sigma_rad.map(f64::to_degrees).iter().product();
        let shrink = (MAX_SEARCH_VOLUME_DEG3 / volume_deg3).cbrt().min(1.0);
        sigma_rad.map(|sigma| shrink * sigma)
    }

    /// Diagonal of the inverse covariance `Σ⁻¹` of rotation and translation.
    pub fn information(&self) -> Vector6<f64> {
        let r = self.rotation_sigma_rad.powi(-2);
        let t = self.translation_sigma_m.map(|s| s.powi(-2));
        Vector6::new(r, r, r, t[0], t[1], t[2])
    }

    /// Half the squared Mahalanobis distance of a pose from the expected pose, `½ eᵀΣ⁻¹e`.
    pub fn deviation_cost(&self, expected: &Pose, pose: &Pose) -> f64 {
        let e = expected.local(pose);
        0.5 * e.component_mul(&e).dot(&self.information())
    }

    /// Simulates the execution of `plan` with this noise.
    ///
    /// The first pose of a random walk equals the plan's. Each pose draws three random numbers for
    /// the rotation and then three for the translation from `rng`.
    pub fn apply(&self, plan: &[Pose], rng: &mut impl Rng) -> Vec<Pose> {
        let mut executed: Vec<Pose> = Vec::with_capacity(plan.len());
        for (k, planned) in plan.iter().enumerate() {
            let pose = match (self.model, k) {
                (JitterModel::RandomWalk, 0) => *planned,
                (JitterModel::RandomWalk, _) => {
                    let (before, last) = (&plan[k - 1], &executed[k - 1]);
                    let increment = before.r_wc.inverse() * planned.r_wc;
                    let (omega, rho) = self.draw(rng);
                    let mut t_wc = last.t_wc + (planned.t_wc - before.t_wc) + rho;
                    t_wc.x *= 1.0 - STEERING_RATE;
                    t_wc.z *= 1.0 - STEERING_RATE;
                    let r_wc = last.r_wc * increment * so3::exp(&omega);
                    Pose::new(steered(&r_wc, &planned.r_wc), t_wc)
                }
                (JitterModel::Independent, _) => {
                    let (omega, rho) = self.draw(rng);
                    Pose::new(planned.r_wc * so3::exp(&omega), planned.t_wc + rho)
                }
            };
            executed.push(pose);
        }
        executed
    }

    fn draw(&self, rng: &mut impl Rng) -> (Vector3<f64>, Vector3<f64>) {
        let mut normal = || -> f64 { StandardNormal.sample(rng) };
        let omega = Vector3::from_fn(|_, _| normal() * self.rotation_sigma_rad);
        let rho = Vector3::from_fn(|k, _| normal() * self.translation_sigma_m[k]);
        (omega, rho)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::plan::spiral;
    use rand::SeedableRng;

    fn jitter(model: JitterModel) -> Jitter {
        Jitter {
            model,
            rotation_sigma_rad: 2f64.to_radians(),
            translation_sigma_m: [0.02, 0.02, 0.03],
        }
    }

    #[test]
    fn a_search_grows_with_a_pause_up_to_the_largest_volume() {
        let jitter = jitter(JitterModel::RandomWalk);
        let volume_deg3 = |scale| -> f64 {
            let sigma_rad = jitter.search_sigma_rad(3.0, scale);
            sigma_rad.map(f64::to_degrees).iter().product()
        };
        let one = jitter.search_volume_deg3(3.0);
        assert!((volume_deg3(1.0) / one - 1.0).abs() < 1e-12);
        assert!((volume_deg3(2.0) / one - 8.0).abs() < 1e-12);
        for scale in [31.0, 1e6, f64::INFINITY] {
            assert!((volume_deg3(scale) / MAX_SEARCH_VOLUME_DEG3 - 1.0).abs() < 1e-12);
        }
    }

    /// Root mean square of the steps' rotation errors, radians per axis.
    fn step_error(plan: &[Pose], executed: &[Pose]) -> f64 {
        let squares: f64 = (1..plan.len())
            .map(|k| {
                let planned = plan[k - 1].r_wc.inverse() * plan[k].r_wc;
                let done = executed[k - 1].r_wc.inverse() * executed[k].r_wc;
                so3::log(&(planned.inverse() * done)).norm_squared() / 3.0
            })
            .sum();
        (squares / (plan.len() - 1) as f64).sqrt()
    }

    #[test]
    fn a_random_walk_errs_by_one_sigma_per_step_and_independent_noise_by_root_two() {
        let plan = spiral(2000, 0.1, 30f64.to_radians());
        let sigma = 2f64.to_radians();
        for (model, expected) in [
            (JitterModel::RandomWalk, sigma),
            (JitterModel::Independent, sigma * 2f64.sqrt()),
        ] {
            let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(7);
            let executed = jitter(model).apply(&plan, &mut rng);
            let measured = step_error(&plan, &executed);
            assert!(
                (measured / expected - 1.0).abs() < 0.05,
                "{model:?}: {measured}"
            );
        }
    }

    /// Tilt and offset stay bounded in a long survey, so that the camera keeps looking at the wall.
    #[test]
    fn a_long_random_walk_keeps_its_tilt_and_offset_bounded() {
        let plan = spiral(12_000, 0.1, 30f64.to_radians());
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let executed = jitter(JitterModel::RandomWalk).apply(&plan, &mut rng);
        let (mut tilt, mut offset) = (0.0, 0.0);
        for (planned, pose) in plan.iter().zip(&executed) {
            let axis = pose.r_wc * planned.r_wc.inverse() * Vector3::y();
            tilt += axis.angle(&Vector3::y()).powi(2) / 2.0;
            offset += pose.t_wc.x.powi(2);
        }
        let rms = |sum: f64| (sum / plan.len() as f64).sqrt();
        let expected = 1.0 / (1.0 - 0.98f64.powi(2)).sqrt();
        assert!((rms(tilt) / (expected * 2f64.to_radians()) - 1.0).abs() < 0.2);
        assert!((rms(offset) / (expected * 0.02) - 1.0).abs() < 0.2);
    }
}
