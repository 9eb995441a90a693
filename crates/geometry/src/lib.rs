//! Cameras, trajectories and tunnel surfaces: from a pixel to a point of the wall and back, with
//! Jacobians, and the files that hold cameras and poses. With them the numerical tools that all
//! crates of `tunnelstitch` share.

pub mod camera;
pub mod files;
pub mod numerics;
pub mod recordings;
pub mod surface;
pub mod trajectory;
