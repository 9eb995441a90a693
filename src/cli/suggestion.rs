//! What belongs into `survey.toml` for poses that were just written.

use super::{Failure, Terminal};
use crate::persist::atomic;
use crate::survey::{PosesSection, PriorSection};
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Where the lines for `survey.toml` go.
#[derive(Debug, clap::Args)]
pub struct SuggestionArguments {
    /// Write the lines that belong into survey.toml to this file, too.
    #[arg(long, value_name = "FILE")]
    toml_out: Option<PathBuf>,
}

/// Sections of `survey.toml`.
#[derive(Serialize)]
pub struct Suggestion {
    poses: PosesSection,
    prior: PriorSection,
    /// Remarks, as comments.
    #[serde(skip)]
    remarks: Vec<String>,
}

impl Suggestion {
    /// For poses in the file `out`, of the survey whose folder or `survey.toml` is `survey`.
    pub fn new(out: &Path, survey: Option<&Path>, prior: PriorSection) -> Self {
        let folder = survey.map(|survey| {
            if survey.is_dir() {
                survey
            } else {
                survey.parent().unwrap_or(Path::new(""))
            }
        });
        let full = |path: &Path| std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
        let relative = folder.and_then(|folder| pathdiff::diff_paths(full(out), full(folder)));
        let initial = relative.unwrap_or_else(|| out.to_owned());
        Self {
            poses: PosesSection::of(initial),
            prior,
            remarks: Vec::new(),
        }
    }

    /// Adds a remark of one line.
    pub fn remark(&mut self, text: impl Into<String>) {
        self.remarks.push(text.into());
    }

    /// Prints the lines, and writes them where that is asked for.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn show(
        &self,
        arguments: &SuggestionArguments,
        terminal: &Terminal,
    ) -> Result<(), Failure> {
        let sections = toml::to_string(self)
            .map_err(|error| Failure::bug(format!("cannot write the sections: {error}")))?;
        let remarks: String = self
            .remarks
            .iter()
            .map(|text| format!("# {text}\n"))
            .collect();
        let text = remarks + &sections;
        terminal.say("for survey.toml:\n");
        for line in text.lines() {
            terminal.say(format!("    {line}").trim_end());
        }
        if let Some(path) = &arguments.toml_out {
            super::stitch::parent_folder(path)?;
            atomic::write_text(path, &text)?;
        }
        Ok(())
    }
}
