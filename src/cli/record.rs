//! What a result was made with and from: `run.toml` beside it.

use super::Failure;
use super::configuration::{EffectiveOption, Source};
use crate::PROGRAM;
use crate::frames::hash_frames;
use crate::persist::atomic;
use crate::persist::provenance::{self, HashError, Input};
use crate::survey::Survey;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The run of a command.
pub struct Run {
    /// The command.
    pub command: String,
    /// The command line, the program by its name only.
    pub arguments: Vec<String>,
    /// Every option of the command.
    pub options: Vec<EffectiveOption>,
}

/// `run.toml`. Its options may be put into `survey.toml` as they are.
#[derive(Serialize)]
struct RunFile<'a> {
    schema_version: u32,
    program: &'static str,
    arguments: &'a [String],
    options: BTreeMap<&'a str, toml::Table>,
    inputs: &'a [Input],
}

const SCHEMA_VERSION: u32 = 1;

/// Name of the file in a folder of results.
pub const RUN_FILE: &str = "run.toml";

impl Run {
    /// Writes the record of a run on `inputs` to `path`.
    ///
    /// # Errors
    /// A record that cannot be written.
    pub fn write(&self, path: &Path, inputs: &[Input]) -> Result<(), Failure> {
        let text = toml::to_string(&RunFile {
            schema_version: SCHEMA_VERSION,
            program: PROGRAM,
            arguments: &self.arguments,
            options: BTreeMap::from([(self.command.as_str(), table(&self.options))]),
            inputs,
        })
        .map_err(|error| Failure::bug(error.to_string()))?;
        let head = "# How the results beside this file were made. [options] may be put into survey.toml.\n";
        atomic::write_text(path, &(head.to_owned() + &text))?;
        Ok(())
    }
}

/// The name of the record of a result that is one file: its own with `.run.toml` added.
pub fn beside(result: &Path) -> PathBuf {
    let mut name = result.as_os_str().to_owned();
    name.push(".");
    name.push(RUN_FILE);
    name.into()
}

/// Hashes of everything that `survey` is made of, and of `others`.
///
/// # Errors
/// An input that cannot be read.
pub fn inputs<'a>(
    survey: &'a Survey,
    others: impl IntoIterator<Item = &'a Path>,
) -> Result<Vec<Input>, Failure> {
    let own = survey.own_files();
    let mut inputs = files(own.iter().map(PathBuf::as_path).chain(others))?;
    inputs.push(hash_frames(&survey.frames).map_err(unreadable)?);
    Ok(inputs)
}

/// Hashes of files.
///
/// # Errors
/// One that cannot be read.
pub fn files<'a>(files: impl IntoIterator<Item = &'a Path>) -> Result<Vec<Input>, Failure> {
    let inputs = files.into_iter().map(provenance::input);
    inputs.collect::<Result<_, _>>().map_err(unreadable)
}

fn unreadable(error: HashError) -> Failure {
    Failure::input(error.to_string())
}

/// Options as `survey.toml` takes them; those without a value are left out.
pub fn table(options: &[EffectiveOption]) -> toml::Table {
    let set = options.iter().filter_map(|option| {
        let value = value(option)?;
        Some((option.name.clone(), value))
    });
    set.collect()
}

/// The value of an option, if it has one.
pub fn value(option: &EffectiveOption) -> Option<toml::Value> {
    if option.switch {
        // A variable says true in more ways than one.
        let set = option.values.first().is_some_and(|value| {
            let value = value.to_lowercase();
            !matches!(
                value.as_str(),
                "" | "false" | "0" | "no" | "n" | "f" | "off"
            )
        });
        return Some(toml::Value::Boolean(set));
    }
    let one = |text: &String| -> toml::Value {
        if let Ok(number) = text.parse::<i64>() {
            number.into()
        } else {
            match text.parse::<f64>() {
                Ok(number) if number.is_finite() => number.into(),
                _ => text.clone().into(),
            }
        }
    };
    match &option.values[..] {
        [] => None,
        [value] => Some(one(value)),
        values => Some(values.iter().map(one).collect::<Vec<_>>().into()),
    }
}

/// Where an option comes from, in a few words.
pub fn origin(source: &Source) -> String {
    match source {
        Source::Flag => "flag".to_owned(),
        Source::Variable(name) => name.clone(),
        Source::Survey => "survey.toml".to_owned(),
        Source::Default => "default".to_owned(),
    }
}
