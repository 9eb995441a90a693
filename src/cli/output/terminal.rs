//! Progress bars, summaries and warnings on the terminal.

use crate::files::escape_controls;
use crate::progress::Progress;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write;
use std::sync::Mutex;
use std::time::Duration;

/// Prints a line on standard error with its control characters escaped. A standard error that is
/// closed or full is not an error, and never a panic.
pub fn print_error(text: &str) {
    // At once, so that lines of several threads do not mix.
    let line = escape_controls(text) + "\n";
    let _ = std::io::stderr().write_all(line.as_bytes());
}

/// Progress bars on standard error (hidden with `--quiet` or if it is no terminal) and summaries on
/// standard output.
pub struct Terminal {
    quiet: bool,
    bar: Mutex<Option<ProgressBar>>,
}

impl Terminal {
    /// Creates the terminal; `quiet` hides bars and summaries.
    pub fn new(quiet: bool) -> Self {
        Self {
            quiet,
            bar: Mutex::new(None),
        }
    }

    /// Prints a line of the summary.
    pub fn say(&self, text: impl AsRef<str>) {
        if !self.quiet {
            // A closed pipe (`| head`) is not an error.
            let _ = writeln!(std::io::stdout(), "{}", escape_controls(text.as_ref()));
        }
    }

    /// Prints a warning on standard error, even when quiet.
    pub fn warn(&self, text: impl AsRef<str>) {
        print_error(&format!("warning: {}", text.as_ref()));
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
        if let Ok(style) = ProgressStyle::with_template(
            "{prefix:>12} [{bar:30}] {pos}/{len} {per_sec} {elapsed} (eta {eta}) {msg}",
        ) {
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
}
