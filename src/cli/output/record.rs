//! `run.toml`, the record beside a result: command line, options and hashes of all inputs.

use super::failure::Failure;
use crate::frames::hash_frames;
use crate::persist::atomic::OutputSet;
use crate::persist::provenance::{self, HashError, Input};
use crate::survey::Survey;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_core::PROGRAM;

/// Command line and options of a run.
pub struct RunRecord {
    /// Name of the command.
    pub command: String,
    /// The command line, with the program's name instead of its path.
    pub arguments: Vec<String>,
    /// Every option of the command that has a value.
    pub options: toml::Table,
}

/// `run.toml`. Its options may be copied into `survey.toml`.
#[derive(Serialize)]
struct RunFile<'a> {
    schema_version: u32,
    program: &'static str,
    arguments: &'a [String],
    options: BTreeMap<&'a str, &'a toml::Table>,
    inputs: &'a [Input],
}

const SCHEMA_VERSION: u32 = 1;

/// Name of the record in a folder of results.
pub const RUN_FILE: &str = "run.toml";

/// First line of the record.
const HEADER: &str = "# How the results beside this file were made. [options] may be put into \
                      survey.toml.\n";

impl RunRecord {
    /// Writes the record of a run on `inputs` to `path`.
    ///
    /// # Errors
    /// A record that cannot be written.
    pub fn write(&self, path: &Path, inputs: &[Input]) -> Result<(), Failure> {
        let mut outputs = OutputSet::default();
        self.add_to(&mut outputs, path, inputs)?;
        Ok(outputs.commit()?)
    }

    /// Adds the record of a run on `inputs` to the set of its outputs, as `path`.
    ///
    /// # Errors
    /// A record that cannot be written.
    pub fn add_to(
        &self,
        outputs: &mut OutputSet,
        path: &Path,
        inputs: &[Input],
    ) -> Result<(), Failure> {
        let text = toml::to_string(&RunFile {
            schema_version: SCHEMA_VERSION,
            program: PROGRAM,
            arguments: &self.arguments,
            options: BTreeMap::from([(self.command.as_str(), &self.options)]),
            inputs,
        })
        .map_err(|error| Failure::bug(error.to_string()))?;
        Ok(outputs.write_text(path, &(HEADER.to_owned() + &text))?)
    }
}

/// Path of the record of a result that is one file: the file's own with `.run.toml` added.
pub fn path_beside(result: &Path) -> PathBuf {
    let mut name = result.as_os_str().to_owned();
    name.push(".");
    name.push(RUN_FILE);
    name.into()
}

/// Hashes all files of `survey`, frames included, and `others`.
///
/// # Errors
/// An input that cannot be read.
pub fn hash_survey<'a>(
    survey: &'a Survey,
    others: impl IntoIterator<Item = &'a Path>,
) -> Result<Vec<Input>, Failure> {
    let own = survey.own_files();
    let mut inputs = hash_files(own.iter().map(PathBuf::as_path).chain(others))?;
    inputs.push(hash_frames(&survey.frames).map_err(unreadable)?);
    Ok(inputs)
}

/// Hashes files.
///
/// # Errors
/// A file that cannot be read.
pub fn hash_files<'a>(files: impl IntoIterator<Item = &'a Path>) -> Result<Vec<Input>, Failure> {
    let inputs = files.into_iter().map(provenance::input);
    inputs.collect::<Result<_, _>>().map_err(unreadable)
}

fn unreadable(error: HashError) -> Failure {
    Failure::input(error.to_string())
}
