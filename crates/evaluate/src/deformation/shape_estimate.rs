//! A wall's shape, estimated, with draws of its errors.

use tunnelstitch_geometry::surface::{RadialField, Surface};

/// A wall's estimated shape, whose deformation is to be measured.
#[derive(Clone, Copy, Debug)]
pub struct ShapeEstimate<'a> {
    /// The nominal wall.
    pub nominal: &'a dyn Surface,
    /// Its displacement δ.
    pub field: &'a RadialField,
    /// Draws of the errors of δ; none if they are unknown.
    pub error_draws: &'a [RadialField],
    /// 1-σ of δ before any frame was seen, metres.
    pub prior_sigma_m: f64,
}

impl ShapeEstimate<'_> {
    /// Number of nodes around the section.
    pub(super) fn columns(&self) -> usize {
        self.field.lattice().columns
    }
}
