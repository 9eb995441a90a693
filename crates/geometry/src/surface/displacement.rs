//! Jacobians of the wall point of a fixed pixel with respect to the pose and the intrinsics.

use super::wall::WallFrame;
use crate::camera::Camera;
use crate::trajectory::{Pose, so3};
use nalgebra::{Matrix2, Matrix2x5, Matrix2x6, Matrix3x2, Vector3};

/// `∂(s, h)/∂ξ` of the wall point seen through a fixed pixel, for `ξ = (ω, ρ)` of
/// [`Pose::retract`].
///
/// The pixel's ray meets the wall at `x_w = t + λ R d_c`. A change of the pose moves that point by
/// `e_s δs + e_h δh = m + δλ d`, where `m = ρ + R (ω × x_c) = ρ − R [x_c]ₓ ω` and `d = x_w − t`.
/// The dual vectors `a = e_h × d` and `b = d × e_s` are orthogonal to the unknown `δλ d`, so
///
/// `δs = a·m / a·e_s`,  `δh = b·m / b·e_h`.
///
/// The equations hold for any surface with tangents. Rows: s, h (metres); columns: ω (radians), ρ
/// (metres). The result is not finite where the ray grazes the wall.
#[inline]
pub fn wall_jacobian(pose: &Pose, wall: &WallFrame) -> Matrix2x6<f64> {
    let d = wall.x_w - pose.t_wc;
    let x_c: Vector3<f64> = pose.r_wc.inverse_transform_vector(&d);
    let a = wall.e_h.cross(&d);
    let b = d.cross(&wall.e_s);
    let row_s = a / a.dot(&wall.e_s);
    let row_h = b / b.dot(&wall.e_h);
    // m = [−R [x_c]ₓ | I] ξ, so a row nᵀ of duals gives (−nᵀ R [x_c]ₓ, nᵀ) = ((x_c × Rᵀn)ᵀ, nᵀ).
    let mut jacobian = Matrix2x6::zeros();
    for (row, n) in [row_s, row_h].iter().enumerate() {
        let omega = so3::skew(&x_c) * pose.r_wc.inverse_transform_vector(n);
        for k in 0..3 {
            jacobian[(row, k)] = omega[k];
            jacobian[(row, 3 + k)] = n[k];
        }
    }
    jacobian
}

/// `C = ∂(s, h)/∂(ln f, cx, cy, k1, k2)` of the wall point `x_c` (camera coordinates) seen through
/// a fixed pixel.
///
/// With `π(x_c, κ)` the pixel, a point on its ray moves across by `∂x_c = −J⁺ ∂π/∂κ`,
/// `J = ∂π/∂x_c`, `J⁺ = Jᵀ (J Jᵀ)⁻¹`, when κ changes, and the wall point as for a translation of
/// the camera: `C = A_ρ R ∂x_c`, with `A_ρ` the last three columns of `a` ([`wall_jacobian`]).
/// Rows: s, h (metres).
pub fn lens_jacobian(
    pose: &Pose,
    a: &Matrix2x6<f64>,
    camera: &Camera,
    x_c: &Vector3<f64>,
) -> Matrix2x5<f64> {
    let r_wc = pose.r_wc.to_rotation_matrix();
    let j = camera.project_jacobian(x_c);
    // Singular only where the distortion is not invertible.
    let square = (j * j.transpose()).try_inverse().unwrap_or_default();
    let moved = j.transpose() * square * -camera.intrinsics_jacobian(x_c);
    a.fixed_columns::<3>(3) * (r_wc.matrix() * moved)
}

/// `∂(s, h)/∂(c_x, c_z)` of the wall point `x_c` (camera coordinates) seen through a fixed pixel,
/// for a curvature c of the tunnel ([`super::Bend`]) along which the camera is carried.
///
/// Seen from the camera's section, a wall point at the distance y along the tunnel and (x, z)
/// across moves by `∂X = (½ y², −x y, 0) ∂c_x + (0, −z y, ½ y²) ∂c_z`, but for terms of the
/// relative order `r |c|`; for the pixel it is as if the camera moved by `−∂X`: `−A_ρ Q ∂X`, with
/// the section's frame Q. `straightened`: the pose in the straight tunnel. Rows: s, h; metres per
/// 1/m.
pub fn bend_jacobian(
    pose: &Pose,
    straightened: &Pose,
    a: &Matrix2x6<f64>,
    x_c: &Vector3<f64>,
) -> Matrix2<f64> {
    let mut p = straightened.r_wc * x_c;
    p.x += straightened.t_wc.x;
    p.z += straightened.t_wc.z;
    let half = 0.5 * p.y * p.y;
    let moved = Matrix3x2::new(half, 0.0, -p.x * p.y, -p.z * p.y, 0.0, half);
    let section = pose.r_wc * straightened.r_wc.inverse();
    a.fixed_columns::<3>(3) * (section.to_rotation_matrix().matrix() * -moved)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::bend::Bend;
    use crate::surface::bent::bent;
    use crate::surface::circle::Circle;
    use crate::surface::shape::Surface;
    use nalgebra::Vector6;

    #[test]
    fn jacobian_matches_central_differences() {
        let circle = Circle::new(3.0).unwrap();
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        for (turn, t) in [
            (Vector3::new(0.1, 0.7, -0.2), Vector3::new(0.5, 2.0, -0.4)),
            (Vector3::new(-0.3, 2.9, 0.4), Vector3::new(-1.5, 0.0, 1.0)),
        ] {
            let pose = Pose::new(so3::exp(&turn), t);
            for (u, v) in [(0.0, 0.0), (320.0, 240.0), (600.0, 50.0), (10.0, 470.0)] {
                let ray = camera.ray(u, v).unwrap();
                let wall_of =
                    |pose: &Pose| circle.hit(&pose.t_wc, &(pose.r_wc * ray)).unwrap().wall;
                let analytic = wall_jacobian(&pose, &circle.frame(wall_of(&pose)));
                let step = 1e-6;
                for k in 0..6 {
                    let mut xi = Vector6::zeros();
                    xi[k] = step;
                    let (plus, minus) = (wall_of(&pose.retract(&xi)), wall_of(&pose.retract(&-xi)));
                    let numeric_s = (plus.s_m - minus.s_m) / (2.0 * step);
                    let numeric_h = (plus.h_m - minus.h_m) / (2.0 * step);
                    assert!((numeric_s - analytic[(0, k)]).abs() < 1e-7, "s, column {k}");
                    assert!((numeric_h - analytic[(1, k)]).abs() < 1e-7, "h, column {k}");
                }
            }
        }
    }

    /// Against the wall point of a pixel of a carried camera, from a straight and from a bent
    /// start.
    #[test]
    fn jacobian_of_the_bend_matches_central_differences() {
        let straight: std::sync::Arc<dyn Surface> = std::sync::Arc::new(Circle::new(3.0).unwrap());
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.1, 0.7, -0.2)),
            Vector3::new(0.5, 9.0, -0.4),
        );
        for start in [[0.0; 2], [2e-3, -3e-3]] {
            let bend = |dx: f64, dz: f64| Bend {
                curvature_per_m: [start[0] + dx, start[1] + dz],
                at_h_m: 2.0,
            };
            let ray = camera.ray(100.0, 50.0).unwrap();
            let hit_of = |bend: Bend| {
                let (wall, pose) = (bent(&straight, Some(bend)), bend.bent(&pose));
                let hit = wall.hit(&pose.t_wc, &(pose.r_wc * ray)).unwrap();
                (hit, wall.frame(hit.wall), pose)
            };
            let (hit, frame, here) = hit_of(bend(0.0, 0.0));
            let a = wall_jacobian(&here, &frame);
            let x_c = here.to_camera(&hit.x_w);
            let analytic = bend_jacobian(&here, &pose, &a, &x_c);
            let step = 1e-6;
            for (k, d) in [[step, 0.0], [0.0, step]].into_iter().enumerate() {
                let plus = hit_of(bend(d[0], d[1])).0.wall;
                let minus = hit_of(bend(-d[0], -d[1])).0.wall;
                let numeric = [plus.s_m - minus.s_m, plus.h_m - minus.h_m];
                for row in 0..2 {
                    let difference = numeric[row] / (2.0 * step) - analytic[(row, k)];
                    // Exact for a straight tunnel, else but for the relative order r |c|.
                    let c_r = 3.0 * f64::hypot(start[0], start[1]);
                    let most = 1e-6 + 3.0 * c_r * analytic.norm();
                    assert!(difference.abs() < most, "{row} {k} {difference} {analytic}");
                }
            }
        }
    }
}
