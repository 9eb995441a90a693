//! Fit of the wall to measured points, before any frame is looked at.
//!
//! | step | file |
//! | --- | --- |
//! | every point has wall coordinates (s, h) and a distance y along the nominal normal | [`located_points`] |
//! | robust fit of each section: size, position of the axis, harmonics | [`section_fit`] |
//! | the axis along the tunnel: offset, tilt, curvature, with σ; is it bent? | [`axis_fit`] |
//! | size and axis, varying slowly along the tunnel, as a known displacement | [`section_field`] |
//! | the displacement beyond it, with strengths by evidence and robust weights | [`lattice_fit`] |
//!
//! **Gauge.** Mean, cos θ and sin θ of a section, its size and the position of its axis, are hardly
//! seen by frames, and do not count when strengths of the shape are learned
//! ([`crate::solver::shape_evidence`]). Points see them as well as everything else. They are fitted
//! first, become part of the known displacement, and leave the coefficients of the shape to what
//! deforms the section.
//!
//! **Robustness.** The noise σ of a point is 1.48 times the median of the absolute residuals of
//! those that are no outliers. Weights are Huber's until the fit is close, then Tukey's, which
//! leave out what is farther off than 4.7 σ ([`robust`]).
//!
//! Source: P. J. Huber, E. M. Ronchetti, "Robust Statistics", 2009, 7.8 (iteratively reweighted
//! least squares).

pub mod axis_fit;
pub mod fit;
pub mod lattice_fit;
pub mod located_points;
pub mod points_report;
pub mod regression;
pub mod robust;
pub mod section_field;
pub mod section_fit;
#[cfg(test)]
mod tests;
