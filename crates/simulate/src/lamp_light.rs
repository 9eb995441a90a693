//! Light of a lamp that is fixed to the camera, and its reflection on the wall.

use crate::camera_lamp::CameraLamp;
use crate::error::{SimulateError, check_option};
use crate::tunnel::Tunnel;
use crate::wall_intersection::{RayCaster, WallHit};
use nalgebra::Vector3;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::Pose;

/// Exponent m of the sheen.
const SHEEN_EXPONENT: i32 = 30;
/// Grey level of white.
const WHITE_GREY: f64 = 255.0;

/// Light of a camera's lamp on the wall.
///
/// At a point of the wall with the unit normal n, at the distance d from the lamp in the unit
/// direction l towards it, the lamp multiplies the radiance by
///
/// ```text
/// E = max(0, n·l)/d² / E₀,
/// ```
///
/// with E₀ such that E = 1 at the nearest wall that the camera sees from the first planned pose:
/// straight ahead, if it looks at the wall from the axis. The sheen adds, with h the unit vector
/// half way between l and the direction to the camera,
///
/// ```text
/// 255 S/100 max(0, n·h)^30 / (d² E₀)
/// ```
///
/// grey levels where n·l > 0.
///
/// Source: J. F. Blinn, "Models of light reflection for computer synthesized pictures", SIGGRAPH
/// 1977.
#[derive(Clone, Copy, Debug)]
pub(super) struct LampLight {
    /// Position in the camera's frame, metres.
    offset: Vector3<f64>,
    /// 255 S/100.
    sheen_grey: f64,
    /// 1/E₀.
    scale: f64,
}

impl LampLight {
    /// The light of a lamp for a camera that first stands at `pose`.
    ///
    /// # Errors
    /// [`SimulateError::Option`] if the lamp does not shine on the nearest wall.
    pub fn new(
        lamp: &CameraLamp,
        pose: &Pose,
        camera: &Camera,
        tunnel: &Tunnel,
    ) -> Result<Self, SimulateError> {
        let caster = RayCaster::new(tunnel, pose.t_wc);
        let mut nearest: Option<(Vector3<f64>, f64)> = None;
        for ray in [Vector3::z()].into_iter().chain(camera.grid_rays()) {
            let d = pose.r_wc * ray;
            let WallHit { h_m, lambda, .. } = caster.intersect(&d);
            let way = lambda * d;
            // From the axis of a round tunnel all walls beside are as near: straight ahead counts.
            let is_nearer =
                nearest.is_none_or(|(other, _)| way.norm() < (1.0 - 1e-6) * other.norm());
            if lambda.is_finite() && is_nearer {
                nearest = Some((way, h_m));
            }
        }
        let mut light = Self {
            offset: Vector3::from(lamp.offset_m),
            sheen_grey: WHITE_GREY * lamp.sheen_percent / 100.0,
            scale: 1.0,
        };
        let reference = nearest.map_or(0.0, |(way, h_m)| {
            let point = pose.t_wc + way;
            let normal = tunnel.inward_normal(&point, h_m);
            light.at(pose).irradiance(&point, &normal)
        });
        check_option(
            reference > 0.0,
            "the lamp does not shine on the nearest wall that the camera sees",
        )?;
        light.scale = 1.0 / reference;
        Ok(light)
    }

    /// The lamp of a camera with the given pose.
    pub fn at(&self, pose: &Pose) -> PosedLamp {
        PosedLamp {
            position: pose.to_world(&self.offset),
            light: *self,
        }
    }
}

/// Lamp in the tunnel.
#[derive(Clone, Copy, Debug)]
pub(super) struct PosedLamp {
    /// Position in the world, metres.
    position: Vector3<f64>,
    light: LampLight,
}

impl PosedLamp {
    /// Factor E of the radiance at a point of a surface with the given unit normal.
    pub fn irradiance(&self, point: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
        let way = self.position - point;
        let square = way.norm_squared();
        self.light.scale * (normal.dot(&way) / square.sqrt()).max(0.0) / square
    }

    /// Sheen of a point of a surface that is seen along direction `d`, grey levels.
    pub fn sheen(&self, point: &Vector3<f64>, normal: &Vector3<f64>, d: &Vector3<f64>) -> f64 {
        let way = self.position - point;
        if self.light.sheen_grey == 0.0 || normal.dot(&way) <= 0.0 {
            return 0.0;
        }
        let half = (way.normalize() - d.normalize()).normalize();
        let facing = normal.dot(&half).max(0.0).powi(SHEEN_EXPONENT);
        self.light.sheen_grey * self.light.scale * facing / way.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(offset_m: [f64; 3], sheen_percent: f64) -> PosedLamp {
        let lamp = CameraLamp {
            offset_m,
            sheen_percent,
        };
        let camera = Camera::from_vertical_fov(160, 120, 1.0);
        let pose = Pose::identity();
        let light = LampLight::new(&lamp, &pose, &camera, &Tunnel::Round(3.0));
        light.unwrap().at(&pose)
    }

    /// Points straight ahead, and h metres farther along the tunnel, with the wall's normal −z.
    fn ahead(h_m: f64) -> (Vector3<f64>, Vector3<f64>) {
        (Vector3::new(0.0, h_m, 3.0), -Vector3::z())
    }

    /// For a lamp at the lens the factor is (r/d)² cos φ = (1 + h²/r²)^(−3/2).
    #[test]
    fn light_falls_with_the_cosine_and_the_squared_distance() {
        let lamp = light([0.0; 3], 0.0);
        for h_m in [0.0, 1.0, 3.0, 9.0] {
            let (point, normal) = ahead(h_m);
            let expected = (1.0 + (h_m / 3.0f64).powi(2)).powf(-1.5);
            assert!((lamp.irradiance(&point, &normal) - expected).abs() < 1e-12);
        }
        let (point, normal) = ahead(0.0);
        assert_eq!(lamp.irradiance(&point, &-normal), 0.0);
    }

    #[test]
    fn a_lamp_beside_the_lens_lights_its_own_side_more() {
        let lamp = light([0.0, 0.5, 0.1], 0.0);
        let at = |h_m| lamp.irradiance(&ahead(h_m).0, &ahead(h_m).1);
        assert!((at(0.0) - 1.0).abs() < 1e-12);
        assert!(at(0.5) > 1.0 && (at(1.5) - at(-0.5)).abs() < 1e-12);
    }

    /// The mirror point of lamp and lens lies half way between them; there the sheen is highest.
    #[test]
    fn the_sheen_is_a_lobe_at_the_mirror_point() {
        let lamp = light([0.0, 0.8, 0.0], 40.0);
        let sheen = |h_m| lamp.sheen(&ahead(h_m).0, &ahead(h_m).1, &ahead(h_m).0);
        let highest = (0..400).map(|k| 0.01 * f64::from(k) - 2.0);
        let highest = highest.max_by(|a, b| sheen(*a).total_cmp(&sheen(*b)));
        assert!((highest.unwrap() - 0.4).abs() < 0.05, "{highest:?}");
        assert!(sheen(4.0) < 0.02 * sheen(0.4) && sheen(-3.2) < 0.02 * sheen(0.4));
        let at_lens = light([0.0; 3], 40.0);
        let (point, normal) = ahead(0.0);
        assert!((at_lens.sheen(&point, &normal, &point) - 102.0).abs() < 1e-9);
        assert_eq!(light([0.0; 3], 0.0).sheen(&point, &normal, &point), 0.0);
    }
}
