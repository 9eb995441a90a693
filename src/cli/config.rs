//! `tunnelstitch config`: the configuration in effect.

use super::configuration::{self, CONFIGURABLE};
use super::{Failure, Terminal, json, record};
use crate::survey::{Survey, SurveyFile};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;

/// Shows every option in effect for a survey, and where it comes from.
///
/// Flags come before variables (TUNNELSTITCH_STITCH_MODE=average), these before [options.stitch] in
/// survey.toml, and that before the defaults. What is printed may be put into survey.toml as it is;
/// every result has the like beside it in run.toml.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  TUNNELSTITCH_STITCH_MODE=average tunnelstitch config my-survey stitch"
)]
pub struct ConfigArguments {
    /// Folder of the survey, or its survey.toml.
    survey: PathBuf,
    /// Only the options of this command.
    #[arg(value_parser = CONFIGURABLE)]
    command: Option<String>,
    /// Print as JSON: the survey's file, and each option with its value and source.
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct JsonOption {
    value: Option<toml::Value>,
    source: String,
}

#[derive(Serialize)]
struct Effective<'a> {
    survey_file: &'a SurveyFile,
    options: BTreeMap<&'a str, BTreeMap<String, JsonOption>>,
}

/// Runs the command.
///
/// # Errors
/// A survey.toml that cannot be used.
pub fn run(arguments: &ConfigArguments, terminal: &Terminal) -> Result<(), Failure> {
    let mut file = Survey::read_file(&arguments.survey)?;
    file.options.clear();
    let mut effective = Effective {
        survey_file: &file,
        options: BTreeMap::new(),
    };
    let mut text = toml::to_string(&file).map_err(|error| Failure::bug(error.to_string()))?;
    if arguments.command.is_some() {
        text.clear();
    }
    let asked = |name: &&str| {
        arguments
            .command
            .as_deref()
            .is_none_or(|only| only == *name)
    };
    for name in CONFIGURABLE.into_iter().filter(asked) {
        let options = configuration::of_command(name, &arguments.survey)?;
        let head = if text.is_empty() { "" } else { "\n" };
        // Writing into a string cannot fail.
        let _ = writeln!(text, "{head}[options.{name}]");
        for option in &options {
            let origin = record::origin(&option.source);
            let _ = match record::value(option) {
                Some(value) => writeln!(text, "{} = {value}    # {origin}", option.name),
                None => writeln!(text, "# {} is not set", option.name),
            };
        }
        let options = options.into_iter().map(|option| {
            let entry = JsonOption {
                value: record::value(&option),
                source: record::origin(&option.source),
            };
            (option.name, entry)
        });
        effective.options.insert(name, options.collect());
    }
    if arguments.json {
        json::print(&effective)
    } else {
        terminal.say(text.trim_end());
        Ok(())
    }
}
