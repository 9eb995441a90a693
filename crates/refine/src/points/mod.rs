//! Measured points of the wall, and their part of the normal equations.
//!
//! A scanner or a depth camera may have measured points of the wall, in the world of the poses.
//! [`WallPoints`](wall_points::WallPoints) thins a file of them to some for every cell of the wall.
//! [`crate::point_fit`] fits axis, section and displacement to these. What is left are
//! [`observations`] of the displacement, whose
//! [normal equations](equations::PointEquations) stand beside those of the pixels in every solve.

pub mod equations;
pub mod error;
pub mod observations;
pub mod wall_points;
