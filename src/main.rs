//! The `tunnelstitch` program: starts the command line and maps errors to exit codes.

use std::process::ExitCode;

fn main() -> ExitCode {
    // A panic in any thread is a bug and ends the program with the exit code of bugs.
    std::panic::set_hook(Box::new(|panic| {
        tunnelstitch::persist::remove_unfinished();
        eprintln!("bug in tunnelstitch {}: {panic}", env!("CARGO_PKG_VERSION"));
        eprintln!("please report it with the command line and, if you can, the survey");
        std::process::exit(1);
    }));
    match tunnelstitch::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            eprintln!("error: {}", failure.message);
            ExitCode::from(failure.code)
        }
    }
}
