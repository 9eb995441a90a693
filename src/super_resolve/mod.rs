//! The wall finer than any frame.
//!
//! ```text
//! poses ─ Footprints::new ──> stencils ─┬─ Footprints::super_resolve ──> fine pixels, and how rough the wall is
//! readings, values to start from ───────┴─ WallSolve ──> fine pixels, roughness and losses given
//! ```
//!
//! A pixel is the mean of the wall over its square, and every frame's squares lie elsewhere: where
//! several frames show the wall, there is one wall x of finer pixels that explains what all of them
//! read, `y = W x + noise`. It is the x that minimises
//!
//! ```text
//! Σ_p ρ((y_p − Σ_k w_pk x_k)/σ_p) + Σ_i a_i Σ_n ρ_i((D_i x)_n)
//! ```
//!
//! with the footprints w ([`Footprints`]), differences `D_i` of fine pixels and robust losses ρ:
//! squares, but linear for what stands out, so that what moves or glints pulls no harder than a few
//! σ, and edges of the wall stay edges. How rough the wall is, `a`, is learned from the region
//! itself, or given.
//!
//! A region is a tile with a margin: pixels near its border lack the views that would reach beyond
//! it, so the margin is cut off. Two native pixels and what most differences reach, [`MARGIN`] fine
//! pixels, are enough.
//!
//! Panoramas are drawn so ([`crate::render::RenderOptions::super_resolve`]), and poses estimated
//! jointly with the wall ([`crate::refine::RefineOptions`]).
//!
//! Sources: R. C. Hardie, K. J. Barnard, E. E. Armstrong, "Joint MAP registration and
//! high-resolution image estimation using a sequence of undersampled images", IEEE Transactions on
//! Image Processing 6(12), 1997; S. Farsiu, M. D. Robinson, M. Elad, P. Milanfar, "Fast and robust
//! multiframe super resolution", IEEE Transactions on Image Processing 13(10), 2004.

mod conjugate_gradients;
mod footprints;
mod huber;
mod learn;
mod observations;
mod region;
mod roughness;
mod solve;
mod stencils;

pub use footprints::{Footprints, View};
pub use huber::weight as huber_weight;
pub use learn::{Evidence, Resolved};
pub use observations::Reading;
pub use region::{Lattice, Region};
pub use roughness::{KINDS, aliased_variance};
pub use solve::{MARGIN, WallSolve};
