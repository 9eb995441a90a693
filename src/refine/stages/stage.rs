//! The stages of a refinement, by name.

use crate::refine::error::RefineError;
use crate::refine::setup::Setup;
use crate::refine::stages::session::Session;
use crate::refine::stages::solve::SolvePlan;
use crate::refine::stages::state::Estimation;
use crate::refine::stages::{
    assess, correct_shading, prescreen, repair, solve, track, validate_pairs,
};
use serde::{Deserialize, Serialize};

/// One step of the estimator. It takes an estimation and returns it changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stage {
    /// Rejects useless frames, estimates common shading and sensor noise ([`prescreen`]).
    Prescreen,
    /// Registers one frame after another on the wall that its predecessors show ([`track`]).
    Track,
    /// Corrects the common shading from overlaps ([`correct_shading`]).
    CorrectShading,
    /// Solves all frames together at one pyramid level ([`solve`]).
    Solve(SolvePlan),
    /// Rejects frames that contradict the others pair by pair ([`validate_pairs`]).
    ValidatePairs,
    /// Rejects inconsistent frames, registers them again, resolves aliases ([`repair`]).
    Repair,
    /// States uncertainty and verdict of every frame ([`assess`]).
    Assess,
}

impl Stage {
    /// Runs the stage.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn run<'a>(
        self,
        setup: &'a Setup<'a>,
        estimation: Estimation<'a>,
        session: &mut Session,
    ) -> Result<Estimation<'a>, RefineError> {
        match self {
            Self::Prescreen => prescreen::run(setup, estimation, session),
            Self::Track => track::run(setup, estimation, session),
            Self::CorrectShading => correct_shading::run(setup, estimation, session),
            Self::Solve(plan) => solve::run(plan, setup, estimation, session),
            Self::ValidatePairs => validate_pairs::run(setup, estimation, session),
            Self::Repair => repair::run(setup, estimation, session),
            Self::Assess => assess::run(setup, estimation, session),
        }
    }
}
