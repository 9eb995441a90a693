//! Output that commands share: texts on the terminal, JSON, failures with their exit codes, and the
//! record of a run beside its results.

mod dry_run;
mod duration;
mod failure;
mod failure_output;
mod interrupt;
mod job_clock;
pub mod json;
mod label;
mod paths;
pub mod record;
mod stream;
mod suggestion;
mod terminal;

pub use dry_run::{DryRunArguments, Job};
pub use duration::duration_text;
pub use failure::Failure;
pub use failure_output::{print_failure, print_failures_as_json, refused_arguments};
pub use interrupt::{FollowedCapture, end_capture};
pub use paths::{
    check_parent_folder, own_program, picture_format, refuse_overwriting, survey_files,
};
pub use record::{RUN_FILE, RunRecord};
pub use stream::{is_stream, print_file, refuse_two_results};
pub use suggestion::{PosesReport, Suggestion, SuggestionArguments};
pub use terminal::{Terminal, print_error};
