//! Taking apart what does not hold, and putting it together again.
//!
//! A wrong frame bends those it is compared with, and a bent wall makes the next frame's place
//! wrong. Gauss–Newton at full size cannot undo it: many pixels off, it has nothing to follow. So
//! when frames are found wrong, they are taken out, the others are solved again from the coarsest
//! level, and the frames in rejection are placed once more on the wall as it is then.

use crate::progress::Progress;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::options::RefineOptions;
use crate::refine::solver::neighbourhood::{Neighbourhood, changes};
use crate::refine::tracking::track::register_rejected;
use crate::refine::validation::aliasing::{AliasHypothesis, resolve_aliases, resolve_all_aliases};
use crate::refine::validation::inconsistent_frames::find_inconsistent_frames;
use crate::refine::validation::inconsistent_frames::reject_disagreeing_frames;
use crate::refine::validation::pairwise_lucas_kanade::{Alignment, align_pairs};
use crate::refine::validation::pairwise_ncc::{compute_pairwise_ncc, find_contradictions};
use std::ops::Range;

/// Times that frames in rejection are placed once more.
const TRIES: usize = 3;
/// Times that frames are taken out, at the most.
const ROUNDS: usize = 8;

/// Takes out the frames that the others do not bear out, places them again, and solves their
/// neighbourhood, until nothing changes. `solved`: the survey as the last solve left it.
///
/// Returns the frames that the wall's repeats leave undecided.
///
/// A round after which fewer frames are inliers than before any is undone.
///
/// # Errors
/// [`ProblemError`].
pub fn repair(
    scene: &EstimationContext,
    options: &RefineOptions,
    tracked: &mut FrameStates,
    mut solved: FrameStates,
    progress: &dyn Progress,
) -> Result<Vec<AliasHypothesis>, ProblemError> {
    let side = scene.camera.shorter_side();
    let count = tracked.estimates.len();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    progress.start("repair", ROUNDS);
    let mut aligned = align_pairs(scene, finest, tracked, &(0..count))?;
    let mut best: Option<FrameStates> = None;
    // Known for the poses as they are.
    let mut rivals = None;
    for round in 0..ROUNDS {
        aligned.retain(|pair| {
            [pair.a, pair.b]
                .iter()
                .all(|k| tracked.rejections[*k].is_none())
        });
        tracked.reject(find_inconsistent_frames(&aligned, count));
        let changed = !changes(&solved, tracked).is_empty();
        if !changed
            && best
                .as_ref()
                .is_none_or(|best| inliers(best) < inliers(tracked))
        {
            best = Some(tracked.clone());
        }
        let placed = if round < TRIES {
            register_rejected(scene, options, tracked)?
        } else {
            0
        };
        if !changed && placed == 0 {
            let settled = resolve_aliases(scene, options, tracked)?;
            if settled.moved.is_empty() || round + 1 == ROUNDS {
                rivals = Some(settled.unsure());
                break;
            }
        }
        let runs = Neighbourhood::of_changes(scene, &solved, tracked)?;
        let mut shares = Vec::new();
        for run in &runs {
            shares.push(run.solve(scene, options, 0..=coarsest, tracked)?);
        }
        solved.clone_from(tracked);
        for (run, shares) in runs.iter().zip(&shares) {
            reject_disagreeing_frames(shares, &mut tracked.rejections[run.active.clone()]);
        }
        for run in &runs {
            let pairs = compute_pairwise_ncc(scene, finest, tracked, &run.participants)?;
            let mut found = find_contradictions(&pairs, count);
            // Of those held, some pairs are missing.
            found.retain(|(frame, _)| run.active.contains(frame));
            tracked.reject(found);
        }
        for Neighbourhood {
            active,
            participants,
        } in &runs
        {
            let within = |frames: &Range<usize>, pair: &Alignment| {
                [pair.a, pair.b].map(|k| frames.contains(&k))
            };
            aligned.retain(|pair| {
                within(participants, pair) != [true; 2] && within(active, pair) == [false; 2]
            });
            aligned.extend(align_pairs(scene, finest, tracked, participants)?);
        }
        progress.advance(1);
    }
    progress.finish();
    if let Some(best) = best.filter(|best| inliers(best) > inliers(tracked)) {
        *tracked = best;
        rivals = None;
    }
    match rivals {
        Some(rivals) => Ok(rivals),
        None => resolve_all_aliases(scene, options, tracked),
    }
}

fn inliers(tracked: &FrameStates) -> usize {
    tracked
        .rejections
        .iter()
        .filter(|rejection| rejection.is_none())
        .count()
}
