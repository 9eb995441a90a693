//! Deformation of a wall as tunnel engineers state it: against the best-fit circle of each section.
//!
//! # Model
//!
//! The wall's displacement `δ(s, h)` along the outward normal of the nominal section is known with
//! its errors: draws `ε_d(s, h)` of them, d = 1 … D. At a chainage, every figure is a linear
//! function of the displacements at points k of the section,
//!
//! `L = L_0 + Σ_k w_k δ_k`,  `σ²(L) = 1/D Σ_d (Σ_k w_k ε_d,k)²`.
//!
//! Errors of neighbouring points, of opposite points (harmonics of the section) and of the lens are
//! correlated; independent nodes would state a σ of ovality that is far too small. The draws hold
//! all of that. With 128 draws a σ is known to 6 %.
//!
//! | figure | weights | file |
//! | --- | --- | --- |
//! | radius and centre of the best-fit circle | `(AᵀA)⁻¹Aᵀ`, rows of A `(1, sin θ_k, cos θ_k)` | [`best_fit_circle`] |
//! | deviation from it | `δ_k − A_k (AᵀA)⁻¹Aᵀ δ` | [`deviation`] |
//! | diameter at θ, its extremes, their directions, the second harmonic | 1 at θ and θ + π | [`diameters`] |
//! | chord, nominal length ℓ along the unit vector u from a to b | `u·n_b` at b, `−u·n_a` at a | [`chord`] |
//!
//! [`section`] puts them together, [`sections_file`] is the table `sections.csv`, [`profile`] an
//! outline and [`grid`] a map to be drawn.
//!
//! # Precision of the linear functions
//!
//! A circle displaced by e about its nominal centre has `δ = e cos θ − e²/(2r) sin²θ + …`, so
//! radius and centre err by less than `e²/(2r)`: 0.02 mm for 10 mm at a radius of 3 m.
//!
//! # What is determined
//!
//! A point of the wall counts as determined where the frames have at least halved the σ that the
//! deviation had before them ([`MAX_SIGMA_SHARE`]). Everything else is left out: of fits, of
//! extremes, of maps. Radius and centre are relative to the nominal ones: no picture shows the
//! scale of a tunnel, so the mean of δ is as certain as the initial poses' steps make it, and its σ
//! does not contain the error of the nominal radius.
//!
//! A section that is no circle has no best-fit circle and no ovality; its deviation is δ itself.

mod best_fit_circle;
mod chord;
mod deviation;
mod diameters;
mod functional;
mod grid;
mod node_errors;
mod outline;
mod profile;
mod section;
mod sections_file;
mod shape_estimate;
#[cfg(test)]
mod test_fields;

pub use deviation::{Deviation, DeviationMap, MAX_SIGMA_SHARE, deviation_sigmas_m};
pub use grid::{DeviationGrid, PageCells};
pub use node_errors::{NodeError, node_errors};
pub use profile::SectionProfile;
pub use section::{SectionDeformation, measure_sections};
pub use sections_file::{clock_position, read_sections, sections_csv};
pub use shape_estimate::ShapeEstimate;
