//! Dispatch of a stage to the function that runs it.

use crate::error::RefineError;
use crate::stages::plan::Stage;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::Estimation;
use crate::stages::{
    assess, correct_shading, prescreen, resolve_aliases, solve, track, validate_pairs,
};

/// Runs a stage: it takes the estimation as the stage before has left it and returns it changed.
///
/// # Errors
/// [`RefineError`].
pub fn run_stage<'a>(
    stage: Stage,
    setup: &'a Setup<'a>,
    estimation: Estimation<'a>,
    session: &mut Session,
) -> Result<Estimation<'a>, RefineError> {
    match stage {
        Stage::Prescreen => prescreen::run(setup, estimation, session),
        Stage::Track => track::run(setup, estimation, session),
        Stage::CorrectShading => correct_shading::run(setup, estimation, session),
        Stage::Solve(plan) => solve::run(plan, setup, estimation, session),
        Stage::ValidatePairs => validate_pairs::run(setup, estimation, session),
        Stage::ResolveAliases => resolve_aliases::run(setup, estimation, session),
        Stage::Assess => assess::run(setup, estimation, session),
    }
}
