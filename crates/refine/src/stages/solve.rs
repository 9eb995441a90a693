//! Stage: solves all frames together at full size.

use crate::error::RefineError;
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::options::{Photometry, RefineOptions};
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::hidden_bands::find_hidden_bands;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::{self, Observation};
use crate::solver::gauss_newton::{Solution, SolveState};
use crate::solver::solve_levels::solve_levels;
use crate::stages::plan::{SolvePlan, Stage};
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::shape;
use crate::stages::state::{Estimation, GlobalSolve, LastSolve, PipelineState};
use crate::thresholds::last_solve::MAX_SLOPE_NOISE;
use crate::tracking::lamp_search::find_lamp;
use crate::tracking::shading_correction::correct_once;
use crate::uncertainty::observability::UnobservableParameter;
use crate::uncertainty::observed_curvature::observe_curvature;
use crate::uncertainty::solution_uncertainty::SolutionUncertainty;
use crate::validation::disagreement::reject_disagreeing_frames;

/// Solves after which none is repeated for the shape: its strengths are not learned again, and one
/// that is not adopted, as measured points may make it each time, is solved for no more.
const MAX_LEARNING_SOLVES: usize = 4;

/// Runs the stage; a snapshot may be kept between two steps.
///
/// A parameter that the last solve finds unobservable is fixed, and the solve planned again; as it
/// is if the shape turns out to have other strengths ([`crate::stages::shape`]), or if residuals
/// show model errors, with pixels that tell accordingly less ([`crate::uncertainty::model_error`]).
/// On a wall so faint that slopes between fine pixels are mostly noise, the last solve may take
/// coarser ones, and be repeated in finer ones that tell more at its end.
///
/// # Errors
/// A frame that cannot be read, equations without a solution.
pub fn run<'a>(
    mut plan: SolvePlan,
    setup: &'a Setup<'a>,
    mut estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    let state = &mut estimation.state;
    shape::begin(setup, state)?;
    let context = setup.context(state);
    let Some((level, problem)) = problem_of(&plan, setup, &context, state)? else {
        session.record_time("joint model of the wall");
        return Ok(estimation);
    };
    plan.sampling.level = level;
    // Without overlap the prior is all there is to report.
    if problem.tiles() == 0 && state.frames.rejections.iter().all(Option::is_none) {
        return Ok(estimation);
    }
    let start = (state.kappa, state.frames.estimates.clone());
    let mut solution = solve(&plan, problem, setup, state, session)?;
    let is_dense = plan.sampling.variance_weighting;
    let is_adopted = shape::take_over(setup, state, &solution, &start);
    let has_changed = may_learn_shape(state)
        && (!is_adopted || shape::learn(setup, state, (&solution, &start), is_dense));
    if has_changed && !has_solve_ahead(state) {
        plan_again(&plan, setup.options, state);
    }
    solution.remove_tested();
    solution.tie_gauge();
    let uncertainty = uncertainty_of(setup, &context, state, &mut solution)?;
    let unobservable = find_unobservable(setup, state, uncertainty.as_ref());
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
    reject_disagreeing_frames(&solution.linearisation.frames, &mut state.frames.rejections);
    state.levels.push(GlobalSolve {
        samples_per_pixel: plan.sampling.density,
        level: plan.sampling.level,
        joint: solution.problem.is_joint(),
        record: solution.record.clone(),
    });
    if state.frames.has_majority() {
        let masked = solution.problem.masked_wall();
        estimation.hidden_bands =
            find_hidden_bands(&masked, context.nominal.as_ref(), &setup.hidden_bands);
    }
    if has_solve_ahead(state) {
        correct_light(&plan, setup, &context, state)?;
    }
    // The assessment uses the last one only.
    if let Some(uncertainty) = uncertainty.filter(|_| !has_solve_ahead(state)) {
        let dispersion = uncertainty.dispersion();
        if is_close_for_finer(&plan, setup, &context, state)? {
            plan_again(&plan, setup.options, state);
        } else if state.dispersion == 1.0 && dispersion > shape::MAX_STRENGTH_CHANGE {
            state.dispersion = dispersion;
            plan_again(&plan, setup.options, state);
        } else {
            solution.release_equations();
            estimation.solution = Some(LastSolve {
                solution,
                uncertainty,
                stopping: plan.stopping,
            });
        }
    }
    session.record_time(&plan.name());
    Ok(estimation)
}

/// Sets up the problem, and its level: if slopes between fine pixels are mostly noise, that at
/// which pixels tell most. None if it was to be joint and the wall is too smooth for that.
fn problem_of<'a>(
    plan: &SolvePlan,
    setup: &Setup,
    context: &EstimationContext<'a>,
    state: &PipelineState,
) -> Result<Option<(usize, PhotometricProblem<'a>)>, ProblemError> {
    let Sampling {
        level,
        joint,
        variance_weighting,
        ..
    } = plan.sampling;
    let Some(mut problem) = problem_at(plan.sampling, setup, context, state)? else {
        return Ok(None);
    };
    // Solves before the last one only bring the estimate close, and the texture of a joint one is
    // finer than pixels.
    if joint || !variance_weighting {
        return Ok(Some((level, problem)));
    }
    let (mut level, mut information) = (level, None);
    while problem.slope_noise() > MAX_SLOPE_NOISE && level < setup.coarsest_level() {
        let sampling = Sampling {
            level: level + 1,
            ..plan.sampling
        };
        let Some(coarser) = problem_at(sampling, setup, context, state)? else {
            break;
        };
        let here = information.map_or_else(|| information_at_start(&problem), Ok)?;
        let there = information_at_start(&coarser)?;
        if there <= here {
            break;
        }
        (level, problem, information) = (level + 1, coarser, Some(there));
    }
    Ok(Some((level, problem)))
}

/// Sets up the problem with these samples; none if it was to be joint and the wall is too smooth
/// for that.
fn problem_at<'a>(
    sampling: Sampling,
    setup: &Setup,
    context: &EstimationContext<'a>,
    state: &PipelineState,
) -> Result<Option<PhotometricProblem<'a>>, ProblemError> {
    let problem =
        PhotometricProblem::new(context, sampling, state.frames.window())?.with_shared_parameters();
    if sampling.joint && !problem.is_joint() {
        return Ok(None);
    }
    let density = if sampling.joint {
        Some(RefineOptions::default().final_density)
    } else {
        let chosen = setup.options.outlier_mask_density;
        chosen.filter(|_| sampling.variance_weighting)
    };
    problem.exclude_outliers(density).map(Some)
}

/// Information about the poses where the last solve starts; 0 if it is not known there.
fn information_at_start(problem: &PhotometricProblem) -> Result<f64, ProblemError> {
    let start = problem.initial_linearisation().and_then(|at| {
        let factor = problem.symbolic().factorise(&at.normal, 0.0);
        Some((at, factor.ok()?))
    });
    let Some((at, factor)) = start else {
        return Ok(0.0);
    };
    let at_start = (at, &problem.initial_unknowns());
    let observed = observe_curvature(problem, at_start, &factor, &problem.signed_scores(at))?;
    Ok(observed.information())
}

/// True if finer pixels than those of a solve tell more at its end: at its beginning frames, lens
/// or wall may have been too far off for that.
fn is_close_for_finer(
    plan: &SolvePlan,
    setup: &Setup,
    context: &EstimationContext,
    state: &PipelineState,
) -> Result<bool, ProblemError> {
    if plan.sampling.level == 0 {
        return Ok(false);
    }
    let found = problem_of(&plan.at_full_size(), setup, context, state)?;
    Ok(found.is_some_and(|(level, _)| level < plan.sampling.level))
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

/// Corrects the light by the poses of a solve: a lamp is looked for, if there may be one, and
/// frames that had to be compared by their contrast are compared in its light from now on. Their
/// exposures are others then, so the solve is repeated.
fn correct_light(
    plan: &SolvePlan,
    setup: &Setup,
    context: &EstimationContext,
    state: &mut PipelineState,
) -> Result<(), ProblemError> {
    let light = setup.frames.camera_light();
    let lamp = light.as_ref().and_then(|light| light.lamp.as_ref());
    let has_lamp = lamp.is_some_and(|(lamp, _)| !lamp.is_at_camera());
    let may_have_lamp =
        setup.options.photometry != Photometry::Normalised && !state.is_lamp_ruled_out && !has_lamp;
    let found = match may_have_lamp {
        true => find_lamp(context, setup.options, &state.frames)?,
        false => None,
    };
    if let Some(noise) = found {
        state.noise = noise;
        if light.is_none() {
            state.frames.forget_exposures();
        }
        let context = setup.context(state);
        let levels = setup.handover_level()..=setup.coarsest_level();
        solve_levels(&context, setup.options, levels, &mut state.frames)?;
        plan_again(plan, setup.options, state);
    } else if light.is_some() {
        correct_once(context, setup.options, &state.frames)?;
    }
    Ok(())
}

/// The uncertainty of the last solution; before, unknowns may be free that it turns out not to
/// have.
fn uncertainty_of(
    setup: &Setup,
    context: &EstimationContext,
    state: &PipelineState,
    solution: &mut Solution,
) -> Result<Option<SolutionUncertainty>, ProblemError> {
    let calibration = setup.calibration_at(state);
    if has_solve_ahead(state) {
        return Ok(None);
    }
    let solved = context.at(solution.unknowns.kappa);
    let alpha = setup.options.false_alarm_rate;
    SolutionUncertainty::at(&solved, solution, &calibration, &state.unseen, alpha).map(Some)
}

/// The shared parameters that a full-size solution does not observe.
fn find_unobservable(
    setup: &Setup,
    state: &PipelineState,
    uncertainty: Option<&SolutionUncertainty>,
) -> Vec<UnobservableParameter> {
    let calibration = setup.calibration_at(state);
    match uncertainty.filter(|_| setup.calibration.has_free_parameters()) {
        Some(uncertainty) => uncertainty.find_unobservable(&calibration, &state.frames.rejections),
        None => Vec::new(),
    }
}

/// True if this solve may be repeated for what is learned of the shape: the first few may.
fn may_learn_shape(state: &PipelineState) -> bool {
    state.levels.len() < MAX_LEARNING_SOLVES
}

/// True if another solve is certain to follow; a joint one may turn out to be needless.
fn has_solve_ahead(state: &PipelineState) -> bool {
    let mut ahead = state.stages.iter().skip(1);
    ahead.any(|stage| matches!(stage, Stage::Solve(plan) if !plan.sampling.joint))
}

/// Plans the solve once more, after this one. Without the unobservable parameter the wall may look
/// smooth, so a joint solve is preceded by one that is not.
fn plan_again(plan: &SolvePlan, options: &RefineOptions, state: &mut PipelineState) {
    // Its level is found anew.
    let plan = plan.at_full_size();
    state.stages.insert(1, Stage::Solve(plan));
    if plan.sampling.joint {
        state
            .stages
            .insert(1, Stage::Solve(SolvePlan::last(options)));
    }
}
