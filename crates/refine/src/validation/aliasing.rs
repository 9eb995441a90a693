//! Resolution of perceptual aliasing: frames on a repetitive wall are moved to where the prior has
//! them, or reported as ambiguous.
//!
//! On a wall with a printed pattern, a frame moved by a whole period shows exactly the same:
//! neither its residual nor a comparison with other frames can tell. Only the prior can. So each
//! frame is compared with the wall after all gauge motions (rotations about the axis, translations
//! along it) within the prior's reach ([`crate::validation::alias_search`]). If it matches
//! elsewhere as well, the prior chooses ([`crate::validation::alias_choice`]); if its odds
//! are not clear, the frame is ambiguous.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::samples::footprints::footprints;
use crate::thresholds::aliasing::MAX_ITERATIONS;
use crate::validation::alias_choice::{Evidence, find_periods};
use crate::validation::alias_search::find_alias_motions;
use std::collections::BTreeMap;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::GaugeMotion;
use tunnelstitch_geometry::trajectory::Pose;

/// A frame and the gauge motion to its alias.
pub type AliasHypothesis = (usize, GaugeMotion);

/// The result of resolving aliases.
#[derive(Debug, Default)]
pub struct AliasResolution {
    /// Frames that have been moved, with the motions back. They were compared at their old poses;
    /// at the new ones the others may contradict.
    pub moved: Vec<AliasHypothesis>,
    /// Frames for which the prior does not decide.
    pub undecided: Vec<AliasHypothesis>,
}

impl AliasResolution {
    /// All frames that nothing decides if no further comparison follows, those moved last among
    /// them.
    pub fn into_undecided(self) -> Vec<AliasHypothesis> {
        let Self { moved, undecided } = self;
        let mut all: BTreeMap<usize, GaugeMotion> = moved.into_iter().collect();
        all.extend(undecided);
        all.into_iter().collect()
    }
}

/// Moves frames with aliases to where the prior has them, until none moves any more; returns the
/// frames that remain undecided.
///
/// # Errors
/// [`ProblemError`].
pub fn resolve_all_aliases(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &mut FrameStates,
) -> Result<Vec<AliasHypothesis>, ProblemError> {
    let mut resolution = resolve_aliases(context, options, states)?;
    for _ in 1..MAX_ITERATIONS {
        if resolution.moved.is_empty() {
            break;
        }
        resolution = resolve_aliases(context, options, states)?;
    }
    Ok(resolution.into_undecided())
}

/// Moves frames with aliases to where the prior has them, once.
///
/// # Errors
/// [`ProblemError`].
pub fn resolve_aliases(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &mut FrameStates,
) -> Result<AliasResolution, ProblemError> {
    let all = 0..states.estimates.len();
    let inliers = states.inliers(&all);
    let frames: Vec<usize> = all.filter(|k| inliers[*k]).collect();
    let footprints = footprints(context, states)?;
    let alias_motions = frames
        .par_map(|k| find_alias_motions(context, options, *k, states, &footprints))
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?;
    if alias_motions.iter().all(Vec::is_empty) {
        return Ok(AliasResolution::default());
    }
    let poses: Vec<Pose> = frames.iter().map(|k| states.estimates[*k].pose).collect();
    let radius_m = context.surface.perimeter_m() / std::f64::consts::TAU;
    let evidence = Evidence {
        prior: context.prior,
        gauge: context.gauge(),
        frames: &frames,
        poses: &poses,
        alias_motions: &alias_motions,
        periods: &find_periods(&alias_motions, radius_m),
    };
    // A choice with posterior odds of 1/α is wrong with the probability α.
    let min_odds = -options.false_alarm_rate.ln();
    let mut choice = evidence.choose(min_odds);
    let undecided = choice.aliases.iter().flatten().count();
    if 2 * undecided > frames.len() {
        let first = std::mem::replace(&mut choice, evidence.choose(f64::INFINITY));
        choice.mark_all_undecided(&first, &alias_motions, evidence.periods);
    }
    let mut moved = Vec::new();
    for (k, motion) in frames.iter().zip(&choice.motions) {
        if !motion.is_none() {
            let pose = &mut states.estimates[*k].pose;
            *pose = motion.apply(pose);
            moved.push((*k, motion.reversed()));
        }
    }
    let aliases = frames.iter().zip(choice.aliases);
    Ok(AliasResolution {
        moved,
        undecided: aliases
            .filter_map(|(k, alias)| Some((*k, alias?)))
            .collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After the last motion the frames have not been compared again.
    #[test]
    fn frames_that_have_moved_last_are_undecided() {
        let period = GaugeMotion::about_y(0.0, 0.45);
        let resolution = AliasResolution {
            moved: vec![(3, period), (7, period)],
            undecided: vec![(7, period.reversed()), (9, period)],
        };
        assert_eq!(
            resolution.into_undecided(),
            [(3, period), (7, period.reversed()), (9, period)]
        );
    }
}
