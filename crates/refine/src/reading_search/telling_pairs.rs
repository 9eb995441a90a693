//! Pairs of neighbouring frames that tell the poses of some frames from those of others.
//!
//! While a camera advances and turns by the same step from frame to frame, poses of other frames
//! are the right ones, moved along the wall by a gauge motion, and nothing tells them apart. Where
//! the step changes, as at a pause, a pair of frames does: it shows which of two steps was made.
//! Only pairs count whose steps differ by more than the prior allows between a step and its
//! estimate. The noise of poses, of which every reading has another piece, does not decide then.

use crate::tracking::registration::MAX_DEVIATION_COST;
use tunnelstitch_core::survey::PoseReading;
use tunnelstitch_geometry::trajectory::{Jitter, Pose};

/// Largest number of pairs that are looked at. A change of the step shows in six: in two to tell a
/// shift by one frame from none, in four and six for two and three.
const MAX_TELLING_PAIRS: usize = 24;

/// A pair of neighbouring frames whose step differs from that of some reading.
#[derive(Clone, Debug, PartialEq)]
pub struct TellingPair {
    /// Index of its first frame.
    pub first: usize,
    /// Places of the readings in their list that have another step than the one given.
    pub readings: Vec<usize>,
}

/// Pairs that tell some of the `shifted` readings from the one given, evenly distributed among all
/// such pairs, and of neighbouring ones that which tells the most readings from the others. All
/// readings have poses of their frames.
pub fn telling_pairs(
    jitter: &Jitter,
    given: &PoseReading,
    shifted: &[&PoseReading],
) -> Vec<TellingPair> {
    let differ = |a: &Pose, b: &Pose| jitter.deviation_cost(a, b) > MAX_DEVIATION_COST;
    let tell = |first: usize| {
        let own = step(given, first);
        let tells = |k: &usize| differ(&own, &step(shifted[*k], first));
        TellingPair {
            first,
            readings: (0..shifted.len()).filter(tells).collect(),
        }
    };
    let are_known = |first: &usize| {
        let mut frames = [*first, first + 1].into_iter();
        frames.all(|k| shifted.iter().all(|reading| reading.has_pose_of(k)))
    };
    let firsts = 0..given.initial.len().saturating_sub(1);
    let telling: Vec<TellingPair> = firsts
        .filter(are_known)
        .map(tell)
        .filter(|pair| !pair.readings.is_empty())
        .collect();
    // The readings with the step given, which is one itself, times those with another.
    let told_apart = |pair: &&TellingPair| {
        let others = pair.readings.len();
        others * (shifted.len() + 1 - others)
    };
    let wanted = telling.len().min(MAX_TELLING_PAIRS);
    let chunk = |k: usize| &telling[k * telling.len() / wanted..(k + 1) * telling.len() / wanted];
    (0..wanted)
        // The first of those that tell the most.
        .filter_map(|k| chunk(k).iter().rev().max_by_key(told_apart))
        .cloned()
        .collect()
}

/// The motion from frame `first` to the next, in the camera's frame.
fn step(reading: &PoseReading, first: usize) -> Pose {
    let [from, to] = [first, first + 1].map(|k| reading.initial[k].pose);
    from.inverse().after(&to)
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::frames::PictureOrientation;
    use tunnelstitch_core::survey::CameraReading;
    use tunnelstitch_geometry::trajectory::{JitterModel, StampedPose, spiral};

    const JITTER: Jitter = Jitter {
        model: JitterModel::RandomWalk,
        rotation_sigma_rad: 0.035,
        translation_sigma_m: [0.02, 0.02, 0.03],
    };

    /// A camera that turns by 30° and advances by 10 cm but for some steps, `steps` of them, with
    /// its poses `shift_frames` places later.
    fn reading(steps: usize, pauses: &[usize], shift_frames: isize) -> PoseReading {
        let spiral = spiral(steps + 1, 0.1, 0.52);
        let mut place = 0;
        let mut initial = vec![spiral[0]];
        for step in 0..steps {
            place += usize::from(!pauses.contains(&step));
            initial.push(spiral[place]);
        }
        let own = |k: usize| k.saturating_add_signed(-shift_frames).min(steps);
        let stamped = |k: usize| StampedPose {
            time_s: k as f64,
            pose: initial[own(k)],
        };
        PoseReading {
            remedy: String::new(),
            changes: 1,
            is_stated: false,
            prior_nats: 0.0,
            initial: (0..=steps).map(stamped).collect(),
            orientation: PictureOrientation::Stored,
            shift_frames,
            camera: CameraReading::AsGiven,
        }
    }

    fn telling(steps: usize, pauses: &[usize], shifts: &[isize]) -> Vec<TellingPair> {
        let shifted: Vec<_> = shifts.iter().map(|k| reading(steps, pauses, *k)).collect();
        let shifted: Vec<_> = shifted.iter().collect();
        telling_pairs(&JITTER, &reading(steps, pauses, 0), &shifted)
    }

    #[test]
    fn a_constant_step_tells_nothing() {
        assert_eq!(telling(30, &[], &[1, -1, 2, -2, 3, -3]), []);
    }

    /// A pause of one step and one that lasts longer; poses at the ends are not known.
    #[test]
    fn a_pause_tells_at_its_start_and_its_end() {
        let firsts = |pauses: &[usize], shift| -> Vec<usize> {
            let telling = telling(30, pauses, &[shift]);
            telling.iter().map(|pair| pair.first).collect()
        };
        assert_eq!(firsts(&[10], 1), [10, 11]);
        assert_eq!(firsts(&[10, 11, 12, 13], 1), [10, 14]);
        assert_eq!(firsts(&[10, 11, 12, 13], -2), [8, 9, 12, 13]);
        assert_eq!(firsts(&[0, 1, 2, 3], -1), [3]);
        assert_eq!(firsts(&[29], 1), [29]);
    }

    #[test]
    fn of_many_pairs_those_that_tell_the_most_apart_are_taken() {
        let pauses: Vec<usize> = (0..400).filter(|k| k % 10 < 5).collect();
        let telling = telling(400, &pauses, &[1, -1, 2, -2, 3, -3]);
        assert_eq!(telling.len(), MAX_TELLING_PAIRS);
        // The last before a change and the first after it.
        assert!(telling.iter().all(|pair| pair.readings.len() == 3));
        let firsts = [telling[0].first, telling[MAX_TELLING_PAIRS - 1].first];
        assert!(firsts[0] < 20 && firsts[1] >= 370, "{firsts:?}");
    }
}
