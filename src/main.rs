//! The `tunnelstitch` program: starts the command line and maps errors to exit codes.

use std::process::ExitCode;
#[cfg(unix)]
use std::sync::{Arc, atomic::AtomicBool};
use tunnelstitch::cli::{Failure, print_failure};

/// In the text of a panic: a `TryReserveError` of the standard library for memory that is not
/// there.
const NO_MEMORY: &str = "AllocError";

fn main() -> ExitCode {
    // A panic in any thread is a bug and ends the program with the exit code of bugs; but a library
    // that expects memory where there is none panics, too.
    std::panic::set_hook(Box::new(|panic| {
        tunnelstitch::persist::remove_unfinished();
        let what = panic.to_string();
        let failure = if what.contains(NO_MEMORY) {
            Failure::temporary(format!("memory has ended: {what}"))
        } else {
            Failure::bug(format!(
                "bug in tunnelstitch {}: {what}\nplease report it with the command line and, if \
                 you can, the survey",
                env!("CARGO_PKG_VERSION")
            ))
        };
        print_failure(&failure);
        std::process::exit(failure.code.into());
    }));
    block_file_size_signal();
    exit_without_memory();
    match tunnelstitch::cli::run() {
        Ok(()) => ExitCode::SUCCESS,
        Err(failure) => {
            print_failure(&failure);
            ExitCode::from(failure.code)
        }
    }
}

/// Blocks the signal of a file that reaches the limit of its size (`ulimit -f`), in this thread and
/// in those that it starts: writing fails instead, as on a full disk.
#[cfg(unix)]
fn block_file_size_signal() {
    let mut signals = nix::sys::signal::SigSet::empty();
    signals.add(nix::sys::signal::Signal::SIGXFSZ);
    // Without it, the program ends by the signal.
    let _ = signals.thread_block();
}

#[cfg(not(unix))]
fn block_file_size_signal() {}

/// Ends the program with the code of temporary failures where it would abort. That is when memory
/// ends, which has been printed then: a panic, the other reason, ends the program before.
#[cfg(unix)]
fn exit_without_memory() {
    let always = Arc::new(AtomicBool::new(true));
    let code = i32::from(Failure::temporary("").code);
    // Without it, the program ends by the signal.
    let _ = signal_hook::flag::register_conditional_shutdown(
        signal_hook::consts::SIGABRT,
        code,
        always,
    );
}

#[cfg(not(unix))]
fn exit_without_memory() {}
