//! The shape of the tunnel: ray → wall, wall coordinates → point, and how the wall point of a pixel moves
//! with the pose.
//!
//! A wall point has two coordinates in metres: `s`, the arc length around the section (periodic), and
//! `h`, the chainage along the axis. One file per shape; each implements [`Surface`].

mod circle;
mod displacement;
mod footprint;
mod gauge;
mod patches;

pub use circle::Circle;
pub use displacement::{lens_jacobian, wall_jacobian};
pub use footprint::{Footprint, shortest_arc};
pub use gauge::{Gauge, GaugeMotion};
pub use patches::Patches;

use crate::trajectory::Pose;
use nalgebra::Vector3;

/// A point of the unrolled wall, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallPoint {
    /// Arc length around the section, in `[0, perimeter)`.
    pub s_m: f64,
    /// Chainage along the axis.
    pub h_m: f64,
}

/// Where a ray meets the wall.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Multiple of the ray's direction that reaches the wall.
    pub range: f64,
    /// The point in the world, metres.
    pub x_w: Vector3<f64>,
    /// The point on the unrolled wall.
    pub wall: WallPoint,
}

/// The wall around one of its points.
#[derive(Clone, Copy, Debug)]
pub struct WallFrame {
    /// The point in the world, metres.
    pub x_w: Vector3<f64>,
    /// `∂x_w/∂s`.
    pub e_s: Vector3<f64>,
    /// `∂x_w/∂h`.
    pub e_h: Vector3<f64>,
}

/// Why a ray or a camera does not go with the tunnel.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum SurfaceError {
    /// The camera's centre is not inside the tunnel.
    #[error(
        "the camera is {distance_m:.3} m off the axis, outside the tunnel (the wall is at {wall_m:.3} m)"
    )]
    CameraOutside {
        /// Distance of the camera from the axis, metres.
        distance_m: f64,
        /// Distance of the wall from the axis in that direction, metres.
        wall_m: f64,
    },
    /// The ray runs along the axis and never meets the wall.
    #[error("the ray runs along the tunnel's axis and meets no wall")]
    Parallel,
    /// The end of the tunnel lies within the picture.
    #[error("the picture holds the vanishing point of the tunnel's axis, and so wall without end")]
    LooksAlongTheAxis,
    /// The lens shows nothing there.
    #[error(
        "the lens shows nothing in the middle of the picture; check the principal point and max_angle_deg"
    )]
    NotShown,
    /// The ray or the camera's position is not a number.
    #[error("the camera's position or viewing direction is not finite")]
    NotFinite,
    /// The shape's own size is impossible.
    #[error("the tunnel's radius is {radius_m} m; it must be a positive number of metres")]
    Radius {
        /// The radius given, metres.
        radius_m: f64,
    },
}

/// Distance of the wall along a camera's optical axis, metres.
///
/// # Errors
/// As [`Surface::hit`].
pub fn viewing_distance(surface: &dyn Surface, pose: &Pose) -> Result<f64, SurfaceError> {
    let hit = surface.hit(&pose.t_wc, &(pose.r_wc * Vector3::z()))?;
    Ok(hit.range)
}

/// A tunnel: a closed section swept along the axis.
pub trait Surface: Send + Sync + std::fmt::Debug {
    /// The point where the ray `t + range · d` from inside meets the wall ahead.
    ///
    /// `t`: camera centre, metres; `d`: direction in the world, any length.
    ///
    /// # Errors
    /// [`SurfaceError::CameraOutside`], [`SurfaceError::Parallel`], [`SurfaceError::NotFinite`].
    fn hit(&self, t: &Vector3<f64>, d: &Vector3<f64>) -> Result<Hit, SurfaceError>;

    /// The wall around `wall`; any `s` and `h` are allowed, `s` is periodic.
    fn frame(&self, wall: WallPoint) -> WallFrame;

    /// World coordinates of the lattice `s_m × h_m` of wall points, in `points` row by row (s runs fastest).
    ///
    /// Same as [`Surface::frame`] point by point; shapes override it where the lattice shares work.
    fn lattice(&self, s_m: &[f64], h_m: &[f64], points: &mut Vec<Vector3<f64>>) {
        points.clear();
        for &h_m in h_m {
            for &s_m in s_m {
                points.push(self.frame(WallPoint { s_m, h_m }).x_w);
            }
        }
    }

    /// Length of the section's outline, metres: the period of `s`.
    fn perimeter_m(&self) -> f64;

    /// The motions that map the tunnel onto itself.
    fn gauge(&self) -> Gauge;

    /// Checks that a camera stands inside.
    ///
    /// # Errors
    /// [`SurfaceError::CameraOutside`] or [`SurfaceError::NotFinite`].
    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError>;
}
