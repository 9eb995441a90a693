//! The interface of tunnel shapes.

use super::error::SurfaceError;
use super::gauge::Gauge;
use super::wall::{Hit, WallFrame, WallPoint};
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// A tunnel: a closed section swept along the axis.
pub trait Surface: Send + Sync + std::fmt::Debug {
    /// Intersects the ray `t + range · d`, which starts inside, with the wall ahead.
    ///
    /// `t`: camera centre, metres; `d`: direction in the world, any length.
    ///
    /// # Errors
    /// [`SurfaceError::CameraOutside`], [`SurfaceError::Parallel`], [`SurfaceError::NotFinite`].
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError>;

    /// Point and tangents of the wall at `wall`; any `s` and `h` are allowed, `s` is periodic.
    fn frame(&self, wall: WallPoint) -> WallFrame;

    /// World coordinates of the grid `s_m × h_m` of wall points, written to `points` row by row (s
    /// runs fastest).
    ///
    /// The points equal those of [`Surface::frame`]; shapes override it to share work within the
    /// grid.
    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        points.clear();
        for &h_m in h_m {
            for &s_m in s_m {
                points.push(self.frame(WallPoint { s_m, h_m }).x_w);
            }
        }
    }

    /// Unit normals `e_s × e_h/|e_s × e_h|` (outwards) on the grid `s_m × h_m` of wall points,
    /// written to `normals` row by row; shapes override it as [`Surface::lattice`].
    fn normals(&self, s_m: &[f64], h_m: &[f64], normals: &mut Vec<Vector3<f64>>) {
        normals.clear();
        for &h_m in h_m {
            for &s_m in s_m {
                normals.push(self.frame(WallPoint { s_m, h_m }).normal());
            }
        }
    }

    /// Length of the section's outline, metres: the period of `s`.
    fn perimeter_m(&self) -> f64;

    /// The rigid motions that map the tunnel onto itself.
    fn gauge(&self) -> Gauge;

    /// Chainage of the section that contains a point, metres.
    fn chainage_m(&self, t: &Vector3<f64>) -> f64 {
        t.y
    }

    /// Converts a pose to the frame of the section at its chainage, as if the tunnel were straight
    /// along y.
    fn straightened(&self, pose: &Pose) -> Pose {
        *pose
    }

    /// The angle of the wall at `s_m` as seen from the axis, from z towards x, in `[0, 2π)`,
    /// radians.
    fn angle_rad(&self, s_m: f64) -> f64 {
        TAU * (s_m / self.perimeter_m()).rem_euclid(1.0)
    }

    /// The arc length on the section's outline at an angle from z towards x, metres; see
    /// [`Surface::angle_rad`].
    fn s_at_m(&self, angle_rad: f64) -> f64 {
        self.perimeter_m() * (angle_rad / TAU).rem_euclid(1.0)
    }

    /// Checks that a camera is inside.
    ///
    /// # Errors
    /// [`SurfaceError::CameraOutside`] or [`SurfaceError::NotFinite`].
    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError>;
}

/// Writes the normals of a straight wall, the same in every row, as [`Surface::normals`] does.
pub(super) fn normals_of_straight(
    surface: &impl Surface,
    s_m: &[f64],
    h_m: &[f64],
    normals: &mut Vec<Vector3<f64>>,
) {
    normals.clear();
    for &h_m in h_m.iter().take(1) {
        let frames = s_m.iter().map(|&s_m| surface.frame(WallPoint { s_m, h_m }));
        normals.extend(frames.map(|frame| frame.normal()));
    }
    for _ in 1..h_m.len() {
        normals.extend_from_within(..s_m.len());
    }
}
