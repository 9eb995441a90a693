//! Comparison of a survey's initial poses with refined ones.

use super::compare::{
    CompareInput, ComparedPanoramas, Comparison, ComparisonPlan, compare, plan_comparison,
};
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
    with_input(survey, refined, px_per_metre, interpolation, |input| {
        compare(input, progress)
    })
}

/// Lays out what [`compare_survey`] draws, and checks it before a frame is decoded.
///
/// # Errors
/// The errors of [`compare_survey`], as far as they are known by then.
pub fn plan_survey_comparison(
    survey: &Survey,
    refined: &[Pose],
    px_per_metre: Option<f64>,
) -> Result<ComparisonPlan, EvaluateError> {
    let interpolation = Interpolation::default();
    with_input(
        survey,
        refined,
        px_per_metre,
        interpolation,
        plan_comparison,
    )
}

/// Calls `act` with the comparison of a survey's initial poses with refined ones.
fn with_input<T>(
    survey: &Survey,
    refined: &[Pose],
    px_per_metre: Option<f64>,
    interpolation: Interpolation,
    act: impl FnOnce(&CompareInput) -> T,
) -> T {
    let initial = survey.initial_poses();
    let truth = survey.truth.as_deref().map(poses_of);
    act(&CompareInput {
        surface: survey.surface.as_ref(),
        cameras: &survey.cameras,
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
    })
}
