//! Numbers in the names of frames, which tell where some are missing.

use crate::frames::FrameFile;
use std::collections::BTreeMap;

/// The step by which a camera numbers its frames on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Numbering {
    step: u64,
}

impl Numbering {
    /// The numbering of frames in the order of their names: by the step that most of them have.
    /// None if there is no such step, as where names are times.
    pub fn of(frames: &[FrameFile]) -> Option<Self> {
        let steps = frames.windows(2).map(|pair| step(&pair[0], &pair[1]));
        let mut counts: BTreeMap<u64, usize> = BTreeMap::new();
        for step in steps.flatten() {
            *counts.entry(step).or_default() += 1;
        }
        let (step, count) = counts.into_iter().max_by_key(|(_, count)| *count)?;
        (2 * count >= frames.len()).then_some(Self { step })
    }

    /// Number of frames that are missing between two.
    pub fn missing_between(self, before: &FrameFile, after: &FrameFile) -> usize {
        let steps = step(before, after).map_or(1, |step| step / self.step);
        steps.saturating_sub(1) as usize
    }
}

/// The difference of the numbers of two frames; None unless both have one and it increases.
fn step(before: &FrameFile, after: &FrameFile) -> Option<u64> {
    let step = number(after)?.checked_sub(number(before)?)?;
    (step > 0).then_some(step)
}

/// The last number in the name of a frame without its extension.
fn number(frame: &FrameFile) -> Option<u64> {
    let stem = frame.path.file_stem()?.to_str()?;
    let mut digits = stem.split(|c: char| !c.is_ascii_digit());
    digits.rfind(|digits| !digits.is_empty())?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frames(names: &[&str]) -> Vec<FrameFile> {
        let frame = |(k, name): (usize, &&str)| FrameFile::picture(k, name.into());
        names.iter().enumerate().map(frame).collect()
    }

    #[test]
    fn a_step_that_most_have_tells_what_is_missing() {
        for (names, missing) in [
            (["a0.png", "a1.png", "a2.png", "a5.png"], 2),
            (["7_10.png", "7_12.png", "7_14.png", "7_18.png"], 1),
        ] {
            let frames = frames(&names);
            let numbering = Numbering::of(&frames).unwrap();
            assert_eq!(numbering.missing_between(&frames[2], &frames[3]), missing);
            assert_eq!(numbering.missing_between(&frames[0], &frames[1]), 0);
        }
    }

    #[test]
    fn times_and_words_are_no_numbering() {
        let times = ["100.png", "133.png", "167.png", "201.png", "232.png"];
        assert_eq!(Numbering::of(&frames(&times)), None);
        assert_eq!(Numbering::of(&frames(&["a.png", "b.png", "c.png"])), None);
        assert_eq!(Numbering::of(&frames(&["a1.png"])), None);
    }
}
