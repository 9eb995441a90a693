//! Taking apart what does not hold, and putting it together again.
//!
//! A wrong frame bends those it is compared with, and a bent wall makes the next frame's place
//! wrong. Gauss–Newton at full size cannot undo it: many pixels off, it has nothing to follow. So
//! when frames are found wrong, they are taken out, the others are solved again from the coarsest
//! level, and the frames in doubt are placed once more on the wall as it is then.

use crate::progress::Progress;
use crate::refine::model::context::Scene;
use crate::refine::model::frame_states::Tracked;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::Doubt;
use crate::refine::options::RefineOptions;
use crate::refine::pipeline::disagreements;
use crate::refine::solver::neighbourhood::{Neighbourhood, changes};
use crate::refine::tracking::track::retry;
use crate::refine::validation::aliasing::{Rival, settle_all_repeats, settle_repeats};
use crate::refine::validation::inconsistent_frames::unsupported;
use crate::refine::validation::pairwise_lucas_kanade::{Alignment, alignments};
use crate::refine::validation::pairwise_ncc::{compare_pairs, contradictions};
use std::ops::Range;

/// Times that frames in doubt are placed once more.
const TRIES: usize = 3;
/// Times that frames are taken out, at the most.
const ROUNDS: usize = 8;

/// Takes out the frames that the others do not bear out, places them again, and solves their
/// neighbourhood, until nothing changes. `solved`: the survey as the last solve left it.
///
/// Returns the frames that the wall's repeats leave undecided.
///
/// A round after which fewer frames are believed than before any is undone.
///
/// # Errors
/// [`ProblemError`].
pub fn repair(
    scene: &Scene,
    options: &RefineOptions,
    tracked: &mut Tracked,
    mut solved: Tracked,
    progress: &dyn Progress,
) -> Result<Vec<Rival>, ProblemError> {
    let side = scene.camera.shorter_side();
    let count = tracked.estimates.len();
    let (coarsest, finest) = (options.coarsest_level(side), options.handover_level(side));
    progress.start("repair", ROUNDS);
    let mut aligned = alignments(scene, finest, tracked, &(0..count))?;
    let mut best: Option<Tracked> = None;
    // Known for the poses as they are.
    let mut rivals = None;
    for round in 0..ROUNDS {
        aligned.retain(|pair| {
            [pair.a, pair.b]
                .iter()
                .all(|k| tracked.doubts[*k].is_none())
        });
        take_out(unsupported(&aligned, count), tracked);
        let changed = !changes(&solved, tracked).is_empty();
        if !changed
            && best
                .as_ref()
                .is_none_or(|best| believed(best) < believed(tracked))
        {
            best = Some(tracked.clone());
        }
        let placed = if round < TRIES {
            retry(scene, options, tracked)?
        } else {
            0
        };
        if !changed && placed == 0 {
            let settled = settle_repeats(scene, options, tracked)?;
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
            disagreements(shares, &mut tracked.doubts[run.active.clone()]);
        }
        for run in &runs {
            let pairs = compare_pairs(scene, finest, tracked, &run.participants)?;
            let mut found = contradictions(&pairs, count);
            // Of those held, some pairs are missing.
            found.retain(|(frame, _)| run.active.contains(frame));
            take_out(found, tracked);
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
            aligned.extend(alignments(scene, finest, tracked, participants)?);
        }
        progress.advance(1);
    }
    progress.finish();
    if let Some(best) = best.filter(|best| believed(best) > believed(tracked)) {
        *tracked = best;
        rivals = None;
    }
    match rivals {
        Some(rivals) => Ok(rivals),
        None => settle_all_repeats(scene, options, tracked),
    }
}

fn believed(tracked: &Tracked) -> usize {
    tracked
        .doubts
        .iter()
        .filter(|doubt| doubt.is_none())
        .count()
}

/// Doubts the frames found wrong.
fn take_out(found: Vec<(usize, Doubt)>, tracked: &mut Tracked) {
    for (frame, doubt) in found {
        tracked.doubts[frame] = Some(doubt);
    }
}
