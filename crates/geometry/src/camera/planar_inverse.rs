//! Maps of the plane that keep its orientation near the origin: the circle within which they do,
//! and their inverse.

use crate::numerics::monotone::monotone_limit;
use nalgebra::{Matrix2, Vector2};
use std::f64::consts::TAU;

/// Directions in which the limit of a map without symmetry is determined.
const LIMIT_DIRECTIONS: usize = 72;
/// Newton iterations of the inverse.
const MAX_NEWTON_ITERATIONS: usize = 50;
/// Residual at which the inverse has converged, for points of the size of 1.
const RESIDUAL_TOLERANCE: f64 = 1e-14;

/// Radius of the circle within which `determinant` is positive, searched up to `end`; infinity if
/// it is everywhere. One direction suffices if the determinant depends on the radius alone
/// (`is_symmetric`).
pub fn planar_limit(
    determinant: impl Fn(&Vector2<f64>) -> f64,
    end: f64,
    is_symmetric: bool,
) -> f64 {
    let directions = if is_symmetric { 1 } else { LIMIT_DIRECTIONS };
    let rises = |k: usize| {
        let (sin, cos) = (TAU * k as f64 / directions as f64).sin_cos();
        let direction = Vector2::new(cos, sin);
        monotone_limit(|radius| determinant(&(direction * radius)), end)
    };
    (0..directions).map(rises).fold(f64::INFINITY, f64::min)
}

/// Solves `map(p) = target` for a point with `|p|² < limit`; None if there is none.
///
/// Newton's method from `start`; steps are halved until they reduce the residual and stay within
/// the limit.
pub fn invert_planar(
    target: &Vector2<f64>,
    start: Vector2<f64>,
    limit: f64,
    map: impl Fn(&Vector2<f64>) -> Vector2<f64>,
    jacobian: impl Fn(&Vector2<f64>) -> Matrix2<f64>,
) -> Option<Vector2<f64>> {
    let tolerance = RESIDUAL_TOLERANCE * (1.0 + target.norm());
    let mut p = start;
    let mut error = map(&p) - target;
    for _ in 0..MAX_NEWTON_ITERATIONS {
        let step = jacobian(&p).try_inverse()? * error;
        let mut share = 1.0;
        let (next, next_error) = loop {
            let next = p - step * share;
            let next_error = map(&next) - target;
            let better = next_error.norm() < error.norm();
            if next.norm_squared() < limit && better {
                break (next, next_error);
            }
            share *= 0.5;
            if share < 1e-6 {
                return (error.norm() <= tolerance * 100.0).then_some(p);
            }
        };
        (p, error) = (next, next_error);
        if error.norm() <= tolerance {
            break;
        }
    }
    (error.norm() <= tolerance * 100.0).then_some(p)
}
