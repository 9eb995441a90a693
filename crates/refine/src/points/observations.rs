//! Points as observations of the wall's displacement.

use tunnelstitch_geometry::surface::WallPoint;

/// One point: an observation of the displacement at a point of the nominal wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PointObservation {
    /// The point of the nominal wall whose normal goes through the measured point.
    pub wall: WallPoint,
    /// Distance of the measured point from the wall with its known displacement, along the normal
    /// of the nominal one, metres, positive outwards.
    pub distance_m: f64,
    /// Information, 1/m²: `w/σ²`, w the robust weight and σ the noise of a point.
    pub information: f64,
}

/// Points, grouped by cells of the wall: those of a cell depend on nearly the same coefficients of
/// its shape.
#[derive(Clone, Debug, Default)]
pub struct PointObservations {
    /// The cells, in a fixed order.
    pub cells: Vec<Vec<PointObservation>>,
}
