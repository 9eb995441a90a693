//! Poses of a file in the order of their times.

use super::pose_entry::PoseEntry;

/// The handling of a time that two poses of a file share.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DuplicateTimes {
    /// They are an error: poses that are counted must all be there.
    #[default]
    Refuse,
    /// The first of two poses is kept if they agree, and they are an error otherwise.
    Merge,
}

/// Largest distance of two poses of one time that agree, metres.
const MAX_DISTANCE_M: f64 = 1e-3;
/// Largest angle between two poses of one time that agree, degrees.
const MAX_ANGLE_DEG: f64 = 0.01;

/// The poses read from a file so far; their times increase.
pub(super) struct EntryList {
    duplicates: DuplicateTimes,
    entries: Vec<PoseEntry>,
    /// 1-based number of the last pose's line.
    last_line: usize,
}

impl EntryList {
    /// An empty list.
    pub fn new(duplicates: DuplicateTimes) -> Self {
        Self {
            duplicates,
            entries: Vec::new(),
            last_line: 0,
        }
    }

    /// Adds the pose of a line.
    ///
    /// # Errors
    /// A time before the last pose's; a pose of the same time that is refused.
    pub fn push(&mut self, line: usize, entry: PoseEntry) -> Result<(), String> {
        if let Some(last) = self.entries.last()
            && let (Some(time_s), Some(last_s)) = (entry.time_s, last.time_s)
        {
            if time_s < last_s {
                return Err(format!(
                    "timestamp {time_s} after {last_s}: sort the file by time"
                ));
            }
            if time_s == last_s {
                return match self.duplicates {
                    DuplicateTimes::Refuse => Err(format!(
                        "duplicate timestamp {time_s}: every pose needs a time of its own"
                    )),
                    DuplicateTimes::Merge => {
                        check_agreement([last, &entry], [self.last_line, line], time_s)
                    }
                };
            }
        }
        self.entries.push(entry);
        self.last_line = line;
        Ok(())
    }

    /// The poses.
    pub fn into_entries(self) -> Vec<PoseEntry> {
        self.entries
    }
}

/// Checks that two poses of one time agree.
fn check_agreement(
    [a, b]: [&PoseEntry; 2],
    [first, second]: [usize; 2],
    time_s: f64,
) -> Result<(), String> {
    let distance_m = (a.pose.t_wc - b.pose.t_wc).norm();
    let angle_deg = a.pose.r_wc.angle_to(&b.pose.r_wc).to_degrees();
    if distance_m <= MAX_DISTANCE_M && angle_deg <= MAX_ANGLE_DEG {
        return Ok(());
    }
    Err(format!(
        "duplicate timestamp {time_s}: lines {first} and {second} have two poses of it, {:.2} mm \
         and {angle_deg:.3}° from each other; remove the wrong line",
        distance_m * 1e3
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::pose::Pose;
    use nalgebra::Vector3;

    fn entry(time_s: f64, x_m: f64) -> PoseEntry {
        PoseEntry {
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
        let message = list.push(9, entry(6.0, 0.1012)).unwrap_err();
        assert!(
            message.contains("lines 7 and 9") && message.contains("1.20 mm"),
            "{message}"
        );
        assert!(
            list.push(10, entry(5.0, 0.0))
                .unwrap_err()
                .contains("sort the file")
        );
        let entries = list.into_entries();
        assert_eq!(entries, [entry(5.0, 0.0), entry(6.0, 0.1)]);
    }

    #[test]
    fn poses_that_are_counted_have_times_of_their_own() {
        let mut list = EntryList::new(DuplicateTimes::Refuse);
        list.push(1, entry(5.0, 0.0)).unwrap();
        let message = list.push(2, entry(5.0, 0.0)).unwrap_err();
        assert!(message.contains("duplicate timestamp 5"), "{message}");
    }
}
