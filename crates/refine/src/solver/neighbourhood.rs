//! Solves around few changed frames, with all others held.
//!
//! A wrong frame bends its neighbours over a few turns; a survey may have hundreds. The effort of
//! rejecting a frame therefore does not grow with the length of the survey. What it has bent
//! farther away is left to the next solve of all frames.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::problem::linearisation::FrameContribution;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::samples::footprints::footprints;
use crate::samples::sampling::Sampling;
use crate::solver::argmin_glue::solve;
use crate::solver::stopping::Stopping;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::thresholds::tracking::LONG_WINDOW_FRAMES;
use std::ops::{Range, RangeInclusive};

/// Frames on either side of a changed one that are solved again: together as many as those of a
/// long window, in which a bend straightens.
const MAX_CHANGED_DISTANCE: usize = LONG_WINDOW_FRAMES / 2;

/// A range of frames that are solved again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Neighbourhood {
    /// The frames that are estimated.
    pub active: Range<usize>,
    /// These frames, and those on either side that may share wall with them.
    pub participants: Range<usize>,
}

impl Neighbourhood {
    /// Neighbourhoods of the frames that have changed since `before`: inliers that were rejected,
    /// rejected ones that were inliers, and inliers with another pose.
    ///
    /// # Errors
    /// [`ProblemError::Placement`].
    pub fn of_changes(
        context: &EstimationContext,
        before: &FrameStates,
        now: &FrameStates,
    ) -> Result<Vec<Self>, ProblemError> {
        let ranges = around(&changes(before, now), now.estimates.len());
        if ranges.is_empty() {
            return Ok(Vec::new());
        }
        let footprints = footprints(context, now)?;
        let perimeter = context.surface.perimeter_m();
        let shares = |k: &usize, range: &Range<usize>| {
            let own = &footprints[*k];
            let mut others = footprints[range.clone()].iter();
            others.any(|other| other.overlaps(own, perimeter))
        };
        let widened = ranges.into_iter().map(|active| {
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
    pub fn of_all(frames: &FrameStates) -> Self {
        let all = 0..frames.estimates.len();
        Self {
            active: all.clone(),
            participants: all,
        }
    }

    /// Solves the inliers at the given pyramid levels, coarse to fine, each close enough for the
    /// next; returns the share of every frame in the last solve.
    ///
    /// # Errors
    /// [`ProblemError`].
    pub fn solve(
        &self,
        context: &EstimationContext,
        options: &RefineOptions,
        levels: RangeInclusive<usize>,
        frames: &mut FrameStates,
    ) -> Result<Vec<FrameContribution>, ProblemError> {
        let mut shares = Vec::new();
        for level in levels.rev() {
            let window = frames.window_of(self.participants.clone(), self.active.clone());
            let problem = PhotometricProblem::new(context, Sampling::of(level), window)?;
            let solution = solve(problem, Stopping::intermediate(options, level))?;
            frames.estimates[self.active.clone()].copy_from_slice(&solution.unknowns.frames);
            shares = solution.linearisation.frames;
        }
        Ok(shares)
    }
}

/// Frames that have become inliers or rejected, and inliers whose pose has changed.
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

/// Ranges that reach [`MAX_CHANGED_DISTANCE`] to either side of the given frames, ascending; joined
/// where they touch.
fn around(frames: &[usize], count: usize) -> Vec<Range<usize>> {
    let mut ranges: Vec<Range<usize>> = Vec::new();
    for k in frames {
        let (start, end) = (
            k.saturating_sub(MAX_CHANGED_DISTANCE),
            (k + MAX_CHANGED_DISTANCE + 1).min(count),
        );
        match ranges.last_mut().filter(|range| start <= range.end) {
            Some(range) => range.end = end,
            None => ranges.push(start..end),
        }
    }
    ranges
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbourhoods_are_joined_where_they_touch_and_end_with_the_survey() {
        assert_eq!(around(&[], 9), []);
        assert_eq!(around(&[3], 9), vec![0..9; 1]);
        let reach = 2 * MAX_CHANGED_DISTANCE + 1;
        assert_eq!(
            around(
                &[
                    MAX_CHANGED_DISTANCE,
                    MAX_CHANGED_DISTANCE + reach,
                    5 * reach
                ],
                5 * reach + 2
            ),
            [
                0..2 * reach,
                5 * reach - MAX_CHANGED_DISTANCE..5 * reach + 2
            ]
        );
    }
}
