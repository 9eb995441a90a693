//! The columns of a table of poses.

use super::pose_column::{ColumnMap, PoseColumn};
use super::title::Title;
use crate::trajectory::time_unit::TimeUnit;
use csv::StringRecord;

/// The columns that this program writes.
pub(crate) const FORM: &str = "frame,time_s,tx_m,ty_m,tz_m,qx,qy,qz,qw";

/// Indices of the columns.
pub(super) struct Columns {
    /// The column of the frames' names.
    pub name: Option<usize>,
    /// The column of times, or its two.
    pub time: Option<TimeColumn>,
    /// The columns `tx`, `ty`, `tz`, `qx`, `qy`, `qz`, `qw`.
    pub pose: [usize; 7],
}

/// Indices of the columns of a time.
#[derive(Clone, Copy)]
pub(super) enum TimeColumn {
    /// Numbers of a unit; without one, of that which their digits tell.
    One(usize, Option<TimeUnit>),
    /// Whole nanoseconds.
    Nanoseconds(usize),
    /// Whole seconds, and the nanoseconds to add.
    Parts(usize, usize),
}

impl Columns {
    /// Finds the columns of a header by the names that `map` gives them, or else by known ones.
    ///
    /// # Errors
    /// A column of poses that is missing, or one that two columns could be.
    pub fn of(header: &StringRecord, map: &ColumnMap) -> Result<Self, String> {
        let titles = Titles {
            header,
            titles: header.iter().map(Title::of).collect(),
            map,
        };
        let mut pose = [0; 7];
        for (index, column) in pose.iter_mut().zip(PoseColumn::POSE) {
            *index = titles.find(column)?.ok_or_else(|| titles.missing(column))?;
        }
        Ok(Self {
            name: titles.find(PoseColumn::Frame)?,
            time: titles.find_time()?,
            pose,
        })
    }
}

/// The titles of a header.
struct Titles<'a> {
    header: &'a StringRecord,
    titles: Vec<Title>,
    map: &'a ColumnMap,
}

impl Titles<'_> {
    /// The index of a column.
    fn find(&self, column: PoseColumn) -> Result<Option<usize>, String> {
        if let Some(name) = self.map.get(&column) {
            return self.find_mapped(column, name).map(Some);
        }
        let rank = |index: &usize| self.titles.get(*index).and_then(|title| title.rank(column));
        let Some(best) = (0..self.titles.len()).filter_map(|k| rank(&k)).min() else {
            return Ok(None);
        };
        let of_best: Vec<usize> = (0..self.titles.len())
            .filter(|k| rank(k) == Some(best))
            .collect();
        match of_best.as_slice() {
            [index] => Ok(Some(*index)),
            several => {
                let names: Vec<&str> = several.iter().filter_map(|k| self.header.get(*k)).collect();
                Err(format!(
                    "two columns are called like `{}`: `{}`; say which one with {}",
                    column.name(),
                    names.join("`, `"),
                    remedy(column)
                ))
            }
        }
    }

    /// The index of the column that a user calls `name`.
    fn find_mapped(&self, column: PoseColumn, name: &str) -> Result<usize, String> {
        let is_so_called = |k: &usize| {
            self.header
                .get(*k)
                .is_some_and(|title| title == name.trim())
        };
        let mut found = (0..self.header.len()).filter(is_so_called);
        match (found.next(), found.next()) {
            (Some(index), None) => Ok(index),
            (None, _) => Err(format!(
                "no column `{name}`, which poses.columns (--pose-columns) names for {}; the \
                 columns are {}",
                column.name(),
                self.listed()
            )),
            (Some(_), Some(_)) => Err(format!(
                "two columns are called `{name}`, which poses.columns (--pose-columns) names for \
                 {}; rename one",
                column.name()
            )),
        }
    }

    fn find_time(&self) -> Result<Option<TimeColumn>, String> {
        let position = |is: fn(&Title) -> bool| self.titles.iter().position(is);
        if let Some(index) = self.find(PoseColumn::TimeS)? {
            return Ok(Some(TimeColumn::One(index, None)));
        }
        for (column, unit) in [
            (PoseColumn::TimeMs, TimeUnit::Ms),
            (PoseColumn::TimeUs, TimeUnit::Us),
        ] {
            if let Some(index) = self.find(column)? {
                return Ok(Some(TimeColumn::One(index, Some(unit))));
            }
        }
        if let Some(index) = self.find(PoseColumn::TimeNs)? {
            return Ok(Some(TimeColumn::Nanoseconds(index)));
        }
        let parts = (
            position(Title::is_stamp_seconds),
            position(Title::is_stamp_nanoseconds),
        );
        Ok(match parts {
            (Some(seconds), Some(nanoseconds)) => Some(TimeColumn::Parts(seconds, nanoseconds)),
            _ => None,
        })
    }

    fn missing(&self, column: PoseColumn) -> String {
        let name = column.name();
        let is_rotation = matches!(name.as_bytes(), [b'q', _]);
        let known = match is_rotation {
            true => format!("`{name}`"),
            false => format!("`{name}_m` or `{name}`"),
        };
        let remedy = if is_rotation && self.titles.iter().any(Title::is_angle) {
            "angles are not read, since programs differ in their order and axes; write the \
             rotation as a quaternion qx, qy, qz, qw (Rotation.from_euler of SciPy makes it)"
                .to_owned()
        } else {
            format!("if it has another name, say so with {}", remedy(column))
        };
        format!(
            "no column {known}; the columns are {}; {remedy}",
            self.listed()
        )
    }

    /// The names of the columns that were found.
    fn listed(&self) -> String {
        let names: Vec<&str> = self.header.iter().collect();
        format!("`{}`", names.join("`, `"))
    }
}

/// The key and the flag that name a column.
fn remedy(column: PoseColumn) -> String {
    let name = column.name();
    format!("columns = {{ {name} = \"…\" }} in [poses] of survey.toml (--pose-columns {name}=…)")
}
