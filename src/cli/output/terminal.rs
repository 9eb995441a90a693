//! Progress bars, summaries and warnings on the terminal.

use super::failure::Failure;
use super::job_clock::JobClock;
use super::json;
use super::label::Label;
use crate::files::escape_controls;
use crate::progress::{JobStage, Progress};
use indicatif::style::TemplateError;
use indicatif::{ProgressBar, ProgressState, ProgressStyle};
use serde::Serialize;
use std::io::Write;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Prints a line on standard error with its control characters escaped. A standard error that is
/// closed or full is not an error, and never a panic.
pub fn print_error(text: &str) {
    write_line(escape_controls(text));
}

/// Prints a message as [`print_error`] does, behind its label. Further messages of the same label
/// may follow on lines of their own.
pub(super) fn print_labelled(label: Label, text: &str) {
    let painted = label.painted();
    let text =
        escape_controls(text).replace(&format!("\n{}", label.word()), &format!("\n{painted}"));
    write_line(format!("{painted} {text}"));
}

/// Writes a line at once, so that those of several threads do not mix.
fn write_line(text: String) {
    let _ = std::io::stderr().write_all((text + "\n").as_bytes());
}

/// Progress bars on standard error (hidden with `--quiet` or if it is no terminal) and, on standard
/// output, summaries or (with `--json`) one JSON document instead.
pub struct Terminal {
    quiet: bool,
    is_json: bool,
    bar: Mutex<Option<ProgressBar>>,
    /// Clock of the job under way, if it has several stages.
    clock: Mutex<Option<JobClock>>,
}

impl Terminal {
    /// Creates the terminal; `quiet` hides bars and summaries, `is_json` prints results as JSON
    /// instead of summaries.
    pub fn new(quiet: bool, is_json: bool) -> Self {
        Self {
            quiet,
            is_json,
            bar: Mutex::new(None),
            clock: Mutex::new(None),
        }
    }

    /// True if the result is printed as JSON.
    pub fn is_json(&self) -> bool {
        self.is_json
    }

    /// Prints the result of the command as JSON, if it is asked for.
    ///
    /// # Errors
    /// A standard output that is full.
    pub fn result(&self, value: &impl Serialize) -> Result<(), Failure> {
        if self.is_json {
            json::print(value)
        } else {
            Ok(())
        }
    }

    /// Prints a line of the summary, unless the result is printed as JSON.
    pub fn say(&self, text: impl AsRef<str>) {
        if !self.quiet && !self.is_json {
            // A closed pipe (`| head`) is not an error.
            let _ = writeln!(std::io::stdout(), "{}", escape_controls(text.as_ref()));
        }
    }

    /// Prints a warning on standard error, even when quiet.
    pub fn warn(&self, text: impl AsRef<str>) {
        print_labelled(Label::Warning, text.as_ref());
    }

    fn clock(&self) -> MutexGuard<'_, Option<JobClock>> {
        self.clock.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn with_bar(&self, act: impl FnOnce(&ProgressBar)) {
        if let Ok(guard) = self.bar.lock()
            && let Some(bar) = guard.as_ref()
        {
            act(bar);
        }
    }
}

impl Progress for Terminal {
    fn start(&self, stage: &str, total: usize) {
        self.finish();
        if self.quiet {
            return;
        }
        let bar = ProgressBar::new(total as u64);
        if let Ok(style) = bar_style(*self.clock()) {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(stage.to_owned());
        bar.enable_steady_tick(Duration::from_millis(200));
        if let Ok(mut guard) = self.bar.lock() {
            *guard = Some(bar);
        }
    }

    fn advance(&self, parts: usize) {
        self.with_bar(|bar| bar.inc(parts as u64));
    }

    fn detail(&self, text: &str) {
        self.with_bar(|bar| bar.set_message(escape_controls(text)));
    }

    fn finish(&self) {
        if let Ok(mut guard) = self.bar.lock()
            && let Some(bar) = guard.take()
        {
            bar.finish_and_clear();
        }
    }

    fn enter_job_stage(&self, stage: JobStage) {
        let mut clock = self.clock();
        *clock = Some(JobClock::enter(*clock, stage));
    }

    fn leave_job(&self) {
        *self.clock() = None;
    }
}

/// Style of a bar: with the time that is left of the stage, or of the whole job, if it has a clock.
fn bar_style(clock: Option<JobClock>) -> Result<ProgressStyle, TemplateError> {
    let Some(clock) = clock else {
        return ProgressStyle::with_template(
            "{prefix:>12} [{bar:30}] {pos}/{len} {per_sec} {elapsed} (eta {eta}) {msg}",
        );
    };
    let job = move |state: &ProgressState, text: &mut dyn std::fmt::Write| {
        // Nobody could be told of an error.
        let _ = text.write_str(&clock.text(state.fraction().into()));
    };
    let template = "{prefix:>12} [{bar:30}] {pos}/{len} {elapsed} ({job}) {msg}";
    Ok(ProgressStyle::with_template(template)?.with_key("job", job))
}
