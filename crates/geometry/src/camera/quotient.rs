//! Projections of the form `(x, y)/D(x_c)`.

use nalgebra::{Matrix2x3, RowVector3, Vector2};

/// `∂p/∂x_c = ((I, 0) − p ∂D/∂x_c)/D` of `p = (x, y)/D`.
pub fn quotient_jacobian(
    p: &Vector2<f64>,
    denominator: f64,
    slope: &RowVector3<f64>,
) -> Matrix2x3<f64> {
    (Matrix2x3::identity() - p * slope) / denominator
}
