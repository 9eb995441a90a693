//! Linear algebra of the normal equations.
//!
//! ```text
//! NormalEquations (block-sparse H, gradient g)
//!    │ SymbolicFactorisation (Fronts by the EliminationTree of an order, once per pattern)
//!    ▼
//! Factor (sparse Cholesky) ──────────────> step δ = −H⁻¹ g
//!    ├─ SharedBorder ─> SchurComplement ─> step of frames and shared parameters
//!    └─ SelectedInverse ─────────────────> blocks of H⁻¹ for the covariances
//! ```
//!
//! Nothing here depends on images or poses, except for the number of parameters
//! ([`crate::parameters`]).

pub mod adjacency;
pub mod bordered_system;
pub mod elimination_order;
pub mod elimination_tree;
pub mod factor_error;
pub mod front_elimination;
pub mod fronts;
pub mod normal_equations;
pub mod selected_inverse;
pub mod sparse_cholesky;
#[cfg(test)]
pub mod test_dense;
