//! How far poses and pictures are from the truth, and from agreeing with each other.
//!
//! | question | answer |
//! | --- | --- |
//! | how far off are the poses? | [`trajectory_error()`], after removing the gauge |
//! | and as they stand, as `evo` measures? | [`unaligned_error()`] |
//! | how far off is each pixel on the wall? | [`wall_error()`] |
//! | how like the true panorama is this one? | [`image_metrics()`] |
//! | how fine is the detail that a panorama shows? | [`mtf50`] |
//! | how well do the frames agree, without any truth? | [`seam_residual`], place by place [`SeamMap`] |
//! | is the stated uncertainty true? | [`normalised_errors`] |
//! | how much noise can the refinement take? | [`converge`] |
//!
//! [`compare()`] asks all of it for initial and refined poses at once.
//!
//! # Example
//!
//! ```
//! use std::path::Path;
//! use tunnelstitch::evaluate::wall_error;
//! use tunnelstitch::survey::Survey;
//! use tunnelstitch::trajectory::poses_of;
//!
//! let survey = Survey::open(Path::new("fixtures/blender_free48"))?;
//! let truth = poses_of(survey.truth.as_deref().ok_or("no true poses")?);
//! let initial = survey.initial_poses();
//! let error = wall_error(survey.surface.as_ref(), &survey.camera, &initial, &truth)?;
//! assert!(error.px.rms > 1.0);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod before_after;
mod compare;
pub mod converge;
mod error;
mod image_metrics;
mod mtf;
mod seam;
mod spread;
mod ssim;
mod survey;
mod table;
mod trajectory_error;
mod unaligned_error;
mod uncertainty;
mod wall_error;

pub use before_after::before_after;
pub use compare::{CompareInput, Comparison, Drawing, Drawings, Scores, compare};
pub use error::EvaluateError;
pub use image_metrics::{ImageMetrics, image_metrics};
pub use mtf::mtf50;
pub use seam::{SeamMap, SeamResidual, seam_residual};
pub use spread::Spread;
pub use survey::compare_survey;
pub use table::Row;
pub use trajectory_error::{TrajectoryError, trajectory_error};
pub use unaligned_error::{UnalignedError, unaligned_error};
pub use uncertainty::{normalised_errors, tied_errors};
pub use wall_error::{WallError, wall_error};
