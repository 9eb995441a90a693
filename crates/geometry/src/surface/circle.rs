//! The circular tunnel `x² + z² = r²`.

use super::error::{SurfaceError, check_size};
use super::gauge::Gauge;
use super::shape::{Surface, normals_of_straight};
use super::wall::{Hit, WallFrame, WallPoint};
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A straight tunnel with a circular section around the world's y axis.
///
/// `s = r θ` with `θ = atan2(x, z)` in `[0, 2π)`, `h = y`; the wall point is
/// `(r sin θ, h, r cos θ)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Circle {
    radius_m: f64,
}

impl Circle {
    /// Creates a tunnel of the given radius (metres).
    ///
    /// # Errors
    /// [`SurfaceError::Size`] unless the radius is positive and finite.
    pub fn new(radius_m: f64) -> Result<Self, SurfaceError> {
        check_size("radius_m", radius_m)?;
        Ok(Self { radius_m })
    }

    /// The radius, metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }
}

impl Surface for Circle {
    /// Intersects the ray by solving `a λ² + 2 b λ + c = 0` with `a = c1² + c3²`,
    /// `b = c1 t_x + c3 t_z`, `c = t_x² + t_z² − r²` for a ray `d = (c1, c2, c3)`:
    /// `λ = (−b + √(b² − a c)) / a`.
    ///
    /// Inside, `c < 0`, so the discriminant `b² − a c` is positive and the + root is the wall
    /// ahead. For `b > 0` this root is computed as `−c / (b + √(b² − a c))`, without cancellation.
    ///
    /// Source: arXiv 1806.10278, Section IV (whose printed discriminant lacks the square on b).
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError> {
        if !d.iter().all(|v| v.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        self.check_inside(t)?;
        let a = d.x * d.x + d.z * d.z;
        if a <= 1e-18 * d.norm_squared() {
            return Err(SurfaceError::Parallel);
        }
        let b = d.x * t.x + d.z * t.z;
        let c = t.x * t.x + t.z * t.z - self.radius_m * self.radius_m;
        let root = (b * b - a * c).sqrt();
        let range = if b > 0.0 {
            -c / (b + root)
        } else {
            (root - b) / a
        };
        let x_w = t + d * range;
        let theta = x_w.x.atan2(x_w.z).rem_euclid(TAU);
        Ok(Hit {
            range,
            x_w,
            wall: WallPoint {
                s_m: self.radius_m * theta,
                h_m: x_w.y,
            },
        })
    }

    fn frame(&self, wall: WallPoint) -> WallFrame {
        let (sin, cos) = (wall.s_m / self.radius_m).sin_cos();
        WallFrame {
            x_w: Vector3::new(self.radius_m * sin, wall.h_m, self.radius_m * cos),
            e_s: Vector3::new(cos, 0.0, -sin),
            e_h: Vector3::y(),
        }
    }

    /// Computes one sine and cosine per column.
    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        points.clear();
        for &h_m in h_m.iter().take(1) {
            points.extend(
                s_m.iter()
                    .map(|&s_m| self.frame(WallPoint { s_m, h_m }).x_w),
            );
        }
        for &h_m in h_m.iter().skip(1) {
            for column in 0..s_m.len() {
                points.push(Vector3::new(points[column].x, h_m, points[column].z));
            }
        }
    }

    fn normals(&self, s_m: &[f64], h_m: &[f64], normals: &mut Vec<Vector3<f64>>) {
        normals_of_straight(self, s_m, h_m, normals);
    }

    fn perimeter_m(&self) -> f64 {
        TAU * self.radius_m
    }

    fn gauge(&self) -> Gauge {
        Gauge::round()
    }

    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError> {
        let distance_m = t.x.hypot(t.z);
        if !(distance_m.is_finite() && t.y.is_finite()) {
            return Err(SurfaceError::NotFinite);
        }
        if distance_m >= self.radius_m {
            return Err(SurfaceError::CameraOutside {
                distance_m,
                wall_m: self.radius_m,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Camera;
    use crate::trajectory::{Pose, so3};
    use proptest::prelude::*;

    fn vector(range: std::ops::Range<f64>) -> impl Strategy<Value = Vector3<f64>> {
        (range.clone(), range.clone(), range).prop_map(|(x, y, z)| Vector3::new(x, y, z))
    }

    proptest! {
        /// Pixel → wall → pixel for a camera anywhere inside, turned any way.
        #[test]
        fn pixel_to_wall_to_pixel_is_the_identity(
            radius in 0.1f64..20.0, share in 0.0f64..0.99, around in 0.0f64..TAU,
            chainage in -1e3f64..1e3,
            turn in vector(-3.0..3.0), u in 0.0f64..639.0, v in 0.0f64..479.0,
        ) {
            let circle = Circle::new(radius).unwrap();
            let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
            let off = share * radius;
            let t = Vector3::new(off * around.sin(), chainage, off * around.cos());
            let pose = Pose::new(so3::exp(&turn), t);
            let ray = pose.r_wc * camera.ray(u, v).unwrap();
            // Rays nearly along the axis meet the wall too far away to be distinguished.
            prop_assume!(ray.x.hypot(ray.z) > 0.02 * ray.norm());
            let hit = circle.hit(&pose.t_wc, &ray).unwrap();
            prop_assert!(hit.range > 0.0);
            prop_assert!((hit.x_w.x.hypot(hit.x_w.z) / radius - 1.0).abs() < 1e-9);
            prop_assert!((0.0..=circle.perimeter_m()).contains(&hit.wall.s_m));
            let x_w = circle.frame(hit.wall).x_w;
            let pixel = camera.project(&pose.to_camera(&x_w)).unwrap();
            prop_assert!((pixel.x - u).abs() < 1e-5 && (pixel.y - v).abs() < 1e-5, "{pixel}");
        }

        #[test]
        fn a_camera_outside_is_a_typed_error(
            radius in 0.1f64..20.0, factor in 1.0f64..5.0, around in 0.0f64..TAU,
            d in vector(-1.0..1.0),
        ) {
            let circle = Circle::new(radius).unwrap();
            let outwards = Vector3::new(around.sin(), 0.0, around.cos());
            let t = outwards * (radius * factor * (1.0 + 1e-12));
            let outside = matches!(circle.hit(&t, &d), Err(SurfaceError::CameraOutside { .. }));
            prop_assert!(outside);
        }

        #[test]
        fn the_frame_holds_the_derivatives_of_the_point(
            radius in 0.1f64..20.0, s in -50.0f64..50.0, h in -50.0f64..50.0,
        ) {
            let circle = Circle::new(radius).unwrap();
            let frame = circle.frame(WallPoint { s_m: s, h_m: h });
            let step = 1e-5 * radius;
            let point = |s_m, h_m| circle.frame(WallPoint { s_m, h_m }).x_w;
            let e_s = (point(s + step, h) - point(s - step, h)) / (2.0 * step);
            let e_h = (point(s, h + step) - point(s, h - step)) / (2.0 * step);
            prop_assert!((e_s - frame.e_s).norm() < 1e-7);
            prop_assert!((e_h - frame.e_h).norm() < 1e-7);
        }
    }

    #[test]
    fn the_lattice_is_the_frame_point_by_point() {
        let circle = Circle::new(3.0).unwrap();
        let (s, h) = ([0.1, 0.2, 18.9], [-1.0, 4.0]);
        let mut points = vec![Vector3::zeros()];
        circle.lattice(&s, &h, &mut points);
        assert_eq!(points.len(), 6);
        for (k, x_w) in points.iter().enumerate() {
            let wall = WallPoint {
                s_m: s[k % 3],
                h_m: h[k / 3],
            };
            assert!((x_w - circle.frame(wall).x_w).norm() < 1e-12);
        }
    }

    #[test]
    fn a_ray_along_the_axis_is_a_typed_error() {
        let circle = Circle::new(3.0).unwrap();
        let t = Vector3::new(0.5, 1.0, 0.5);
        assert_eq!(
            circle.hit(&t, &Vector3::y()).unwrap_err(),
            SurfaceError::Parallel
        );
        assert_eq!(
            circle
                .hit(&t, &Vector3::new(f64::NAN, 0.0, 1.0))
                .unwrap_err(),
            SurfaceError::NotFinite
        );
    }

    #[test]
    fn impossible_radii_are_refused() {
        for radius_m in [0.0, -3.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                Circle::new(radius_m),
                Err(SurfaceError::Size { .. })
            ));
        }
    }

    #[test]
    fn theta_is_measured_from_z_towards_x() {
        let circle = Circle::new(3.0).unwrap();
        let hit = circle.hit(&Vector3::zeros(), &Vector3::x()).unwrap();
        assert!((hit.wall.s_m - 3.0 * TAU / 4.0).abs() < 1e-12);
    }
}
