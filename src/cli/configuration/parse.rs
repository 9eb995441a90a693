//! Parses the command line together with the options of `survey.toml`.

use super::option::{EffectiveOption, OptionSource, is_false, long_options};
use super::survey_options::{SurveyOptions, read_survey_options};
use super::variables::variable_name;
use crate::cli::output::{Failure, refused_arguments};
use crate::files::printed;
use clap::error::ErrorKind;
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};
use std::ffi::OsString;
use std::path::Path;

/// The parsed arguments, and every option in effect with its source.
pub struct Parsed {
    /// The arguments.
    pub matches: ArgMatches,
    /// Name of the command.
    pub command: String,
    /// Options of the command.
    pub options: Vec<EffectiveOption>,
}

/// Parses `arguments`, the program's name first, for `command`, which has its variables.
///
/// # Errors
/// Wrong options in `survey.toml`. Wrong arguments and requests for help end the program as clap
/// does, unless failures are printed as JSON.
pub fn parse(command: &Command, arguments: Vec<OsString>) -> Result<Parsed, Failure> {
    let given = command.clone().try_get_matches_from(&arguments);
    let from_survey = match &given {
        Ok(matches) => read_survey_options(command, matches)?,
        // The survey may hold the missing argument.
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => {
            read_survey_options(command, &parse_incomplete(command, &arguments)?)?
        }
        Err(_) => None,
    };
    let (matches, survey_names) = match from_survey {
        None => (
            given.map_err(|error| refused_arguments(&error))?,
            Vec::new(),
        ),
        Some(from_survey) => {
            let matches = parse_with_survey(command, arguments, &from_survey)?;
            (matches, from_survey.names)
        }
    };
    let (name, options) = match matches.subcommand() {
        Some((name, own)) => {
            let options = effective_options(command, name, own, &survey_names);
            (name.to_owned(), options)
        }
        None => (String::new(), Vec::new()),
    };
    Ok(Parsed {
        matches,
        command: name,
        options,
    })
}

/// True if arguments that may be wrong, or the variable, ask for results and failures as JSON.
pub fn asks_for_json(arguments: &[OsString]) -> bool {
    let mut options = arguments.iter().take_while(|word| *word != "--");
    let variable = std::env::var(variable_name(None, "json"));
    options.any(|word| word == "--json")
        || variable.is_ok_and(|value| !is_false(&value.to_lowercase()))
}

/// Parses the arguments with those of the survey behind them.
fn parse_with_survey(
    command: &Command,
    mut arguments: Vec<OsString>,
    from_survey: &SurveyOptions,
) -> Result<ArgMatches, Failure> {
    // Behind a lone `--` there are no options.
    let end = arguments.iter().position(|word| word == "--");
    let end = end.unwrap_or(arguments.len());
    arguments.splice(end..end, from_survey.arguments.iter().cloned());
    let matches = command.clone().try_get_matches_from(&arguments);
    matches.map_err(|error| {
        if error.kind() == ErrorKind::MissingRequiredArgument {
            return refused_arguments(&error);
        }
        let text = error.to_string();
        let what = text.strip_prefix("error: ").unwrap_or(&text);
        Failure::input(format!(
            "{}: [options.{}]: {what}",
            printed(&from_survey.path),
            from_survey.command
        ))
    })
}

/// Lists every option of the command `name` with its value and source.
fn effective_options(
    command: &Command,
    name: &str,
    matches: &ArgMatches,
    survey_names: &[String],
) -> Vec<EffectiveOption> {
    let Some(sub) = command.find_subcommand(name) else {
        return Vec::new();
    };
    long_options(command, sub)
        .map(|(arg, long)| {
            let id = arg.get_id().as_str();
            let option = long.replace('-', "_");
            let values = matches.try_get_raw(id).ok().flatten();
            let values: Vec<String> = values
                .into_iter()
                .flatten()
                .map(|value| value.to_string_lossy().into_owned())
                .collect();
            let source = match matches.value_source(id) {
                Some(ValueSource::CommandLine) if survey_names.contains(&option) => {
                    OptionSource::Survey
                }
                Some(ValueSource::CommandLine) => OptionSource::Flag,
                Some(ValueSource::EnvVariable) => {
                    let command = (!arg.is_global_set()).then_some(name);
                    OptionSource::Variable(variable_name(command, long))
                }
                _ => OptionSource::Default,
            };
            EffectiveOption {
                name: option,
                values,
                is_switch: !arg.get_action().takes_values(),
                source,
            }
        })
        .collect()
}

/// Lists the options of the command `name` for a survey, as if it were run without flags.
///
/// # Errors
/// The errors of [`parse`].
pub fn options_of_command(
    command: &Command,
    name: &str,
    survey: &Path,
) -> Result<Vec<EffectiveOption>, Failure> {
    let mut arguments: Vec<OsString> = vec![
        "tunnelstitch".into(),
        name.into(),
        survey.as_os_str().into(),
    ];
    let without_options = parse_incomplete(command, &arguments)?;
    let survey_names = match read_survey_options(command, &without_options)? {
        None => Vec::new(),
        Some(from_survey) => {
            arguments.extend(from_survey.arguments);
            from_survey.names
        }
    };
    let matches = parse_incomplete(command, &arguments)?;
    Ok(match matches.subcommand() {
        Some((name, own)) => effective_options(command, name, own, &survey_names),
        None => Vec::new(),
    })
}

/// Parses arguments of which required ones may be missing.
fn parse_incomplete(command: &Command, arguments: &[OsString]) -> Result<ArgMatches, Failure> {
    match command.clone().try_get_matches_from(arguments) {
        Ok(matches) => Ok(matches),
        Err(error) if error.kind() == ErrorKind::MissingRequiredArgument => command
            .clone()
            .ignore_errors(true)
            .try_get_matches_from(arguments)
            .map_err(|error| Failure::bug(error.to_string())),
        Err(error) => Err(Failure::input(error.to_string())),
    }
}
