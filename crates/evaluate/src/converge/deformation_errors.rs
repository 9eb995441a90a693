//! Errors of the deformation that refinements of deformed walls have found.

use crate::deformation::{NodeError, ShapeEstimate, node_errors};
use serde::Serialize;
use std::fmt;
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::surface::{GaugeMotion, WallPoint};
use tunnelstitch_refine::EstimatedShape;
use tunnelstitch_simulate::Scene;

/// Errors of the deviation from the best-fit circles, over all nodes that the frames determine.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DeformationErrors {
    /// Number of nodes.
    pub nodes: usize,
    /// Root mean square error, millimetres.
    pub error_mm: f64,
    /// Stated 1-σ, root mean square, millimetres.
    pub sigma_mm: f64,
    /// Mean of the error squared over its stated variance; 1 if the stated σ are consistent.
    pub normalised_error: f64,
}

impl DeformationErrors {
    /// Statistics of some nodes; None of none.
    pub(super) fn of(errors: &[NodeError]) -> Option<Self> {
        let mean = |value: &dyn Fn(&NodeError) -> f64| {
            errors.iter().map(value).sum::<f64>() / errors.len() as f64
        };
        (!errors.is_empty()).then(|| Self {
            nodes: errors.len(),
            error_mm: 1e3 * mean(&|node| node.error_m.powi(2)).sqrt(),
            sigma_mm: 1e3 * mean(&|node| node.sigma_m.powi(2)).sqrt(),
            normalised_error: mean(&|node| (node.error_m / node.sigma_m).powi(2)),
        })
    }
}

/// The errors of an estimated shape at its nodes; `gauge`: the motion from the estimated to the
/// true poses.
pub(super) fn errors_of(
    shape: &EstimatedShape,
    survey: &Survey,
    scene: &Scene,
    gauge: &GaugeMotion,
) -> Vec<NodeError> {
    let estimate = ShapeEstimate {
        nominal: survey.nominal.as_ref(),
        field: &shape.field,
        error_draws: &shape.error_draws,
        prior_sigma_m: shape.prior_sigma_m,
        extent_h_m: shape.extent_h_m,
    };
    let radius_m = survey.file.tunnel.nominal_m();
    node_errors(&estimate, |wall: WallPoint| {
        scene.lining_deviation_m(
            wall.s_m / radius_m + gauge.turn_rad,
            wall.h_m + gauge.shift_m,
        )
    })
}

impl fmt::Display for DeformationErrors {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "deformation at {} nodes: error {:.3} mm, stated {:.3} mm, normalised error squared \
             {:.2} (1 if the stated σ are true)",
            self.nodes, self.error_mm, self.sigma_mm, self.normalised_error
        )
    }
}
