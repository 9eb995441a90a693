//! The columns of a table of poses.

use super::pose_column::{ColumnMap, PoseColumn};
use super::title::Title;
use crate::trajectory::euler::{AngleUnit, EulerSequence};
use crate::trajectory::pose_options::PoseFileOptions;
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
    /// The columns `tx`, `ty`, `tz`, and the metres of a unit of each.
    pub translation: [(usize, f64); 3],
    /// The columns of the rotation.
    pub rotation: RotationColumns,
}

/// Indices of the columns of a rotation.
pub(super) enum RotationColumns {
    /// `qx`, `qy`, `qz`, `qw`.
    Quaternion([usize; 4]),
    /// The rows of a matrix.
    Matrix([[usize; 3]; 3]),
    /// Angles about x, y and z with their units.
    Angles([(usize, AngleUnit); 3], EulerSequence),
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
    /// Finds the columns of a header by the names that options give them, or else by known ones.
    ///
    /// # Errors
    /// A column of poses that is missing, or one that two columns could be; angles whose order or
    /// unit is not known.
    pub fn of(header: &StringRecord, options: &PoseFileOptions) -> Result<Self, String> {
        let titles = Titles {
            header,
            titles: header.iter().map(Title::of).collect(),
            map: &options.columns,
        };
        Ok(Self {
            name: titles.find(PoseColumn::Frame)?,
            time: titles.find_time()?,
            translation: titles.find_translation()?,
            rotation: titles.find_rotation(options)?,
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

    /// The indices of columns that must be there.
    fn need<const N: usize>(&self, columns: [PoseColumn; N]) -> Result<[usize; N], String> {
        let mut indices = [0; N];
        for (index, column) in indices.iter_mut().zip(columns) {
            *index = self.find(column)?.ok_or_else(|| self.missing(column))?;
        }
        Ok(indices)
    }

    /// The columns of a translation: by their names, or the last of a matrix of three rows.
    fn find_translation(&self) -> Result<[(usize, f64); 3], String> {
        if self.find(PoseColumn::Tx)?.is_none()
            && let Some(indices) = self.matrix_columns([[3]; 3])
        {
            return Ok(indices.map(|[index]| (index, 1.0)));
        }
        let mut columns = [(0, 1.0); 3];
        let indices = self.need(PoseColumn::TRANSLATION)?;
        for ((column, index), name) in columns.iter_mut().zip(indices).zip(PoseColumn::TRANSLATION)
        {
            let own = self.titles[index].length_unit_m();
            let is_mapped = self.map.contains_key(&name);
            *column = (index, own.filter(|_| !is_mapped).unwrap_or(1.0));
        }
        Ok(columns)
    }

    /// The indices of entries of a matrix, row by row, if their titles name them all; `wanted` are
    /// the columns of each row, from 0.
    fn matrix_columns<const N: usize>(&self, wanted: [[usize; N]; 3]) -> Option<[[usize; N]; 3]> {
        let places: Vec<_> = self.titles.iter().map(Title::matrix_place).collect();
        let first = if places.contains(&Some([0, 0])) { 0 } else { 1 };
        let mut indices = [[0; N]; 3];
        for (row, (found, columns)) in indices.iter_mut().zip(wanted).enumerate() {
            for (index, column) in found.iter_mut().zip(columns) {
                let place = Some([row + first, column + first]);
                *index = places.iter().position(|found| *found == place)?;
            }
        }
        Some(indices)
    }

    /// The columns of a quaternion, or of angles whose order of rotations is given.
    fn find_rotation(&self, options: &PoseFileOptions) -> Result<RotationColumns, String> {
        let has_column = |column| Ok::<_, String>(self.find(column)?.is_some());
        let Some(sequence) = options.euler else {
            let has_angle = has_column(PoseColumn::Rx)? && has_column(PoseColumn::Ry)?;
            let has_quaternion = has_column(PoseColumn::Qx)? || has_column(PoseColumn::Qw)?;
            let matrix = self.matrix_columns([[0, 1, 2]; 3]);
            if let Some(matrix) = matrix.filter(|_| !has_angle && !has_quaternion) {
                return Ok(RotationColumns::Matrix(matrix));
            }
            if has_angle && !has_quaternion {
                return Err(self.unknown_order(options.angle_unit));
            }
            return self
                .need(PoseColumn::QUATERNION)
                .map(RotationColumns::Quaternion);
        };
        let mut angles = [(0, AngleUnit::Deg); 3];
        let columns = self.need(PoseColumn::ANGLES)?;
        for (angle, index) in angles.iter_mut().zip(columns) {
            let unit = options.angle_unit.or(self.titles[index].angle_unit());
            let name = self.header.get(index).unwrap_or_default();
            let unit = unit.ok_or_else(|| {
                format!("the unit of `{name}` is not known; say which one with {ANGLE_UNIT}")
            })?;
            *angle = (index, unit);
        }
        Ok(RotationColumns::Angles(angles, sequence))
    }

    /// The error of angles whose order of rotations is not given.
    fn unknown_order(&self, unit: Option<AngleUnit>) -> String {
        let (sequence, axes, other) = if self.titles.iter().any(Title::is_omega) {
            (
                "XYZ",
                " and camera_axes = \"opengl\"",
                "if they are the angles R = Rx(omega) Ry(phi) Rz(kappa) of photogrammetry",
            )
        } else {
            (
                "ZYX",
                "",
                "if R = Rz(yaw) Ry(pitch) Rx(roll), as robots and vehicles have it",
            )
        };
        let has_unit = unit.is_some() || self.titles.iter().any(|t| t.angle_unit().is_some());
        let unit = if has_unit {
            ""
        } else {
            " and angle_unit = \"deg\" (or \"rad\")"
        };
        format!(
            "programs differ in the order of angles: write euler = \"{sequence}\"{unit}{axes} in \
             [poses] of survey.toml (--pose-euler …) {other}; the columns are {}",
            self.listed()
        )
    }

    fn find_time(&self) -> Result<Option<TimeColumn>, String> {
        let position = |is: fn(&Title) -> bool| self.titles.iter().position(is);
        let stamp = self.find(PoseColumn::TimeS)?;
        let is_best = |index: usize| self.titles[index].rank(PoseColumn::TimeS) == Some(0);
        let is_given = self.map.contains_key(&PoseColumn::TimeS);
        let parts = (
            position(Title::is_stamp_seconds),
            position(Title::is_stamp_nanoseconds),
        );
        if let (Some(seconds), Some(nanoseconds)) = parts
            && !is_given
            && !stamp.is_some_and(is_best)
        {
            return Ok(Some(TimeColumn::Parts(seconds, nanoseconds)));
        }
        if let Some(index) = stamp {
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
        Ok(None)
    }

    fn missing(&self, column: PoseColumn) -> String {
        let name = column.name();
        let known = if PoseColumn::TRANSLATION.contains(&column) {
            format!("`{name}_m` or `{name}`")
        } else {
            format!("`{name}`")
        };
        if PoseColumn::TRANSLATION.contains(&column) && self.titles.iter().any(Title::is_geographic)
        {
            return format!(
                "no column {known}; the columns are {}; latitude and longitude are no metres: \
                 project them first, as `cs2cs EPSG:4326 EPSG:…` of PROJ does, and name the \
                 columns of the result tx, ty, tz",
                self.listed()
            );
        }
        format!(
            "no column {known}; the columns are {}; if it has another name, say so with {}",
            self.listed(),
            remedy(column)
        )
    }

    /// The names of the columns that were found.
    fn listed(&self) -> String {
        let names: Vec<&str> = self.header.iter().collect();
        format!("`{}`", names.join("`, `"))
    }
}

/// The key and the flag that name the unit of angles.
const ANGLE_UNIT: &str =
    "angle_unit = \"deg\" or \"rad\" in [poses] of survey.toml (--pose-angle-unit deg)";

/// The key and the flag that name a column.
fn remedy(column: PoseColumn) -> String {
    let name = column.name();
    format!("columns = {{ {name} = \"…\" }} in [poses] of survey.toml (--pose-columns {name}=…)")
}
