//! Failures on standard error: as a text, or as JSON with `--json`.

use super::failure::Failure;
use super::label::Label;
use super::terminal::{print_error, print_labelled};
use serde::Serialize;
use std::sync::atomic::{AtomicBool, Ordering};

/// True if failures are printed as JSON. It is a variable of the process because a failure may be a
/// panic in any thread.
static IS_JSON: AtomicBool = AtomicBool::new(false);

/// A failure in JSON.
#[derive(Serialize)]
struct FailureReport<'a> {
    error: &'a str,
    exit_code: u8,
}

/// Chooses whether failures are printed as JSON.
pub fn print_failures_as_json(is_json: bool) {
    IS_JSON.store(is_json, Ordering::Relaxed);
}

/// Prints a failure on standard error: `error: …`, or one line
/// `{"error": "…", "exit_code": …}` with `--json`.
pub fn print_failure(failure: &Failure) {
    if IS_JSON.load(Ordering::Relaxed) {
        print_error(&json_text(failure));
    } else {
        print_labelled(Label::Error, &failure.message);
    }
}

fn json_text(failure: &Failure) -> String {
    let report = FailureReport {
        error: &failure.message.replace("\nerror: ", "\n"),
        exit_code: failure.code,
    };
    // Texts and numbers can always be serialised.
    serde_json::to_string(&report).unwrap_or_else(|_| failure.message.clone())
}

/// The failure of arguments that clap refuses. Without `--json`, and for requests of help, the
/// program ends here as clap does.
pub fn refused_arguments(error: &clap::Error) -> Failure {
    if !(IS_JSON.load(Ordering::Relaxed) && error.use_stderr()) {
        error.exit();
    }
    let text = error.to_string();
    Failure::usage(text.strip_prefix("error: ").unwrap_or(&text).trim_end())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failure_in_json_is_one_line_with_its_exit_code() {
        let text = json_text(&Failure::input("frame 1: \"x\"\nerror: frame 2"));
        assert_eq!(text, r#"{"error":"frame 1: \"x\"\nframe 2","exit_code":3}"#);
    }
}
