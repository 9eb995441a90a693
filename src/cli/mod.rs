//! Command line of the program: arguments, printing and exit codes. The library does the work.
//!
//! | folder | content |
//! | --- | --- |
//! | `program` | the command line as a whole, and [`run`] |
//! | `commands` | one file per command: its arguments, the call of the library, its summary |
//! | `arguments` | groups of arguments that commands share |
//! | `configuration` | options from flags, variables, `survey.toml` and defaults |
//! | `help` | the commands under headings |
//! | `output` | terminal, JSON, failures, the record of a run |

mod arguments;
mod commands;
mod configuration;
mod help;
mod output;
mod program;

pub use output::{Failure, Terminal, print_failure};
pub use program::run;
