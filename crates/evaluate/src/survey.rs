//! Comparison of a survey's initial poses with refined ones.

use super::compare::{CompareInput, ComparedPanoramas, Comparison, compare};
use super::error::EvaluateError;
use tunnelstitch_core::progress::Progress;
use tunnelstitch_core::survey::Survey;
use tunnelstitch_geometry::trajectory::{Pose, poses_of};
use tunnelstitch_render::{Interpolation, Mode, RenderOptions};

/// Compares a survey's initial poses with refined ones, and both with the true ones if they are
/// known.
///
/// The panoramas are averages without blending, so that they differ by the poses only.
///
/// # Errors
/// Poses that cannot be placed on the wall, unreadable frames, too little memory.
pub fn compare_survey(
    survey: &Survey,
    refined: &[Pose],
    px_per_metre: Option<f64>,
    interpolation: Interpolation,
    progress: &dyn Progress,
) -> Result<(Comparison, ComparedPanoramas), EvaluateError> {
    let initial = survey.initial_poses();
    let truth = survey.truth.as_deref().map(poses_of);
    let input = CompareInput {
        surface: survey.surface.as_ref(),
        camera: &survey.camera,
        shutter: &survey.shutter(),
        files: &survey.frames,
        initial: &initial,
        refined,
        truth: truth.as_deref(),
        px_per_metre,
        render: RenderOptions {
            interpolation,
            mode: Mode::Average,
            blend: false,
            super_resolve: false,
        },
    };
    compare(&input, progress)
}
