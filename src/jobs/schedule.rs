//! The order in which the tasks of a job run on one machine.

use super::job::{Job, TriggerRule};

/// Processors and memory of a machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Machine {
    /// Processors.
    pub cores: usize,
    /// Memory that is free, bytes; None if the system does not tell.
    pub memory_bytes: Option<u64>,
}

/// The state of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    Waiting,
    Running,
    Done,
    /// It failed, or comes after one that did.
    Lost,
}

/// The tasks that wait, run and are done.
pub struct Schedule<'j> {
    job: &'j Job,
    machine: Machine,
    /// Places of the tasks that each task comes after.
    before: Vec<Vec<usize>>,
    /// Expected time from the start of each task to the end of the job, if nothing else had to run,
    /// seconds: its critical path.
    path_s: Vec<f64>,
    states: Vec<State>,
}

impl<'j> Schedule<'j> {
    /// All tasks wait, but those that are done.
    pub fn new(job: &'j Job, machine: Machine, is_done: &[bool]) -> Self {
        let places = job.places();
        let before = job.tasks.iter().map(|task| {
            // A job is read only if these stand before the task.
            let after = task.after.iter();
            after.map(|id| places[id.as_str()]).collect()
        });
        let before: Vec<Vec<usize>> = before.collect();
        let mut path_s = vec![0.0f64; job.tasks.len()];
        for (k, task) in job.tasks.iter().enumerate().rev() {
            path_s[k] += task.needs.seconds;
            for earlier in &before[k] {
                path_s[*earlier] = path_s[*earlier].max(path_s[k]);
            }
        }
        let states = is_done.iter().map(|is_done| match is_done {
            true => State::Done,
            false => State::Waiting,
        });
        Self {
            job,
            machine,
            before,
            path_s,
            states: states.collect(),
        }
    }

    /// Starts the task with the longest critical path among those that are ready and fit beside
    /// what runs; None if there is none. One that needs more than the machine has runs alone.
    pub fn start_next(&mut self) -> Option<usize> {
        let ready = (0..self.states.len()).filter(|k| self.is_ready(*k) && self.fits(*k));
        let next = ready.max_by(|a, b| {
            let by_path = self.path_s[*a].total_cmp(&self.path_s[*b]);
            by_path.then(b.cmp(a))
        })?;
        self.states[next] = State::Running;
        Some(next)
    }

    /// Reports the end of a task. Returns the tasks that come after it and are lost if it failed.
    pub fn end(&mut self, task: usize, is_good: bool) -> Vec<usize> {
        self.states[task] = if is_good { State::Done } else { State::Lost };
        let mut lost = Vec::new();
        for k in task + 1..self.states.len() {
            let is_lost = |earlier: &usize| self.states[*earlier] == State::Lost;
            let needs_success = self.job.tasks[k].trigger_rule == TriggerRule::AllSuccess;
            let is_waiting = self.states[k] == State::Waiting;
            if is_waiting && needs_success && self.before[k].iter().any(is_lost) {
                self.states[k] = State::Lost;
                lost.push(k);
            }
        }
        lost
    }

    fn is_ready(&self, k: usize) -> bool {
        let rule = self.job.tasks[k].trigger_rule;
        let is_done = |earlier: &usize| match self.states[*earlier] {
            State::Waiting | State::Running => false,
            State::Done => true,
            State::Lost => rule == TriggerRule::AllDone,
        };
        self.states[k] == State::Waiting && self.before[k].iter().all(is_done)
    }

    fn fits(&self, k: usize) -> bool {
        let is_running = |k: &usize| self.states[*k] == State::Running;
        let running = || (0..self.states.len()).filter(is_running).chain([k]);
        if running().count() == 1 {
            return true;
        }
        let needs = |k: usize| self.job.tasks[k].needs;
        let cores: usize = running().map(|k| usize::from(needs(k).cores)).sum();
        let bytes = running().fold(0u64, |sum, k| sum.saturating_add(needs(k).memory_bytes));
        cores <= self.machine.cores && self.machine.memory_bytes.is_none_or(|free| bytes <= free)
    }
}

#[cfg(test)]
mod tests {
    use super::super::job::tests::task;
    use super::*;

    /// Tasks of one core, 1 GiB and these times.
    fn job(tasks: &[(&str, &[&str], f64)]) -> Job {
        let tasks = tasks.iter().map(|(id, after, seconds)| {
            let mut task = task(id, after);
            task.needs.seconds = *seconds;
            task.needs.cores = 1;
            task
        });
        Job::new(tasks.collect())
    }

    const TWO_CORES: Machine = Machine {
        cores: 2,
        memory_bytes: None,
    };

    #[test]
    fn the_longest_path_begins_and_what_is_ready_follows() {
        let job = job(&[
            ("a", &[], 5.0),
            ("b", &[], 1.0),
            ("c", &["b"], 9.0),
            ("d", &["a", "c"], 1.0),
        ]);
        let mut schedule = Schedule::new(&job, TWO_CORES, &[false; 4]);
        assert_eq!(schedule.start_next(), Some(1));
        assert_eq!(schedule.start_next(), Some(0));
        assert_eq!(schedule.start_next(), None);
        assert!(schedule.end(0, true).is_empty());
        assert_eq!(schedule.start_next(), None);
        schedule.end(1, true);
        assert_eq!(schedule.start_next(), Some(2));
        assert_eq!(schedule.start_next(), None);
        schedule.end(2, true);
        assert_eq!(schedule.start_next(), Some(3));
    }

    #[test]
    fn what_comes_after_a_failure_is_lost_and_the_rest_goes_on() {
        let job = job(&[
            ("a", &[], 1.0),
            ("b", &["a"], 1.0),
            ("c", &["b"], 1.0),
            ("d", &[], 1.0),
        ]);
        let mut schedule = Schedule::new(&job, TWO_CORES, &[false; 4]);
        assert_eq!(schedule.start_next(), Some(0));
        assert_eq!(schedule.end(0, false), [1, 2]);
        assert_eq!(schedule.start_next(), Some(3));
        assert_eq!(schedule.start_next(), None);
    }

    #[test]
    fn a_report_runs_after_all_others_whatever_their_ends() {
        let mut job = job(&[
            ("a", &[], 1.0),
            ("b", &["a"], 1.0),
            ("c", &[], 2.0),
            ("map", &["a", "b", "c"], 9.0),
        ]);
        job.tasks[3].trigger_rule = TriggerRule::AllDone;
        let mut schedule = Schedule::new(&job, TWO_CORES, &[false; 4]);
        let mut started = [schedule.start_next(), schedule.start_next()];
        started.sort();
        assert_eq!(started, [Some(0), Some(2)]);
        assert_eq!(schedule.end(0, false), [1]);
        assert_eq!(schedule.start_next(), None);
        assert!(schedule.end(2, true).is_empty());
        assert_eq!(schedule.start_next(), Some(3));
    }

    #[test]
    fn memory_limits_and_a_task_too_large_runs_alone() {
        let mut job = job(&[("a", &[], 3.0), ("b", &[], 2.0), ("c", &[], 1.0)]);
        job.tasks[0].needs.memory_bytes = 9 << 30;
        job.tasks[0].needs.cores = 8;
        let machine = Machine {
            memory_bytes: Some(2 << 30),
            ..TWO_CORES
        };
        let mut schedule = Schedule::new(&job, machine, &[false; 3]);
        assert_eq!(schedule.start_next(), Some(0));
        assert_eq!(schedule.start_next(), None);
        schedule.end(0, true);
        assert_eq!(schedule.start_next(), Some(1));
        assert_eq!(schedule.start_next(), Some(2));
    }

    #[test]
    fn what_is_done_does_not_run() {
        let job = job(&[("a", &[], 1.0), ("b", &["a"], 1.0)]);
        let mut schedule = Schedule::new(&job, TWO_CORES, &[true, false]);
        assert_eq!(schedule.start_next(), Some(1));
        assert_eq!(schedule.start_next(), None);
    }
}
