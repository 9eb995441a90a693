//! Linear algebra of the normal equations.
//!
//! ```text
//! NormalEquations (block-sparse H, gradient g) ─ Symbolic ─> Factor (sparse Cholesky) ─┬─> step δ = −H⁻¹ g
//! SharedBorder (shared parameters) ── Schur complement ──────────────────────────────────────┤
//!                                                                                      └─> blocks of H⁻¹
//! ```

pub mod bordered_system;
pub mod normal_equations;
pub mod selected_inverse;
pub mod sparse_cholesky;
