//! Crossing of a ray and a wall by false position.

use nalgebra::Vector3;

/// Maximum iterations of false position.
const MAX_FALSE_POSITION_ITERATIONS: usize = 60;
/// Distance from the wall at which false position stops, as a share of that from the axis.
const WALL_TOLERANCE: f64 = 1e-11;

/// Point of a ray.
#[derive(Clone, Copy)]
pub(super) struct RayPoint {
    /// Distance from the camera, metres.
    pub distance_m: f64,
    /// Coordinates in the section at its chainage.
    pub point: Vector3<f64>,
    /// Relative distance beyond the wall; negative inside.
    pub beyond: f64,
}

/// Finds the wall between a point inside and one beyond by the Illinois variant of false position.
///
/// The residual of an end that is kept twice is halved.
pub(super) fn find_crossing(
    mut inside: RayPoint,
    mut outside: RayPoint,
    point_at: impl Fn(f64, f64) -> RayPoint,
) -> RayPoint {
    let mut wall = outside;
    let mut last = None;
    for _ in 0..MAX_FALSE_POSITION_ITERATIONS {
        let share = inside.beyond / (inside.beyond - outside.beyond);
        wall = point_at(
            inside.distance_m + share * (outside.distance_m - inside.distance_m),
            inside.point.y + share * (outside.point.y - inside.point.y),
        );
        if wall.beyond.abs() < WALL_TOLERANCE {
            break;
        }
        let is_inside = wall.beyond < 0.0;
        if last == Some(is_inside) {
            let other = if is_inside { &mut outside } else { &mut inside };
            other.beyond *= 0.5;
        }
        last = Some(is_inside);
        *(if is_inside { &mut inside } else { &mut outside }) = wall;
    }
    wall
}
