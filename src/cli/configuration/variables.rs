//! Environment variables of options.

use clap::Command;

/// Commands whose options `survey.toml` may hold: those that take a survey.
pub const CONFIGURABLE: [&str; 11] = [
    "check", "plan", "gyro", "refine", "stitch", "locate", "compare", "convert", "report",
    "export", "view",
];

/// Adds the environment variable of every option to the command line, and a line about them to
/// every help text.
pub fn with_variables(command: Command) -> Command {
    let global = |arg: clap::Arg| match arg.get_long() {
        Some(long) => {
            let name = variable_name(None, long);
            arg.env(name)
        }
        None => arg,
    };
    command.mut_args(global).mut_subcommands(|sub| {
        let name = sub.get_name().to_owned();
        let own = sub.mut_args(|arg| match arg.get_long() {
            Some("help" | "version") | None => arg,
            Some(long) => {
                let variable = variable_name(Some(&name), long);
                arg.env(variable).hide_env(true)
            }
        });
        let in_survey = if CONFIGURABLE.contains(&name.as_str()) {
            format!(" and under [options.{name}] in survey.toml")
        } else {
            String::new()
        };
        let sources = format!(
            "Options may also be set as TUNNELSTITCH_{}_<OPTION>{in_survey}; `tunnelstitch config` \
             shows what is in effect.",
            upper_case(&name)
        );
        let help = own.get_after_help().map(|help| format!("{help}\n\n"));
        own.after_help(help.unwrap_or_default() + &sources)
    })
}

/// Name of the variable of an option; `None` for the command of a global option.
pub(super) fn variable_name(command: Option<&str>, long: &str) -> String {
    let command = command.map_or(String::new(), |name| upper_case(name) + "_");
    format!("TUNNELSTITCH_{command}{}", upper_case(long))
}

fn upper_case(name: &str) -> String {
    name.to_uppercase().replace('-', "_")
}
