//! Size and axis of the tunnel along its sections, and whether it bends.

use crate::point_fit::located_points::SECTION_MODES;
use crate::point_fit::regression::{Regression, Sample, fit_polynomial};
use crate::point_fit::section_fit::SectionFit;
use nalgebra::Vector3;
use tunnelstitch_geometry::numerics::significance::f_bound;

/// Sections from which on a curvature is looked for: as many again as it takes to fit it.
const MIN_BEND_SECTIONS: usize = 6;

/// Prior knowledge of the axis.
#[derive(Clone, Copy, Debug)]
pub struct AxisPrior {
    /// Chainage of the pivot of tilt and curvature, metres.
    pub at_h_m: f64,
    /// 1-σ of shift (m), tilt (1) and curvature (1/m): wide.
    pub sigma: Vector3<f64>,
    /// True if a curvature may be found.
    pub may_bend: bool,
    /// Rate at which a straight tunnel may be found to bend.
    pub alpha: f64,
}

/// Size and axis along the tunnel.
#[derive(Clone, Copy, Debug)]
pub struct AxisFit {
    /// Chainage of the pivot, metres.
    pub at_h_m: f64,
    /// Change of the radius, and shift along x and z, as polynomials of the distance from the
    /// pivot.
    pub modes: [Regression; SECTION_MODES],
    /// True if the axis is curved by more than chance.
    pub is_bent: bool,
}

/// The sections as samples of a mode.
fn samples(sections: &[SectionFit], mode: usize, at_h_m: f64) -> Vec<Sample> {
    let sample = |section: &SectionFit| Sample {
        along_m: section.h_m - at_h_m,
        value_m: section.modes_m[mode],
        variance_m2: section.variances_m2[mode],
    };
    sections.iter().map(sample).collect()
}

/// Fits the axis to sections; None for none.
///
/// The size is constant. The axis is a line; or a parabola, if its curvature (c_x, c_z) is more
/// than chance: `½ (c_x²/v_x + c_z²/v_z)` exceeds what an F variable does with the probability
/// `alpha`.
pub fn fit_axis(sections: &[SectionFit], prior: &AxisPrior) -> Option<AxisFit> {
    let fit = |mode: usize, degree: usize| {
        fit_polynomial(&samples(sections, mode, prior.at_h_m), degree, &prior.sigma)
    };
    let size = fit(0, 0)?;
    if prior.may_bend && sections.len() >= MIN_BEND_SECTIONS {
        let bent = [fit(1, 2)?, fit(2, 2)?];
        let ratio = |r: &Regression| (r.beta[2] / r.sigma(2)).powi(2);
        let statistic = bent.iter().map(ratio).sum::<f64>() / bent.len() as f64;
        let freedoms: usize = bent.iter().map(|r| r.freedoms).sum();
        let bound = f_bound(prior.alpha, bent.len() as f64, freedoms as f64);
        if bound.is_some_and(|bound| statistic > bound) {
            return Some(AxisFit {
                at_h_m: prior.at_h_m,
                modes: [size, bent[0], bent[1]],
                is_bent: true,
            });
        }
    }
    let degree = usize::from(sections.len() > 1);
    Some(AxisFit {
        at_h_m: prior.at_h_m,
        modes: [size, fit(1, degree)?, fit(2, degree)?],
        is_bent: false,
    })
}

impl AxisFit {
    /// Size and shift of the section at the chainage `h_m`, metres; with its own deviation from
    /// polynomials, if there is a fit of it.
    pub fn section_m(&self, h_m: f64, section: Option<&SectionFit>) -> [f64; SECTION_MODES] {
        std::array::from_fn(|mode| {
            let regression = &self.modes[mode];
            let own = section.and_then(|section| {
                let samples = samples(std::slice::from_ref(section), mode, self.at_h_m);
                Some(regression.deviation_m(samples.first()?))
            });
            regression.at(h_m - self.at_h_m) + own.unwrap_or_default()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PRIOR: AxisPrior = AxisPrior {
        at_h_m: 5.0,
        sigma: Vector3::new(1.0, 0.1, 0.01),
        may_bend: true,
        alpha: 1e-3,
    };

    fn sections(curvature_per_m: f64) -> Vec<SectionFit> {
        let section = |k: i64| {
            let h_m = 1.2 * k as f64;
            let x = h_m - 5.0;
            let error_m = 2e-4 * (37.0 * h_m).sin();
            SectionFit {
                row: k,
                h_m,
                modes_m: [
                    0.01,
                    0.002 + 0.001 * x + 0.5 * curvature_per_m * x * x + error_m,
                    -0.003 + error_m,
                ],
                variances_m2: [4e-8; 3],
                used: 100,
                outliers: 0,
                rms_m: 0.002,
            }
        };
        (0..10).map(section).collect()
    }

    #[test]
    fn a_bend_is_found_and_a_line_is_none() {
        let bent = fit_axis(&sections(1e-3), &PRIOR).unwrap();
        assert!(bent.is_bent);
        assert!((bent.modes[1].beta[2] - 1e-3).abs() < 5.0 * bent.modes[1].sigma(2));
        let line = fit_axis(&sections(0.0), &PRIOR).unwrap();
        assert!(!line.is_bent);
        assert!((line.modes[1].beta[1] - 1e-3).abs() < 1e-4);
        assert!((line.section_m(9.0, None)[1] - 0.006).abs() < 3e-4);
        assert!((line.section_m(9.0, None)[0] - 0.01).abs() < 3e-4);
        let declared = AxisPrior {
            may_bend: false,
            ..PRIOR
        };
        assert!(!fit_axis(&sections(1e-3), &declared).unwrap().is_bent);
        assert!(fit_axis(&[], &PRIOR).is_none());
    }
}
