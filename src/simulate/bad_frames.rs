//! Which frames are no good, and why.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// What is wrong with a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Fault {
    /// All zero, but for the sensor's noise.
    Black,
    /// Motion blur of 15 to 30 pixels.
    Blurred,
    /// The left half is covered by a dark object with a texture of its own.
    Occluded,
    /// The picture of the frame before again, to the bit; the camera has moved on.
    Repeated,
    /// Not there at all, and its poses neither.
    Missing,
}

/// The faults by their names.
const FAULTS: [(&str, Fault); 5] = [
    ("black", Fault::Black),
    ("blurred", Fault::Blurred),
    ("occluded", Fault::Occluded),
    ("repeated", Fault::Repeated),
    ("missing", Fault::Missing),
];

/// Consecutive frames with the same fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Run {
    first: usize,
    last: usize,
    fault: Fault,
}

/// The bad frames of a survey; all others are good. As a text, and in `simulation.json`:
/// `5:black,9:blurred,18-20:missing`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadFrames(Vec<Run>);

/// An item of a list of bad frames cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("bad frames `{item}`: {what}")]
pub struct BadFramesError {
    item: String,
    what: String,
}

impl BadFrames {
    /// What is wrong with a frame, if anything.
    pub fn fault(&self, frame: usize) -> Option<Fault> {
        self.run(frame).map(|run| run.fault)
    }

    /// Number of frames that are missing.
    pub fn missing(&self) -> usize {
        let missing = self.0.iter().filter(|run| run.fault == Fault::Missing);
        missing.map(|run| run.last - run.first + 1).sum()
    }

    /// The frame whose picture a frame shows: its own, or of a repeated frame the last one before
    /// it that is neither repeated nor missing. `None` if the frame is missing or has nothing to
    /// repeat.
    pub fn shown(&self, frame: usize) -> Option<usize> {
        if self.fault(frame) == Some(Fault::Missing) {
            return None;
        }
        let mut shown = frame;
        while let Some(run) = self.run(shown)
            && matches!(run.fault, Fault::Repeated | Fault::Missing)
        {
            shown = run.first.checked_sub(1)?;
        }
        Some(shown)
    }

    /// Checks the list against the survey's number of frames.
    ///
    /// # Errors
    /// [`BadFramesError`] for the first item that names a frame beyond the last one or repeats what
    /// is not there, and when no frame is left.
    pub(super) fn check(&self, frames: usize) -> Result<(), BadFramesError> {
        for run in &self.0 {
            let wrong = if run.last >= frames {
                format!(
                    "the last of {frames} frames is number {}",
                    frames.saturating_sub(1)
                )
            } else if run.fault == Fault::Repeated && self.shown(run.first).is_none() {
                format!("there is no frame before number {} to repeat", run.first)
            } else if self.missing() == frames {
                "no frame would be left".to_owned()
            } else {
                continue;
            };
            return Err(run.error(&wrong));
        }
        Ok(())
    }

    fn run(&self, frame: usize) -> Option<&Run> {
        self.0
            .iter()
            .find(|run| (run.first..=run.last).contains(&frame))
    }
}

impl Run {
    fn error(&self, what: &str) -> BadFramesError {
        BadFramesError {
            item: self.to_string(),
            what: what.to_owned(),
        }
    }
}

impl FromStr for Run {
    type Err = String;

    fn from_str(item: &str) -> Result<Self, String> {
        let (frames, fault) = item
            .split_once(':')
            .ok_or("must be frame:fault or from-to:fault, as 5:black or 18-20:missing")?;
        let (first, last) = frames.split_once('-').unwrap_or((frames, frames));
        let number = |text: &str| {
            let text = text.trim();
            text.parse::<usize>()
                .map_err(|_| format!("`{text}` is no number of a frame; the first frame is 0"))
        };
        let (first, last) = (number(first)?, number(last)?);
        if first > last {
            return Err(format!("{first} comes after {last}"));
        }
        let fault = fault.trim();
        let names = FAULTS.map(|(name, _)| name).join(", ");
        let fault = FAULTS
            .iter()
            .find(|(name, _)| *name == fault)
            .map(|(_, fault)| *fault)
            .ok_or_else(|| format!("`{fault}` is none of {names}"))?;
        Ok(Self { first, last, fault })
    }
}

impl FromStr for BadFrames {
    type Err = BadFramesError;

    fn from_str(text: &str) -> Result<Self, BadFramesError> {
        let mut runs: Vec<Run> = Vec::new();
        for item in text.split(',').map(str::trim) {
            let run: Run = item.parse().map_err(|what| BadFramesError {
                item: item.to_owned(),
                what,
            })?;
            if let Some(twice) = runs
                .iter()
                .find(|other| run.first <= other.last && other.first <= run.last)
            {
                return Err(run.error(&format!("`{twice}` names a frame of it already")));
            }
            runs.push(run);
        }
        Ok(Self(runs))
    }
}

impl fmt::Display for Run {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.first)?;
        if self.last != self.first {
            write!(f, "-{}", self.last)?;
        }
        let name = FAULTS.iter().find(|(_, fault)| *fault == self.fault);
        write!(f, ":{}", name.map_or("", |(name, _)| name))
    }
}

impl fmt::Display for BadFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs: Vec<String> = self.0.iter().map(Run::to_string).collect();
        write!(f, "{}", runs.join(","))
    }
}

impl Serialize for BadFrames {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_and_written() {
        let text = "5:black,9:blurred,12:occluded,15-16:repeated,18-20:missing";
        let bad: BadFrames = text.parse().unwrap();
        assert_eq!(bad.to_string(), text);
        assert_eq!(
            " 5 : black, 18 - 20:missing"
                .parse::<BadFrames>()
                .unwrap()
                .to_string(),
            "5:black,18-20:missing"
        );
        assert_eq!(serde_json::to_string(&bad).unwrap(), format!("\"{text}\""));
        let fault = |frame| bad.fault(frame);
        assert_eq!(fault(5), Some(Fault::Black));
        assert_eq!((fault(4), fault(6)), (None, None));
        assert_eq!(fault(12), Some(Fault::Occluded));
        for frame in 18..=20 {
            assert_eq!(fault(frame), Some(Fault::Missing));
        }
        assert_eq!((bad.missing(), fault(21)), (3, None));
        bad.check(21).unwrap();
    }

    #[test]
    fn a_repeated_frame_shows_the_last_picture_before_it() {
        let bad: BadFrames = "1-3:repeated,5:missing,6:repeated,8:black,9:repeated"
            .parse()
            .unwrap();
        let shown: Vec<_> = (0..10).map(|frame| bad.shown(frame)).collect();
        let expected = [0, 0, 0, 0, 4, 99, 4, 7, 8, 8].map(|k| (k != 99).then_some(k));
        assert_eq!(shown, expected);
    }

    #[test]
    fn a_faulty_item_is_named_with_the_reason() {
        for (text, item, part) in [
            ("5:black,9:blury", "`9:blury`", "none of black, blurred"),
            ("5:black,9", "`9`", "frame:fault"),
            ("5:black,", "``", "frame:fault"),
            ("x:black", "`x:black`", "`x` is no number"),
            ("-3:black", "`-3:black`", "`` is no number"),
            ("20-18:missing", "`20-18:missing`", "20 comes after 18"),
            ("3-6:black,5:missing", "`5:missing`", "`3-6:black`"),
        ] {
            let message = text.parse::<BadFrames>().unwrap_err().to_string();
            assert!(
                message.contains(item) && message.contains(part),
                "{message}"
            );
        }
        for (text, part) in [
            (
                "9:black,10:black",
                "`10:black`: the last of 10 frames is number 9",
            ),
            ("0:repeated", "no frame before number 0"),
            ("0-2:missing,3:repeated", "`3:repeated`: there is no frame"),
            ("0-4:missing,5-9:missing", "no frame would be left"),
        ] {
            let bad: BadFrames = text.parse().unwrap();
            let message = bad.check(10).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
