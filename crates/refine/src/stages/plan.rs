//! The plan of a refinement: its stages by name, and the rules of its global solves.

use crate::options::RefineOptions;
use crate::samples::sampling::Sampling;
use crate::solver::stopping::Stopping;
use crate::thresholds::joint;
use crate::tiles::interpolation::Interpolation;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Largest step that ends the joint solve, standard deviations of the estimates: the step after one
/// of this length is a tenth of it.
const MAX_JOINT_STEP_SIGMA: f64 = 0.3;

/// One step of the estimator ([`crate::stages::run::run_stage`]).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Stage {
    /// Rejects useless frames, estimates common shading and sensor noise
    /// ([`crate::stages::prescreen`]).
    Prescreen,
    /// Registers one frame after another on the wall that its predecessors show
    /// ([`crate::stages::track`]).
    Track,
    /// Corrects the common shading from overlaps ([`crate::stages::correct_shading`]).
    CorrectShading,
    /// Solves all frames together at one pyramid level ([`crate::stages::solve`]).
    Solve(SolvePlan),
    /// Rejects frames that contradict the others pair by pair
    /// ([`crate::stages::validate_pairs`]).
    ValidatePairs,
    /// Moves frames to where the prior has them if they fit there as well
    /// ([`crate::stages::resolve_aliases`]).
    ResolveAliases,
    /// States uncertainty and verdict of every frame ([`crate::stages::assess`]).
    Assess,
}

impl Stage {
    /// True for the solves with the dense samples that a refinement ends with, after the solves and
    /// checks that bring every frame close.
    pub fn is_dense_solve(&self) -> bool {
        matches!(self, Self::Solve(plan) if plan.sampling.variance_weighting)
    }
}

/// The stages of a refinement: track coarsely, check, solve at full size, check again with the
/// lens and the shape that this has found, resolve aliases, solve twice with denser samples,
/// assess.
pub fn plan_stages(options: &RefineOptions) -> VecDeque<Stage> {
    let mut stages = VecDeque::from([
        Stage::Prescreen,
        Stage::Track,
        Stage::CorrectShading,
        Stage::ValidatePairs,
        Stage::Solve(SolvePlan::first(options)),
        Stage::ValidatePairs,
        Stage::ResolveAliases,
    ]);
    if let Some(approach) = SolvePlan::approach(options) {
        stages.push_back(Stage::Solve(approach));
    }
    stages.push_back(Stage::Solve(SolvePlan::last(options)));
    if options.joint {
        stages.push_back(Stage::Solve(SolvePlan::joint(options)));
    }
    stages.push_back(Stage::Assess);
    stages
}

/// Sampling and stopping rule of one global solve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SolvePlan {
    /// The wall samples.
    pub sampling: Sampling,
    /// When to stop.
    pub stopping: Stopping,
}

impl SolvePlan {
    /// The first solve, which only brings the estimate close for the last one.
    pub fn first(options: &RefineOptions) -> Self {
        Self {
            sampling: Sampling {
                shape: true,
                ..Sampling::of(0)
            },
            stopping: Stopping::intermediate(options, 0),
        }
    }

    /// The last solve, at full size with denser samples.
    ///
    /// One sample per pixel is too sparse to end with: the products of residual and gradient vary
    /// faster than either, and where the wall repeats in step with the samples (courses of bricks
    /// run along them) what falls between them does not average out. On brick this alone is 0.05 px
    /// of wall error over two turns.
    pub fn last(options: &RefineOptions) -> Self {
        Self {
            sampling: Sampling {
                density: options.final_density,
                interpolation: Interpolation::Bicubic,
                variance_weighting: true,
                shape: true,
                ..Sampling::of(0)
            },
            stopping: Stopping {
                max_iterations: options.max_iterations,
                step_px: options.step_tolerance_px,
                step_sigma: options.step_tolerance_sigma,
            },
        }
    }

    /// The solve before the last one, which only brings the estimate close for it.
    ///
    /// A solve selects its samples, and estimates noise and outlier mask, where it begins. Two that
    /// begin a tenth of a pixel apart compare other tiles at the borders of frames, and end a tenth
    /// of σ apart. So the last one begins close to where it ends, wherever this one has begun. None
    /// if the last one ends as early as this one.
    pub fn approach(options: &RefineOptions) -> Option<Self> {
        let (last, stopping) = (Self::last(options), Stopping::intermediate(options, 0));
        let is_earlier = stopping.step_sigma > last.stopping.step_sigma;
        is_earlier.then_some(Self { stopping, ..last })
    }

    /// The solve after the last one, jointly with the wall ([`crate::joint`]).
    pub fn joint(options: &RefineOptions) -> Self {
        let last = Self::last(options);
        Self {
            sampling: Sampling {
                density: joint::SAMPLES_PER_PIXEL,
                joint: true,
                ..last.sampling
            },
            stopping: Stopping {
                step_sigma: MAX_JOINT_STEP_SIGMA,
                ..last.stopping
            },
        }
    }

    /// The solve at full size.
    pub fn at_full_size(self) -> Self {
        Self {
            sampling: Sampling {
                level: 0,
                ..self.sampling
            },
            ..self
        }
    }

    /// The solve in words, for the progress display and the timings.
    pub fn name(&self) -> String {
        let Sampling {
            density,
            joint,
            level,
            ..
        } = self.sampling;
        let size = match level {
            0 => String::new(),
            level => format!(" of size {}", 1 << level),
        };
        match (joint, density) {
            (true, _) => "solve, jointly with the wall".to_owned(),
            (false, 1.0) => format!("solve, a sample per pixel{size}"),
            (false, density) => format!("solve, {density} samples per pixel{size}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_are_checked_before_they_are_solved_and_solved_densely_at_last() {
        let options = RefineOptions {
            joint: true,
            ..RefineOptions::default()
        };
        let stages = plan_stages(&options);
        let solves = stages.iter().filter_map(|stage| match stage {
            Stage::Solve(plan) => Some((plan.sampling.density, plan.sampling.joint)),
            _ => None,
        });
        let solves: Vec<(f64, bool)> = solves.collect();
        let joint = joint::SAMPLES_PER_PIXEL;
        assert_eq!(
            solves,
            [(1.0, false), (2.0, false), (2.0, false), (joint, true)]
        );
        assert_eq!(stages[3], Stage::ValidatePairs);
        assert_eq!(stages.back(), Some(&Stage::Assess));
    }
}
