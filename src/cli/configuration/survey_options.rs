//! Options that `survey.toml` holds for a command.

use super::option::long_options;
use super::variables::CONFIGURABLE;
use crate::cli::output::Failure;
use crate::files::printed;
use crate::survey::{Survey, SurveyFile, toml_path};
use clap::parser::ValueSource;
use clap::{ArgMatches, Command};
use std::ffi::{OsStr, OsString};
use std::path::PathBuf;

/// Options that a survey holds for a command and that neither flags nor variables set.
pub(super) struct SurveyOptions {
    /// The file.
    pub(super) path: PathBuf,
    /// Name of the command.
    pub(super) command: String,
    /// Names of the options, with underscores.
    pub(super) names: Vec<String>,
    /// The options as arguments of the command line.
    pub(super) arguments: Vec<OsString>,
}

/// A value of `survey.toml` for the command line.
enum OptionValue {
    /// A flag without a value, set or not.
    Switch(bool),
    /// The value of an option.
    Text(String),
}

/// Reads the options of `survey.toml` for the command of `matches`.
///
/// # Errors
/// An unknown section or option; a value of the wrong type.
pub(super) fn read_survey_options(
    command: &Command,
    matches: &ArgMatches,
) -> Result<Option<SurveyOptions>, Failure> {
    let Some((name, own)) = matches.subcommand() else {
        return Ok(None);
    };
    let survey = match own.try_get_one::<PathBuf>("survey") {
        Ok(Some(survey)) => survey,
        Ok(None) | Err(_) => return Ok(None),
    };
    // The command reports a file that cannot be read when it opens the survey.
    let Ok(file) = Survey::read_file(survey) else {
        return Ok(None);
    };
    let path = toml_path(survey);
    let fail = |what: String| Failure::input(format!("{}: {what}", printed(&path)));
    check_sections(&file).map_err(fail)?;
    let (Some(table), Some(sub)) = (file.options.get(name), command.find_subcommand(name)) else {
        return Ok(None);
    };
    let mut found = SurveyOptions {
        path: path.clone(),
        command: name.to_owned(),
        names: Vec::new(),
        arguments: Vec::new(),
    };
    for (key, value) in table {
        let long = key.replace('_', "-");
        let option = long_options(command, sub).find(|(_, other)| *other == long);
        let Some((arg, _)) = option else {
            let names = long_options(command, sub).map(|(_, long)| long.replace('-', "_"));
            return Err(fail(format!(
                "[options.{name}]: unknown option `{key}`; there are {}",
                names.collect::<Vec<_>>().join(", ")
            )));
        };
        if is_given(own, arg) {
            continue;
        }
        let value =
            option_value(value).map_err(|what| fail(format!("[options.{name}]: {key}: {what}")))?;
        let default = arg.get_default_values().join(OsStr::new(","));
        match value {
            OptionValue::Switch(false) => continue,
            OptionValue::Switch(true) => found.arguments.push(format!("--{long}").into()),
            // A default does not conflict with other options, so it is not given as a flag.
            OptionValue::Text(text) if default == *text => continue,
            OptionValue::Text(text) => found.arguments.push(format!("--{long}={text}").into()),
        }
        found.names.push(key.replace('-', "_"));
    }
    Ok((!found.names.is_empty()).then_some(found))
}

/// Refuses a section `[options.<command>]` of no configurable command.
fn check_sections(file: &SurveyFile) -> Result<(), String> {
    let is_unknown = |key: &&String| !CONFIGURABLE.contains(&key.as_str());
    match file.options.keys().find(is_unknown) {
        Some(unknown) => Err(format!(
            "[options.{unknown}]: no such section; there are {}",
            CONFIGURABLE
                .map(|name| format!("[options.{name}]"))
                .join(", ")
        )),
        None => Ok(()),
    }
}

/// True if a flag or a variable sets the option.
fn is_given(matches: &ArgMatches, arg: &clap::Arg) -> bool {
    matches!(
        matches.value_source(arg.get_id().as_str()),
        Some(ValueSource::CommandLine | ValueSource::EnvVariable)
    )
}

fn option_value(value: &toml::Value) -> Result<OptionValue, String> {
    let text = |value: &toml::Value| match value {
        toml::Value::String(text) => Ok(text.clone()),
        toml::Value::Integer(number) => Ok(number.to_string()),
        toml::Value::Float(number) => Ok(number.to_string()),
        _ => Err("must be a text, a number, true or false, or a list of these".to_owned()),
    };
    Ok(match value {
        toml::Value::Boolean(is_set) => OptionValue::Switch(*is_set),
        toml::Value::Array(list) => {
            let list: Vec<String> = list.iter().map(text).collect::<Result<_, _>>()?;
            OptionValue::Text(list.join(","))
        }
        value => OptionValue::Text(text(value)?),
    })
}
