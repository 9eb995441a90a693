//! `network.toml`: the sections of a network of tunnels, each with its survey.

use super::error::JobError;
use super::text_file;
use crate::files::read_text;
use crate::survey::toml_path;
use serde::Deserialize;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Largest size of the file, bytes: a hundred thousand sections.
const MAX_BYTES: u64 = 64 << 20;

/// A network of tunnels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Network {
    /// Its sections, in the order of the file.
    pub sections: Vec<Section>,
}

/// A section of a network, as from manhole to manhole.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Section {
    /// Name of the section, and of the folder of its results; unique.
    pub id: String,
    /// Folder of its survey, or its `survey.toml`.
    pub survey: PathBuf,
}

/// Content of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkFile {
    section: Vec<Section>,
}

impl Network {
    /// Reads a network; of a survey (a folder, or a `survey.toml`), it is the only section.
    ///
    /// # Errors
    /// A file that is missing, malformed, or has unknown keys; names that are no names of sections,
    /// or stand twice.
    pub fn read(path: &Path) -> Result<Self, JobError> {
        if path.is_dir() {
            return Self::of_survey(path);
        }
        let text = read_text(path, MAX_BYTES).map_err(|source| JobError::Read {
            path: path.to_owned(),
            source,
            remedy: "; give a network.toml, or a survey",
        })?;
        let content: toml::Table =
            toml::from_str(&text).map_err(|error| text_file::toml_error(path, &text, &error))?;
        if content.contains_key("tunnel") {
            return Self::of_survey(path);
        }
        let file: NetworkFile =
            toml::from_str(&text).map_err(|error| text_file::toml_error(path, &text, &error))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        let sections = file.section.into_iter().map(|section| Section {
            survey: folder.join(&section.survey),
            ..section
        });
        let network = Self {
            sections: sections.collect(),
        };
        network.validate(path)?;
        Ok(network)
    }

    /// The network of a single survey, named after its folder.
    fn of_survey(path: &Path) -> Result<Self, JobError> {
        let file = toml_path(path);
        let folder = std::path::absolute(&file).ok();
        let name = folder
            .as_deref()
            .and_then(Path::parent)
            .and_then(Path::file_name);
        let is_valid = |byte: char| byte.is_ascii_alphanumeric() || "-_".contains(byte);
        let id: String = name
            .map(|name| name.to_string_lossy().into_owned())
            .unwrap_or_default()
            .chars()
            .map(|letter| if is_valid(letter) { letter } else { '_' })
            .collect();
        let id = if id.is_empty() {
            "survey".to_owned()
        } else {
            id
        };
        let survey = path.to_owned();
        Ok(Self {
            sections: vec![Section { id, survey }],
        })
    }

    fn validate(&self, path: &Path) -> Result<(), JobError> {
        let wrong = |what: String| JobError::Value {
            path: path.to_owned(),
            what,
        };
        if self.sections.is_empty() {
            return Err(wrong("has no [[section]]".to_owned()));
        }
        let mut names = BTreeSet::new();
        for Section { id, .. } in &self.sections {
            let is_valid = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
            if id.is_empty() || !id.bytes().all(is_valid) {
                return Err(wrong(format!(
                    "section.id is {id:?}; it must be letters, digits, - and _, since it names the \
                     folder of the results"
                )));
            }
            // Some file systems do not tell capitals.
            if !names.insert(id.to_lowercase()) {
                return Err(wrong(format!(
                    "section.id {id:?} stands twice (capitals do not count)"
                )));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Network, String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("network.toml");
        std::fs::write(&path, text).unwrap();
        let relative = |section: Section| Section {
            survey: section.survey.strip_prefix(dir.path()).unwrap().to_owned(),
            ..section
        };
        let network = Network::read(&path).map_err(|error| error.to_string())?;
        Ok(Network {
            sections: network.sections.into_iter().map(relative).collect(),
        })
    }

    #[test]
    fn sections_are_read_in_order() {
        let network = read(
            "[[section]]\nid = \"K2\"\nsurvey = \"b\"\n[[section]]\nid = \"K1\"\nsurvey = \"a\"\n",
        );
        let section = |id: &str, survey: &str| Section {
            id: id.to_owned(),
            survey: survey.into(),
        };
        let sections = vec![section("K2", "b"), section("K1", "a")];
        assert_eq!(network, Ok(Network { sections }));
    }

    #[test]
    fn wrong_files_are_refused_with_their_place() {
        let section = |id: &str| format!("[[section]]\nid = \"{id}\"\nsurvey = \"a\"\n");
        for (text, expected) in [
            (section("K1") + &section("k1"), "stands twice"),
            (section("../up"), "must be letters"),
            (
                section("a") + "surwey = 1\n",
                ":4:1: unknown field `surwey`",
            ),
            ("section = []".to_owned(), "has no [[section]]"),
            (
                "[[section]]\nid = \"a\"\n".to_owned(),
                "missing field `survey`",
            ),
            ("[[section\n".to_owned(), ":1:"),
        ] {
            let message = read(&text).unwrap_err();
            assert!(message.contains(expected), "{message}");
            assert!(message.contains("network.toml"), "{message}");
        }
        let message = Network::read(Path::new("none.toml"))
            .unwrap_err()
            .to_string();
        assert!(message.contains("give a network.toml"), "{message}");
    }

    #[test]
    fn a_survey_is_a_network_of_one_section() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("K 7");
        std::fs::create_dir(&folder).unwrap();
        let file = folder.join("survey.toml");
        std::fs::write(&file, "[tunnel]\nshape = \"circle\"\n").unwrap();
        for path in [&folder, &file] {
            let network = Network::read(path).unwrap();
            assert_eq!(network.sections[0].id, "K_7");
            assert_eq!(network.sections[0].survey, *path);
        }
    }
}
