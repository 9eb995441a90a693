//! Intersection of a ray with a curved wall by Newton's method.

use super::shape::Surface;
use super::wall::Hit;
use nalgebra::{Matrix3, Vector3};

/// Steps at the most; three or four suffice for rays that do not graze the wall.
const MAX_STEPS: usize = 30;
/// Step below which the intersection has converged, share of the perimeter.
const CONVERGED: f64 = 1e-13;

/// Solves `t + λ d − X(s, h) = 0` from the intersection `start`, in steps of `longest_m` on the
/// wall at the most.
///
/// A ray that grazes the wall, for which this does not settle, keeps `start`: it meets the wall
/// somewhere near.
pub(super) fn settle_hit(
    surface: &impl Surface,
    start: Hit,
    [t, d]: [&Vector3<f64>; 2],
    longest_m: f64,
) -> Hit {
    let (mut range, mut wall) = (start.range, start.wall);
    let converged_m = CONVERGED * surface.perimeter_m();
    for _ in 0..MAX_STEPS {
        let frame = surface.frame(wall);
        let jacobian = Matrix3::from_columns(&[*d, -frame.e_s, -frame.e_h]);
        let Some(inverse) = jacobian.try_inverse() else {
            break;
        };
        let step = inverse * (frame.x_w - t - d * range);
        let length_m = step.y.hypot(step.z);
        let share = (longest_m / length_m).min(1.0);
        range += step.x * share;
        wall.s_m += step.y * share;
        wall.h_m += step.z * share;
        if length_m < converged_m {
            wall.s_m = wall.s_m.rem_euclid(surface.perimeter_m());
            return Hit {
                range,
                x_w: t + d * range,
                wall,
            };
        }
    }
    start
}
