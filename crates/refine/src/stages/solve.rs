//! Stage: solves all frames together at one pyramid level.

use crate::error::RefineError;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::hidden_bands::find_hidden_bands;
use crate::solver::argmin_glue::{self, Observation};
use crate::solver::gauss_newton::{Solution, SolveState};
use crate::stages::plan::{SolvePlan, Stage};
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::shape;
use crate::stages::state::{Estimation, GlobalSolve, LastSolve, PipelineState};
use crate::tracking::shading_correction::correct_once;
use crate::uncertainty::observability::UnobservableParameter;
use crate::uncertainty::solution_uncertainty::SolutionUncertainty;
use crate::validation::inconsistent_frames::reject_disagreeing_frames;

/// Solves at full size after which the strengths of the shape are not learned again.
const MAX_LEARNING_SOLVES: usize = 4;

/// Runs the stage; a snapshot may be kept between two steps.
///
/// A parameter that the last solve finds unobservable is fixed, and the solve planned again; as it
/// is if the shape turns out to have other strengths ([`crate::stages::shape`]), or if residuals
/// show model errors, with pixels that tell accordingly less ([`crate::uncertainty::model_error`]).
///
/// # Errors
/// A frame that cannot be read, equations without a solution.
pub fn run<'a>(
    plan: SolvePlan,
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let state = &mut estimation.state;
    if plan.sampling.level == 0 {
        shape::begin(setup, state)?;
    }
    let context = setup.context(state);
    let Some(problem) = problem_of(&plan, setup, &context, state)? else {
        session.record_time("joint model of the wall");
        return Ok(estimation);
    };
    // Without overlap the prior is all there is to report.
    if problem.tiles() == 0 && state.frames.rejections.iter().all(Option::is_none) {
        return Ok(estimation);
    }
    let mut solution = solve(&plan, problem, setup, state, session)?;
    state.frames.estimates.clone_from(&solution.unknowns.frames);
    state.kappa = solution.unknowns.kappa;
    shape::take_over(setup, state, &solution);
    let is_last = !has_solve_ahead(state);
    if may_learn_shape(&plan, state) && shape::learn(setup, state, &solution, is_last) && is_last {
        plan_again(&plan, setup.options, state);
    }
    solution.remove_tested();
    solution.tie_gauge();
    let uncertainty = uncertainty_of(&plan, setup, &context, state, &solution)?;
    let unobservable = find_unobservable(setup, &context, state, &solution, uncertainty.as_ref());
    let mut kappa = state.kappa;
    for parameter in &unobservable {
        kappa[parameter.unknown] = 0.0;
        state.free[parameter.unknown] = false;
    }
    setup.replace_kappa(state, kappa);
    let context = setup.context(state);
    state.kappa = context.kappa;
    if !unobservable.is_empty() && !has_solve_ahead(state) {
        plan_again(&plan, setup.options, state);
    }
    state.unobservable.extend(unobservable);
    state.solved.clone_from(&state.frames);
    if plan.sampling.level == 0 {
        reject_disagreeing_frames(&solution.linearisation.frames, &mut state.frames.rejections);
    }
    state.levels.push(GlobalSolve {
        level: plan.sampling.level,
        samples_per_pixel: plan.sampling.density,
        share_of_wall: solution.problem.compared_share(),
        joint: solution.problem.is_joint(),
        record: solution.record.clone(),
    });
    if plan.sampling.level == 0 && state.frames.has_majority() {
        let masked = solution.problem.masked_wall();
        estimation.hidden_bands =
            find_hidden_bands(&masked, context.nominal.as_ref(), &setup.hidden_bands);
    }
    if has_solve_ahead(state) && setup.frames.camera_light().is_some() {
        correct_once(&context, setup.options, &state.frames)?;
    }
    // The assessment uses the last one only.
    if let Some(uncertainty) = uncertainty.filter(|_| !has_solve_ahead(state)) {
        let dispersion = uncertainty
            .model_error
            .map_or(1.0, |found| found.dispersion);
        if state.dispersion == 1.0 && dispersion > 1.0 {
            state.dispersion = dispersion;
            plan_again(&plan, setup.options, state);
        } else {
            estimation.solution = Some(LastSolve {
                solution,
                uncertainty,
                stopping: plan.stopping,
            });
        }
    }
    session.record_time(&format!("global {}", plan.name()));
    Ok(estimation)
}

/// Sets up the problem; none if it was to be joint and the wall is too smooth for that.
fn problem_of<'a>(
    plan: &SolvePlan,
    setup: &Setup,
    context: &EstimationContext<'a>,
    state: &PipelineState,
) -> Result<Option<PhotometricProblem<'a>>, ProblemError> {
    let sampling = plan.sampling;
    let problem =
        PhotometricProblem::new(context, sampling, state.frames.window())?.with_shared_parameters();
    if sampling.joint && !problem.is_joint() {
        return Ok(None);
    }
    // Before the frames are aligned at full size, residuals are mostly misalignment.
    if sampling.level > 0 {
        return Ok(Some(problem));
    }
    let density = if sampling.joint {
        Some(RefineOptions::default().final_density)
    } else {
        let chosen = setup.options.outlier_mask_density;
        chosen.filter(|_| sampling.variance_weighting)
    };
    problem.exclude_outliers(density).map(Some)
}

/// Solves the problem, from where an interrupted solve was.
fn solve<'a>(
    plan: &SolvePlan,
    problem: PhotometricProblem<'a>,
    setup: &Setup,
    state: &mut PipelineState,
    session: &mut Session,
) -> Result<Solution<'a>, ProblemError> {
    let progress = session.progress;
    let begun = state.solve.take();
    let state = &*state;
    let mut keep = |solve: SolveState| {
        session.keep_if_due(setup, || PipelineState {
            solve: Some(solve),
            ..state.clone()
        })
    };
    let name = plan.name();
    progress.start("global", setup.options.max_iterations as usize);
    let observation = Observation {
        stage: &name,
        progress,
        keep: &mut keep,
    };
    let solution = argmin_glue::resume(problem, plan.stopping, begun, Some(observation))?;
    progress.finish();
    Ok(solution)
}

/// The uncertainty of the last solution; before, unknowns may be free that it turns out not to
/// have.
fn uncertainty_of(
    plan: &SolvePlan,
    setup: &Setup,
    context: &EstimationContext,
    state: &PipelineState,
    solution: &Solution,
) -> Result<Option<SolutionUncertainty>, ProblemError> {
    let calibration = setup.calibration_at(state);
    if plan.sampling.level > 0 || has_solve_ahead(state) {
        return Ok(None);
    }
    let solved = context.at(solution.unknowns.kappa);
    let alpha = setup.options.false_alarm_rate;
    SolutionUncertainty::at(&solved, solution, &calibration, &state.unseen, alpha).map(Some)
}

/// The shared parameters that a full-size solution does not observe.
fn find_unobservable(
    setup: &Setup,
    context: &EstimationContext,
    state: &PipelineState,
    solution: &Solution,
    uncertainty: Option<&SolutionUncertainty>,
) -> Vec<UnobservableParameter> {
    let calibration = setup.calibration_at(state);
    match uncertainty.filter(|_| setup.calibration.has_free_parameters()) {
        Some(uncertainty) => uncertainty.find_unobservable(
            &context.at(solution.unknowns.kappa),
            &calibration,
            &solution.unknowns.frames,
            &state.frames.rejections,
            setup.options.max_sigma_px,
        ),
        None => Vec::new(),
    }
}

/// True if the strengths of the shape are learned after this solve: at full size, a few times.
fn may_learn_shape(plan: &SolvePlan, state: &PipelineState) -> bool {
    let before = state.levels.iter().filter(|solve| solve.level == 0).count();
    plan.sampling.level == 0 && before < MAX_LEARNING_SOLVES
}

/// True if another solve is certain to follow; a joint one may turn out to be needless.
fn has_solve_ahead(state: &PipelineState) -> bool {
    let mut ahead = state.stages.iter().skip(1);
    ahead.any(|stage| matches!(stage, Stage::Solve(plan) if !plan.sampling.joint))
}

/// Plans the solve once more, after this one. Without the unobservable parameter the wall may look
/// smooth, so a joint solve is preceded by one that is not.
fn plan_again(plan: &SolvePlan, options: &RefineOptions, state: &mut PipelineState) {
    state.stages.insert(1, Stage::Solve(*plan));
    if plan.sampling.joint {
        state
            .stages
            .insert(1, Stage::Solve(SolvePlan::last(options)));
    }
}
