//! Poses of a file in the order of their times.

use super::iso_time::DAY_S;
use super::pose_conflict::PoseConflict;
use super::pose_entry::PoseEntry;

/// The handling of a time that two poses of a file share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DuplicateTimes {
    /// They are an error: poses that are counted must all be there.
    #[default]
    Refuse,
    /// All are kept: cameras of a rig take pictures at the same time.
    Keep,
    /// The first of two poses is kept; if they do not agree, [`PoseConflict`] tells of it.
    Merge,
}

/// The poses of a file, and what contradicts them.
#[derive(Debug, Default)]
pub(super) struct ParsedPoses {
    /// The poses; their times, if present, increase.
    pub entries: Vec<PoseEntry>,
    /// Poses that were left out because another has their time, and differs.
    pub conflicts: Vec<PoseConflict>,
}

impl From<Vec<PoseEntry>> for ParsedPoses {
    fn from(entries: Vec<PoseEntry>) -> Self {
        Self {
            entries,
            conflicts: Vec::new(),
        }
    }
}

/// The poses read from a file so far; their times increase.
pub(super) struct EntryList {
    duplicates: DuplicateTimes,
    parsed: ParsedPoses,
    /// 1-based number of the last pose's line.
    last_line: usize,
}

impl EntryList {
    /// An empty list.
    pub fn new(duplicates: DuplicateTimes) -> Self {
        Self {
            duplicates,
            parsed: ParsedPoses::default(),
            last_line: 0,
        }
    }

    /// Adds the pose of a line.
    ///
    /// # Errors
    /// A time before the last pose's; a pose of the same time, if it is refused.
    pub fn push(&mut self, line: usize, entry: PoseEntry) -> Result<(), String> {
        if let Some(last) = self.parsed.entries.last()
            && let (Some(time_s), Some(last_s)) = (entry.time_s, last.time_s)
        {
            if time_s < last_s {
                return Err(unordered(time_s, last_s, self.begins_again(time_s)));
            }
            if time_s == last_s && self.duplicates != DuplicateTimes::Keep {
                if self.duplicates == DuplicateTimes::Refuse {
                    return Err(format!(
                        "duplicate timestamp {time_s}: every pose needs a time of its own; or \
                         associate them by time (--associate time)"
                    ));
                }
                let kept = self.parsed.entries.len() - 1;
                let lines = [self.last_line, line];
                let conflict = PoseConflict::between(kept, [last, &entry], lines, time_s);
                self.parsed.conflicts.extend(conflict);
                return Ok(());
            }
        }
        self.parsed.entries.push(entry);
        self.last_line = line;
        Ok(())
    }

    /// True if a time is that of the first pose, as where a trajectory follows another.
    fn begins_again(&self, time_s: f64) -> bool {
        let first = self.parsed.entries.first();
        self.parsed.entries.len() > 1 && first.and_then(|entry| entry.time_s) == Some(time_s)
    }

    /// The poses.
    pub fn into_parsed(self) -> ParsedPoses {
        self.parsed
    }
}

/// The error of a time before the last pose's, both seconds; `begins_again`: it is the first one's.
fn unordered(time_s: f64, last_s: f64, begins_again: bool) -> String {
    // A clock of the day that goes back by more than half of it has passed midnight.
    let is_midnight = last_s < DAY_S && last_s - time_s > 0.5 * DAY_S;
    let remedy = if begins_again {
        "the file has several trajectories, or one several times: keep one"
    } else if is_midnight {
        "if the clock began again at midnight, add 86400 to the times from there on"
    } else {
        "sort the file by time"
    };
    format!("timestamp {time_s} after {last_s}: {remedy}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::pose::Pose;
    use nalgebra::Vector3;

    fn entry(time_s: f64, x_m: f64) -> PoseEntry {
        PoseEntry {
            camera: None,
            name: None,
            time_s: Some(time_s),
            pose: Pose::new(Default::default(), Vector3::new(x_m, 0.0, 0.0)),
        }
    }

    #[test]
    fn a_pose_that_is_there_twice_is_kept_once() {
        let mut list = EntryList::new(DuplicateTimes::Merge);
        for (line, x_m) in [(1, 0.0), (3, 0.0009), (4, 0.0)] {
            list.push(line, entry(5.0, x_m)).unwrap();
        }
        list.push(7, entry(6.0, 0.1)).unwrap();
        list.push(9, entry(6.0, 0.1012)).unwrap();
        let mut message_of = |time_s| list.push(10, entry(time_s, 0.0)).unwrap_err();
        assert!(message_of(5.5).contains("sort the file"));
        // The first time again.
        assert!(message_of(5.0).contains("several trajectories"));
        let parsed = list.into_parsed();
        assert_eq!(parsed.entries, [entry(5.0, 0.0), entry(6.0, 0.1)]);
        let [conflict] = parsed.conflicts[..] else {
            panic!("{:?}", parsed.conflicts);
        };
        assert_eq!((conflict.entry, conflict.lines), (1, [7, 9]));
        assert!((conflict.distance - 0.0012).abs() < 1e-12 && conflict.angle_deg == 0.0);
    }

    #[test]
    fn a_clock_that_passed_midnight_is_not_to_be_sorted() {
        let mut list = EntryList::new(DuplicateTimes::Refuse);
        list.push(1, entry(86399.0, 0.0)).unwrap();
        let message = list.push(2, entry(0.5, 0.0)).unwrap_err();
        assert!(
            message.contains("midnight") && !message.contains("sort"),
            "{message}"
        );
    }

    #[test]
    fn poses_that_are_counted_have_times_of_their_own() {
        let mut list = EntryList::new(DuplicateTimes::Refuse);
        list.push(1, entry(5.0, 0.0)).unwrap();
        let message = list.push(2, entry(5.0, 0.0)).unwrap_err();
        assert!(message.contains("duplicate timestamp 5"), "{message}");
        let mut of_rig = EntryList::new(DuplicateTimes::Keep);
        for line in 1..3 {
            of_rig.push(line, entry(5.0, 0.0)).unwrap();
        }
        assert_eq!(of_rig.into_parsed().entries.len(), 2);
    }
}
