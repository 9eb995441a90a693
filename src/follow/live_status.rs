//! The state of the frames so far, in words.

use crate::refine::LiveCounts;
use crate::render::Gap;
use crate::survey::{MissingFrames, SetAside};
use std::time::Duration;

/// Most gaps in a line.
const MAX_NAMED_GAPS: usize = 2;
/// Most frames in a warning.
const MAX_NAMED_FRAMES: usize = 5;

/// The state of the frames so far.
#[derive(Clone, Debug)]
pub struct LiveStatus {
    /// Number of pictures in the folder.
    pub pictures: usize,
    /// Number of those that wait for their end, for one before them, or for their pose.
    pub waiting: usize,
    /// Counts of the tracked frames.
    pub counts: LiveCounts,
    /// Longest time from a frame's arrival to its pose, of the last frames.
    pub lag: Duration,
    /// Chainage of the camera at the last frame, metres.
    pub chainage_m: Option<f64>,
    /// Wall that no frame has shown although the camera is past it.
    pub gaps: Vec<Gap>,
    /// Frames that are missing in the numbering.
    pub missing: Vec<MissingFrames>,
    /// Frames that are not in the preview.
    pub set_aside: Vec<SetAside>,
    /// The error of the file of poses at the last reading.
    pub poses_error: Option<String>,
    /// The reason for which frames are not tracked any more.
    pub failure: Option<String>,
}

impl LiveStatus {
    /// The state in a line.
    pub fn line(&self) -> String {
        let LiveCounts {
            tracked,
            empty,
            unmatched,
            skipped,
        } = self.counts;
        let missing: usize = self.missing.iter().map(|missing| missing.count).sum();
        let chainage = self.chainage_m.map(|h_m| format!("at {h_m:.2} m"));
        let counted = [
            (self.waiting, "waiting"),
            (unmatched, "do not match"),
            (empty, "show nothing"),
            (skipped, "skipped"),
            (missing, "missing"),
            (self.set_aside.len(), "set aside"),
        ];
        let counted = counted.into_iter().filter(|(count, _)| *count > 0);
        let counted = counted.map(|(count, what)| format!("{count} {what}"));
        let lag = format!("lag {:.1} s", self.lag.as_secs_f64());
        let frames = format!("{} frames, {tracked} tracked", self.pictures);
        let parts = std::iter::once(frames)
            .chain(counted)
            .chain([lag])
            .chain(chainage);
        let parts: Vec<String> = parts.chain(self.gap_text()).collect();
        parts.join(", ")
    }

    /// The gaps in words; None if there are none.
    pub fn gap_text(&self) -> Option<String> {
        let others = self.gaps.len().saturating_sub(MAX_NAMED_GAPS);
        let named = self.gaps.iter().take(MAX_NAMED_GAPS).map(gap_in_words);
        let named: Vec<String> = named.collect();
        let more = if others > 0 {
            format!(" and {others} more")
        } else {
            String::new()
        };
        (!named.is_empty()).then(|| format!("GAPS: {}{more}", named.join("; ")))
    }

    /// The problems of the capture, a sentence each with its remedy.
    pub fn warnings(&self) -> Vec<String> {
        let missing = self.missing.iter().take(MAX_NAMED_FRAMES).map(|missing| {
            let MissingFrames {
                count,
                before,
                after,
            } = missing;
            let frames = match count {
                1 => "1 frame is".to_owned(),
                _ => format!("{count} frames are"),
            };
            format!("{frames} missing between {before} and {after}")
        });
        let set_aside = self.set_aside.iter().take(MAX_NAMED_FRAMES);
        let set_aside = set_aside
            .map(|frame| format!("{} is not in the preview: {}", frame.file, frame.reason));
        let more = |what: &str, count: usize| {
            let count = count.saturating_sub(MAX_NAMED_FRAMES);
            (count > 0).then(|| format!("{what} {count} more"))
        };
        let waiting = (self.waiting > 0).then(|| {
            format!(
                "{} pictures were left without a pose in the file of poses, or are incomplete",
                self.waiting
            )
        });
        let failure = self.failure.iter();
        let failure = failure.map(|why| format!("the preview has ended early: {why}"));
        (missing.chain(more(
            "frames are missing in gaps of the numbering:",
            self.missing.len(),
        )))
        .chain(set_aside)
        .chain(more("not in the preview are", self.set_aside.len()))
        .chain(waiting)
        .chain(failure)
        .chain(self.poses_error.clone())
        .collect()
    }
}

/// A gap in words: where it is, and how large.
fn gap_in_words(gap: &Gap) -> String {
    let (from, to) = (gap.angle_from_deg, gap.angle_to_deg);
    let around = if to - from >= 360.0 {
        "all around".to_owned()
    } else {
        format!("{from:.0}° to {:.0}°", to % 360.0)
    };
    format!(
        "{:.2} to {:.2} m, {around}, {:.3} m²",
        gap.chainage_from_m, gap.chainage_to_m, gap.area_m2
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_missing_is_counted_and_named() {
        let missing = |count| MissingFrames {
            count,
            before: "4.png".to_owned(),
            after: "9.png".to_owned(),
        };
        let status = LiveStatus {
            pictures: 30,
            waiting: 0,
            counts: LiveCounts {
                tracked: 25,
                unmatched: 2,
                ..LiveCounts::default()
            },
            lag: Duration::from_millis(240),
            chainage_m: Some(1.5),
            gaps: Vec::new(),
            missing: vec![missing(1); 7],
            set_aside: vec![SetAside {
                file: "3.png".to_owned(),
                reason: "it came after 4.png".to_owned(),
            }],
            poses_error: None,
            failure: None,
        };
        let expected = "30 frames, 25 tracked, 2 do not match, 7 missing, 1 set aside, lag 0.2 s, \
                        at 1.50 m";
        assert_eq!(status.line(), expected);
        let warnings = status.warnings();
        assert_eq!(warnings[0], "1 frame is missing between 4.png and 9.png");
        assert_eq!(
            warnings[5],
            "frames are missing in gaps of the numbering: 2 more"
        );
        assert_eq!(
            warnings[6],
            "3.png is not in the preview: it came after 4.png"
        );
        assert_eq!(warnings.len(), 7);
    }
}
