//! What is solved again when few of many frames have changed: their neighbourhood, with all else
//! held.
//!
//! A wrong frame bends its neighbours over a few turns; a survey may have hundreds. So what a
//! doubted frame makes to be solved does not grow with the length of the survey. What it has bent
//! farther off is left to the next solve of all.

use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::options::RefineOptions;
use crate::refine::problem::linearisation::FrameContribution;
use crate::refine::problem::photometric_problem::PhotometricProblem;
use crate::refine::samples::footprints::footprints;
use crate::refine::samples::sampling::Sampling;
use crate::refine::solver::argmin_glue::solve;
use crate::refine::solver::stopping::Stopping;
use crate::refine::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use std::ops::{Range, RangeInclusive};

/// Frames on either side of a changed one that are solved again.
const REACH: usize = 64;

/// A run of frames that are solved again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbourhood {
    /// The frames.
    pub active: Range<usize>,
    /// They and those on either side that may share wall with them.
    pub participants: Range<usize>,
}

impl Neighbourhood {
    /// Those of the frames that are inliers now and were not `before`, or the other way round, or
    /// stand elsewhere.
    ///
    /// # Errors
    /// [`ProblemError::Placement`].
    pub fn of_changes(
        scene: &EstimationContext,
        before: &FrameStates,
        now: &FrameStates,
    ) -> Result<Vec<Self>, ProblemError> {
        let runs = around(&changes(before, now), now.estimates.len());
        if runs.is_empty() {
            return Ok(Vec::new());
        }
        let footprints = footprints(scene, now)?;
        let perimeter = scene.surface.perimeter_m();
        let shares = |k: &usize, run: &Range<usize>| {
            let own = &footprints[*k];
            let mut others = footprints[run.clone()].iter();
            others.any(|other| other.overlaps(own, perimeter))
        };
        let widened = runs.into_iter().map(|active| {
            let earlier = active.start.saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES)..active.start;
            let later =
                active.end..(active.end + MAX_OVERLAP_DISTANCE_FRAMES).min(footprints.len());
            let first = earlier.clone().find(|k| shares(k, &active));
            let last = later.clone().rev().find(|k| shares(k, &active));
            // The prior ties the first and the last to their neighbours, wall in common or not.
            let first = first.or(earlier.last()).unwrap_or(active.start);
            let last = last.or(later.min()).map_or(active.end, |k| k + 1);
            Self {
                participants: first..last,
                active,
            }
        });
        Ok(widened.collect())
    }

    /// All frames.
    pub fn of_all(tracked: &FrameStates) -> Self {
        let all = 0..tracked.estimates.len();
        Self {
            active: all.clone(),
            participants: all,
        }
    }

    /// Solves the inliers frames at some pyramid levels, coarse to fine, each close enough for the
    /// next; returns how each frame took part in the last.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn solve(
        &self,
        scene: &EstimationContext,
        options: &RefineOptions,
        levels: RangeInclusive<usize>,
        tracked: &mut FrameStates,
    ) -> Result<Vec<FrameContribution>, ProblemError> {
        let mut shares = Vec::new();
        for level in levels.rev() {
            let members = tracked.window_of(self.participants.clone(), self.active.clone());
            let problem = PhotometricProblem::new(scene, Sampling::of(level), members)?;
            let solution = solve(problem, Stopping::intermediate(options, level))?;
            tracked.estimates[self.active.clone()].copy_from_slice(&solution.estimates);
            shares = solution.linearisation.frames;
        }
        Ok(shares)
    }
}

/// The frames whose belief or, of those inliers, whose pose has changed.
pub fn changes(before: &FrameStates, now: &FrameStates) -> Vec<usize> {
    let changed = |k: &usize| {
        let (was, is) = (
            before.rejections[*k].is_none(),
            now.rejections[*k].is_none(),
        );
        was != is || is && before.estimates[*k].pose != now.estimates[*k].pose
    };
    (0..now.estimates.len()).filter(changed).collect()
}

/// Runs of frames that reach [`REACH`] to either side of those given, ascending; joined where they
/// touch.
fn around(frames: &[usize], count: usize) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for k in frames {
        let (start, end) = (k.saturating_sub(REACH), (k + REACH + 1).min(count));
        match runs.last_mut().filter(|run| start <= run.end) {
            Some(run) => run.end = end,
            None => runs.push(start..end),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbourhoods_are_joined_where_they_touch_and_end_with_the_survey() {
        assert_eq!(around(&[], 9), []);
        assert_eq!(around(&[3], 9), vec![0..9; 1]);
        let reach = 2 * REACH + 1;
        assert_eq!(
            around(&[REACH, REACH + reach, 5 * reach], 5 * reach + 2),
            [0..2 * reach, 5 * reach - REACH..5 * reach + 2]
        );
    }
}
