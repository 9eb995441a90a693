//! The shape of the tunnel: ray → wall, wall coordinates → point, and how the wall point of a pixel
//! moves with the pose.
//!
//! A wall point has two coordinates in metres: `s`, the arc length around the section (periodic),
//! and `h`, the chainage along the axis. One file per shape; each implements [`Surface`].
//!
//! # Example
//!
//! ```
//! use nalgebra::Vector3;
//! use tunnelstitch::surface::{Circle, Surface};
//!
//! let tunnel = Circle::new(3.0)?;
//! let hit = tunnel.hit(&Vector3::new(0.5, 1.0, 0.0), &Vector3::new(0.0, 0.2, 1.0))?;
//! let wall = tunnel.frame(hit.wall);
//! assert!((wall.x_w - hit.x_w).norm() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod centreline;
mod circle;
mod displacement;
mod footprint;
mod gauge;
mod patches;
mod prism;
pub mod section;
mod swept;

pub use centreline::{CentrePoint, Centreline, Station};
pub use circle::Circle;
pub use displacement::{lens_jacobian, wall_jacobian};
pub use footprint::{Footprint, shortest_arc};
pub use gauge::{Axis, Gauge, GaugeMotion, free_part};
pub use patches::Patches;
pub use prism::Prism;
pub use swept::Swept;

use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;

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
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
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
    /// A size of the section is impossible.
    #[error("{name} is {size_m} m; it must be a positive number of metres")]
    Size {
        /// Its name in `survey.toml`.
        name: &'static str,
        /// The size given, metres.
        size_m: f64,
    },
    /// A horseshoe without walls.
    #[error(
        "a horseshoe {width_m} m wide and {height_m} m high has no floor; its height must be more than half its width"
    )]
    NoWalls {
        /// Width, metres.
        width_m: f64,
        /// Height, metres.
        height_m: f64,
    },
    /// A centreline that no tunnel follows.
    #[error("the centreline: {what}")]
    Centreline {
        /// What is wrong with it.
        what: String,
    },
}

/// Refuses a size that is not positive and finite.
fn check_size(name: &'static str, size_m: f64) -> Result<(), SurfaceError> {
    if size_m.is_finite() && size_m > 0.0 {
        Ok(())
    } else {
        Err(SurfaceError::Size { name, size_m })
    }
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

    /// World coordinates of the lattice `s_m × h_m` of wall points, in `points` row by row (s runs
    /// fastest).
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

    /// How far along the tunnel a point is, metres: the chainage of the section that holds it.
    fn chainage_m(&self, t: &Vector3<f64>) -> f64 {
        t.y
    }

    /// A pose as the section at its chainage sees it: what it would be if the tunnel were straight
    /// along y.
    fn straightened(&self, pose: &Pose) -> Pose {
        *pose
    }

    /// The angle of the wall at `s_m` as seen from the axis, from z towards x, in `[0, 2π)`,
    /// radians.
    fn angle_rad(&self, s_m: f64) -> f64 {
        TAU * (s_m / self.perimeter_m()).rem_euclid(1.0)
    }

    /// The place on the section's outline at an angle from z towards x, metres; see
    /// [`Surface::angle_rad`].
    fn s_at_m(&self, angle_rad: f64) -> f64 {
        self.perimeter_m() * (angle_rad / TAU).rem_euclid(1.0)
    }

    /// Checks that a camera stands inside.
    ///
    /// # Errors
    /// [`SurfaceError::CameraOutside`] or [`SurfaceError::NotFinite`].
    fn check_inside(&self, t: &Vector3<f64>) -> Result<(), SurfaceError>;
}
