//! Leaving out of what does not move with the wall, for the commands that use the pixels.

use crate::check::interlacing_warning;
use crate::cli::output::{Failure, Terminal};
use crate::survey::{Overlay, Survey};

/// Leaves out the pixels of a survey that do not move with the wall, and says so; warns of
/// interlaced frames.
///
/// # Errors
/// A frame that cannot be read.
pub fn leave_out_overlay(survey: &mut Survey, terminal: &Terminal) -> Result<Overlay, Failure> {
    let overlay = survey.leave_out_overlay()?;
    if let Some(sentence) = overlay.report.sentence() {
        terminal.say(sentence);
    }
    if overlay.report.interlaced {
        terminal.warn(interlacing_warning(survey));
    }
    Ok(overlay)
}
