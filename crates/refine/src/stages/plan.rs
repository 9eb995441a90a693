//! The plan of a refinement: its stages by name, and the rules of its global solves.

use crate::options::RefineOptions;
use crate::samples::sampling::Sampling;
use crate::solver::stopping::Stopping;
use crate::thresholds::joint;
use crate::tiles::interpolation::Interpolation;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

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
    /// Rejects inconsistent frames, registers them again, resolves aliases
    /// ([`crate::stages::repair`]).
    Repair,
    /// States uncertainty and verdict of every frame ([`crate::stages::assess`]).
    Assess,
}

/// The stages of a refinement whose tracking ends at pyramid level `handover`: track coarsely,
/// solve coarse to fine with a check after the first solve and a repair before the last, assess.
pub fn plan_stages(options: &RefineOptions, handover: usize) -> VecDeque<Stage> {
    let mut stages = VecDeque::from([Stage::Prescreen, Stage::Track, Stage::CorrectShading]);
    for level in (0..=handover).rev() {
        let plan = SolvePlan::intermediate(options, level, handover);
        stages.push_back(Stage::Solve(plan));
        if level == handover {
            stages.push_back(Stage::ValidatePairs);
        }
    }
    stages.push_back(Stage::Repair);
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
    /// A solve that only brings the estimate close for the next one, finer level; the first, at the
    /// level where tracking ended, uses all of the information.
    pub fn intermediate(options: &RefineOptions, level: usize, handover_level: usize) -> Self {
        let information = if level == handover_level {
            1.0
        } else {
            options.intermediate_information
        };
        Self {
            sampling: Sampling {
                information,
                shape: true,
                ..Sampling::of(level)
            },
            stopping: Stopping::intermediate(options, level),
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
                step_sigma: joint::MAX_FINAL_STEP_SIGMA,
                ..last.stopping
            },
        }
    }

    /// The solve in words, for the progress display and the timings.
    pub fn name(&self) -> String {
        let Sampling {
            level,
            density,
            information,
            ..
        } = self.sampling;
        let mut name = format!("level {level}");
        if density != 1.0 {
            name += &format!(", {density} samples per pixel");
        }
        if information != 1.0 {
            name += &format!(", {:.0} % of the information", 100.0 * information);
        }
        name
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn solves_go_from_coarse_to_fine_and_end_at_full_size() {
        let options = RefineOptions {
            joint: true,
            ..RefineOptions::default()
        };
        let stages = plan_stages(&options, 2);
        let solves = stages.iter().filter_map(|stage| match stage {
            Stage::Solve(plan) => Some((plan.sampling.level, plan.sampling.joint)),
            _ => None,
        });
        let expected = [(2, false), (1, false), (0, false), (0, false), (0, true)];
        assert_eq!(solves.collect::<Vec<_>>(), expected);
        assert_eq!(stages.back(), Some(&Stage::Assess));
        // The first solve is checked at once, with all of the information.
        assert_eq!(stages[4], Stage::ValidatePairs);
        let Stage::Solve(first) = stages[3] else {
            panic!("{:?}", stages[3]);
        };
        assert_eq!(first.sampling.information, 1.0);
    }
}
