//! `tunnelstitch config`: prints the options in effect.

use crate::cli::configuration::{CONFIGURABLE, options_of_command};
use crate::cli::output::{Failure, Terminal, json};
use crate::survey::{Survey, SurveyFile};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// Shows every option in effect for a survey, with its source.
///
/// Flags come before variables (TUNNELSTITCH_STITCH_MODE=average), variables before
/// [options.stitch] in survey.toml, and that before the defaults. The output may be copied into
/// survey.toml. The run.toml beside every result records the same options.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  TUNNELSTITCH_STITCH_MODE=average tunnelstitch config my-survey stitch"
)]
pub struct ConfigArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Show only the options of this command.
    #[arg(value_parser = CONFIGURABLE)]
    command: Option<String>,
}

#[derive(Serialize)]
struct JsonOption {
    value: Option<toml::Value>,
    source: String,
}

#[derive(Serialize)]
struct JsonOutput<'a> {
    survey_file: &'a SurveyFile,
    options: BTreeMap<&'a str, BTreeMap<String, JsonOption>>,
}

/// Runs the command; `definition` is the whole command line with its variables.
///
/// # Errors
/// A survey.toml that cannot be used.
pub fn run(
    arguments: &ConfigArguments,
    definition: &clap::Command,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let mut file = Survey::read_file(&arguments.survey)?;
    file.options.clear();
    let mut output = JsonOutput {
        survey_file: &file,
        options: BTreeMap::new(),
    };
    let mut text = toml::to_string(&file).map_err(|error| Failure::bug(error.to_string()))?;
    if arguments.command.is_some() {
        text.clear();
    }
    let only = arguments.command.as_deref();
    let is_shown = |name: &&str| only.is_none_or(|only| only == *name);
    for name in CONFIGURABLE.into_iter().filter(is_shown) {
        let options = options_of_command(definition, name, &arguments.survey)?;
        let separator = if text.is_empty() { "" } else { "\n" };
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{separator}[options.{name}]");
        for option in &options {
            let source = option.source.text();
            let _ = match option.toml_value() {
                Some(value) => writeln!(text, "{} = {value}    # {source}", option.name),
                None => writeln!(text, "# {} is not set", option.name),
            };
        }
        let options = options.into_iter().map(|option| {
            let entry = JsonOption {
                value: option.toml_value(),
                source: option.source.text(),
            };
            (option.name, entry)
        });
        output.options.insert(name, options.collect());
    }
    if terminal.is_json() {
        json::print(&output)
    } else {
        terminal.say(text.trim_end());
        Ok(())
    }
}
