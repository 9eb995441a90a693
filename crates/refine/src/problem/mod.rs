//! The photometric problem over a window of frames at one pyramid level.
//!
//! ```text
//! EstimationContext, Sampling, FrameWindow
//!      │  noise_estimation: noise, model of the wall; outlier_exclusion
//!      ▼
//! PhotometricProblem
//!      │  linearise (estimates, κ): per block of the wall, in parallel,
//!      │  sum_block: tiles ─> ObserverColumn ─> BlockSums, IntrinsicsSums;
//!      │  then prior and gauge constraint
//!      ▼
//! Linearisation: cost, NormalEquations, SharedBorder, gradients of blocks ─> ScoreScatter
//! ```
//!
//! Near an estimate at which it was linearised, [`linearise_change`] updates the equations by a
//! share of the tiles.
//!
//! The objective is that of [`crate::tiles::tile`]. [`set_up`] has the steps of the set-up.
//! [`step_length`] measures a step on the wall; [`unknown_texture`] reduces the information to that
//! of an unknown texture, for the Cramér–Rao bound; [`assumed_texture`] has that of pictures which
//! are not sampled.

pub mod assumed_texture;
pub mod block_sums;
pub mod intrinsics_terms;
pub mod linearisation;
pub mod linearise;
pub mod linearise_change;
pub mod noise_estimation;
pub mod observer_column;
pub mod outlier_exclusion;
pub mod patch_scores;
pub mod photometric_problem;
pub mod score_scatter;
pub mod set_up;
pub mod shape_terms;
pub mod step_length;
pub mod sum_block;
#[cfg(test)]
pub mod test_ring;
pub mod tile_share;
pub mod unknown_texture;
