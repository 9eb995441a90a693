//! A bend of a tunnel that was planned straight, in the report.

use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use tunnelstitch_geometry::surface::Bend;

/// The bend in the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct BendReport {
    /// The bend.
    #[serde(flatten)]
    pub bend: Bend,
    /// 1-σ of the curvature along x and z, 1/m.
    pub sigma_per_m: [f64; 2],
    /// Radius of the tunnel's axis, metres.
    pub radius_m: f64,
    /// 1-σ of it, to first order, metres.
    pub radius_sigma_m: f64,
    /// The angle towards which the tunnel turns, from z (12 o'clock) towards x, degrees.
    pub towards_deg: f64,
}

impl BendReport {
    /// Reports a bend with 1-σ of its curvature, 1/m.
    pub fn new(bend: Bend, sigma_per_m: [f64; 2]) -> Self {
        let ([x, z], radius_m) = (bend.curvature_per_m, bend.radius_m());
        // |c| changes by u·δc, u the direction of c.
        let sigma = (x * sigma_per_m[0]).hypot(z * sigma_per_m[1]) * radius_m;
        Self {
            bend,
            sigma_per_m,
            radius_m,
            radius_sigma_m: sigma * radius_m * radius_m,
            towards_deg: x.atan2(z).rem_euclid(TAU).to_degrees(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bend_has_a_radius_and_a_direction() {
        let bend = Bend {
            curvature_per_m: [0.01, 0.0],
            at_h_m: 0.0,
        };
        let report = BendReport::new(bend, [1e-4, 5e-4]);
        assert!((report.radius_m - 100.0).abs() < 1e-9);
        assert!((report.radius_sigma_m - 1.0).abs() < 1e-9);
        assert!((report.towards_deg - 90.0).abs() < 1e-9);
    }
}
