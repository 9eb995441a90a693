//! Errors of frames.

use std::path::PathBuf;
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::recordings::RecordingError;

/// An error of a frame, a video or a mask.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// The pattern in survey.toml is malformed.
    #[error("frames.images = \"{pattern}\": {what}")]
    Pattern {
        /// The pattern.
        pattern: String,
        /// The problem.
        what: String,
    },
    /// The pattern matches nothing.
    #[error(
        "frames.images = \"{pattern}\" matches no file; the pattern is relative to \
         survey.toml{hint}"
    )]
    NoFrames {
        /// The pattern.
        pattern: String,
        /// The files that there are instead, for the message.
        hint: String,
    },
    /// A frame is unreadable or damaged.
    #[error("frame {index} ({}): {what}; {remedy}{}", printed(path), or_skip(*can_be_skipped))]
    Decode {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// The error of the decoder.
        what: String,
        /// The remedy.
        remedy: String,
        /// True if the frame may be left out instead (`frames.skip_bad`).
        can_be_skipped: bool,
    },
    /// No frame can be read.
    #[error("all {count} frames ({}, …): {what}; {remedy}", printed(path))]
    All {
        /// Number of frames.
        count: usize,
        /// The file of the first.
        path: PathBuf,
        /// The problem of the first.
        what: String,
        /// The remedy.
        remedy: String,
    },
    /// A video cannot be read.
    #[error("{}: {what}", printed(path))]
    Video {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
    /// A recording cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A mask is unreadable or invalid.
    #[error("{}: {what}", printed(path))]
    Mask {
        /// The file.
        path: PathBuf,
        /// The problem and the remedy.
        what: String,
    },
    /// A frame's size differs from the calibration's.
    #[error(
        "frame {index} ({}): {width} × {height} px, but the calibration is for {expected_width} × \
         {expected_height} px; give the calibration of these frames, or leave out what cannot be \
         read by --skip-bad (skip_bad = true under [frames])",
        printed(path)
    )]
    Size {
        /// Index of the frame in the survey.
        index: usize,
        /// The file.
        path: PathBuf,
        /// Width found.
        width: u32,
        /// Height found.
        height: u32,
        /// Width of the calibration.
        expected_width: u32,
        /// Height of the calibration.
        expected_height: u32,
    },
}

/// The other remedy for a frame that cannot be read.
fn or_skip(can_be_skipped: bool) -> &'static str {
    if can_be_skipped {
        ", or leave out what cannot be read by --skip-bad (skip_bad = true under [frames])"
    } else {
        ""
    }
}

/// The remedy for frames that are all of another size than the calibration.
fn remedy_of_size(size: [u32; 2], calibrated: [u32; 2]) -> String {
    let give = "give the calibration of these frames";
    let [[width, height], [of_width, of_height]] = [size, calibrated].map(|s| s.map(f64::from));
    let scale = width / of_width;
    if size == [calibrated[1], calibrated[0]] {
        format!("{give}, or turn them by a quarter, as they were when the camera was calibrated")
    } else if (scale * of_height - height).abs() < 1.0 {
        format!(
            "{give}; if they were scaled by {scale:.4} after the calibration, multiply its fx, fy, \
             cx + 0.5 and cy + 0.5 by that (its centres of pixels are whole numbers)"
        )
    } else {
        give.to_owned()
    }
}

impl FrameError {
    /// The error of `count` frames, all of which have this one.
    #[must_use]
    pub fn of_all(self, count: usize) -> Self {
        let what = self.reason();
        match self {
            Self::Decode { path, remedy, .. } if count > 1 => Self::All {
                count,
                path,
                what,
                remedy,
            },
            Self::Size {
                path,
                width,
                height,
                expected_width,
                expected_height,
                ..
            } if count > 1 => Self::All {
                count,
                path,
                what: format!("{what} as the calibration"),
                remedy: remedy_of_size([width, height], [expected_width, expected_height]),
            },
            other => other,
        }
    }

    /// The reason of the failure, without the name of the frame and the remedy.
    pub fn reason(&self) -> String {
        match self {
            Self::Decode { what, .. } => what.clone(),
            Self::Size {
                width,
                height,
                expected_width,
                expected_height,
                ..
            } => format!("{width} × {height} px, not {expected_width} × {expected_height} px"),
            _ => self.to_string(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Nothing is left if all frames are left out.
    #[test]
    fn frames_that_are_all_wrong_are_not_to_be_skipped() {
        let of_size = |width, height| FrameError::Size {
            index: 0,
            path: "a.png".into(),
            width,
            height,
            expected_width: 640,
            expected_height: 480,
        };
        assert!(of_size(320, 240).to_string().contains("--skip-bad"));
        assert!(
            of_size(320, 240)
                .of_all(1)
                .to_string()
                .contains("--skip-bad")
        );
        for (width, height, expected) in [
            (320, 240, "scaled by 0.5000 after the calibration"),
            (480, 640, "turn them by a quarter"),
            (
                500,
                500,
                "500 × 500 px, not 640 × 480 px as the calibration; give the calibration",
            ),
        ] {
            let said = of_size(width, height).of_all(7).to_string();
            assert!(said.starts_with("all 7 frames (a.png, …): "), "{said}");
            assert!(
                said.contains(expected) && !said.contains("--skip-bad"),
                "{said}"
            );
        }
    }
}
