//! Points in wall coordinates, and how size and position of the section move them.

use crate::points::wall_points::WallPoints;
use nalgebra::Vector3;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{RadialField, Surface, WallPoint, foot_point};
use tunnelstitch_geometry::trajectory::Pose;

/// Number of modes of a section that are no deformation: its size and the position of its axis.
pub const SECTION_MODES: usize = 3;

/// A point in wall coordinates.
#[derive(Clone, Copy, Debug)]
pub struct LocatedPoint {
    /// The point of the nominal wall whose normal goes through it.
    pub wall: WallPoint,
    /// Its distance from the wall with the known displacement along that normal, metres, positive
    /// outwards.
    pub distance_m: f64,
    /// Displacement of the wall there by the modes of the section ([`section_modes`]).
    pub modes: [f64; SECTION_MODES],
}

/// Displacement along the normal of the wall at `wall` by a change of size (so that the nominal
/// radius grows by 1 m), and by a shift of the section along x and z by 1 m: `x·n/r`, `n_x`, `n_z`,
/// in the frame of the section. For a circle 1, sin θ and cos θ.
pub fn section_modes(
    surface: &dyn Surface,
    wall: WallPoint,
    radius_m: f64,
) -> [f64; SECTION_MODES] {
    let frame = surface.frame(wall);
    let straight = surface.straightened(&Pose::new(Default::default(), frame.x_w));
    let n: Vector3<f64> = straight.r_wc * frame.normal();
    let across = straight.t_wc;
    [(across.x * n.x + across.z * n.z) / radius_m, n.x, n.z]
}

/// Locates points on a wall with a known displacement; `radius_m`: nominal radius. Points without a
/// foot point ([`foot_point`]) and those outside the chainages `extent_h_m` are left out.
pub fn locate_points(
    points: &WallPoints,
    surface: &dyn Surface,
    known: Option<&RadialField>,
    radius_m: f64,
    extent_h_m: [f64; 2],
) -> Vec<Vec<LocatedPoint>> {
    let [from, to] = extent_h_m;
    let locate = |point: &Vector3<f64>| {
        let foot = foot_point(surface, point)?;
        let known_m = known.map_or(0.0, |known| known.at(foot.wall).delta_m);
        (from..=to).contains(&foot.wall.h_m).then(|| LocatedPoint {
            wall: foot.wall,
            distance_m: foot.distance_m - known_m,
            modes: section_modes(surface, foot.wall, radius_m),
        })
    };
    let cells = points.cells.as_slice();
    let cells = cells.par_map(|cell| cell.iter().filter_map(locate).collect::<Vec<_>>());
    cells.into_iter().filter(|cell| !cell.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;
    use tunnelstitch_geometry::surface::{Bend, Circle, bent};

    /// Against the distances of points of a circle that is moved and larger.
    #[test]
    fn modes_are_the_displacement_by_size_and_position() {
        let circle: Arc<dyn Surface> = Arc::new(Circle::new(3.0).unwrap());
        let bend = Bend {
            curvature_per_m: [0.01, 0.0],
            at_h_m: 0.0,
        };
        for surface in [Arc::clone(&circle), bent(&circle, Some(bend))] {
            for (s_m, h_m) in [(0.4, 1.0), (7.0, 5.0)] {
                let wall = WallPoint { s_m, h_m };
                let [size, x, z] = section_modes(surface.as_ref(), wall, 3.0);
                let theta = s_m / 3.0;
                assert!((size - 1.0).abs() < 1e-9);
                assert!((x - theta.sin()).abs() < 1e-9 && (z - theta.cos()).abs() < 1e-9);
            }
        }
    }
}
