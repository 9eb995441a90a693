//! The photometric problem over a window of frames at one pyramid level: cost and normal equations.

pub mod block_sums;
pub mod intrinsics_terms;
pub mod linearisation;
pub mod noise_estimation;
pub mod observer_column;
pub mod photometric_problem;
pub mod sum_block;
pub mod unknown_texture;
