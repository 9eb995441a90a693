//! Defects marked by the inspector: a GeoJSON file and a CSV table.
//!
//! `marks.geojson` is the file that is read again; `marks.csv` is written along with it.
//! Coordinates are arc length and chainage on the unrolled wall, metres, as in a GeoTIFF of
//! `stitch`, so that both coincide in a GIS.

use crate::inspect::error::InspectError;
use crate::persist::atomic;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Name of the GeoJSON file of a survey's marks.
pub const MARKS_GEOJSON: &str = "marks.geojson";
/// Name of the table of a survey's marks.
pub const MARKS_CSV: &str = "marks.csv";

/// Maximum marks of a survey, which no inspector exceeds by hand.
const MAX_MARKS: usize = 100_000;
/// Maximum characters of a text in a mark.
const MAX_CHARACTERS: usize = 10_000;

/// Mark of a defect, a GeoJSON feature.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Mark {
    #[serde(rename = "type")]
    kind: FeatureKind,
    /// Identifier of the mark: letters, digits, `-`.
    pub id: String,
    /// Point, or line between two points.
    pub geometry: Geometry,
    /// Attributes of the defect.
    pub properties: Properties,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
enum FeatureKind {
    Feature,
}

/// Position on the unrolled wall: arc length and chainage, metres.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "type", content = "coordinates")]
pub enum Geometry {
    /// A point.
    Point([f64; 2]),
    /// A measured line. Arc lengths may exceed the perimeter, so that the line takes the shorter
    /// way around.
    LineString([[f64; 2]; 2]),
}

/// Attributes of a defect and its position in an inspector's terms.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Properties {
    /// Defect code, as of EN 13508-2 (`BAB` for a crack), or any text.
    pub class: String,
    /// Severity, 1 (slight) to 5 (severe).
    pub severity: u8,
    /// A remark.
    pub note: String,
    /// Chainage, metres.
    pub chainage_m: f64,
    /// Clock position, hours and minutes.
    pub clock: String,
    /// Angle θ, degrees.
    pub theta_deg: f64,
    /// World coordinate x, metres.
    pub x_m: f64,
    /// World coordinate y, metres.
    pub y_m: f64,
    /// World coordinate z, metres.
    pub z_m: f64,
    /// Chainage of the other end, metres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub end_chainage_m: Option<f64>,
    /// Clock position of the other end.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub end_clock: Option<String>,
    /// Length along the wall, metres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub length_m: Option<f64>,
    /// Width of a crack, millimetres.
    #[serde(skip_serializing_if = "Option::is_none", default)]
    pub width_mm: Option<f64>,
    /// The layer in which it was marked.
    pub layer: String,
    /// Time of creation, RFC 3339.
    pub created: String,
}

/// Content of the GeoJSON file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Collection {
    #[serde(rename = "type")]
    kind: CollectionKind,
    features: Vec<Mark>,
}

#[derive(Serialize, Deserialize)]
enum CollectionKind {
    FeatureCollection,
}

impl Mark {
    /// Validates the mark.
    ///
    /// # Errors
    /// A description of the first invalid value.
    pub fn validate(&self) -> Result<(), &'static str> {
        let p = &self.properties;
        let name = |c: char| c.is_ascii_alphanumeric() || c == '-';
        let numbers = [p.chainage_m, p.theta_deg, p.x_m, p.y_m, p.z_m];
        let optional = [p.end_chainage_m, p.length_m, p.width_mm];
        let places = match &self.geometry {
            Geometry::Point(place) => vec![*place],
            Geometry::LineString(places) => places.to_vec(),
        };
        let all = numbers
            .into_iter()
            .chain(optional.into_iter().flatten())
            .chain(places.into_iter().flatten());
        let texts = [&p.class, &p.note, &p.clock, &p.layer, &p.created];
        let wrong = [
            (
                !(1..=64).contains(&self.id.len()) || !self.id.chars().all(name),
                "its id must be 1 to 64 letters, digits or -",
            ),
            (
                !(1..=5).contains(&p.severity),
                "its severity must be 1 to 5",
            ),
            (
                all.into_iter().any(|v| !v.is_finite()),
                "a number of it is not finite",
            ),
            (
                texts
                    .into_iter()
                    .chain(&p.end_clock)
                    .any(|text| text.chars().count() > MAX_CHARACTERS),
                "a text of it is too long",
            ),
        ];
        match wrong.iter().find(|(wrong, _)| *wrong) {
            Some((_, what)) => Err(what),
            None => Ok(()),
        }
    }
}

/// Marks of a survey and their files.
#[derive(Debug)]
pub struct Marks {
    folder: PathBuf,
    marks: Vec<Mark>,
}

impl Marks {
    /// Reads the marks in `folder`; empty without a file.
    ///
    /// # Errors
    /// [`InspectError::Marks`] for an invalid file.
    pub fn open(folder: &Path) -> Result<Self, InspectError> {
        let path = folder.join(MARKS_GEOJSON);
        let fail = |what: String| InspectError::Marks {
            path: path.clone(),
            what,
        };
        let marks = match std::fs::read_to_string(&path) {
            Ok(text) => {
                let collection: Collection =
                    serde_json::from_str(&text).map_err(|error| fail(error.to_string()))?;
                if let Some((mark, what)) = collection
                    .features
                    .iter()
                    .find_map(|mark| Some((mark, mark.validate().err()?)))
                {
                    return Err(fail(format!("mark {}: {what}", mark.id)));
                }
                collection.features
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(fail(error.to_string())),
        };
        Ok(Self {
            folder: folder.to_owned(),
            marks,
        })
    }

    /// Encodes the marks as GeoJSON.
    ///
    /// # Errors
    /// [`InspectError::Marks`] if they cannot be encoded.
    pub fn geojson(&self) -> Result<String, InspectError> {
        let collection = Collection {
            kind: CollectionKind::FeatureCollection,
            features: self.marks.clone(),
        };
        serde_json::to_string_pretty(&collection)
            .map(|text| text + "\n")
            .map_err(|error| self.fail(MARKS_GEOJSON, error.to_string()))
    }

    /// Adds a mark, or replaces the one with its identifier, and writes the files.
    ///
    /// If that fails, the marks are unchanged.
    ///
    /// # Errors
    /// [`InspectError::Marks`] for an invalid mark; [`InspectError::Write`].
    pub fn put(&mut self, mark: Mark) -> Result<(), InspectError> {
        if let Err(what) = mark.validate() {
            return Err(self.fail(MARKS_GEOJSON, what.to_owned()));
        }
        let mut marks = self.marks.clone();
        match marks.iter().position(|other| other.id == mark.id) {
            Some(place) => marks[place] = mark,
            None => marks.push(mark),
        }
        if marks.len() > MAX_MARKS {
            let what = format!("no more than {MAX_MARKS} marks are kept");
            return Err(self.fail(MARKS_GEOJSON, what));
        }
        self.replace(marks)
    }

    /// Removes the mark with an identifier, if it exists, and writes the files.
    ///
    /// # Errors
    /// [`InspectError::Write`].
    pub fn remove(&mut self, id: &str) -> Result<(), InspectError> {
        let others = self.marks.iter().filter(|mark| mark.id != id);
        self.replace(others.cloned().collect())
    }

    fn replace(&mut self, marks: Vec<Mark>) -> Result<(), InspectError> {
        let before = std::mem::replace(&mut self.marks, marks);
        self.write().inspect_err(|_| self.marks = before)
    }

    fn write(&self) -> Result<(), InspectError> {
        let (geojson, csv) = (self.geojson()?, self.csv()?);
        atomic::write_text(&self.folder.join(MARKS_GEOJSON), &geojson)?;
        Ok(atomic::write_text(&self.folder.join(MARKS_CSV), &csv)?)
    }

    /// Encodes the marks as CSV, in order of chainage.
    fn csv(&self) -> Result<String, InspectError> {
        let fail = |error: String| self.fail(MARKS_CSV, error);
        let mut marks: Vec<&Mark> = self.marks.iter().collect();
        marks.sort_by(|a, b| a.properties.chainage_m.total_cmp(&b.properties.chainage_m));
        let mut table = csv::Writer::from_writer(Vec::new());
        let number = |value: Option<f64>, digits: usize| {
            value.map_or(String::new(), |v| format!("{v:.digits$}"))
        };
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
                id.clone(),
                p.class.clone(),
                p.severity.to_string(),
                number(Some(p.chainage_m), 4),
                p.clock.clone(),
                number(Some(p.theta_deg), 3),
                number(p.end_chainage_m, 4),
                p.end_clock.clone().unwrap_or_default(),
                number(p.length_m, 4),
                number(p.width_mm, 2),
                number(Some(p.x_m), 4),
                number(Some(p.y_m), 4),
                number(Some(p.z_m), 4),
                p.note.clone(),
                p.layer.clone(),
                p.created.clone(),
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

#[cfg(test)]
mod tests {
    use super::*;

    fn mark(id: &str, chainage_m: f64) -> Mark {
        let text = format!(
            r#"{{"type": "Feature", "id": "{id}",
            "geometry": {{
                "type": "LineString", "coordinates": [[1.5, {chainage_m}], [1.5, 2.0]]
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
        assert_eq!(again.marks, [mark("a", 4.0), mark("b", 3.0)]);
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
}
