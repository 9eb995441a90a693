//! Damped Gauss–Newton over a photometric problem.

pub mod argmin_glue;
pub mod evidence_fall;
pub mod gauss_newton;
pub mod shape_evidence;
pub mod solve_levels;
pub mod solve_record;
pub mod stopping;
