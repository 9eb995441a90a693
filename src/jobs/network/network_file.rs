//! `network.toml`: the sections of a network of tunnels, each with its survey.

use super::crs::Crs;
use crate::files::{line_and_column, read_text};
use crate::jobs::error::JobError;
use crate::jobs::text_file;
use crate::survey::toml_path;
use serde::Deserialize;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use toml::Spanned;

/// Largest size of the file, bytes: a hundred thousand sections.
const MAX_BYTES: u64 = 64 << 20;
/// Least distance of two points of a section's line, metres.
const MIN_DISTANCE_M: f64 = 1e-3;

/// A network of tunnels.
#[derive(Clone, Debug, PartialEq)]
pub struct Network {
    /// Its file, or the survey that it was made of.
    pub path: PathBuf,
    /// The coordinate reference system of its map; without one it has no map.
    pub crs: Option<Crs>,
    /// Its manholes, in the order of the file.
    pub manholes: Vec<Manhole>,
    /// Its sections, in the order of the file.
    pub sections: Vec<Section>,
}

/// A manhole, at which sections end.
#[derive(Clone, Debug, PartialEq)]
pub struct Manhole {
    /// Its name; unique.
    pub id: String,
    /// Its position (east and north), metres.
    pub position_m: [f64; 2],
}

/// A section of a network, as from manhole to manhole.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Name of the section, and of the folder of its results; unique.
    pub id: String,
    /// Folder of its survey, or its `survey.toml`.
    pub survey: PathBuf,
    /// Its ends; none if the centreline of its survey is its line on the map.
    pub ends: Option<SectionEnds>,
    /// Line and column of its name in the file.
    pub place: [usize; 2],
}

/// The ends of a section on the map.
#[derive(Clone, Debug, PartialEq)]
pub struct SectionEnds {
    /// The manhole from which chainage increases.
    pub from: String,
    /// The manhole at the other end.
    pub to: String,
    /// Bends between them (east and north), metres.
    pub via_m: Vec<[f64; 2]>,
    /// Chainage of the survey at the first manhole, metres.
    pub start_chainage_m: f64,
}

/// Content of the file.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NetworkFile {
    crs: Option<Spanned<String>>,
    #[serde(default)]
    manhole: Vec<ManholeEntry>,
    section: Vec<SectionEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ManholeEntry {
    id: Spanned<String>,
    position_m: Spanned<Vec<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SectionEntry {
    id: Spanned<String>,
    survey: PathBuf,
    from: Option<Spanned<String>>,
    to: Option<Spanned<String>>,
    via_m: Option<Spanned<Vec<Vec<f64>>>>,
    start_chainage_m: Option<Spanned<f64>>,
}

impl Network {
    /// Reads a network; of a survey (a folder, or a `survey.toml`), it is the only section.
    ///
    /// # Errors
    /// A file that is missing, malformed, or has unknown keys; names that are no names of sections,
    /// or stand twice; positions without a coordinate reference system; a line between manholes
    /// that are not there, or at one point.
    pub fn read(path: &Path) -> Result<Self, JobError> {
        if path.is_dir() {
            return Ok(Self::of_survey(path));
        }
        let text = read_text(path, MAX_BYTES).map_err(|source| JobError::Read {
            path: path.to_owned(),
            source,
            remedy: "; give a network.toml, or a survey",
        })?;
        let content: toml::Table =
            toml::from_str(&text).map_err(|error| text_file::toml_error(path, &text, &error))?;
        if content.contains_key("tunnel") {
            return Ok(Self::of_survey(path));
        }
        let file: NetworkFile =
            toml::from_str(&text).map_err(|error| text_file::toml_error(path, &text, &error))?;
        Reader { path, text: &text }.network(file)
    }

    /// The network of a single survey, named after its folder.
    fn of_survey(path: &Path) -> Self {
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
        Self {
            path: path.to_owned(),
            crs: None,
            manholes: Vec::new(),
            sections: vec![Section {
                id,
                survey: path.to_owned(),
                ends: None,
                place: [1, 1],
            }],
        }
    }

    /// The position (east and north, metres) of a manhole; None if there is none of this name.
    pub fn position_m(&self, manhole: &str) -> Option<[f64; 2]> {
        let found = self.manholes.iter().find(|known| known.id == manhole);
        found.map(|manhole| manhole.position_m)
    }

    /// An error at a line and column of the file.
    pub fn error_at(&self, [line, column]: [usize; 2], what: String) -> JobError {
        JobError::Parse {
            path: self.path.clone(),
            line,
            column,
            what,
        }
    }
}

/// Reads the content of a file; its errors name the place.
struct Reader<'f> {
    path: &'f Path,
    text: &'f str,
}

impl Reader<'_> {
    fn network(&self, file: NetworkFile) -> Result<Network, JobError> {
        if file.section.is_empty() {
            return Err(JobError::Value {
                path: self.path.to_owned(),
                what: "has no [[section]]".to_owned(),
            });
        }
        let crs = file.crs.as_ref();
        let crs = crs.map(|crs| Crs::parse(crs.get_ref()).map_err(|what| self.wrong(crs, what)));
        let crs = crs.transpose()?;
        let manholes = self.manholes(file.manhole, crs)?;
        let sections = self.sections(file.section, &manholes)?;
        Ok(Network {
            path: self.path.to_owned(),
            crs,
            manholes,
            sections,
        })
    }

    fn manholes(
        &self,
        entries: Vec<ManholeEntry>,
        crs: Option<Crs>,
    ) -> Result<Vec<Manhole>, JobError> {
        let mut names = BTreeSet::new();
        let manholes = entries.into_iter().map(|ManholeEntry { id, position_m }| {
            if id.get_ref().is_empty() || !names.insert(id.get_ref().clone()) {
                let what = format!("manhole.id {:?} is empty or stands twice", id.get_ref());
                return Err(self.wrong(&id, what));
            }
            if crs.is_none() {
                let what = "manholes have positions in a coordinate reference system; name it at \
                            the top of the file, as crs = \"EPSG:2056\"";
                return Err(self.wrong(&position_m, what.to_owned()));
            }
            Ok(Manhole {
                id: id.into_inner(),
                position_m: self.point(position_m.get_ref(), &position_m)?,
            })
        });
        manholes.collect()
    }

    fn sections(
        &self,
        entries: Vec<SectionEntry>,
        manholes: &[Manhole],
    ) -> Result<Vec<Section>, JobError> {
        let positions = manholes.iter();
        let positions: BTreeMap<&str, [f64; 2]> = positions
            .map(|manhole| (manhole.id.as_str(), manhole.position_m))
            .collect();
        let mut names = BTreeSet::new();
        let sections = entries.into_iter().map(|entry| {
            let id = entry.id.get_ref();
            let is_valid = |byte: u8| byte.is_ascii_alphanumeric() || b"-_".contains(&byte);
            if id.is_empty() || !id.bytes().all(is_valid) {
                let what = format!(
                    "section.id is {id:?}; it must be letters, digits, - and _, since it names the \
                     folder of the results"
                );
                return Err(self.wrong(&entry.id, what));
            }
            // Some file systems do not tell capitals.
            if !names.insert(id.to_lowercase()) {
                let what = format!("section.id {id:?} stands twice (capitals do not count)");
                return Err(self.wrong(&entry.id, what));
            }
            let ends = self.ends(&entry, &positions)?;
            let folder = self.path.parent().unwrap_or(Path::new(""));
            Ok(Section {
                place: self.place(&entry.id),
                id: entry.id.into_inner(),
                survey: folder.join(entry.survey),
                ends,
            })
        });
        sections.collect()
    }

    /// The ends of a section, between which its line has a length everywhere.
    fn ends(
        &self,
        entry: &SectionEntry,
        positions: &BTreeMap<&str, [f64; 2]>,
    ) -> Result<Option<SectionEnds>, JobError> {
        let (from, to) = match (&entry.from, &entry.to) {
            (Some(from), Some(to)) => (from, to),
            (None, None) if entry.via_m.is_none() && entry.start_chainage_m.is_none() => {
                return Ok(None);
            }
            _ => {
                let what = "from and to go together, and via_m and start_chainage_m with them";
                return Err(self.wrong(&entry.id, what.to_owned()));
            }
        };
        let position = |end: &Spanned<String>| {
            let known = positions.get(end.get_ref().as_str()).copied();
            known.ok_or_else(|| {
                let what = format!("there is no [[manhole]] with id = {:?}", end.get_ref());
                self.wrong(end, what)
            })
        };
        let via_m = entry.via_m.as_ref().map_or(Ok(Vec::new()), |via_m| {
            let points = via_m.get_ref().iter();
            points.map(|point| self.point(point, via_m)).collect()
        })?;
        let chainage = entry.start_chainage_m.as_ref();
        let start_chainage_m = chainage.map_or(0.0, |chainage| *chainage.get_ref());
        let mut points = vec![position(from)?];
        points.extend(&via_m);
        points.push(position(to)?);
        let is_apart = |pair: &[[f64; 2]]| {
            let distance_m = (pair[1][0] - pair[0][0]).hypot(pair[1][1] - pair[0][1]);
            distance_m >= MIN_DISTANCE_M
        };
        if !points.windows(2).all(is_apart) {
            let what = "the manholes and bends (via_m) of a section must be apart";
            return Err(self.wrong(&entry.id, what.to_owned()));
        }
        if let Some(chainage) = chainage.filter(|chainage| !chainage.get_ref().is_finite()) {
            return Err(self.wrong(chainage, "start_chainage_m must be finite".to_owned()));
        }
        Ok(Some(SectionEnds {
            from: from.get_ref().clone(),
            to: to.get_ref().clone(),
            via_m,
            start_chainage_m,
        }))
    }

    /// A point of the file, of which `value` is the place.
    fn point<T>(&self, numbers: &[f64], value: &Spanned<T>) -> Result<[f64; 2], JobError> {
        match *numbers {
            [east, north] if east.is_finite() && north.is_finite() => Ok([east, north]),
            _ => {
                let what =
                    format!("{numbers:?} is no point; give two finite numbers, east and north");
                Err(self.wrong(value, what))
            }
        }
    }

    /// Line and column of a value.
    fn place<T>(&self, value: &Spanned<T>) -> [usize; 2] {
        line_and_column(self.text, value.span().start)
    }

    /// The error of a value.
    fn wrong<T>(&self, value: &Spanned<T>, what: String) -> JobError {
        let [line, column] = self.place(value);
        JobError::Parse {
            path: self.path.to_owned(),
            line,
            column,
            what,
        }
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
            ..network
        })
    }

    #[test]
    fn sections_are_read_in_order() {
        let network = read(
            "[[section]]\nid = \"K2\"\nsurvey = \"b\"\n[[section]]\nid = \"K1\"\nsurvey = \"a\"\n",
        );
        let section = |id: &str, survey: &str, line: usize| Section {
            id: id.to_owned(),
            survey: survey.into(),
            ends: None,
            place: [line, 6],
        };
        let sections = vec![section("K2", "b", 2), section("K1", "a", 5)];
        assert_eq!(network.unwrap().sections, sections);
    }

    /// Two manholes in the system of Switzerland.
    const MANHOLES: &str = "crs = \"EPSG:2056\"\n\
                            [[manhole]]\nid = \"M1\"\nposition_m = [2600000, 1200000]\n\
                            [[manhole]]\nid = \"M 2\"\nposition_m = [2600030.5, 1200040]\n";

    #[test]
    fn sections_lie_between_manholes() {
        let section = "[[section]]\nid = \"a\"\nsurvey = \"a\"\nfrom = \"M 2\"\nto = \"M1\"\n\
                       via_m = [[2600000.0, 1200040.0]]\nstart_chainage_m = -1.5\n";
        let network = read(&(MANHOLES.to_owned() + section)).unwrap();
        assert_eq!(network.crs.unwrap().code(), 2056);
        assert_eq!(network.position_m("M 2"), Some([2_600_030.5, 1_200_040.0]));
        let ends = SectionEnds {
            from: "M 2".to_owned(),
            to: "M1".to_owned(),
            via_m: vec![[2_600_000.0, 1_200_040.0]],
            start_chainage_m: -1.5,
        };
        assert_eq!(network.sections[0].ends, Some(ends));
    }

    #[test]
    fn wrong_places_are_refused_with_their_line() {
        let section = "[[section]]\nid = \"a\"\nsurvey = \"a\"\n";
        let of = |more: &str| MANHOLES.to_owned() + section + more;
        for (text, expected) in [
            (of("").replace("2056", "4326"), ":1:7: crs EPSG:4326"),
            (
                of("").replacen("crs", "# crs", 1),
                ":4:14: manholes have positions",
            ),
            (of("").replace("M 2", "M1"), ":6:6: manhole.id \"M1\""),
            (
                of("").replace("1200040]", "nan]"),
                ":7:14: [2600030.5, NaN] is no point",
            ),
            (
                of("").replace("1200040]", "1, 2]"),
                ":7:14: [2600030.5, 1.0, 2.0] is no",
            ),
            (of("from = \"M1\"\n"), ":9:6: from and to go together"),
            (
                of("start_chainage_m = 1\n"),
                ":9:6: from and to go together",
            ),
            (
                of("from = \"M1\"\nto = \"M3\"\n"),
                ":12:6: there is no [[manhole]] with id = \"M3\"",
            ),
            (
                of("from = \"M1\"\nto = \"M1\"\n"),
                ":9:6: the manholes and bends",
            ),
            (
                of("from = \"M1\"\nto = \"M 2\"\nvia_m = [[inf, 0.0]]\n"),
                ":13:9: [inf, 0.0] is no point",
            ),
        ] {
            let message = read(&text).unwrap_err();
            assert!(message.contains(expected), "{message}");
            assert!(message.contains("network.toml:"), "{message}");
        }
    }

    #[test]
    fn wrong_files_are_refused_with_their_place() {
        let section = |id: &str| format!("[[section]]\nid = \"{id}\"\nsurvey = \"a\"\n");
        for (text, expected) in [
            (
                section("K1") + &section("k1"),
                ":5:6: section.id \"k1\" stands twice",
            ),
            (section("../up"), ":2:6: section.id"),
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
