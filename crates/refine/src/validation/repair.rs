//! Repair: rejects frames that the others do not support, registers them again, and solves their
//! neighbourhood.
//!
//! A wrong frame bends those that it is compared with, and a bent wall makes the registration of
//! the next frame wrong. Gauss–Newton at full size cannot undo that: many pixels off, it is outside
//! its basin. So when frames are found wrong, they are rejected, the others are solved again from
//! the coarsest level, and the rejected frames are registered once more on the wall as it is then.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::solver::neighbourhood::{Neighbourhood, changes};
use crate::thresholds::assessment::MAX_PAIR_ITERATIONS;
use crate::thresholds::repair::MAX_ITERATIONS;
use crate::tracking::track::register_rejected;
use crate::validation::aliasing::{AliasHypothesis, resolve_aliases, resolve_all_aliases};
use crate::validation::disagreement::reject_disagreeing_frames;
use crate::validation::inconsistent_frames::{find_inconsistent_frames, known_relations};
use crate::validation::pairwise_ncc::{PairNcc, compute_pairwise_ncc};
use std::ops::Range;
use tunnelstitch_core::progress::Progress;

/// Rejects the frames that the others do not support, registers them again, and solves their
/// neighbourhood, until nothing changes. `solved`: the frames as the last solve left them.
///
/// Returns the frames whose aliases remain undecided. If an earlier iteration had more inliers than
/// the last, its frames are restored.
///
/// # Errors
/// [`ProblemError`].
pub fn repair(
    context: &EstimationContext,
    options: &RefineOptions,
    states: &mut FrameStates,
    mut solved: FrameStates,
    progress: &dyn Progress,
) -> Result<Vec<AliasHypothesis>, ProblemError> {
    let count = states.estimates.len();
    let finest = options.handover_level(context.cameras.shorter_side());
    progress.start("repair", MAX_ITERATIONS);
    let mut pairs = compute_pairwise_ncc(context, finest, states, &(0..count))?;
    let relations = known_relations(context);
    let mut best: Option<FrameStates> = None;
    // Known for the present poses only.
    let mut undecided = None;
    for iteration in 0..MAX_ITERATIONS {
        pairs.retain(|pair| {
            [pair.a, pair.b]
                .iter()
                .all(|k| states.rejections[*k].is_none())
        });
        states.reject(find_inconsistent_frames(&pairs, &relations, count));
        let has_changed = !changes(&solved, states).is_empty();
        let is_better = |best: &FrameStates| count_inliers(best) < count_inliers(states);
        if !has_changed && best.as_ref().is_none_or(is_better) {
            best = Some(states.clone());
        }
        if !states.has_majority() {
            break;
        }
        let registered = if iteration < MAX_PAIR_ITERATIONS {
            register_rejected(context, options, states)?
        } else {
            0
        };
        if !has_changed && registered == 0 {
            let resolution = resolve_aliases(context, options, states)?;
            if resolution.moved.is_empty() || iteration + 1 == MAX_ITERATIONS {
                undecided = Some(resolution.into_undecided());
                break;
            }
        }
        let neighbourhoods = Neighbourhood::of_changes(context, &solved, states)?;
        solve_neighbourhoods(context, options, &neighbourhoods, states, &mut solved)?;
        compare_again(context, finest, &neighbourhoods, states, &mut pairs)?;
        progress.advance(1);
    }
    progress.finish();
    if let Some(best) = best.filter(|best| count_inliers(best) > count_inliers(states)) {
        *states = best;
        undecided = None;
    }
    match undecided {
        Some(undecided) => Ok(undecided),
        None if !states.has_majority() => Ok(Vec::new()),
        None => resolve_all_aliases(context, options, states),
    }
}

/// Solves neighbourhoods from the coarsest level to full size, and rejects their frames that
/// disagree with the others. `solved` is set to the frames as these solves leave them.
fn solve_neighbourhoods(
    context: &EstimationContext,
    options: &RefineOptions,
    neighbourhoods: &[Neighbourhood],
    states: &mut FrameStates,
    solved: &mut FrameStates,
) -> Result<(), ProblemError> {
    let coarsest = options.coarsest_level(context.cameras.shorter_side());
    let mut shares = Vec::new();
    for neighbourhood in neighbourhoods {
        shares.push(neighbourhood.solve(context, options, 0..=coarsest, states)?);
    }
    solved.clone_from(states);
    for (neighbourhood, shares) in neighbourhoods.iter().zip(&shares) {
        let rejections = &mut states.rejections[neighbourhood.active.clone()];
        reject_disagreeing_frames(shares, rejections);
    }
    Ok(())
}

/// Replaces the pairs that the solve of neighbourhoods has changed.
fn compare_again(
    context: &EstimationContext,
    finest: usize,
    neighbourhoods: &[Neighbourhood],
    states: &FrameStates,
    pairs: &mut Vec<PairNcc>,
) -> Result<(), ProblemError> {
    for Neighbourhood {
        active,
        participants,
    } in neighbourhoods
    {
        let within =
            |frames: &Range<usize>, pair: &PairNcc| [pair.a, pair.b].map(|k| frames.contains(&k));
        pairs.retain(|pair| {
            within(participants, pair) != [true; 2] && within(active, pair) == [false; 2]
        });
        pairs.extend(compute_pairwise_ncc(context, finest, states, participants)?);
    }
    Ok(())
}

fn count_inliers(states: &FrameStates) -> usize {
    states
        .rejections
        .iter()
        .filter(|rejection| rejection.is_none())
        .count()
}
