//! Following of frames while they are taken, before they are refined.

use super::refine_files::check_outputs;
use crate::cli::arguments::{FollowArguments, PoseReadingArguments};
use crate::cli::output::{Failure, FollowedCapture, Terminal};
use crate::follow::{LivePreview, LiveStatus};
use std::path::Path;
use std::time::{Duration, Instant};

/// Time between two looks into the folder.
const POLL: Duration = Duration::from_millis(50);
/// Shortest time between two previews.
const MIN_PREVIEW_INTERVAL: Duration = Duration::from_secs(2);
/// Shortest time between two previews, as a multiple of the time that the last one took.
const MIN_PREVIEW_RATIO: u32 = 20;

/// The last preview.
struct Shown {
    at: Instant,
    /// Time until the next one.
    wait: Duration,
    line: String,
}

/// Follows the frames of a survey until no more come, and writes provisional poses and a picture of
/// the wall into the folder `out`.
///
/// # Errors
/// A survey whose frames cannot be followed; previews that cannot be written.
pub fn follow(
    survey: &Path,
    out: &Path,
    reading: &PoseReadingArguments,
    arguments: &FollowArguments,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let capture = FollowedCapture::begin();
    terminal.say("following the frames (Ctrl-C once ends the capture and refines them)");
    let Some(mut preview) = await_first(survey, reading, &capture)? else {
        return Ok(());
    };
    check_outputs(preview.survey(), out)?;
    let mut shown = Shown {
        at: Instant::now(),
        wait: Duration::ZERO,
        line: String::new(),
    };
    let (mut pictures, mut last_new) = (0, Instant::now());
    while !capture.is_ended() && last_new.elapsed() < arguments.patience() {
        let has_advanced = preview.advance()?;
        if preview.pictures() > pictures {
            (pictures, last_new) = (preview.pictures(), Instant::now());
        }
        if shown.at.elapsed() >= shown.wait {
            shown = show(&preview, out, shown.line, terminal)?;
        }
        if !has_advanced {
            std::thread::sleep(POLL);
        }
    }
    preview.advance()?;
    preview.write(out)?;
    conclude(&preview.status()?, terminal);
    Ok(())
}

/// Waits for the first picture; None if the capture is ended before.
fn await_first(
    survey: &Path,
    reading: &PoseReadingArguments,
    capture: &FollowedCapture,
) -> Result<Option<LivePreview>, Failure> {
    while !capture.is_ended() {
        if let Some(preview) = LivePreview::open(survey, |file| reading.apply_to(file))? {
            return Ok(Some(preview));
        }
        std::thread::sleep(POLL);
    }
    Ok(None)
}

/// Writes the preview, and prints the state if it is another than that of `before`.
fn show(
    preview: &LivePreview,
    out: &Path,
    before: String,
    terminal: &Terminal,
) -> Result<Shown, Failure> {
    let since = Instant::now();
    let line = preview.status()?.line();
    if line != before {
        preview.write(out)?;
        terminal.say(format!("  {line}"));
    }
    Ok(Shown {
        at: Instant::now(),
        wait: MIN_PREVIEW_INTERVAL.max(since.elapsed() * MIN_PREVIEW_RATIO),
        line,
    })
}

/// Says at the end of the capture what has become of the frames.
fn conclude(status: &LiveStatus, terminal: &Terminal) {
    terminal.say(format!("the capture has ended: {}", status.line()));
    for warning in status.warnings() {
        terminal.warn(warning);
    }
}
