//! The hand-over of a solve to argmin: its executor counts the iterations, calls the observer and
//! stops; [`DampedGaussNewton`] does the work.

use crate::model::problem_error::ProblemError;
use crate::parameters::unknowns::Unknowns;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::solver::gauss_newton::{DampedGaussNewton, Solution, SolveState};
use crate::solver::stopping::Stopping;
use argmin::core::observers::{Observe, ObserverMode};
use argmin::core::{
    Error, Executor, IterState, KV, Problem as Counted, Solver, State, TerminationReason,
};
use std::sync::Arc;
use tunnelstitch_core::progress::Progress;

/// The state of argmin's executor: the unknowns and the cost.
type Iterate = IterState<Unknowns, (), (), (), (), f64>;

/// Receives the state between two steps, to keep it.
pub type KeepState<'k> = dyn FnMut(SolveState) -> Result<(), ProblemError> + 'k;

/// Whoever follows a solve while it works.
pub struct Observation<'k> {
    /// Name of the stage, for the progress display.
    pub stage: &'k str,
    /// The progress display.
    pub progress: &'k Arc<dyn Progress>,
    /// Called between any two steps.
    pub keep: &'k mut KeepState<'k>,
}

/// Solves `problem` from the estimates it was made with.
///
/// # Errors
/// [`ProblemError::Factor`] if the normal equations stay singular whatever the damping;
/// [`ProblemError::Frame`] if a frame has to be read again and cannot be.
pub fn solve<'a>(
    problem: PhotometricProblem<'a>,
    stopping: Stopping,
) -> Result<Solution<'a>, ProblemError> {
    resume(problem, stopping, None, None)
}

/// Solves `problem` from where an earlier solve of it was, observed.
///
/// # Errors
/// The errors of [`solve`], and those of [`Observation::keep`].
pub fn resume<'a>(
    mut problem: PhotometricProblem<'a>,
    stopping: Stopping,
    begun: Option<SolveState>,
    observation: Option<Observation>,
) -> Result<Solution<'a>, ProblemError> {
    let at_start = problem.take_initial_linearisation();
    let (gauss_newton, start, done) = match begun {
        None => {
            let start = problem.initial_unknowns();
            (DampedGaussNewton::starting(stopping, at_start), start, 0)
        }
        Some(state) => {
            let gauss_newton = DampedGaussNewton::resume(stopping, &state);
            (gauss_newton, state.unknowns, state.iterations)
        }
    };
    let reporter = observation.as_ref().map(|observation| Reporter {
        stage: observation.stage.to_owned(),
        progress: Arc::clone(observation.progress),
    });
    let solver = Adapter {
        gauss_newton,
        keep: observation.map(|observation| observation.keep),
    };
    let mut executor = Executor::new(problem, solver).configure(|mut state| {
        state.iter = done;
        state.param(start).max_iters(stopping.max_iterations)
    });
    if let Some(reporter) = reporter {
        reporter.progress.advance(done as usize);
        executor = executor.add_observer(reporter, ObserverMode::Always);
    }
    let outcome = executor.run().map_err(|error| {
        error
            .downcast::<ProblemError>()
            .unwrap_or_else(|other| ProblemError::Solver(other.to_string()))
    })?;
    let problem = outcome.problem.get_problem();
    let unknowns = outcome.state.get_param().cloned();
    problem
        .zip(unknowns)
        .and_then(|(problem, unknowns)| outcome.solver.gauss_newton.finish(problem, unknowns))
        .ok_or_else(|| ProblemError::Solver("no iterate was kept".to_owned()))
}

/// [`DampedGaussNewton`] as argmin's solver.
struct Adapter<'k> {
    gauss_newton: DampedGaussNewton,
    keep: Option<&'k mut KeepState<'k>>,
}

impl<'a> Solver<PhotometricProblem<'a>, Iterate> for Adapter<'_> {
    fn name(&self) -> &str {
        "damped Gauss–Newton"
    }

    fn next_iter(
        &mut self,
        problem: &mut Counted<PhotometricProblem<'a>>,
        mut state: Iterate,
    ) -> Result<(Iterate, Option<KV>), Error> {
        let unknowns = state.take_param().unwrap_or_default();
        let (unknowns, cost) = problem.problem("iterate", |problem| {
            Ok(self.gauss_newton.iterate(problem, &unknowns)?)
        })?;
        let iterations = state.get_iter() + 1;
        if self.gauss_newton.stop().is_none()
            && iterations < state.get_max_iters()
            && let Some(keep) = &mut self.keep
        {
            keep(self.gauss_newton.state(&unknowns, iterations))?;
        }
        state = state.param(unknowns).cost(cost);
        if self.gauss_newton.stop().is_some() {
            state = state.terminate_with(TerminationReason::SolverConverged);
        }
        Ok((state, None))
    }
}

/// Shows every iteration on a progress display.
struct Reporter {
    stage: String,
    progress: Arc<dyn Progress>,
}

impl Observe<Iterate> for Reporter {
    fn observe_iter(&mut self, state: &Iterate, _: &KV) -> Result<(), Error> {
        self.progress.advance(1);
        self.progress.detail(&format!(
            "{}: step {}, cost {:.6e}",
            self.stage,
            state.get_iter() + 1,
            state.get_cost()
        ));
        Ok(())
    }
}
