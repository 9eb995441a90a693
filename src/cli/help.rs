//! Help of the program as a whole: its commands under headings.

use clap::Command;
use std::fmt::Write;

/// Headings and the commands below them.
const GROUPS: [(&str, &[&str]); 6] = [
    ("Prepare a survey", &["init", "plan", "gyro", "check"]),
    ("Refine the poses", &["refine", "compare", "report"]),
    (
        "Use the result",
        &["stitch", "locate", "view", "export", "convert"],
    ),
    (
        "Many surveys",
        &["plan-job", "run-job", "run-task", "network-map"],
    ),
    ("Try it", &["demo", "simulate", "converge", "project"]),
    ("The program", &["config", "completions", "man", "help"]),
];

/// Groups of options that the short help (`-h`) leaves out.
const LONG_HELP_GROUPS: [&str; 5] = [
    "Reading poses (overrides survey.toml)",
    "Reading frames (overrides survey.toml)",
    "Degradations (none by default)",
    "Real pictures (ideal by default)",
    "The wall as built (as drawn by default)",
];

/// Width of the column of names.
const NAME_COLUMNS: usize = 14;
/// Width of a line.
const LINE_COLUMNS: usize = 80;
/// Description of the command that clap adds.
const HELP_ABOUT: &str = "Prints this text, or the help of a command";

/// Lists the commands of the program under headings in its help.
pub fn group_commands(command: Command) -> Command {
    let header = *command.get_styles().get_header();
    let literal = *command.get_styles().get_literal();
    let mut list = String::new();
    for (heading, names) in GROUPS {
        // Writing into a string cannot fail.
        let _ = writeln!(list, "{header}{heading}:{header:#}");
        for name in names {
            let about = match command.find_subcommand(name) {
                Some(sub) => sub.get_about().map_or(String::new(), ToString::to_string),
                None => HELP_ABOUT.to_owned(),
            };
            let padding = " ".repeat(NAME_COLUMNS - 2 - name.len());
            let about = wrapped(about.trim_end_matches('.'));
            let _ = writeln!(list, "  {literal}{name}{literal:#}{padding}{about}");
        }
        list.push('\n');
    }
    command.help_template(format!(
        "{{about-with-newline}}\n{{usage-heading}} {{usage}}\n\n{list}\
         {header}Options:{header:#}\n{{options}}{{after-help}}"
    ))
}

/// Leaves groups of rarely used options out of the short help of the commands.
pub fn shorten_short_help(command: Command) -> Command {
    command.mut_subcommands(|sub| {
        sub.mut_args(|argument| {
            let heading = argument.get_help_heading();
            let is_rare = heading.is_some_and(|heading| LONG_HELP_GROUPS.contains(&heading));
            argument.hide_short_help(is_rare)
        })
    })
}

/// Breaks a description so that it stays within its column.
fn wrapped(text: &str) -> String {
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.is_empty() => line.push_str(word),
            Some(line) if NAME_COLUMNS + line.len() + word.len() < LINE_COLUMNS => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines.join(&format!("\n{}", " ".repeat(NAME_COLUMNS)))
}

/// Names of all commands under the headings.
#[cfg(test)]
pub(super) fn grouped_names() -> Vec<&'static str> {
    GROUPS
        .iter()
        .flat_map(|(_, names)| names.iter().copied())
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_stay_within_their_column() {
        let text = wrapped(&"word ".repeat(30));
        let mut lines = text.lines();
        assert!(
            lines
                .next()
                .is_some_and(|line| line.len() <= LINE_COLUMNS - NAME_COLUMNS)
        );
        assert!(lines.all(|line| line.len() <= LINE_COLUMNS && line.starts_with("    ")));
        assert_eq!(wrapped("short"), "short");
    }
}
