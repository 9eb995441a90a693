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
    /// Chainage between which the frames see the wall, metres; None if unknown.
    pub extent_h_m: Option<[f64; 2]>,
}

impl ShapeEstimate<'_> {
    /// Number of nodes around the section.
    pub(super) fn columns(&self) -> usize {
        self.field.lattice().columns
    }

    /// True for a row of nodes, at a chainage in metres, that is seen, or not half a spacing
    /// beyond.
    pub(super) fn sees(&self, h_m: f64) -> bool {
        let beyond_m = 0.5 * self.field.lattice().spacing_m();
        let [from_m, to_m] = self
            .extent_h_m
            .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        (from_m - beyond_m..to_m + beyond_m).contains(&h_m)
    }
}
