//! Errors of an estimated deformation against a known one.

use super::deviation::{angles_rad, deviation_sigmas_m, nodes};
use super::shape_estimate::ShapeEstimate;
use tunnelstitch_geometry::surface::WallPoint;

/// Error of the deviation from the best-fit circle at a node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NodeError {
    /// Estimated less true deviation, metres.
    pub error_m: f64,
    /// Stated 1-σ, metres.
    pub sigma_m: f64,
}

/// Errors at all nodes that the frames determine, for a tunnel whose sections are circles;
/// `truth_m`: the true displacement at a point of the nominal wall, metres.
///
/// The deviation is linear in the displacement, so its error is that of the displacement less the
/// best-fit circle of this.
pub fn node_errors(shape: &ShapeEstimate, truth_m: impl Fn(WallPoint) -> f64) -> Vec<NodeError> {
    let sigmas = deviation_sigmas_m(shape);
    let columns = shape.columns();
    let mut errors = Vec::new();
    for (row, sigmas) in shape.field.rows().zip(sigmas.chunks(columns)) {
        let walls = nodes(shape.field, row);
        let difference = |wall: &WallPoint| shape.field.at(*wall).delta_m - truth_m(*wall);
        let differences: Vec<f64> = walls.iter().map(difference).collect();
        let angles = angles_rad(&walls, shape.field);
        let of_deviation = without_circle(&differences, &angles);
        let determined = of_deviation.into_iter().zip(sigmas);
        errors.extend(determined.filter_map(|(error_m, sigma_m)| {
            Some(NodeError {
                error_m,
                sigma_m: (*sigma_m)?,
            })
        }));
    }
    errors
}

/// Values at evenly distributed angles less their mean, cos θ and sin θ.
fn without_circle(values: &[f64], angles_rad: &[f64]) -> Vec<f64> {
    let count = values.len() as f64;
    let mean = |weight: &dyn Fn(f64) -> f64| {
        let terms = values.iter().zip(angles_rad);
        terms.map(|(v, angle)| v * weight(*angle)).sum::<f64>() / count
    };
    let (constant, cos, sin) = (mean(&|_| 1.0), mean(&f64::cos), mean(&f64::sin));
    let rest = |(value, angle): (&f64, &f64)| {
        value - constant - 2.0 * (cos * angle.cos() + sin * angle.sin())
    };
    values.iter().zip(angles_rad).map(rest).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn a_displaced_circle_is_no_error() {
        let angles: Vec<f64> = (0..32).map(|k| TAU * f64::from(k) / 32.0).collect();
        let circle = |angle: &f64| 0.002 - 0.001 * angle.cos() + 0.003 * angle.sin();
        let of = |oval: f64| -> Vec<f64> {
            let value = |angle: &f64| circle(angle) + oval * (2.0 * angle).cos();
            without_circle(&angles.iter().map(value).collect::<Vec<f64>>(), &angles)
        };
        assert!(of(0.0).iter().all(|error| error.abs() < 1e-15));
        for (error, angle) in of(0.004).iter().zip(&angles) {
            assert!((error - 0.004 * (2.0 * angle).cos()).abs() < 1e-15);
        }
    }
}
