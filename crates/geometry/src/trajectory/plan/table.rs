//! Plan tables: `frame,chainage_m,angle_deg` or `time_s,chainage_m,angle_deg`, and optionally
//! `x_m,z_m`.
//!
//! Columns are found by name, in any order; others are ignored. Frames count from 0. Between rows
//! all numbers are interpolated linearly, angles as they are given: from 350 to 370 the carrier
//! turns by 20°, from 350 to 10 by 340° backwards.

use super::station::Station;
use crate::trajectory::csv::{separator, split};
use crate::trajectory::error::PoseError;
use crate::trajectory::text;
use csv::StringRecord;
use std::path::{Path, PathBuf};

const FORM: &str = "frame (or time_s), chainage_m, angle_deg, and optionally x_m and z_m";

/// The key of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Key {
    Frame,
    Time,
}

/// A table of stations.
#[derive(Clone, Debug)]
pub struct PlanTable {
    path: PathBuf,
    key: Key,
    /// Frame or time (seconds), increasing, and station.
    rows: Vec<(f64, Station)>,
}

/// Indices of the columns.
struct Columns {
    key: usize,
    chainage_m: usize,
    angle_deg: usize,
    offset_m: Option<[usize; 2]>,
}

impl Columns {
    fn of(header: &StringRecord) -> Result<(Key, Self), String> {
        let find = |names: &[&str]| {
            header
                .iter()
                .position(|column| names.contains(&column.to_lowercase().as_str()))
        };
        let need = |name: &str| {
            find(&[name]).ok_or_else(|| format!("no column `{name}`; the columns are {FORM}"))
        };
        let (key, at) = match (find(&["frame"]), find(&["time_s", "time"])) {
            (Some(at), None) => (Key::Frame, at),
            (None, Some(at)) => (Key::Time, at),
            (None, None) => {
                return Err(format!(
                    "no column `frame` or `time_s`; the columns are {FORM}"
                ));
            }
            (Some(_), Some(_)) => {
                return Err(
                    "has both `frame` and `time_s`; leave only the one that orders the rows"
                        .to_owned(),
                );
            }
        };
        let offset_m = match (find(&["x_m"]), find(&["z_m"])) {
            (Some(x), Some(z)) => Some([x, z]),
            (None, None) => None,
            _ => return Err("has only one of `x_m` and `z_m`".to_owned()),
        };
        let columns = Self {
            key: at,
            chainage_m: need("chainage_m")?,
            angle_deg: need("angle_deg")?,
            offset_m,
        };
        Ok((key, columns))
    }

    fn row(&self, record: &StringRecord, expected: usize) -> Result<(f64, Station), String> {
        if record.len() != expected {
            return Err(format!(
                "{} columns where the first line names {expected}",
                record.len()
            ));
        }
        let value = |column: usize| text::finite(record.get(column).unwrap_or_default());
        let offset_m = match self.offset_m {
            Some([x, z]) => [value(x)?, value(z)?],
            None => [0.0; 2],
        };
        let station = Station {
            chainage_m: value(self.chainage_m)?,
            angle_rad: value(self.angle_deg)?.to_radians(),
            offset_m,
        };
        Ok((value(self.key)?, station))
    }
}

impl PlanTable {
    /// Reads a table.
    ///
    /// # Errors
    /// An unreadable file; missing columns; a row with more or fewer columns than the first line,
    /// or with something that is no number; frames or times that do not increase; no row at all.
    pub fn read(path: &Path) -> Result<Self, PoseError> {
        let text = text::read(path)?;
        let mut lines = text::lines(&text);
        let Some((number, first)) = lines.next() else {
            return Err(PoseError::file(
                path,
                format!("is empty; the columns are {FORM}"),
            ));
        };
        let separator = separator(first);
        let fail = |number: usize, what: String| PoseError::line(path, number, what);
        let header = split(first, separator).map_err(|what| fail(number, what))?;
        let (key, columns) = Columns::of(&header).map_err(|what| fail(number, what))?;
        let mut rows: Vec<(f64, Station)> = Vec::new();
        for (number, line) in lines {
            let row = split(line, separator)
                .and_then(|record| columns.row(&record, header.len()))
                .map_err(|what| fail(number, what))?;
            if let Some((last, _)) = rows.last()
                && row.0 <= *last
            {
                return Err(fail(
                    number,
                    format!("{} after {last}: they must increase", row.0),
                ));
            }
            rows.push(row);
        }
        if rows.is_empty() {
            return Err(PoseError::file(path, "has no row under its first line"));
        }
        Ok(Self {
            path: path.to_owned(),
            key,
            rows,
        })
    }

    /// True if the table's key is time, not the frame's index.
    pub fn is_by_time(&self) -> bool {
        self.key == Key::Time
    }

    /// The stations at the frames' times, seconds.
    ///
    /// # Errors
    /// A frame before the first row or after the last.
    pub fn stations(&self, times_s: &[f64]) -> Result<Vec<Station>, PoseError> {
        let station = |(frame, time_s): (usize, &f64)| {
            let (at, what) = match self.key {
                Key::Frame => (frame as f64, format!("frame {frame}")),
                Key::Time => (*time_s, format!("frame {frame} at {time_s} s")),
            };
            self.station(at).ok_or_else(|| {
                let (first, last) = (self.rows.first(), self.rows.last());
                let key = |row: Option<&(f64, Station)>| row.map_or(f64::NAN, |row| row.0);
                PoseError::file(
                    &self.path,
                    format!(
                        "{what} lies beyond its rows, which go from {} to {}; nothing is \
                         extrapolated",
                        key(first),
                        key(last)
                    ),
                )
            })
        };
        times_s.iter().enumerate().map(station).collect()
    }

    fn station(&self, at: f64) -> Option<Station> {
        let after = self.rows.partition_point(|row| row.0 < at);
        let next = self.rows.get(after)?;
        if next.0 == at {
            return Some(next.1);
        }
        let last = self.rows.get(after.checked_sub(1)?)?;
        Some(last.1.towards(&next.1, (at - last.0) / (next.0 - last.0)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table(text: &str) -> Result<PlanTable, PoseError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("plan.csv");
        std::fs::write(&path, text).unwrap();
        PlanTable::read(&path)
    }

    #[test]
    fn stations_lie_between_rows_and_angles_are_not_wrapped() {
        let plan = table(
            "angle_deg;frame;chainage_m;x_m;z_m;note\n\
            350;0;1;0;0.5;a\n370;2;2;0.2;0.5;b\n0;4;2;0;0;c\n",
        )
        .unwrap();
        let stations = plan.stations(&[7.0, 8.0, 9.0, 10.0]).unwrap();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-12, "{a} {b}");
        near(stations[1].angle_rad.to_degrees(), 360.0);
        near(stations[1].chainage_m, 1.5);
        near(stations[1].offset_m[0], 0.1);
        near(stations[3].angle_rad.to_degrees(), 185.0);
        let plan = table("time_s,chainage_m,angle_deg\n7,0,0\n10,3,30\n").unwrap();
        near(plan.stations(&[7.0, 8.0]).unwrap()[1].chainage_m, 1.0);
        let message = plan.stations(&[8.0, 10.5]).unwrap_err().to_string();
        assert!(
            message.contains("frame 1 at 10.5 s") && message.contains("7 to 10"),
            "{message}"
        );
    }

    #[test]
    fn bad_tables_say_where() {
        for (text, expected) in [
            ("", "is empty"),
            ("frame,chainage_m,angle_deg\n", "no row"),
            (
                "chainage_m,angle_deg\n1,2\n",
                ":1: no column `frame` or `time_s`",
            ),
            ("frame,time_s,chainage_m,angle_deg\n", ":1: has both"),
            ("frame,chainage_m\n", ":1: no column `angle_deg`"),
            ("frame,chainage_m,angle_deg,x_m\n", ":1: has only one"),
            ("frame,chainage_m,angle_deg\n0,0\n", ":2: 2 columns"),
            ("frame,chainage_m,angle_deg\n0,0,nan\n", ":2: `nan`"),
            (
                "frame,chainage_m,angle_deg\n1,0,0\n1,0,0\n",
                ":3: 1 after 1",
            ),
        ] {
            let message = table(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
