//! Damped Gauss–Newton over a photometric problem.

pub mod gauss_newton;
pub mod neighbourhood;
