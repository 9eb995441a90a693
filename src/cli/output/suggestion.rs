//! Lines that `survey.toml` needs for poses that have just been written.

use super::failure::Failure;
use super::terminal::Terminal;
use crate::persist::atomic;
use crate::survey::{PosesSection, PriorSection};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Argument for the lines that belong into `survey.toml`.
#[derive(Debug, clap::Args)]
pub struct SuggestionArguments {
    /// Also write the lines that belong into survey.toml to this file.
    #[arg(long, value_name = "FILE")]
    toml_out: Option<PathBuf>,
}

/// Suggested sections of `survey.toml`.
#[derive(Serialize)]
pub struct Suggestion {
    poses: PosesSection,
    prior: PriorSection,
    /// Remarks, as comments.
    #[serde(skip)]
    remarks: Vec<String>,
}

/// Poses that were written, with the sections of `survey.toml` that they need.
#[derive(Serialize)]
pub struct PosesReport<'a> {
    out: &'a Path,
    poses: usize,
    survey_file: &'a Suggestion,
    remarks: &'a [String],
}

impl Suggestion {
    /// Suggests sections for poses in the file `out`; `survey` is the survey's folder or
    /// `survey.toml`.
    pub fn new(out: &Path, survey: Option<&Path>, prior: PriorSection) -> Self {
        let folder = survey.map(|survey| {
            if survey.is_dir() {
                survey
            } else {
                survey.parent().unwrap_or(Path::new(""))
            }
        });
        let absolute = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let relative =
            folder.and_then(|folder| pathdiff::diff_paths(absolute(out), absolute(folder)));
        let initial = relative.unwrap_or_else(|| out.to_owned());
        Self {
            poses: PosesSection::of(initial),
            prior,
            remarks: Vec::new(),
        }
    }

    /// The poses that were written, with these sections, for `--json`.
    pub fn report<'a>(&'a self, out: &'a Path, poses: usize) -> PosesReport<'a> {
        PosesReport {
            out,
            poses,
            survey_file: self,
            remarks: &self.remarks,
        }
    }

    /// Adds a comment of one line.
    pub fn add_remark(&mut self, text: impl Into<String>) {
        self.remarks.push(text.into());
    }

    /// Prints the lines, and writes them to the file of --toml-out.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn show(
        &self,
        arguments: &SuggestionArguments,
        terminal: &Terminal,
    ) -> Result<(), Failure> {
        terminal.say("for survey.toml:\n");
        for line in self.text()?.lines() {
            terminal.say(format!("    {line}").trim_end());
        }
        self.write(arguments)
    }

    /// Writes the lines to the file of --toml-out.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, arguments: &SuggestionArguments) -> Result<(), Failure> {
        if let Some(path) = &arguments.toml_out {
            atomic::write_text(path, &self.text()?)?;
        }
        Ok(())
    }

    fn text(&self) -> Result<String, Failure> {
        let sections = toml::to_string(self)
            .map_err(|error| Failure::bug(format!("cannot write the sections: {error}")))?;
        let remarks = self.remarks.iter().map(|text| format!("# {text}\n"));
        Ok(remarks.collect::<String>() + &sections)
    }
}
