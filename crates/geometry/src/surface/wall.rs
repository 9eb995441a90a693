//! Points of the wall, in the world and unrolled.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A point of the unrolled wall, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WallPoint {
    /// Arc length around the section, in `[0, perimeter)`.
    pub s_m: f64,
    /// Chainage along the axis.
    pub h_m: f64,
}

/// The intersection of a ray with the wall.
#[derive(Clone, Copy, Debug)]
pub struct Hit {
    /// Multiple of the ray's direction that reaches the wall.
    pub range: f64,
    /// The point in the world, metres.
    pub x_w: Vector3<f64>,
    /// The point on the unrolled wall.
    pub wall: WallPoint,
}

/// A point of the wall with its tangents.
#[derive(Clone, Copy, Debug)]
pub struct WallFrame {
    /// The point in the world, metres.
    pub x_w: Vector3<f64>,
    /// `∂x_w/∂s`.
    pub e_s: Vector3<f64>,
    /// `∂x_w/∂h`.
    pub e_h: Vector3<f64>,
}

impl WallFrame {
    /// The unit normal `e_s × e_h/|e_s × e_h|`, which points outwards.
    pub fn normal(&self) -> Vector3<f64> {
        self.e_s.cross(&self.e_h).normalize()
    }
}
