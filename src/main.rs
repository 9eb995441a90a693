//! The `tunnelstitch` program: starts the command line and maps errors to exit codes.

use std::process::ExitCode;

fn main() -> ExitCode {
    match tunnelstitch::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.code)
        }
    }
}
