//! A lamp that moves with the camera: its light on the wall by pose and shape.
//!
//! A small lamp at l, in the camera's frame, lights a matt wall point x with the unit normal n in
//! proportion to `L = cos ψ r²/ρ²`, where ρ is the distance of the lamp and ψ the angle of its ray
//! to the normal; r only makes it a number:
//!
//! `ln L = ln(|w·n| r²/ρ³)`,   `w = x − t − R l`,   `ρ = |w|`.
//!
//! With the position in units of r, `∂ ln L/∂(l/r) = r Rᵀ (3 w/ρ² − n/(w·n))`.
//!
//! Source: inverse-square and cosine law, J. H. Lambert, "Photometria", 1760.

use nalgebra::{Vector2, Vector3};
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Surface, sighted_wall};
use tunnelstitch_geometry::trajectory::Pose;

/// Unknowns of a lamp: its position in units of its reach.
pub const TERMS: usize = 3;
/// Columns and rows of the grid on which a frame's falloff is kept.
const GRID: [usize; 2] = [33, 25];
/// Smallest `|w·n|/ρ` that is distinguished: rays that graze the wall.
const MIN_COSINE: f64 = 0.02;

/// A lamp that moves with the camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Lamp {
    /// Its position in the camera's frame (x right, y down, z along the optical axis), in units of
    /// [`Lamp::reach_m`].
    pub position: Vector3<f64>,
    /// The distance r at which its light counts as 1, metres.
    pub reach_m: f64,
}

impl Lamp {
    /// A lamp at the camera.
    pub fn at_camera(reach_m: f64) -> Self {
        Self {
            position: Vector3::zeros(),
            reach_m,
        }
    }

    /// True if it is at the camera, as it is assumed to be before it is found.
    pub fn is_at_camera(&self) -> bool {
        self.position == Vector3::zeros()
    }

    /// Its unknowns: the position in units of the reach.
    pub fn unknowns(&self) -> [f64; TERMS] {
        self.position.into()
    }

    /// The lamp with its unknowns changed by δ.
    pub fn changed(&self, delta: &[f64; TERMS]) -> Self {
        Self {
            position: self.position + Vector3::from(*delta),
            ..*self
        }
    }

    /// `ln L` at the wall point `x_w` with the unit normal `normal`, seen from `pose`, and its
    /// derivatives by [`Lamp::unknowns`].
    pub fn log_falloff(
        &self,
        pose: &Pose,
        x_w: &Vector3<f64>,
        normal: &Vector3<f64>,
    ) -> (f64, [f64; TERMS]) {
        let r = self.reach_m;
        let w = x_w - pose.t_wc - pose.r_wc * (self.position * r);
        let rho = w.norm().max(f64::MIN_POSITIVE);
        let across = w.dot(normal);
        let cosine = (across.abs() / rho).max(MIN_COSINE);
        let slope = w * (3.0 / (rho * rho)) - normal / (cosine * rho).copysign(across);
        (
            (cosine * r * r / (rho * rho)).ln(),
            (pose.r_wc.inverse() * slope * r).into(),
        )
    }

    /// `ln L` at a wall point.
    pub fn log_at(&self, pose: &Pose, x_w: &Vector3<f64>, normal: &Vector3<f64>) -> f64 {
        self.log_falloff(pose, x_w, normal).0
    }

    /// `ln L` at the wall point that a pixel of `camera` shows; None if it shows no wall in range.
    pub fn log_seen_at(
        &self,
        pixel: &Vector2<f64>,
        surface: &dyn Surface,
        camera: &Camera,
        pose: &Pose,
    ) -> Option<f64> {
        let ray = camera.ray(pixel.x, pixel.y)?;
        let hit = sighted_wall(surface, camera, pose, &ray).ok()?;
        Some(self.log_at(pose, &hit.x_w, &surface.frame(hit.wall).normal()))
    }
}

/// The falloff of a lamp's light over a frame, `ln L`, on a grid of the picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Falloff {
    size: (usize, usize),
    logs: Vec<f32>,
}

impl Falloff {
    /// The falloff over a full-size frame of `camera` at `pose`; where it shows no wall in range,
    /// that of the nearest grid point before in its row that does.
    pub fn new(lamp: &Lamp, surface: &dyn Surface, camera: &Camera, pose: &Pose) -> Self {
        let size = (camera.width as usize, camera.height as usize);
        let [columns, rows] = GRID;
        let mut last = 0.0f32;
        let log = |k: usize| {
            let u = (k % columns) as f64 / (columns - 1) as f64 * (size.0 - 1) as f64;
            let v = (k / columns) as f64 / (rows - 1) as f64 * (size.1 - 1) as f64;
            let seen = lamp.log_seen_at(&Vector2::new(u, v), surface, camera, pose);
            if let Some(seen) = seen {
                last = seen as f32;
            }
            last
        };
        Self {
            size,
            logs: (0..columns * rows).map(log).collect(),
        }
    }

    /// `ln L` at a pixel of the full-size frame, interpolated bilinearly.
    pub fn log_at(&self, pixel: &Vector2<f64>) -> f64 {
        let [columns, rows] = GRID;
        let place = |x: f64, of: usize, n: usize| {
            let at = (x / (of.max(2) - 1) as f64 * (n - 1) as f64).clamp(0.0, (n - 1) as f64);
            let first = (at as usize).min(n - 2);
            (first, at - first as f64)
        };
        let (i, a) = place(pixel.x, self.size.0, columns);
        let (j, b) = place(pixel.y, self.size.1, rows);
        let at = |i: usize, j: usize| f64::from(self.logs[j * columns + i]);
        (1.0 - b) * ((1.0 - a) * at(i, j) + a * at(i + 1, j))
            + b * ((1.0 - a) * at(i, j + 1) + a * at(i + 1, j + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use tunnelstitch_geometry::surface::Circle;

    fn lamp() -> Lamp {
        Lamp {
            position: Vector3::new(0.2, -0.1, 0.05),
            reach_m: 3.0,
        }
    }

    fn pose() -> Pose {
        let turn = UnitQuaternion::from_euler_angles(0.1, 0.4, -0.2);
        Pose {
            r_wc: turn,
            t_wc: Vector3::new(0.2, 1.0, -0.1),
        }
    }

    #[test]
    fn terms_are_the_derivatives() {
        let (lamp, pose) = (lamp(), pose());
        let x_w = Vector3::new(1.0, 2.5, 8.0f64.sqrt());
        let normal = Vector3::new(1.0, 0.0, 8.0f64.sqrt()) / 3.0;
        let (_, terms) = lamp.log_falloff(&pose, &x_w, &normal);
        for (k, term) in terms.iter().enumerate() {
            let moved = |step: f64| {
                let mut delta = [0.0; TERMS];
                delta[k] = step;
                lamp.changed(&delta).log_at(&pose, &x_w, &normal)
            };
            let numeric = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((numeric - term).abs() < 1e-7, "{k}: {numeric} {term}");
        }
    }

    #[test]
    fn a_lamp_on_the_axis_lights_the_wall_beside_it_by_one() {
        let lamp = Lamp::at_camera(3.0);
        let (x_w, normal) = (Vector3::new(3.0, 0.0, 0.0), Vector3::x());
        assert_eq!(lamp.log_at(&Pose::identity(), &x_w, &normal), 0.0);
        // Twice as far at 60°: an eighth.
        let farther = Vector3::new(3.0, 27.0f64.sqrt(), 0.0);
        let log = lamp.log_at(&Pose::identity(), &farther, &normal);
        assert!((log - 0.125f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn the_grid_has_the_falloff_between_its_points() {
        let (lamp, pose) = (lamp(), Pose::identity());
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        let falloff = Falloff::new(&lamp, &circle, &camera, &pose);
        for (u, v) in [(3.0, 7.0), (320.0, 250.0), (601.5, 33.3)] {
            let ray = camera.ray(u, v).unwrap();
            let hit = sighted_wall(&circle, &camera, &pose, &ray).unwrap();
            let exact = lamp.log_at(&pose, &hit.x_w, &circle.frame(hit.wall).normal());
            let found = falloff.log_at(&Vector2::new(u, v));
            assert!((found - exact).abs() < 1e-3, "{found} {exact}");
        }
    }
}
