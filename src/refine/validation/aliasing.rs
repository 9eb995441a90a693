//! Walls that repeat.
//!
//! Where bricks come as a printed tile, a frame moved by a whole tile shows the same, exactly: no
//! residual, and no comparison of frames can tell. Only the prior can. So at the end each frame is
//! compared with the wall at all gauge motions (turns about the axis, shifts along it) within the
//! prior's reach; where it fits as well as where it is, the likelier of the two is taken, and if
//! the odds are not clear, the frame is ambiguous and both are reported.
//!
//! With errors that add up, what can be wrong by a tile is a step, and with it all frames after it;
//! with independent errors a frame by itself. Where less than half of the frames would be clear,
//! none is: what they are clear against has been settled by the others.
//!
//! A frame may fit where it is and, for all that is seen there, nowhere else, because those that it
//! is compared with are wrong by a tile as well. If the prior would clearly have it a period of the
//! wall away, as others have shown it, it is ambiguous, too.

use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::prior::Prior;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::options::RefineOptions;
use crate::refine::samples::footprints::{FARTHEST, footprints};
use crate::refine::thresholds::correlation_search::MIN_SQUARED_CORRELATION_LEFT;
use crate::refine::tracking::correlation_search::matches;
use crate::refine::tracking::reference_mosaic::{ReferenceMosaic, UnwrappedFrame};
use crate::refine::tracking::registration::{
    LEAST_UNEXPLAINED, MOST_DEVIATION, Neighbours, UNEXPLAINED, near, unexplained,
};
use crate::surface::{Footprint, Gauge, GaugeMotion, free_part};
use crate::trajectory::{JitterModel, Pose};
use nalgebra::Vector2;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Difference of log-posteriors from which on one place is inliers: odds of 1000 to 1.
const CLEAR: f64 = 6.9;
/// Motions closer to none than this are none, samples of the search level.
const APART: f64 = 3.0;
/// Sweeps over all frames until no choice changes, at the most.
const SWEEPS: usize = 20;
/// Motions whose difference is a smaller share of them are the same.
const SAME: f64 = 0.1;
/// Times that all frames are compared with the wall elsewhere, at the most.
const ROUNDS: usize = 8;

/// A frame, and where it might be as well.
pub type AliasHypothesis = (usize, GaugeMotion);

/// What the prior makes of the repeats.
#[derive(Debug, PartialEq)]
struct Choice {
    /// By how much each frame is to be moved.
    motion: Vec<GaugeMotion>,
    /// For each frame how it might be moved from there as well, if that is about as likely.
    rival: Vec<Option<GaugeMotion>>,
}

/// What a choice between repeats rests on; the slices are frame by frame.
struct Evidence<'a> {
    prior: &'a Prior,
    gauge: Gauge,
    /// Which of the prior's frames.
    frames: &'a [usize],
    /// Where they are.
    poses: &'a [Pose],
    /// How each may be moved and fits as well.
    repeats: &'a [Vec<GaugeMotion>],
    /// The motions by which the wall repeats.
    periods: &'a [GaugeMotion],
}

impl Choice {
    /// Where most frames are undecided, so is every other, too: those that a `first` choice, by
    /// clear odds, found in rejection, those that fit elsewhere, and those that fit nowhere else,
    /// perhaps because what they are compared with is a period off as well.
    fn leave_none_clear(
        &mut self,
        first: &Self,
        repeats: &[Vec<GaugeMotion>],
        periods: &[GaugeMotion],
    ) {
        let before = first.rival.iter().zip(repeats);
        for (rival, (before, repeats)) in self.rival.iter_mut().zip(before) {
            let elsewhere = repeats.first().or(periods.first());
            *rival = rival.or(*before).or(elsewhere.copied());
        }
    }
}

/// What has become of frames that fit elsewhere as well.
#[derive(Debug, Default)]
pub struct Settled {
    /// Those that have moved, and how they would go back. They have been compared where they were;
    /// where they are now, the others may tell otherwise.
    pub moved: Vec<AliasHypothesis>,
    /// Those for which the prior does not decide.
    pub undecided: Vec<AliasHypothesis>,
}

impl Settled {
    /// All that nothing decides, if this is where it ends.
    pub fn unsure(self) -> Vec<AliasHypothesis> {
        let Self { moved, undecided } = self;
        let mut unsure: BTreeMap<usize, GaugeMotion> = moved.into_iter().collect();
        unsure.extend(undecided);
        unsure.into_iter().collect()
    }
}

/// Moves the frames that fit elsewhere as well to where the prior has them, until none moves any
/// more.
///
/// Returns those of which it is not known where they belong.
///
/// # Errors
/// [`ProblemError`].
pub fn resolve_all_aliases(
    scene: &EstimationContext,
    options: &RefineOptions,
    tracked: &mut FrameStates,
) -> Result<Vec<AliasHypothesis>, ProblemError> {
    let mut settled = resolve_aliases(scene, options, tracked)?;
    for _ in 1..ROUNDS {
        if settled.moved.is_empty() {
            break;
        }
        settled = resolve_aliases(scene, options, tracked)?;
    }
    Ok(settled.unsure())
}

/// Moves the frames that fit elsewhere as well to where the prior has them.
///
/// # Errors
/// [`ProblemError`].
pub fn resolve_aliases(
    scene: &EstimationContext,
    options: &RefineOptions,
    tracked: &mut FrameStates,
) -> Result<Settled, ProblemError> {
    let all = 0..tracked.estimates.len();
    let inliers = tracked.inliers(&all);
    let frames: Vec<usize> = all.filter(|k| inliers[*k]).collect();
    let footprints = footprints(scene, tracked)?;
    let repeats = frames
        .par_iter()
        .map(|k| repeats_of(scene, options, *k, tracked, &footprints))
        .collect::<Result<Vec<_>, _>>()?;
    if repeats.iter().all(Vec::is_empty) {
        return Ok(Settled::default());
    }
    let poses: Vec<Pose> = frames.iter().map(|k| tracked.estimates[*k].pose).collect();
    let radius_m = scene.surface.perimeter_m() / std::f64::consts::TAU;
    let evidence = Evidence {
        prior: scene.prior,
        gauge: scene.surface.gauge(),
        frames: &frames,
        poses: &poses,
        repeats: &repeats,
        periods: &periods(&repeats, radius_m),
    };
    let mut choice = evidence.choose(CLEAR);
    let undecided = choice.rival.iter().flatten().count();
    if 2 * undecided > frames.len() {
        let first = std::mem::replace(&mut choice, evidence.choose(f64::INFINITY));
        choice.leave_none_clear(&first, &repeats, evidence.periods);
    }
    let mut moved = Vec::new();
    for (k, motion) in frames.iter().zip(&choice.motion) {
        if !motion.is_none() {
            let pose = &mut tracked.estimates[*k].pose;
            *pose = motion.apply(pose);
            moved.push((*k, motion.reversed()));
        }
    }
    let rivals = frames.iter().zip(choice.rival);
    Ok(Settled {
        moved,
        undecided: rivals.filter_map(|(k, rival)| Some((*k, rival?))).collect(),
    })
}

/// The gauge motions after which frame `frame` matches what the others show as well as it does now.
fn repeats_of(
    scene: &EstimationContext,
    options: &RefineOptions,
    frame: usize,
    tracked: &FrameStates,
    footprints: &[Footprint],
) -> Result<Vec<GaugeMotion>, ProblemError> {
    let side = scene.camera.shorter_side();
    let level = options
        .handover_level(side)
        .max(options.coarsest_level(side).saturating_sub(1));
    let camera = scene.camera.at_level(level);
    let run = frame.saturating_sub(FARTHEST)..(frame + FARTHEST).min(tracked.estimates.len());
    let mut placed = tracked.inliers(&run);
    placed[frame - run.start] = false;
    let neighbours = Neighbours {
        estimates: &tracked.estimates[run.clone()],
        placed: &placed,
        footprints: &footprints[run.clone()],
        run: run.clone(),
    };
    let pose = tracked.estimates[frame].pose;
    let radius_m = scene.surface.perimeter_m() / std::f64::consts::TAU;
    let jitter = &scene.prior.jitter;
    let farthest = (2.0 * MOST_DEVIATION).sqrt();
    let reach_m = [
        (farthest * jitter.rotation_sigma_rad).min(std::f64::consts::PI) * radius_m,
        (farthest * jitter.translation_sigma_m[1]).min(std::f64::consts::PI * radius_m),
    ];
    let margin = reach_m[0].max(reach_m[1]);
    let near = near(scene, frame, &pose, margin, &neighbours)?;
    let mut unwrapped_frames = Vec::new();
    for (k, _) in near.iter().enumerate().filter(|(_, near)| **near) {
        let sweep = neighbours.sweep(scene, neighbours.run.start + k);
        let unwrapped = UnwrappedFrame::new(scene, level, neighbours.run.start + k, &sweep)?;
        unwrapped_frames.push((unwrapped, neighbours.estimates[k]));
    }
    if unwrapped_frames.is_empty() {
        return Ok(Vec::new());
    }
    let sweep = neighbours.sweep(scene, frame);
    let unwrapped = UnwrappedFrame::new(scene, level, frame, &sweep)?;
    let wall = ReferenceMosaic::new(scene, &unwrapped_frames, &camera, (frame, &pose), margin)?;
    let ncc_score = |pose: &Pose| wall.ncc_score(scene, &unwrapped, pose);
    let left = |pose: &Pose| unexplained(&ncc_score(pose), &unwrapped);
    let at_home = ncc_score(&pose);
    let Some(here) = unexplained(&at_home, &unwrapped) else {
        return Ok(Vec::new());
    };
    let most = most_unexplained(here);
    let motion = |shift_m: [f64; 2]| free_part(scene.surface, &pose, &shift_m.into());
    let moved = |shift_m: [f64; 2]| motion(shift_m).1.apply(&pose);
    let spacing = wall.lattice.spacing_m;
    let mut found = Vec::new();
    // Of the correlation as it is, noise and all.
    let least = MIN_SQUARED_CORRELATION_LEFT * (1.0 - most).max(0.0) * at_home.texture().powi(2);
    for shift_m in matches(&wall, &unwrapped, &pose, reach_m, least) {
        // Where the shape forbids a motion, no repeat leads there.
        let (made_m, _) = motion(shift_m);
        let missed_m = (made_m - Vector2::from(shift_m)).norm();
        if shift_m[0].hypot(shift_m[1]) < APART * spacing || missed_m > APART * spacing {
            continue;
        }
        // To a fraction of a sample: the best of ever closer neighbours.
        let mut best = (left(&moved(shift_m)), shift_m);
        let mut step = 0.5 * spacing;
        for _ in 0..4 {
            let [s_m, h_m] = best.1;
            for (ds, dh) in [(-1.0, 0.0), (1.0, 0.0), (0.0, -1.0), (0.0, 1.0)] {
                let shift_m = [s_m + ds * step, h_m + dh * step];
                let there = left(&moved(shift_m));
                if there.is_some_and(|there| best.0.is_none_or(|best| there < best)) {
                    best = (there, shift_m);
                }
            }
            step *= 0.5;
        }
        let (made_m, motion) = motion(best.1);
        if best.0.is_some_and(|there| there < most) && made_m.norm() >= APART * spacing {
            found.push(motion);
        }
    }
    Ok(found)
}

/// What a place may leave unexplained, as a share of the contrast, to fit as well as one that
/// leaves `here`.
///
/// By odds: (1 − u)/u no less than half of what it is here. Where little is explained here, a place
/// that explains nothing is no rival, though it leaves less than twice as much.
fn most_unexplained(here: f64) -> f64 {
    let here = here.max(LEAST_UNEXPLAINED);
    UNEXPLAINED * here / (1.0 + (UNEXPLAINED - 1.0) * here)
}

/// The motions by which the wall repeats: those of all frames and their opposites, without those
/// nearly the same.
fn periods(repeats: &[Vec<GaugeMotion>], radius_m: f64) -> Vec<GaugeMotion> {
    let length = |motion: &GaugeMotion| (radius_m * motion.turn_rad).hypot(motion.shift_m);
    let mut found: Vec<GaugeMotion> = Vec::new();
    for there in repeats.iter().flatten() {
        for motion in [*there, there.reversed()] {
            let same =
                |other: &GaugeMotion| length(&motion.plus(-1.0, other)) < SAME * length(other);
            if !found.iter().any(same) {
                found.push(motion);
            }
        }
    }
    found
}

/// The likeliest of some motions, and the second if it is less likely by no more than `clear`; or
/// one of the wall's `periods`, if it is likelier by more than that.
fn likeliest(
    motions: &[GaugeMotion],
    periods: &[GaugeMotion],
    clear: f64,
    cost: impl Fn(&GaugeMotion) -> f64,
) -> (GaugeMotion, Option<GaugeMotion>) {
    let none = GaugeMotion::default();
    let mut ranked: Vec<(f64, GaugeMotion)> = std::iter::once(&none)
        .chain(motions)
        .map(|motion| (cost(motion), *motion))
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (best_cost, best) = ranked[0];
    let second = ranked.get(1).filter(|second| second.0 - best_cost < clear);
    let elsewhere = || {
        let costs = periods.iter().map(|period| (cost(period), *period));
        let likelier = costs.min_by(|a, b| a.0.total_cmp(&b.0));
        likelier.filter(|(cost, _)| best_cost - cost > clear)
    };
    let rival = second.copied().or_else(elsewhere);
    (best, rival.map(|(_, motion)| motion))
}

impl Evidence<'_> {
    /// What the prior makes of the repeats, where odds are clear from `clear` on.
    fn choose(&self, clear: f64) -> Choice {
        match self.prior.jitter.model {
            JitterModel::RandomWalk => self.by_steps(clear),
            JitterModel::Independent => self.by_frames(clear),
        }
    }

    /// Errors that add up: step by step. Of the runs of frames between undecided steps, the longest
    /// is inliers.
    fn by_steps(&self, clear: f64) -> Choice {
        let count = self.frames.len();
        let mut motion = vec![GaugeMotion::default(); count];
        // How all frames from here on might be moved as well.
        let mut step = vec![None; count];
        for i in 1..count {
            let before = motion[i - 1];
            let (from, to) = (self.frames[i - 1], self.frames[i]);
            let expected = self
                .prior
                .predict(from, &before.apply(&self.poses[i - 1]), to);
            let steps = self.prior.steps_between(from, to);
            let cost = |own: &GaugeMotion| {
                self.prior
                    .deviation_cost(&expected, &before.plus(1.0, own).apply(&self.poses[i]))
                    / steps
            };
            let (best, second) = likeliest(&self.repeats[i], self.periods, clear, cost);
            motion[i] = before.plus(1.0, &best);
            step[i] = second.map(|second| second.plus(-1.0, &best));
        }
        let cuts: Vec<usize> = (1..count).filter(|i| step[*i].is_some()).collect();
        let starts = std::iter::once(0).chain(cuts.iter().copied());
        let ends = cuts.iter().copied().chain([count]);
        let longest = starts
            .zip(ends)
            .max_by_key(|(start, end)| (end - start, std::cmp::Reverse(*start)));
        let (start, end) = longest.unwrap_or((0, count));
        let rival = (0..count)
            .map(|i| {
                if i >= end {
                    step[end]
                } else if i < start {
                    step[start].map(|step| step.reversed())
                } else {
                    None
                }
            })
            .collect();
        Choice { motion, rival }
    }

    /// Independent errors: frame by frame, against the gauge that all have taken on, until nothing
    /// changes.
    fn by_frames(&self, clear: f64) -> Choice {
        let initial: Vec<Pose> = self.frames.iter().map(|k| self.prior.initial[*k]).collect();
        let mut choice = Choice {
            motion: vec![GaugeMotion::default(); self.frames.len()],
            rival: vec![None; self.frames.len()],
        };
        for _ in 0..SWEEPS {
            let moved: Vec<Pose> = choice
                .motion
                .iter()
                .zip(self.poses)
                .map(|(m, p)| m.apply(p))
                .collect();
            let settled = self.gauge.align(&initial, &moved);
            let mut next = Choice {
                motion: Vec::new(),
                rival: Vec::new(),
            };
            for (i, initial) in initial.iter().enumerate() {
                let expected = settled.apply(initial);
                let cost = |own: &GaugeMotion| {
                    self.prior
                        .deviation_cost(&expected, &own.apply(&self.poses[i]))
                };
                let (best, second) = likeliest(&self.repeats[i], self.periods, clear, cost);
                next.motion.push(best);
                next.rival
                    .push(second.map(|second| second.plus(-1.0, &best)));
            }
            let same = next.motion == choice.motion;
            choice = next;
            if same {
                break;
            }
        }
        choice
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::{Jitter, spiral};

    /// A tile on.
    fn tile() -> GaugeMotion {
        GaugeMotion::about_y(0.0, 0.45)
    }

    fn prior(model: JitterModel, shift_sigma_m: f64) -> Prior {
        Prior {
            jitter: Jitter {
                model,
                rotation_sigma_rad: 0.05,
                translation_sigma_m: [0.02, shift_sigma_m, 0.02],
            },
            initial: spiral(12, 0.1, 30f64.to_radians()),
            times_s: (0..12).map(f64::from).collect(),
            usual_step_s: 1.0,
            log_gain_sigma: 0.3,
            bias_sigma: 10.0,
        }
    }

    /// Every frame fits a tile on and a tile back.
    fn choose_of_all(prior: &Prior, poses: &[Pose]) -> Choice {
        choose_of(
            prior,
            poses,
            &vec![vec![tile(), tile().reversed()]; poses.len()],
        )
    }

    fn choose_of(prior: &Prior, poses: &[Pose], repeats: &[Vec<GaugeMotion>]) -> Choice {
        let frames: Vec<usize> = (0..poses.len()).collect();
        let evidence = Evidence {
            prior,
            gauge: Gauge::round(),
            frames: &frames,
            poses,
            repeats,
            periods: &periods(repeats, 3.0),
        };
        evidence.choose(CLEAR)
    }

    #[test]
    fn what_fits_as_well_has_half_the_odds() {
        let odds = |unexplained: f64| (1.0 - unexplained) / unexplained;
        for here in [0.05, 0.3, 0.9, 0.99] {
            let ratio = odds(most_unexplained(here)) / odds(here);
            assert!((ratio - 1.0 / UNEXPLAINED).abs() < 1e-9, "{here}: {ratio}");
        }
        // Of a perfect match, places that differ by noise alone are no worse.
        assert_eq!(most_unexplained(0.0), most_unexplained(LEAST_UNEXPLAINED));
        assert!(most_unexplained(0.99) < 1.0);
    }

    #[test]
    fn periods_are_counted_once() {
        let near = GaugeMotion::about_y(0.001, 0.46);
        let turn = GaugeMotion::about_y(0.6, 0.0);
        let found = periods(
            &[vec![tile(), turn], vec![], vec![near, tile().reversed()]],
            3.0,
        );
        assert_eq!(found, [tile(), tile().reversed(), turn, turn.reversed()]);
    }

    /// Those that a frame was compared with are a tile off, too, so it fits nowhere else; others
    /// have shown that the wall repeats.
    #[test]
    fn what_the_prior_would_have_a_period_away_is_ambiguous() {
        for model in [JitterModel::RandomWalk, JitterModel::Independent] {
            let prior = prior(model, 0.03);
            let mut poses = prior.initial.clone();
            poses[8] = tile().apply(&poses[8]);
            let mut repeats = vec![Vec::new(); poses.len()];
            let choice = choose_of(&prior, &poses, &repeats);
            assert!(choice.rival.iter().all(Option::is_none));
            repeats[2] = vec![tile()];
            let choice = choose_of(&prior, &poses, &repeats);
            assert_eq!(choice.rival[8], Some(tile().reversed()), "{model:?}");
            assert_eq!(choice.rival[4], None);
            assert!(choice.motion.iter().all(GaugeMotion::is_none));
        }
    }

    /// What is in rejection by clear odds is so, too, where no odds are clear enough.
    #[test]
    fn no_frame_is_clear_because_others_are_not() {
        let (none, other) = (GaugeMotion::default(), tile().reversed());
        let choice = |rival: [Option<GaugeMotion>; 4]| Choice {
            motion: vec![none; 4],
            rival: rival.to_vec(),
        };
        let first = choice([Some(tile()), Some(other), None, None]);
        let mut last = choice([Some(tile()), None, None, None]);
        let repeats = [vec![], vec![], vec![other], vec![]];
        last.leave_none_clear(&first, &repeats, &[tile()]);
        let expected = [Some(tile()), Some(other), Some(other), Some(tile())];
        assert_eq!(last.rival, expected);
    }

    #[test]
    fn frames_beyond_a_wrong_step_are_moved_back_by_a_tile() {
        let prior = prior(JitterModel::RandomWalk, 0.03);
        let mut poses = prior.initial.clone();
        poses[7..]
            .iter_mut()
            .for_each(|pose| *pose = tile().apply(pose));
        let choice = choose_of_all(&prior, &poses);
        assert!(choice.rival.iter().all(Option::is_none));
        for (k, motion) in choice.motion.iter().enumerate() {
            let expected = if k < 7 { 0.0 } else { -0.45 };
            assert!((motion.shift_m - expected).abs() < 1e-12, "{k}: {motion:?}");
        }
    }

    #[test]
    fn a_single_wrong_frame_is_moved_back_by_a_tile() {
        let prior = prior(JitterModel::Independent, 0.03);
        let mut poses = prior.initial.clone();
        poses[7] = tile().apply(&poses[7]);
        let choice = choose_of_all(&prior, &poses);
        assert!(choice.rival.iter().all(Option::is_none));
        assert_eq!(choice.motion[7], tile().reversed());
        assert_eq!(choice.motion[6], GaugeMotion::default());
    }

    /// Of frames that have moved last, nobody has asked the others since.
    #[test]
    fn what_has_moved_last_is_unsure() {
        let settled = Settled {
            moved: vec![(3, tile()), (7, tile())],
            undecided: vec![(7, tile().reversed()), (9, tile())],
        };
        assert_eq!(
            settled.unsure(),
            [(3, tile()), (7, tile().reversed()), (9, tile())]
        );
    }

    /// Half a tile off with σ of a quarter: the prior cannot tell.
    #[test]
    fn what_the_prior_cannot_tell_is_ambiguous() {
        let model = JitterModel::Independent;
        let half = GaugeMotion::about_y(0.0, 0.2);
        let walk = prior(JitterModel::RandomWalk, 0.1);
        let mut poses = walk.initial.clone();
        poses[8..]
            .iter_mut()
            .for_each(|pose| *pose = half.apply(pose));
        let choice = choose_of_all(&walk, &poses);
        for (k, rival) in choice.rival.iter().enumerate() {
            assert_eq!(rival.is_some(), k >= 8, "{k}");
        }
        assert_eq!(choice.rival[9], Some(tile().reversed()));
        let independent = prior(model, 0.1);
        let mut poses = independent.initial.clone();
        poses[8] = half.apply(&poses[8]);
        let choice = choose_of_all(&independent, &poses);
        for (k, rival) in choice.rival.iter().enumerate() {
            assert_eq!(rival.is_some(), k == 8, "{k}");
        }
    }
}
