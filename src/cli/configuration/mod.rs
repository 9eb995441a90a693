//! Options of a command from all their sources, in this order: a flag on the command line, a
//! variable `TUNNELSTITCH_<COMMAND>_<OPTION>`, `[options.<command>]` of `survey.toml`, the
//! default.

mod option;
mod parse;
mod survey_options;
mod variables;

#[cfg(test)]
pub use option::EffectiveOption;
pub use option::options_table;
pub use parse::{asks_for_json, options_of_command, parse};
pub use variables::{CONFIGURABLE, with_variables};
