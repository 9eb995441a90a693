//! The estimator: every frame's pose and exposure from the photometric consistency of overlapping
//! strips of the wall.
//!
//! It minimises the robust photometric cost plus the priors, over all poses, exposures and, if
//! asked for, parameters that all frames share. The wall's texture is eliminated exactly. The
//! objective is stated and derived in one place, beside the code that computes it: [`tiles::tile`].
//!
//! # The pipeline
//!
//! [`pipeline`] runs a list of [`stages`], each a function from an estimation to an estimation:
//!
//! | stage | what it does | works with |
//! | --- | --- | --- |
//! | [`prescreen`](stages::prescreen) | rejects useless frames; first model of the light, sensor noise | [`tracking::prescreening`], [`tracking::first_light`] |
//! | [`track`](stages::track) | registers one frame after another on the wall that its predecessors show; sliding windows | [`tracking`] |
//! | [`correct_shading`](stages::correct_shading) | light that moves with the camera, from the overlaps | [`tunnelstitch_photometry`] |
//! | [`validate_pairs`](stages::validate_pairs) | rejects frames that contradict larger groups pair by pair, and registers them again | [`comparison`] |
//! | [`solve`](stages::solve) | all frames together, at full size; then pairs are validated again | [`problem`], [`solver`] |
//! | [`resolve_aliases`](stages::resolve_aliases) | moves frames to where the prior has them if they fit there as well | [`validation`] |
//! | [`solve`](stages::solve), last | full size, dense samples; then jointly with the wall, if asked for | [`joint`] |
//! | [`assess`](stages::assess) | uncertainty and verdict of every frame and of the survey | [`uncertainty`], [`verdict`] |
//!
//! # A solve
//!
//! Every solve, of one frame, a window or all frames, is the same: choose samples, linearise,
//! reduce, solve, accept.
//!
//! | step | where |
//! | --- | --- |
//! | samples: tiles of the wall, the frames that see them, no outliers | [`samples`] |
//! | linearise: texture, residuals, Jacobian and their moments over a tile | [`tiles`] |
//! | reduce: sums over tiles to cost and normal equations | [`problem`] |
//! | solve: sparse Cholesky, shared parameters by Schur complement | [`linear`] |
//! | accept: damping, step test, stopping | [`solver::gauss_newton`] |
//!
//! Measured points of the wall, where there are any, are fitted first ([`point_fit`]): that wall is
//! the start, and the equations of the points stand beside those of the pixels ([`points`]).
//!
//! Dependencies point downwards only, in the order parameters, linear, points, model, tiles,
//! samples, joint, problem, solver, point_fit, comparison, tracking, validation, uncertainty,
//! verdict, stages, pipeline. Every tuned number is in [`thresholds`].
//!
//! # Speed
//!
//! - The work on a tile is loops over whole vectors ([`tiles::tile`]), compiled for several
//!   processors; the version for the present one is chosen at run time. Sums keep their order, so
//!   results stay the same.
//! - The last solve samples the wall twice a pixel along each axis; the first once.
//!   `--fast` samples 1.5 times a pixel and takes a single step, if that is short.
//! - Each linearisation serves twice: its cost judges the step that led there, its equations make
//!   the next. The last step of a solve is within its tolerance and is not judged.
//! - The corners of tiles are computed once for all frames ([`samples::visibility`]), local
//!   contrast once for a picture.
//!
//! What each technique contributes is measured by `benches/ablation.py`.

mod comparison;
mod deformation_bound;
mod error;
mod input;
mod joint;
mod linear;
mod live_tracking;
mod model;
mod options;
mod parameters;
mod pipeline;
mod point_fit;
mod points;
mod problem;
mod reading_search;
mod refined;
mod report;
mod samples;
mod shards;
mod solver;
mod stages;
#[cfg(test)]
mod test_scene;
mod thresholds;
mod tiles;
mod tracking;
mod uncertainty;
mod validation;
mod verdict;

pub use deformation_bound::{DeformationBound, PictureTexture, deformation_bound};
pub use error::RefineError;
pub use input::{RefineInput, is_motionless};
pub use live_tracking::{LiveCounts, LiveTracking};
pub use model::problem_error::ProblemError;
pub use options::{Photometry, RefineOptions, ShapeMode};
pub use parameters::wall_prior::WallPrior;
pub use pipeline::{check_input, refine, refine_with_checkpoint};
pub use point_fit::points_report::{PointsAxis, PointsReport, PointsSection};
pub use points::error::PointsFitError;
pub use points::wall_points::WallPoints;
pub use problem::unknown_texture::UnknownTexture;
pub use reading_search::search_readings;
pub use refined::Refined;
pub use report::{
    FrameFlag, FrameReport, HiddenBand, LevelReport, PoseReport, RefineReport, StageTime,
};
pub use shards::division::{JOIN_CACHE_BYTES, SHARD_CACHE_BYTES, Shard};
pub use shards::join_shards::join_shards;
pub use shards::refine_shard::refine_shard;
pub use shards::state::ShardState;
pub use solver::solve_record::{SolveRecord, StepRecord};
pub use solver::stopping::StopReason;
pub use tracking::focal_search::focal_search_registrations;
pub use uncertainty::calibration_report::{CalibrationReport, UnknownReport};
pub use uncertainty::covariance::Covariances;
pub use uncertainty::covariance_file::{CovarianceError, read_covariances};
pub use uncertainty::cramer_rao::{FINER, PoseBounds, pose_bounds};
pub use uncertainty::frame_sigma::FrameSigma;
pub use uncertainty::masked_report::{MaskedPlace, MaskedReport};
pub use uncertainty::model_error::ModelErrorReport;
pub use uncertainty::rolling_shutter_test::ReadoutEstimate;
pub use uncertainty::shape_report::{EstimatedShape, ScaleReport, ShapeReport, UnseenScaleReport};
pub use verdict::length_scale::{LengthScale, RadiusSource};
pub use verdict::other_readings::{FittingReadings, OtherReadings};
pub use verdict::prior_test::{GivenLengths, PriorTest, ScaleTest, SigmaTest};
pub use verdict::rig_report::MountReport;
pub use verdict::survey_verdict::SurveyVerdict;
