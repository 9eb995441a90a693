//! Scale of a result: how sure its lengths are.
//!
//! Pictures stay the same when the tunnel and all positions grow together. So lengths follow what
//! is known of the radius, whose relative error is that of all of them. Every other σ of the result
//! is relative to this scale.

use crate::point_fit::points_report::PointsReport;
use crate::uncertainty::calibration_report::CalibrationReport;
use serde::{Deserialize, Serialize};

/// The scale of a result.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct LengthScale {
    /// 1-σ of the radius, and with it of all lengths, percent; 0 if the radius is exact.
    pub sigma_percent: f64,
    /// Source of the radius.
    pub radius: RadiusSource,
}

/// Source of the radius.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum RadiusSource {
    /// The survey says it.
    Given,
    /// It was estimated from the initial poses.
    Calibrated,
    /// Measured points show it.
    Points,
}

impl LengthScale {
    /// The scale of a result with a given radius, metres, and its relative 1-σ, unless it was
    /// estimated or measured.
    pub fn new(
        (radius_m, radius_sigma): (f64, f64),
        calibration: Option<&CalibrationReport>,
        points: Option<&PointsReport>,
    ) -> Self {
        let unknowns = calibration.map_or(&[][..], |calibration| &calibration.unknowns);
        let estimated = unknowns.iter().find(|unknown| {
            unknown.name == "radius" && unknown.observed && unknown.sigma.is_finite()
        });
        let (sigma, radius) = match (estimated, points) {
            (Some(found), _) => (found.sigma / found.estimate, RadiusSource::Calibrated),
            (None, Some(points)) => {
                let sigma_m = 1e-3 * points.radius_change_sigma_mm;
                (sigma_m / radius_m, RadiusSource::Points)
            }
            (None, None) => (radius_sigma, RadiusSource::Given),
        };
        Self {
            sigma_percent: 100.0 * sigma,
            radius,
        }
    }

    /// The scale in words.
    pub fn sentence(&self) -> String {
        let radius = match self.radius {
            RadiusSource::Given => "the radius as given",
            RadiusSource::Calibrated => "the radius as estimated",
            RadiusSource::Points => "the radius by the measured points",
        };
        match self.sigma_percent {
            0.0 => format!("all lengths follow {radius}, which is taken to be exact"),
            percent => format!("all lengths follow {radius}, ± {percent:.2} % (1-σ)"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_as_sure_as_the_radius() {
        let given = LengthScale::new((3.0, 0.005), None, None);
        assert_eq!(given.radius, RadiusSource::Given);
        assert!((given.sigma_percent - 0.5).abs() < 1e-12);
        assert!(given.sentence().contains("0.50 %"));
        let exact = LengthScale::new((3.0, 0.0), None, None);
        assert!(exact.sentence().contains("exact"));
    }
}
