//! Remaining time of a job of several stages.

use super::duration::duration_text;
use crate::progress::JobStage;
use std::time::Instant;

/// Smallest share of the work that has to be done before the rest is estimated from its time.
const MIN_SHARE: f64 = 0.05;

/// The clock of a job: its stage under way, and the times of what came before.
#[derive(Clone, Copy, Debug)]
pub(super) struct JobClock {
    started: Instant,
    /// Share of the work that was done before this process began, as in a run that is continued.
    first_share: f64,
    entered: Instant,
    stage: JobStage,
}

impl JobClock {
    /// The clock of a job that enters `stage`, after `before` if that is of the same job.
    pub fn enter(before: Option<Self>, stage: JobStage) -> Self {
        let entered = Instant::now();
        // A job that begins again has a lower number.
        match before.filter(|clock| clock.stage.number < stage.number) {
            Some(clock) => Self {
                entered,
                stage,
                ..clock
            },
            None => Self {
                started: entered,
                first_share: stage.done_share,
                entered,
                stage,
            },
        }
    }

    /// Stage and remaining time in words, if `fraction` (0–1) of the stage is done.
    pub fn text(&self, fraction: f64) -> String {
        let before_s = (self.entered - self.started).as_secs_f64();
        let within_s = self.entered.elapsed().as_secs_f64();
        let place = format!("stage {} of {}", self.stage.number, self.stage.of);
        match self.remaining_s(before_s, within_s, fraction) {
            Some(seconds) if seconds < 60.0 => format!("{place}, under 1 min left"),
            Some(seconds) => {
                // Whole minutes, rounded up.
                let seconds = 60.0 * (seconds / 60.0).ceil();
                format!("{place}, about {} left", duration_text(seconds))
            }
            None => place,
        }
    }

    /// Time until the end of the job, seconds, `before_s` after its start and `within_s` after that
    /// of the stage; none as long as too little is done.
    ///
    /// Work that is done before the stage tells the pace: solves end after fewer steps than they
    /// are allowed, so the fraction of the stage tells little. It counts only in the first stages.
    fn remaining_s(&self, before_s: f64, within_s: f64, fraction: f64) -> Option<f64> {
        let JobStage {
            done_share, share, ..
        } = self.stage;
        let before = done_share - self.first_share;
        let later = 1.0 - done_share - share;
        if before >= MIN_SHARE {
            let pace_s = before_s / before;
            return Some(pace_s * later + (pace_s * share - within_s).max(0.0));
        }
        let done = before + fraction * share;
        let pace_s = (before_s + within_s) / done;
        (done >= MIN_SHARE).then_some(pace_s * (later + (1.0 - fraction) * share))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stage(number: usize, done_share: f64, share: f64) -> JobStage {
        JobStage {
            number,
            of: 4,
            done_share,
            share,
        }
    }

    #[test]
    fn the_rest_follows_from_the_time_of_what_is_done() {
        let close = |clock: &JobClock, times: [f64; 3], expected: f64| {
            let rest = clock.remaining_s(times[0], times[1], times[2]).unwrap();
            assert!((rest - expected).abs() < 1e-9, "{rest}");
        };
        let first = JobClock::enter(None, stage(1, 0.0, 0.02));
        assert_eq!(first.remaining_s(0.0, 5.0, 0.9), None);
        // A tenth is done after 10 s.
        let second = JobClock::enter(Some(first), stage(2, 0.02, 0.16));
        close(&second, [2.0, 8.0, 0.5], 90.0);
        // A fifth is done after 20 s: 100 s in all; the stage takes half of them.
        let third = JobClock::enter(Some(second), stage(3, 0.2, 0.5));
        close(&third, [20.0, 0.0, 0.0], 80.0);
        close(&third, [20.0, 40.0, 0.1], 40.0);
        // It takes longer than that.
        close(&third, [20.0, 70.0, 0.1], 30.0);
        assert_eq!(third.text(0.1), "stage 3 of 4, under 1 min left");
    }

    #[test]
    fn a_job_that_is_continued_or_begins_again_is_timed_from_there() {
        let continued = JobClock::enter(None, stage(3, 0.5, 0.3));
        assert_eq!(continued.text(0.0), "stage 3 of 4");
        // A tenth of the work in 10 s.
        let rest = continued.remaining_s(0.0, 10.0, 1.0 / 3.0).unwrap();
        assert!((rest - 40.0).abs() < 1e-9, "{rest}");
        let again = JobClock::enter(Some(continued), stage(1, 0.0, 0.1));
        assert_eq!(again.first_share, 0.0);
        assert_eq!(again.started, again.entered);
    }
}
