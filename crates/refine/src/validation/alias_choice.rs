//! Choice between aliases by the prior.
//!
//! With errors that accumulate, a step can be wrong by a period of the wall, and with it all frames
//! after it; with independent errors, each frame by itself. Where less than half of the frames
//! would be decided, none is: the others are what they are decided against.
//!
//! A frame may match the wall at its present pose and, for all that is seen there, nowhere else,
//! because the frames that it is compared with are wrong by a period as well. If the prior would
//! clearly have it a period away, as other frames have shown it, it is ambiguous, too.

use crate::model::prior::Prior;
use crate::thresholds::aliasing::{MAX_ITERATIONS, MAX_PERIOD_DIFFERENCE};
use tunnelstitch_geometry::surface::{Gauge, GaugeMotion};
use tunnelstitch_geometry::trajectory::{JitterModel, Pose};

/// The prior's choice between aliases, frame by frame.
#[derive(Debug, PartialEq)]
pub struct AliasChoice {
    /// The motion of each frame.
    pub motions: Vec<GaugeMotion>,
    /// The motion from there to an alias that is about as likely, if there is one.
    pub aliases: Vec<Option<GaugeMotion>>,
}

/// The evidence for a choice between aliases; the slices are frame by frame.
pub struct Evidence<'a> {
    /// The prior of the poses.
    pub prior: &'a Prior,
    /// The gauge freedoms of the tunnel.
    pub gauge: Gauge,
    /// The frames' indices.
    pub frames: &'a [usize],
    /// Their present poses.
    pub poses: &'a [Pose],
    /// The motions to their aliases.
    pub alias_motions: &'a [Vec<GaugeMotion>],
    /// The periods of the wall.
    pub periods: &'a [GaugeMotion],
}

impl AliasChoice {
    /// Marks every frame as undecided that has an alias by this choice, by a `first` one or by its
    /// alias motions, or that may be a period of the wall away.
    ///
    /// This is for walls where most frames are undecided: the others may be wrong by a period as
    /// well.
    pub fn mark_all_undecided(
        &mut self,
        first: &Self,
        alias_motions: &[Vec<GaugeMotion>],
        periods: &[GaugeMotion],
    ) {
        let before = first.aliases.iter().zip(alias_motions);
        for (alias, (before, motions)) in self.aliases.iter_mut().zip(before) {
            let elsewhere = motions.first().or(periods.first());
            *alias = alias.or(*before).or(elsewhere.copied());
        }
    }
}

/// Finds the periods of the wall: the alias motions of all frames and their opposites, without
/// those that are nearly the same.
pub fn find_periods(alias_motions: &[Vec<GaugeMotion>], radius_m: f64) -> Vec<GaugeMotion> {
    let length = |motion: &GaugeMotion| (radius_m * motion.turn_rad).hypot(motion.shift_m);
    let mut found: Vec<GaugeMotion> = Vec::new();
    for alias in alias_motions.iter().flatten() {
        for motion in [*alias, alias.reversed()] {
            let is_same = |other: &GaugeMotion| {
                length(&motion.plus(-1.0, other)) < MAX_PERIOD_DIFFERENCE * length(other)
            };
            if !found.iter().any(is_same) {
                found.push(motion);
            }
        }
    }
    found
}

/// Chooses the likeliest of some motions and no motion. Returns with it the second one if it is
/// less likely by no more than `min_odds`; or else one of the wall's `periods` if it is likelier by
/// more than that.
fn choose_likeliest(
    motions: &[GaugeMotion],
    periods: &[GaugeMotion],
    min_odds: f64,
    cost: impl Fn(&GaugeMotion) -> f64,
) -> (GaugeMotion, Option<GaugeMotion>) {
    let none = GaugeMotion::default();
    let mut ranked: Vec<(f64, GaugeMotion)> = std::iter::once(&none)
        .chain(motions)
        .map(|motion| (cost(motion), *motion))
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (best_cost, best) = ranked[0];
    let second = ranked
        .get(1)
        .filter(|second| second.0 - best_cost < min_odds);
    let elsewhere = || {
        let costs = periods.iter().map(|period| (cost(period), *period));
        let likelier = costs.min_by(|a, b| a.0.total_cmp(&b.0));
        likelier.filter(|(cost, _)| best_cost - cost > min_odds)
    };
    let alias = second.copied().or_else(elsewhere);
    (best, alias.map(|(_, motion)| motion))
}

impl Evidence<'_> {
    /// Chooses between the aliases by the prior; odds below `min_odds`, nats, leave a frame
    /// undecided.
    pub fn choose(&self, min_odds: f64) -> AliasChoice {
        match self.prior.jitter.model {
            JitterModel::RandomWalk => self.choose_by_steps(min_odds),
            JitterModel::Independent => self.choose_by_frames(min_odds),
        }
    }

    /// Chooses step by step, for errors that accumulate. The longest sequence of frames between two
    /// undecided steps is decided, the others are not.
    fn choose_by_steps(&self, min_odds: f64) -> AliasChoice {
        let count = self.frames.len();
        let mut motions = vec![GaugeMotion::default(); count];
        // The motion of all frames from here on to an alias.
        let mut step = vec![None; count];
        for i in 1..count {
            let before = motions[i - 1];
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
            let (best, second) =
                choose_likeliest(&self.alias_motions[i], self.periods, min_odds, cost);
            motions[i] = before.plus(1.0, &best);
            step[i] = second.map(|second| second.plus(-1.0, &best));
        }
        let cuts: Vec<usize> = (1..count).filter(|i| step[*i].is_some()).collect();
        let starts = std::iter::once(0).chain(cuts.iter().copied());
        let ends = cuts.iter().copied().chain([count]);
        let longest = starts
            .zip(ends)
            .max_by_key(|(start, end)| (end - start, std::cmp::Reverse(*start)));
        let (start, end) = longest.unwrap_or((0, count));
        let aliases = (0..count)
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
        AliasChoice { motions, aliases }
    }

    /// Chooses frame by frame, for independent errors, against the gauge motion that all frames
    /// have taken on, until nothing changes.
    fn choose_by_frames(&self, min_odds: f64) -> AliasChoice {
        let initial: Vec<Pose> = self.frames.iter().map(|k| self.prior.initial[*k]).collect();
        let mut choice = AliasChoice {
            motions: vec![GaugeMotion::default(); self.frames.len()],
            aliases: vec![None; self.frames.len()],
        };
        for _ in 0..MAX_ITERATIONS {
            let moved: Vec<Pose> = choice
                .motions
                .iter()
                .zip(self.poses)
                .map(|(m, p)| m.apply(p))
                .collect();
            let gauge_motion = self.gauge.align(&initial, &moved);
            let mut next = AliasChoice {
                motions: Vec::new(),
                aliases: Vec::new(),
            };
            for (i, initial) in initial.iter().enumerate() {
                let expected = gauge_motion.apply(initial);
                let variance_ratio = self.prior.variance_ratios[self.frames[i]];
                let cost = |own: &GaugeMotion| {
                    self.prior
                        .deviation_cost(&expected, &own.apply(&self.poses[i]))
                        / variance_ratio
                };
                let (best, second) =
                    choose_likeliest(&self.alias_motions[i], self.periods, min_odds, cost);
                next.motions.push(best);
                next.aliases
                    .push(second.map(|second| second.plus(-1.0, &best)));
            }
            let is_settled = next.motions == choice.motions;
            choice = next;
            if is_settled {
                break;
            }
        }
        choice
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::{Jitter, spiral};

    /// Odds of 1000 to 1, nats.
    const MIN_ODDS: f64 = 6.9;

    /// A period of the wall along the tunnel.
    fn period() -> GaugeMotion {
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
            median_step_s: 1.0,
            variance_ratios: vec![1.0; 12],
            rig: None,
            log_gain_sigma: 0.3,
            bias_sigma: 10.0,
        }
    }

    /// The choice where every frame has an alias a period ahead and one a period back.
    fn choose_of_all(prior: &Prior, poses: &[Pose]) -> AliasChoice {
        choose_of(
            prior,
            poses,
            &vec![vec![period(), period().reversed()]; poses.len()],
        )
    }

    fn choose_of(prior: &Prior, poses: &[Pose], alias_motions: &[Vec<GaugeMotion>]) -> AliasChoice {
        let frames: Vec<usize> = (0..poses.len()).collect();
        let evidence = Evidence {
            prior,
            gauge: Gauge::round(),
            frames: &frames,
            poses,
            alias_motions,
            periods: &find_periods(alias_motions, 3.0),
        };
        evidence.choose(MIN_ODDS)
    }

    #[test]
    fn periods_are_found_once() {
        let near = GaugeMotion::about_y(0.001, 0.46);
        let turn = GaugeMotion::about_y(0.6, 0.0);
        let found = find_periods(
            &[
                vec![period(), turn],
                vec![],
                vec![near, period().reversed()],
            ],
            3.0,
        );
        assert_eq!(
            found,
            [period(), period().reversed(), turn, turn.reversed()]
        );
    }

    /// The frames that a frame was compared with are a period off, too, so it matches nowhere else;
    /// but others have shown the period.
    #[test]
    fn frame_a_period_off_by_the_prior_is_ambiguous() {
        for model in [JitterModel::RandomWalk, JitterModel::Independent] {
            let prior = prior(model, 0.03);
            let mut poses = prior.initial.clone();
            poses[8] = period().apply(&poses[8]);
            let mut alias_motions = vec![Vec::new(); poses.len()];
            let choice = choose_of(&prior, &poses, &alias_motions);
            assert!(choice.aliases.iter().all(Option::is_none));
            alias_motions[2] = vec![period()];
            let choice = choose_of(&prior, &poses, &alias_motions);
            assert_eq!(choice.aliases[8], Some(period().reversed()), "{model:?}");
            assert_eq!(choice.aliases[4], None);
            assert!(choice.motions.iter().all(GaugeMotion::is_none));
        }
    }

    /// Frames that are undecided by clear odds are so, too, where no odds are clear enough.
    #[test]
    fn no_frame_is_decided_where_others_are_not() {
        let (none, other) = (GaugeMotion::default(), period().reversed());
        let choice = |aliases: [Option<GaugeMotion>; 4]| AliasChoice {
            motions: vec![none; 4],
            aliases: aliases.to_vec(),
        };
        let first = choice([Some(period()), Some(other), None, None]);
        let mut last = choice([Some(period()), None, None, None]);
        let alias_motions = [vec![], vec![], vec![other], vec![]];
        last.mark_all_undecided(&first, &alias_motions, &[period()]);
        let expected = [Some(period()), Some(other), Some(other), Some(period())];
        assert_eq!(last.aliases, expected);
    }

    #[test]
    fn frames_after_a_wrong_step_are_moved_back_by_a_period() {
        let prior = prior(JitterModel::RandomWalk, 0.03);
        let mut poses = prior.initial.clone();
        poses[7..]
            .iter_mut()
            .for_each(|pose| *pose = period().apply(pose));
        let choice = choose_of_all(&prior, &poses);
        assert!(choice.aliases.iter().all(Option::is_none));
        for (k, motion) in choice.motions.iter().enumerate() {
            let expected = if k < 7 { 0.0 } else { -0.45 };
            assert!((motion.shift_m - expected).abs() < 1e-12, "{k}: {motion:?}");
        }
    }

    #[test]
    fn single_wrong_frame_is_moved_back_by_a_period() {
        let prior = prior(JitterModel::Independent, 0.03);
        let mut poses = prior.initial.clone();
        poses[7] = period().apply(&poses[7]);
        let choice = choose_of_all(&prior, &poses);
        assert!(choice.aliases.iter().all(Option::is_none));
        assert_eq!(choice.motions[7], period().reversed());
        assert_eq!(choice.motions[6], GaugeMotion::default());
    }

    /// Half a period off with σ of a quarter: the prior cannot tell.
    #[test]
    fn frame_is_ambiguous_where_the_prior_cannot_tell() {
        let model = JitterModel::Independent;
        let half = GaugeMotion::about_y(0.0, 0.2);
        let walk = prior(JitterModel::RandomWalk, 0.1);
        let mut poses = walk.initial.clone();
        poses[8..]
            .iter_mut()
            .for_each(|pose| *pose = half.apply(pose));
        let choice = choose_of_all(&walk, &poses);
        for (k, alias) in choice.aliases.iter().enumerate() {
            assert_eq!(alias.is_some(), k >= 8, "{k}");
        }
        assert_eq!(choice.aliases[9], Some(period().reversed()));
        let independent = prior(model, 0.1);
        let mut poses = independent.initial.clone();
        poses[8] = half.apply(&poses[8]);
        let choice = choose_of_all(&independent, &poses);
        for (k, alias) in choice.aliases.iter().enumerate() {
            assert_eq!(alias.is_some(), k == 8, "{k}");
        }
    }
}
