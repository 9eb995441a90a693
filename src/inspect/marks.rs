//! Defects marked by the inspector: a GeoJSON file and a CSV table.
//!
//! `marks.geojson` is the file that is read again; `marks.csv` is written along with it.
//! Coordinates are chainage and arc length on the unrolled wall, metres, as in a GeoTIFF of
//! `stitch`, so that both coincide in a GIS.

use crate::files::limits::MAX_MARKS_BYTES;
use crate::files::read_text;
use crate::inspect::error::InspectError;
use crate::inspect::mark::{Mark, MarkVersions};
use crate::persist::atomic::OutputSet;
use crate::persist::file_lock::FileLock;
use crate::trajectory::csv::to_cell;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use std::fs::File;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

/// Name of the GeoJSON file of a survey's marks.
pub const MARKS_GEOJSON: &str = "marks.geojson";
/// Name of the table of a survey's marks.
pub const MARKS_CSV: &str = "marks.csv";

/// Maximum marks of a survey, which no inspector exceeds by hand.
const MAX_MARKS: usize = 100_000;
/// Content of the GeoJSON file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Collection {
    #[serde(rename = "type")]
    kind: CollectionKind,
    features: Vec<Mark>,
    /// Members of other programs, as `name` and `crs` (RFC 7946, section 6.1), kept as they are.
    #[serde(flatten)]
    foreign: Map<String, Value>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum CollectionKind {
    FeatureCollection,
}

impl Collection {
    fn empty() -> Self {
        Self {
            kind: CollectionKind::FeatureCollection,
            features: Vec::new(),
            foreign: Map::new(),
        }
    }

    /// The mark with an identifier.
    fn find(&self, id: &str) -> Option<&Mark> {
        self.features.iter().find(|mark| mark.id == id)
    }
}

/// Marks of a survey and their files.
///
/// The files may change meanwhile, by another `view` or an editor. Before each change they are read
/// again: changes of other marks are kept, and one of the same mark is a conflict.
#[derive(Debug)]
pub struct Marks {
    folder: PathBuf,
    /// Content of the GeoJSON file as last read or written.
    content: Collection,
}

impl Marks {
    /// Reads the marks in `folder`; empty without a file.
    ///
    /// # Errors
    /// [`InspectError::Marks`] for an invalid file.
    pub fn open(folder: &Path) -> Result<Self, InspectError> {
        Ok(Self {
            folder: folder.to_owned(),
            content: read_marks(&folder.join(MARKS_GEOJSON))?,
        })
    }

    /// All marks, in the order of the file.
    pub fn all(&self) -> &[Mark] {
        &self.content.features
    }

    /// Encodes the marks as GeoJSON.
    ///
    /// # Errors
    /// [`InspectError::Marks`] if they cannot be encoded.
    pub fn geojson(&self) -> Result<String, InspectError> {
        self.encode(&self.content)
    }

    fn encode(&self, content: &Collection) -> Result<String, InspectError> {
        serde_json::to_string_pretty(content)
            .map(|text| text + "\n")
            .map_err(|error| self.fail(MARKS_GEOJSON, error.to_string()))
    }

    /// Adds a mark, or replaces the one with its identifier, and writes the files.
    ///
    /// If that fails, the marks are unchanged.
    ///
    /// # Errors
    /// [`InspectError::Marks`] for an invalid mark, or a file that has become invalid;
    /// [`InspectError::MarkConflict`]; [`InspectError::Write`].
    pub fn put(&mut self, mark: Mark) -> Result<(), InspectError> {
        if let Err(what) = mark.validate() {
            return Err(self.fail(MARKS_GEOJSON, what.to_owned()));
        }
        self.change(mark.id.clone(), Some(mark.with_chainage_first()))
    }

    /// Removes the mark with an identifier, if it exists, and writes the files.
    ///
    /// # Errors
    /// The errors of [`Marks::put`].
    pub fn remove(&mut self, id: &str) -> Result<(), InspectError> {
        self.change(id.to_owned(), None)
    }

    /// Replaces the mark with an identifier by another one, or by none, in the files as they are
    /// now.
    fn change(&mut self, id: String, mark: Option<Mark>) -> Result<(), InspectError> {
        let _lock = lock_folder(&self.folder);
        let mut content = read_marks(&self.folder.join(MARKS_GEOJSON))?;
        let saved = content.find(&id);
        if saved != self.content.find(&id) && saved != mark.as_ref() {
            let versions = Box::new(MarkVersions {
                error: "the mark has been changed in the file meanwhile",
                saved: saved.cloned(),
                sent: mark,
            });
            // The next change starts from what the file has.
            self.content = content;
            return Err(InspectError::MarkConflict { versions });
        }
        let place = content.features.iter().position(|other| other.id == id);
        match (place, mark) {
            (Some(place), Some(mark)) => content.features[place] = mark,
            (Some(place), None) => drop(content.features.remove(place)),
            (None, Some(mark)) => content.features.push(mark),
            (None, None) => {}
        }
        if content.features.len() > MAX_MARKS {
            let what = format!("no more than {MAX_MARKS} marks are kept");
            return Err(self.fail(MARKS_GEOJSON, what));
        }
        self.write(&content)?;
        self.content = content;
        Ok(())
    }

    /// Writes both files, or neither.
    fn write(&self, content: &Collection) -> Result<(), InspectError> {
        let mut outputs = OutputSet::default();
        outputs.write_text(&self.folder.join(MARKS_CSV), &self.csv(content)?)?;
        outputs.write_text(&self.folder.join(MARKS_GEOJSON), &self.encode(content)?)?;
        Ok(outputs.commit()?)
    }

    /// Encodes the marks as CSV, in order of chainage.
    fn csv(&self, content: &Collection) -> Result<String, InspectError> {
        let fail = |error: String| self.fail(MARKS_CSV, error);
        let mut marks: Vec<&Mark> = content.features.iter().collect();
        marks.sort_by(|a, b| a.properties.chainage_m.total_cmp(&b.properties.chainage_m));
        let mut table = csv::Writer::from_writer(Vec::new());
        let number = |value: Option<f64>, digits: usize| {
            value.map_or(String::new(), |v| format!("{v:.digits$}"))
        };
        let text = |text: &str| to_cell(text).into_owned();
        let head = [
            "id",
            "class",
            "severity",
            "chainage_m",
            "clock",
            "theta_deg",
            "end_chainage_m",
            "end_clock",
            "length_m",
            "width_mm",
            "x_m",
            "y_m",
            "z_m",
            "note",
            "layer",
            "created",
        ];
        table
            .write_record(head)
            .map_err(|error| fail(error.to_string()))?;
        for Mark {
            id, properties: p, ..
        } in marks
        {
            let record = [
                text(id),
                text(&p.class),
                p.severity.to_string(),
                number(Some(p.chainage_m), 4),
                text(&p.clock),
                number(Some(p.theta_deg), 3),
                number(p.end_chainage_m, 4),
                text(p.end_clock.as_deref().unwrap_or_default()),
                number(p.length_m, 4),
                number(p.width_mm, 2),
                number(Some(p.x_m), 4),
                number(Some(p.y_m), 4),
                number(Some(p.z_m), 4),
                text(&p.note),
                text(&p.layer),
                text(&p.created),
            ];
            table
                .write_record(record)
                .map_err(|error| fail(error.to_string()))?;
        }
        let bytes = table
            .into_inner()
            .map_err(|error| fail(error.to_string()))?;
        String::from_utf8(bytes).map_err(|error| fail(error.to_string()))
    }

    fn fail(&self, name: &str, what: String) -> InspectError {
        InspectError::Marks {
            path: self.folder.join(name),
            what,
        }
    }
}

/// Reads a file of marks, with or without a byte order mark; empty if there is none.
fn read_marks(path: &Path) -> Result<Collection, InspectError> {
    let fail = |what: String| InspectError::Marks {
        path: path.to_owned(),
        what,
    };
    let text = match read_text(path, MAX_MARKS_BYTES) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Collection::empty()),
        Err(error) => return Err(fail(error.to_string())),
    };
    let mut content: Collection = serde_json::from_str(text.trim_start_matches('\u{feff}'))
        .map_err(|error| fail(error.to_string()))?;
    let marks = content.features.into_iter();
    content.features = marks.map(Mark::with_chainage_first).collect();
    let mut marks = content.features.iter();
    match marks.find_map(|mark| Some((mark, mark.validate().err()?))) {
        Some((mark, what)) => Err(fail(format!("mark {:?}: {what}", mark.id))),
        None => Ok(content),
    }
}

/// Keeps other programs from changing the marks of a folder; None where folders have no locks.
fn lock_folder(folder: &Path) -> Option<FileLock> {
    FileLock::wait(File::open(folder).ok()?).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(id: &str, chainage_m: f64) -> Mark {
        let text = format!(
            r#"{{"type": "Feature", "id": "{id}",
            "geometry": {{
                "type": "LineString", "coordinates": [[{chainage_m}, 1.5], [2.0, 1.5]]
            }},
            "properties": {{"class": "BAB", "severity": 3, "note": "wet, \"open\"",
            "chainage_m": {chainage_m}, "clock": "4:30", "theta_deg": 135.0,
            "x_m": 0.1, "y_m": 2.0, "z_m": -1.0, "width_mm": 1.25,
            "layer": "refined", "created": ""}}}}"#
        );
        serde_json::from_str(&text).unwrap()
    }

    #[test]
    fn marks_are_found_again_and_listed_by_chainage() {
        let dir = tempfile::tempdir().unwrap();
        let mut marks = Marks::open(dir.path()).unwrap();
        for (id, chainage_m) in [("a", 7.0), ("b", 3.0), ("c", 5.0)] {
            marks.put(mark(id, chainage_m)).unwrap();
        }
        marks.put(mark("a", 4.0)).unwrap();
        marks.remove("c").unwrap();
        let again = Marks::open(dir.path()).unwrap();
        assert_eq!(again.content.features, [mark("a", 4.0), mark("b", 3.0)]);
        let table = std::fs::read_to_string(dir.path().join(MARKS_CSV)).unwrap();
        let rows: Vec<&str> = table.lines().collect();
        assert_eq!(rows.len(), 3);
        assert!(
            rows[1].starts_with("b,BAB,3,3.0000,4:30,135.000,,,,1.25,"),
            "{}",
            rows[1]
        );
        assert!(rows[1].contains("\"wet, \"\"open\"\"\""));
    }

    #[test]
    fn an_invalid_mark_is_refused_and_changes_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let mut marks = Marks::open(dir.path()).unwrap();
        marks.put(mark("a", 1.0)).unwrap();
        let before = std::fs::read(dir.path().join(MARKS_GEOJSON)).unwrap();
        let mut severe = mark("b", 1.0);
        severe.properties.severity = 6;
        let mut nowhere = mark("c", 1.0);
        nowhere.properties.x_m = f64::NAN;
        for bad in [mark("../x", 1.0), mark("", 1.0), severe, nowhere] {
            assert!(marks.put(bad).is_err());
        }
        assert_eq!(
            std::fs::read(dir.path().join(MARKS_GEOJSON)).unwrap(),
            before
        );
        std::fs::write(dir.path().join(MARKS_GEOJSON), "{}").unwrap();
        let error = Marks::open(dir.path()).unwrap_err().to_string();
        assert!(error.contains("marks.geojson"), "{error}");
    }

    #[test]
    fn changes_by_others_are_kept_and_conflicts_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let [mut one, mut two] = [(); 2].map(|()| Marks::open(dir.path()).unwrap());
        one.put(mark("a", 1.0)).unwrap();
        two.put(mark("b", 2.0)).unwrap();
        one.put(mark("c", 3.0)).unwrap();
        let ids = |marks: &Marks| -> Vec<String> {
            marks
                .content
                .features
                .iter()
                .map(|mark| mark.id.clone())
                .collect()
        };
        assert_eq!(ids(&Marks::open(dir.path()).unwrap()), ["a", "b", "c"]);
        // The same mark, changed by both.
        two.put(mark("b", 4.0)).unwrap();
        let refused = one.put(mark("b", 5.0)).unwrap_err();
        let InspectError::MarkConflict { versions } = refused else {
            panic!("{refused}");
        };
        assert_eq!(versions.saved, Some(mark("b", 4.0)));
        assert_eq!(versions.sent, Some(mark("b", 5.0)));
        // Both are known now.
        one.put(mark("b", 5.0)).unwrap();
    }

    #[test]
    fn a_failed_write_changes_neither_file_nor_memory() {
        let dir = tempfile::tempdir().unwrap();
        let mut marks = Marks::open(dir.path()).unwrap();
        std::fs::create_dir(dir.path().join(MARKS_CSV)).unwrap();
        assert!(marks.put(mark("a", 1.0)).is_err());
        assert!(marks.content.features.is_empty());
        assert!(!dir.path().join(MARKS_GEOJSON).exists());
    }

    /// Files of version 0.1 have arc length before chainage.
    #[test]
    fn coordinates_of_earlier_versions_are_put_in_order() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(MARKS_GEOJSON);
        let present = Collection {
            features: vec![mark("a", 4.0)],
            ..Collection::empty()
        };
        let text = serde_json::to_string(&present).unwrap();
        let earlier = text.replace("[[4.0,1.5],[2.0,1.5]]", "[[1.5,4.0],[1.5,2.0]]");
        assert_ne!(text, earlier);
        for file in [&earlier, &text] {
            std::fs::write(&path, file).unwrap();
            let marks = Marks::open(dir.path()).unwrap();
            assert_eq!(marks.content.features, [mark("a", 4.0)]);
        }
    }

    #[test]
    fn members_of_other_programs_are_kept() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(MARKS_GEOJSON);
        let text = "\u{feff}{\"type\": \"FeatureCollection\", \"name\": \"marks\", \"crs\": {}, \
                    \"features\": []}";
        std::fs::write(&path, text).unwrap();
        let mut marks = Marks::open(dir.path()).unwrap();
        let mut other = serde_json::to_value(mark("a", 1.0)).unwrap();
        other["bbox"] = serde_json::json!([0, 0, 1, 1]);
        other["properties"]["fid"] = 7.into();
        marks.put(serde_json::from_value(other).unwrap()).unwrap();
        let read: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        assert_eq!(read["name"], "marks");
        let feature = &read["features"][0];
        assert_eq!(
            (&feature["bbox"][3], &feature["properties"]["fid"]),
            (&1.into(), &7.into())
        );
    }

    #[test]
    fn no_cell_of_the_table_is_a_formula() {
        let dir = tempfile::tempdir().unwrap();
        let mut marks = Marks::open(dir.path()).unwrap();
        let mut evil = mark("-a", -1.0);
        evil.properties.class = "=HYPERLINK(\"x\")".to_owned();
        evil.properties.note = "@SUM(1)".to_owned();
        marks.put(evil).unwrap();
        let table = std::fs::read_to_string(dir.path().join(MARKS_CSV)).unwrap();
        let row = table.lines().nth(1).unwrap();
        assert!(
            row.starts_with("'-a,\"'=HYPERLINK(\"\"x\"\")\",3,-1.0000,"),
            "{row}"
        );
        assert!(row.contains("'@SUM(1)"), "{row}");
    }
}
