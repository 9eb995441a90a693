//! The pipeline: the stages of a refinement, one after another.
//!
//! It begins again where a stage shows that what all of them rest on does not hold: with local
//! normalisation where no model of the light fits, and without the bands along the tunnel that are
//! hidden ([`crate::samples::hidden_bands`]). It ends early where frames that fit nowhere show that
//! poses, pictures or camera are read wrongly ([`crate::reading_search`]).

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::frame_states::{FrameStates, majority};
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::options::{Photometry, RefineOptions};
use crate::reading_search::search_readings;
use crate::refined::Refined;
use crate::report::FrameFlag;
use crate::stages::assess::without_solution;
use crate::stages::begin::begin;
use crate::stages::plan::Stage;
use crate::stages::run::run_stage;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{Estimation, PipelineState, Snapshot};
use crate::verdict::other_readings::OtherReadings;
use std::sync::Arc;
use tunnelstitch_core::frames::Light;
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::progress::Progress;

/// Refines the poses of frames: a [`RefineInput`], or a
/// [`Survey`](tunnelstitch_core::survey::Survey) that converts into one.
///
/// Equal input gives equal bytes, whatever the number of threads.
///
/// # Errors
/// [`RefineError`].
pub fn refine<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    refine_with_checkpoint(input, options, None, progress)
}

/// Checks input and options as [`refine`] does before it decodes a frame.
///
/// # Errors
/// [`RefineError`].
pub fn check_input<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
) -> Result<(), RefineError> {
    Setup::new(input.into(), options).map(drop)
}

/// Refines the poses of frames, with snapshots kept in a checkpoint; resumes from the snapshot that
/// is in it.
///
/// The result has the same bytes however often the run was interrupted, but for the times that
/// stages took.
///
/// # Errors
/// [`RefineError`].
pub fn refine_with_checkpoint<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let mut session = Session::new(checkpoint, progress);
    let snapshot = session.snapshot()?;
    refine_from(&input.into(), options, snapshot, &mut session)
}

/// Refines the poses of frames from a snapshot, or from the beginning.
///
/// # Errors
/// [`RefineError`].
pub fn refine_from(
    input: &RefineInput,
    options: &RefineOptions,
    mut snapshot: Option<Snapshot>,
    session: &mut Session,
) -> Result<Refined, RefineError> {
    loop {
        match run(input, options, snapshot.take(), |_| false, session)? {
            Pause::Refined(refined) => {
                session.progress.leave_job();
                return Ok(*refined);
            }
            Pause::Before(paused) => snapshot = Some(*paused),
        }
    }
}

/// The place where a run through the stages pauses.
pub enum Pause {
    /// At its end, with the result.
    Refined(Box<Refined>),
    /// Before a stage.
    Before(Box<Snapshot>),
}

/// Runs the stages from a snapshot, or from the beginning, as far as the first one that
/// `is_beyond` names.
///
/// # Errors
/// [`RefineError`].
pub fn run(
    input: &RefineInput,
    options: &RefineOptions,
    mut snapshot: Option<Snapshot>,
    is_beyond: impl Fn(&Stage) -> bool,
    session: &mut Session,
) -> Result<Pause, RefineError> {
    let known = snapshot.as_ref().map(|snapshot| &snapshot.hidden_bands);
    let mut hidden_bands = known.cloned().unwrap_or_default();
    loop {
        let mut ignored = input.ignored.clone();
        for band in &hidden_bands {
            ignored.add(input.surface.as_ref(), Some(*band), None);
        }
        let without_bands = RefineInput {
            ignored: &ignored,
            ..input.clone()
        };
        let setup = Setup {
            hidden_bands,
            ..Setup::new(without_bands, options)?
        };
        let state = match snapshot.take() {
            Some(snapshot) => session.restore(&setup, snapshot),
            None => begin(&setup),
        };
        match run_stages(&setup, state, &is_beyond, session)? {
            Outcome::Paused(pause) => return Ok(pause),
            Outcome::Hidden(bands) => hidden_bands = bands,
        }
    }
}

/// The end of a run through the stages.
enum Outcome {
    /// The result, or the stage before which it pauses.
    Paused(Pause),
    /// The bands along the tunnel without which all is to be done again: angles θ from and to,
    /// radians.
    Hidden(Vec<[f64; 2]>),
}

/// Runs the stages that are left, as far as the first one that `is_beyond` names.
fn run_stages(
    setup: &Setup,
    state: PipelineState,
    is_beyond: &dyn Fn(&Stage) -> bool,
    session: &mut Session,
) -> Result<Outcome, RefineError> {
    if setup.options.photometry == Photometry::Normalised {
        setup.frames.set_light(Light::Normalised);
    }
    let mut readings = state.readings.clone();
    let mut estimation = Estimation::new(state);
    while let Some(stage) = estimation.state.stages.front().copied() {
        if is_beyond(&stage) {
            let paused = session.snapshot_of(setup, estimation.state);
            return Ok(Outcome::Paused(Pause::Before(Box::new(paused))));
        }
        // The solution that the assessment uses is no part of a snapshot.
        if estimation.solution.is_none() {
            session.keep_if_due(setup, || estimation.state.clone())?;
        }
        session.enter_stage(setup, &estimation.state);
        let ended = match run_stage(stage, setup, estimation, session) {
            Ok(estimation) => Some(estimation),
            Err(RefineError::Problem(ProblemError::Factor { .. })) => None,
            Err(error) => return Err(error),
        };
        let fits = ended.as_ref().is_some_and(fits_light);
        let is_doubtful = !fits || ended.as_ref().is_none_or(has_many_strays);
        if is_doubtful && readings.are_untried() {
            readings = compare_readings(setup, session)?;
        }
        estimation = match ended {
            ended if is_doubtful && is_misread(&readings, ended.as_ref()) => {
                let frames = ended.map(|ended| ended.state.frames);
                return unsolved(
                    setup,
                    session,
                    (&RejectionReason::Misread, frames),
                    readings,
                );
            }
            _ if !fits && may_normalise(setup) => {
                let light = setup.frames.camera_light();
                setup.frames.set_light(Light::Normalised);
                Estimation::new(PipelineState {
                    is_lamp_ruled_out: light.is_some_and(|light| light.lamp.is_some()),
                    ..begin(setup)
                })
            }
            Some(Estimation {
                hidden_bands: Some(bands),
                ..
            }) => return Ok(Outcome::Hidden(bands)),
            Some(ended) => match majority(&ended.state.frames.rejections) {
                // No later stage registers frames on a minority.
                Err(reason) if !is_assessed(&ended) => {
                    let frames = Some(ended.state.frames);
                    return unsolved(setup, session, (&reason, frames), readings);
                }
                _ => ended.without_first_stage(),
            },
            None => {
                let reason = RejectionReason::Unsolved;
                return unsolved(setup, session, (&reason, None), readings);
            }
        };
        estimation.state.readings = readings.clone();
    }
    let is_doubtful = has_many_strays(&estimation);
    let mut refined = estimation.refined.ok_or(RefineError::NoOverlap)?;
    if is_doubtful {
        refined.report.readings = readings;
    }
    Ok(Outcome::refined(refined))
}

impl Outcome {
    fn refined(refined: Refined) -> Self {
        Self::Paused(Pause::Refined(Box::new(refined)))
    }
}

/// True after the last stage.
fn is_assessed(ended: &Estimation) -> bool {
    ended.refined.is_some()
}

/// True if a stage has shown that the survey is read wrongly: no later one will mend it. Another
/// camera may still be found by a solve for the lens.
fn is_misread(readings: &OtherReadings, ended: Option<&Estimation>) -> bool {
    let OtherReadings::Fit(found) = readings else {
        return false;
    };
    ended.is_none_or(|ended| {
        let is_lens_solved = !ended.state.levels.is_empty();
        !is_assessed(ended) && (is_lens_solved || !found.is_of_camera)
    })
}

/// True if more than a quarter of the frames fit nowhere, or not the others: by so many pairs of
/// neighbours at most is another reading of the survey contradicted that is right.
fn has_many_strays(ended: &Estimation) -> bool {
    let rejections = &ended.state.frames.rejections;
    let strays = match &ended.refined {
        Some(refined) => refined.report.count_flagged(FrameFlag::Prior),
        None => (rejections.iter().flatten())
            .filter(|reason| reason.is_stray())
            .count(),
    };
    4 * strays > rejections.len()
}

/// Compares the readings of the survey, if the input is one.
fn compare_readings(setup: &Setup, session: &Session) -> Result<OtherReadings, RefineError> {
    let Some(survey) = setup.input.survey else {
        return Ok(OtherReadings::Untried);
    };
    session.progress.start("readings", 1);
    let found = search_readings(survey)?;
    session.progress.finish();
    Ok(found.into())
}

/// True if local normalisation may take the place of a model of light that does not hold.
fn may_normalise(setup: &Setup) -> bool {
    setup.options.photometry == Photometry::Auto
        && !matches!(setup.frames.light(), Light::Normalised)
}

/// True if the light of most frames that show something fits the model, as far as they tell: a
/// shading explains it and they are inliers. Where they contradict the lengths of the prior they
/// fit each other.
fn fits_light(ended: &Estimation) -> bool {
    let prior_test = ended
        .refined
        .as_ref()
        .map(|refined| &refined.report.prior_test);
    let contradicts_scale = prior_test.is_some_and(|test| test.contradicting_scale().is_some());
    ended.state.has_common_light && (ended.state.frames.has_majority() || contradicts_scale)
}

/// The end without a solution, for a reason and with what is known of the frames: poses that
/// nothing determines are those given.
fn unsolved(
    setup: &Setup,
    session: &mut Session,
    (reason, frames): (&RejectionReason, Option<FrameStates>),
    readings: OtherReadings,
) -> Result<Outcome, RefineError> {
    let rejections = frames.map_or_else(|| vec![None; setup.count()], |frames| frames.rejections);
    let mut refined = without_solution(setup, session, reason, rejections);
    refined.report.readings = readings;
    Ok(Outcome::refined(refined))
}
