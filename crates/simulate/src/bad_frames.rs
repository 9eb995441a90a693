//! Faults of single frames: black, blurred, occluded, repeated or missing.

use serde::{Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Fault that is injected into a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum FrameFault {
    /// All zero, except for the sensor's noise.
    Black,
    /// Motion blur of 15 to 30 pixels.
    Blurred,
    /// The left half is covered by a dark textured object.
    Occluded,
    /// A bit-exact copy of the frame before, although the camera has moved on.
    Repeated,
    /// Neither an image nor poses exist.
    Missing,
}

/// Names of the faults in the text form of a list.
const FAULT_NAMES: [(&str, FrameFault); 5] = [
    ("black", FrameFault::Black),
    ("blurred", FrameFault::Blurred),
    ("occluded", FrameFault::Occluded),
    ("repeated", FrameFault::Repeated),
    ("missing", FrameFault::Missing),
];

/// Consecutive frames with the same fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FaultRange {
    first: usize,
    last: usize,
    fault: FrameFault,
}

/// The frames of a survey with a fault; all others are good.
///
/// Text form, also in `simulation.json`: `5:black,9:blurred,18-20:missing`.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BadFrames(Vec<FaultRange>);

/// Error for an item of a list of bad frames that cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("bad frames `{item}`: {what}")]
pub struct BadFramesError {
    item: String,
    what: String,
}

impl BadFrames {
    /// The fault of a frame, or `None` for a good one.
    pub fn fault(&self, frame: usize) -> Option<FrameFault> {
        self.range_of(frame).map(|range| range.fault)
    }

    /// Number of missing frames.
    pub fn missing_count(&self) -> usize {
        let missing = self
            .0
            .iter()
            .filter(|range| range.fault == FrameFault::Missing);
        missing.map(|range| range.last - range.first + 1).sum()
    }

    /// The frame whose image a frame shows.
    ///
    /// That is the frame itself, or for a repeated frame the last one before it that is neither
    /// repeated nor missing. `None` if the frame is missing or has nothing to repeat.
    pub fn source_frame(&self, frame: usize) -> Option<usize> {
        if self.fault(frame) == Some(FrameFault::Missing) {
            return None;
        }
        let mut shown = frame;
        while let Some(range) = self.range_of(shown)
            && matches!(range.fault, FrameFault::Repeated | FrameFault::Missing)
        {
            shown = range.first.checked_sub(1)?;
        }
        Some(shown)
    }

    /// Checks the list against the survey's number of frames.
    ///
    /// # Errors
    /// [`BadFramesError`] for the first item that names a frame beyond the last one or repeats a
    /// frame that does not exist, and if no frame is left.
    pub(super) fn validate(&self, frames: usize) -> Result<(), BadFramesError> {
        for range in &self.0 {
            let wrong = if range.last >= frames {
                format!(
                    "the last of {frames} frames is number {}",
                    frames.saturating_sub(1)
                )
            } else if range.fault == FrameFault::Repeated
                && self.source_frame(range.first).is_none()
            {
                format!("there is no frame before number {} to repeat", range.first)
            } else if self.missing_count() == frames {
                "no frame would be left".to_owned()
            } else {
                continue;
            };
            return Err(range.error(&wrong));
        }
        Ok(())
    }

    fn range_of(&self, frame: usize) -> Option<&FaultRange> {
        self.0
            .iter()
            .find(|range| (range.first..=range.last).contains(&frame))
    }
}

impl FaultRange {
    fn error(&self, what: &str) -> BadFramesError {
        BadFramesError {
            item: self.to_string(),
            what: what.to_owned(),
        }
    }
}

impl FromStr for FaultRange {
    type Err = String;

    fn from_str(item: &str) -> Result<Self, String> {
        let (frames, fault) = item
            .split_once(':')
            .ok_or("must be frame:fault or from-to:fault, as 5:black or 18-20:missing")?;
        let (first, last) = frames.split_once('-').unwrap_or((frames, frames));
        let number = |text: &str| {
            let text = text.trim();
            text.parse::<usize>()
                .map_err(|_| format!("`{text}` is not a frame number; the first frame is 0"))
        };
        let (first, last) = (number(first)?, number(last)?);
        if first > last {
            return Err(format!("{first} comes after {last}"));
        }
        let fault = fault.trim();
        let names = FAULT_NAMES.map(|(name, _)| name).join(", ");
        let fault = FAULT_NAMES
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
        let mut ranges: Vec<FaultRange> = Vec::new();
        for item in text.split(',').map(str::trim) {
            let range: FaultRange = item.parse().map_err(|what| BadFramesError {
                item: item.to_owned(),
                what,
            })?;
            if let Some(twice) = ranges
                .iter()
                .find(|other| range.first <= other.last && other.first <= range.last)
            {
                return Err(range.error(&format!("`{twice}` already names one of its frames")));
            }
            ranges.push(range);
        }
        Ok(Self(ranges))
    }
}

impl fmt::Display for FaultRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.first)?;
        if self.last != self.first {
            write!(f, "-{}", self.last)?;
        }
        let name = FAULT_NAMES.iter().find(|(_, fault)| *fault == self.fault);
        write!(f, ":{}", name.map_or("", |(name, _)| name))
    }
}

impl fmt::Display for BadFrames {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ranges: Vec<String> = self.0.iter().map(FaultRange::to_string).collect();
        write!(f, "{}", ranges.join(","))
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
        assert_eq!(fault(5), Some(FrameFault::Black));
        assert_eq!((fault(4), fault(6)), (None, None));
        assert_eq!(fault(12), Some(FrameFault::Occluded));
        for frame in 18..=20 {
            assert_eq!(fault(frame), Some(FrameFault::Missing));
        }
        assert_eq!((bad.missing_count(), fault(21)), (3, None));
        bad.validate(21).unwrap();
    }

    #[test]
    fn a_repeated_frame_shows_the_last_picture_before_it() {
        let bad: BadFrames = "1-3:repeated,5:missing,6:repeated,8:black,9:repeated"
            .parse()
            .unwrap();
        let shown: Vec<_> = (0..10).map(|frame| bad.source_frame(frame)).collect();
        let expected = [0, 0, 0, 0, 4, 99, 4, 7, 8, 8].map(|k| (k != 99).then_some(k));
        assert_eq!(shown, expected);
    }

    #[test]
    fn a_faulty_item_is_named_with_the_reason() {
        for (text, item, part) in [
            ("5:black,9:blury", "`9:blury`", "none of black, blurred"),
            ("5:black,9", "`9`", "frame:fault"),
            ("5:black,", "``", "frame:fault"),
            ("x:black", "`x:black`", "`x` is not a frame number"),
            ("-3:black", "`-3:black`", "`` is not a frame number"),
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
            let message = bad.validate(10).unwrap_err().to_string();
            assert!(message.contains(part), "{message}");
        }
    }
}
