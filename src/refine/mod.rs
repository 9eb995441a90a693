//! The estimator: every frame's pose and exposure from the photometric consistency of overlapping
//! strips of the wall.
//!
//! It minimises over all poses `T_i`, log-gains `α_i` and biases `b_i`
//!
//! `E = Σ_x Σ_i q_i ρ((I_i(π(T_i⁻¹ X(x))) − b_i)/a_i − S(x)) / σ² + prior`
//!
//! over wall samples x ([`grid`]), with the wall's texture S eliminated exactly ([`tile`]); q is
//! the number of pixels a sample stands for in a frame.
//!
//! | step | where |
//! | --- | --- |
//! | a first look: useless frames, common light, noise | [`examine`] |
//! | one frame after another, sliding windows | [`track`]; a single frame: [`place`], [`search`] on the fused [`wall`]; again with a better camera: [`retrack`] |
//! | light that moves with the camera, from the overlaps | [`flat_field`] |
//! | do overlapping frames show the same? take out, try again | [`consistency`], [`rejection`] |
//! | displaced pairs at full size, what nothing ties to the rest; unbend and place again | [`alignment`], [`verdict`], [`repair`], [`neighbourhood`] |
//! | walls that repeat | [`repeats`] |
//! | all frames together, coarse to fine | [`run`](mod@run) |
//! | what all frames share, if asked for | [`calibration`], [`shared`], [`lens`], [`observed`] |
//! | are rows read when they are said to be | [`rows`] |
//! | going on after an interruption | [`state`] |
//! | how sure | [`uncertainty_of_solution`], [`covariance`]; how sure it could be at best: [`bound`] |
//!
//! At full size what is in a frame but not on the wall is left out of a solve beforehand:
//! [`foreign`]. Every solve is the same: `samples → linearise → reduce → solve → accept`. [`grid`],
//! [`visibility`], [`coverage`] and [`choice`] choose the samples, [`tile`] derives residual,
//! Jacobian and the elimination of S and linearises, with the slopes of S as [`denoise`] finds them
//! ([`joint`] does the same with the wall solved for finer than pixels, if asked for), [`problem`]
//! reduces to normal equations, [`factor`] solves them, [`gauss_newton`] accepts.
//!
//! # Speed
//!
//! - The work on a tile is loops over whole vectors ([`tile`], [`view`]), compiled for several
//!   processors, the one at hand chosen when it runs; sums keep their order, so results stay the
//!   same.
//! - The last solve looks at the wall twice a pixel along each axis; those before it at the parts
//!   that tell most ([`choice`]). With `--fast` it does so 1.5 times a pixel and takes a single
//!   step, if that is short.
//! - Each linearisation serves twice: its cost judges the step that led there, its equations make
//!   the next. The last step of a solve is within its tolerance and is not judged
//!   ([`gauss_newton`]).
//! - Where a tile's corners are is computed once for all frames ([`visibility`]), local contrast
//!   once for a picture.
//!
#![doc = include_str!("ablation.md")]

mod error;
mod inputs;
mod joint;
mod linear;
mod model;
mod options;
mod parameters;
mod pipeline;
mod pose_convention_search;
mod problem;
mod refined;
mod report;
mod samples;
mod solver;
mod stages;
#[cfg(test)]
mod test_scene;
mod thresholds;
mod tiles;
mod tracking;
mod uncertainty;
mod validation;

pub use error::RefineError;
pub use model::problem_error::ProblemError;
pub use options::RefineOptions;
pub use pipeline::{refine, refine_with_checkpoint};
pub use pose_convention_search::search_pose_conventions;
pub use problem::unknown_texture::UnknownTexture;
pub use refined::Refined;
pub use report::{FrameFlag, FrameReport, LevelReport, PoseReport, RefineReport, StageTime};
pub use solver::solve_record::{SolveRecord, StepRecord};
pub use solver::stopping::StopReason;
pub use uncertainty::calibration_report::{CalibrationReport, UnknownReport};
pub use uncertainty::covariance::Covariances;
pub use uncertainty::covariance_file::{CovarianceError, read_covariances};
pub use uncertainty::cramer_rao::{FINER, PoseBounds, pose_bounds};
pub use uncertainty::frame_sigma::FrameSigma;
pub use uncertainty::rolling_shutter_test::ReadoutEstimate;
