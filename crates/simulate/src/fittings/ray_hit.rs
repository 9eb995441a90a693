//! Rays and where they meet a solid.

use nalgebra::Vector3;

/// The ray `t + λ d`, λ > 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ray {
    /// Camera centre, metres.
    pub t: Vector3<f64>,
    /// Direction, of any length.
    pub d: Vector3<f64>,
}

impl Ray {
    /// The point at λ.
    pub fn at(&self, lambda: f64) -> Vector3<f64> {
        self.t + self.d * lambda
    }
}

/// First point of a solid on a ray that comes from outside.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RayHit {
    /// λ of the point.
    pub lambda: f64,
    /// Unit normal of the solid, outwards.
    pub normal: Vector3<f64>,
}
