//! Multi-frame super-resolution: the wall at a finer resolution than any frame.
//!
//! ```text
//! poses ─ Footprints::new ─> stencils ─┬─ Footprints::super_resolve ─> fine pixels and roughness
//! readings, initial values ────────────┴─ WallSolve ─> fine pixels, for given roughness and losses
//! ```
//!
//! A pixel is the mean of the wall over its square, and the squares of different frames overlap. If
//! several frames show the wall, one wall x of finer pixels explains all their readings,
//! `y = W x + noise`. It is the x that minimises
//!
//! ```text
//! Σ_p ρ((y_p − Σ_k w_pk x_k)/σ_p) + Σ_i a_i Σ_n ρ_i((D_i x)_n)
//! ```
//!
//! with the footprints w ([`Footprints`]), differences `D_i` of fine pixels and robust losses ρ.
//! The losses are quadratic near zero and linear for outliers, so that moving objects and
//! reflections have limited influence and edges of the wall stay sharp. The strengths `a` of the
//! roughness prior are estimated from the region itself, or given.
//!
//! A region is a tile with a margin. Pixels near its border lack the views that would extend beyond
//! it, so the margin is cut off. Two native pixels and the extent of most differences, [`MARGIN`]
//! fine pixels, are enough.
//!
//! Panoramas are rendered this way (`RenderOptions::super_resolve`), and poses are
//! estimated jointly with the wall (`RefineOptions`).
//!
//! Sources: R. C. Hardie, K. J. Barnard, E. E. Armstrong, "Joint MAP registration and
//! high-resolution image estimation using a sequence of undersampled images", IEEE Transactions on
//! Image Processing 6(12), 1997; S. Farsiu, M. D. Robinson, M. Elad, P. Milanfar, "Fast and robust
//! multiframe super resolution", IEEE Transactions on Image Processing 13(10), 2004.

mod conjugate_gradients;
mod footprints;
mod huber;
mod observations;
mod reading;
mod region;
mod roughness;
mod roughness_estimation;
mod stencils;
mod wall_solve;

pub use footprints::{Footprints, PosedCamera};
pub use huber::weight as huber_weight;
pub use reading::Reading;
pub use region::{FineGrid, Region};
pub use roughness::{KINDS, aliased_variance};
pub use roughness_estimation::{
    HUBER_LIMIT_SIGMAS, MAX_CG_ITERATIONS, MAX_REWEIGHTING_ITERATIONS, RoughnessEvidence,
    SolvedRegion,
};
pub use wall_solve::{MARGIN, WallSolve};
