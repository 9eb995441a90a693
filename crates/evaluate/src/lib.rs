//! Accuracy of poses and panoramas: errors against the truth, and consistency without it.
//!
//! | measure | function |
//! | --- | --- |
//! | pose errors after removing the gauge | [`trajectory_error()`] |
//! | pose errors without alignment, as `evo` measures | [`unaligned_error()`] |
//! | displacement of each pixel on the wall | [`wall_error()`] |
//! | similarity to the true panorama | [`image_metrics()`] |
//! | sharpness of a panorama | [`mtf50`] |
//! | consistency of the frames, without truth | [`seam_residual()`], as a map [`SeamMap`] |
//! | consistency of the stated covariances | [`normalised_errors_squared`] |
//! | deformation of the wall against best-fit circles | [`deformation`] |
//! | noise of the initial poses that the refinement tolerates | [`converge`] |
//!
//! [`compare()`] computes the measures for initial and refined poses.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch_evaluate::wall_error;
//! use tunnelstitch_core::survey::Survey;
//! use tunnelstitch_geometry::trajectory::poses_of;
//!
//! let survey = Survey::open(Path::new("../../fixtures/blender_free48"))?;
//! let truth = poses_of(survey.truth.as_deref().ok_or("no true poses")?);
//! let initial = survey.initial_poses();
//! let error = wall_error(survey.surface.as_ref(), &survey.cameras, &initial, &truth)?;
//! assert!(error.px.rms > 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod before_after;
mod compare;
mod comparison_table;
pub mod converge;
pub mod deformation;
mod error;
mod error_statistics;
mod image_metrics;
mod mtf;
mod normalised_errors;
mod seam_residual;
mod ssim;
mod survey;
#[cfg(test)]
mod test_pictures;
mod trajectory_error;
mod unaligned_error;
mod wall_error;

pub use before_after::draw_before_after;
pub use compare::{
    CompareInput, ComparedPanorama, ComparedPanoramas, Comparison, ComparisonPlan, Scores, compare,
    plan_comparison,
};
pub use comparison_table::ComparisonRow;
pub use error::EvaluateError;
pub use error_statistics::ErrorStatistics;
pub use image_metrics::{ImageMetrics, image_metrics};
pub use mtf::mtf50;
pub use normalised_errors::{first_pose_gauge, gauge_fixed_errors, normalised_errors_squared};
pub use seam_residual::{SeamMap, SeamResidual, seam_residual};
pub use survey::{compare_survey, plan_survey_comparison};
pub use trajectory_error::{TrajectoryError, trajectory_error};
pub use unaligned_error::{UnalignedError, unaligned_error};
pub use wall_error::{WallError, wall_error};
