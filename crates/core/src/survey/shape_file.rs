//! `shape.json`: a wall's displacement from its nominal shape, and the bend of its tunnel.
//!
//! ```json
//! {
//!   "format": "wall-shape-1",
//!   "perimeter_m": 18.85, "columns": 64,
//!   "origin": { "s_m": 0.0, "h_m": 0.0 }, "first_row": -3,
//!   "coefficients_m": [0.0012, 0.0009],
//!   "sigma_m": [0.0001, 0.0001],
//!   "deviation_sigma_m": [0.00008, null],
//!   "bend": { "curvature_per_m": [0.0033, 0.0], "at_h_m": 2.35 }
//! }
//! ```
//!
//! The displacement along the normal of the nominal wall, positive outwards, is the cubic B-spline
//! `δ(s, h) = Σ_ji c_ji B((s − s_0)/Δ − i) B((h − h_0)/Δ − j)`, with the spacing
//! `Δ = perimeter/columns`, the columns i periodic, and rows j from `first_row` on, row by row in
//! `coefficients_m` ([`tunnelstitch_geometry::surface::RadialField`]). `sigma_m` has 1-σ of δ at
//! each node, `deviation_sigma_m` that of δ less the best-fit circle of its row (of δ itself if the
//! section is no circle), null where the frames do not determine it; both are optional.
//!
//! `bend`, optional as well, is a constant curvature of a tunnel that was planned straight
//! ([`tunnelstitch_geometry::surface::Bend`]); its wall is displaced from there.

use super::error::SurveyError;
use super::wall_file::{check_format, check_origin, check_perimeter, read_wall_file};
use serde::{Deserialize, Serialize};
use std::path::Path;
use tunnelstitch_geometry::surface::{Bend, RadialField, SplineLattice, WallPoint};

/// Name and version of the format.
const FORMAT: &str = "wall-shape-1";
/// Columns at the least.
const MIN_COLUMNS: usize = 8;
/// Columns at the most: nodes a thousandth of the perimeter apart.
const MAX_COLUMNS: usize = 1024;
/// Largest displacement, share of the perimeter.
const MAX_DISPLACEMENT_SHARE: f64 = 0.05;
/// Smallest radius of a bend, perimeters; a tighter one is no deviation from a plan.
const MIN_BEND_RADIUS_PERIMETERS: f64 = 1.0;

/// The content of `shape.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ShapeFile {
    format: String,
    perimeter_m: f64,
    columns: usize,
    origin: WallPoint,
    first_row: i64,
    coefficients_m: Vec<f64>,
    /// 1-σ of δ at each node, metres; empty if unknown.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sigma_m: Vec<f64>,
    /// 1-σ of the deviation from the best-fit circle of its row at each node, metres; None where
    /// the frames do not determine it. Empty if unknown.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub deviation_sigma_m: Vec<Option<f64>>,
    /// A curvature of the tunnel that is not planned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bend: Option<Bend>,
}

impl ShapeFile {
    /// The file of a field, with 1-σ at each of its nodes, metres, if all are known.
    pub fn new(field: &RadialField, mut sigma_m: Vec<f64>) -> Self {
        if !sigma_m.iter().all(|sigma_m| sigma_m.is_finite()) {
            sigma_m.clear();
        }
        let lattice = field.lattice();
        Self {
            format: FORMAT.to_owned(),
            perimeter_m: lattice.perimeter_m,
            columns: lattice.columns,
            origin: lattice.origin,
            first_row: field.rows().start,
            coefficients_m: field.coefficients_m().to_vec(),
            sigma_m,
            deviation_sigma_m: Vec::new(),
            bend: None,
        }
    }

    /// The file with 1-σ of the deviation at each node, metres.
    pub fn with_deviation_sigma_m(self, deviation_sigma_m: Vec<Option<f64>>) -> Self {
        Self {
            deviation_sigma_m,
            ..self
        }
    }

    /// The file with another bend.
    pub fn with_bend(self, bend: Option<Bend>) -> Self {
        Self { bend, ..self }
    }

    /// The file of a bend without displacement, in a tunnel of the given perimeter, metres.
    pub fn of_bend(bend: Bend, perimeter_m: f64) -> Self {
        Self {
            format: FORMAT.to_owned(),
            perimeter_m,
            columns: MIN_COLUMNS,
            origin: WallPoint::default(),
            first_row: 0,
            coefficients_m: Vec::new(),
            sigma_m: Vec::new(),
            deviation_sigma_m: Vec::new(),
            bend: Some(bend),
        }
    }

    /// Reads a file for a tunnel of the given perimeter, metres.
    ///
    /// # Errors
    /// [`SurveyError::Value`] that names the file and what is wrong.
    pub fn read(path: &Path, perimeter_m: f64) -> Result<Self, SurveyError> {
        read_wall_file(path, "the wall's shape", |file: &Self| {
            file.check(perimeter_m)
        })
    }

    /// The field.
    pub fn field(&self) -> RadialField {
        let lattice = SplineLattice {
            perimeter_m: self.perimeter_m,
            columns: self.columns,
            origin: self.origin,
        };
        RadialField::new(lattice, self.first_row, self.coefficients_m.clone())
    }

    /// The field; None if it is empty.
    pub fn displacement(&self) -> Option<RadialField> {
        (!self.coefficients_m.is_empty()).then(|| self.field())
    }

    /// Checks all values; returns what is wrong.
    fn check(&self, perimeter_m: f64) -> Result<(), String> {
        check_format(&self.format, FORMAT)?;
        check_perimeter(self.perimeter_m, perimeter_m, "the shape")?;
        if !(MIN_COLUMNS..=MAX_COLUMNS).contains(&self.columns) || !self.columns.is_power_of_two() {
            return Err(format!(
                "columns is {}; it must be a power of two from {MIN_COLUMNS} to \
                 {MAX_COLUMNS}",
                self.columns
            ));
        }
        check_origin(self.origin)?;
        if let Some(bend) = &self.bend {
            let least_m = MIN_BEND_RADIUS_PERIMETERS * perimeter_m;
            let is_possible = bend.at_h_m.is_finite() && bend.radius_m() > least_m;
            if !is_possible {
                return Err(format!(
                    "bend has a radius of {} m; it must be more than {least_m:.0} m, at a finite \
                     chainage",
                    bend.radius_m()
                ));
            }
        }
        let most_m = MAX_DISPLACEMENT_SHARE * perimeter_m;
        let possible = -most_m..=most_m;
        if let Some(c) = (self.coefficients_m.iter()).find(|c| !possible.contains(*c)) {
            return Err(format!(
                "a coefficient is {c} m; displacements must be no more than {most_m:.3} m"
            ));
        }
        if !self.coefficients_m.len().is_multiple_of(self.columns) {
            return Err(format!(
                "coefficients_m has {} values, which are no whole rows of {} columns",
                self.coefficients_m.len(),
                self.columns
            ));
        }
        let lengths = [
            ("sigma_m", self.sigma_m.len()),
            ("deviation_sigma_m", self.deviation_sigma_m.len()),
        ];
        for (name, length) in lengths {
            if length != 0 && length != self.coefficients_m.len() {
                return Err(format!(
                    "{name} has {length} values for {} coefficients",
                    self.coefficients_m.len()
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::{Circle, Surface};

    const BEND: Bend = Bend {
        curvature_per_m: [0.003, -0.001],
        at_h_m: 5.0,
    };

    fn file() -> ShapeFile {
        let lattice = SplineLattice {
            perimeter_m: circle().perimeter_m(),
            columns: 8,
            origin: WallPoint { s_m: 0.1, h_m: 2.0 },
        };
        let field = RadialField::new(
            lattice,
            -2,
            (0..24).map(|k| 1e-3 / f64::from(k + 1)).collect(),
        );
        let mut deviations = vec![Some(1e-4); 24];
        deviations[5] = None;
        ShapeFile::new(&field, vec![1e-4; 24])
            .with_deviation_sigma_m(deviations)
            .with_bend(Some(BEND))
    }

    fn circle() -> Circle {
        Circle::new(3.0).unwrap()
    }

    #[test]
    fn a_written_shape_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.json");
        std::fs::write(&path, serde_json::to_string(&file()).unwrap()).unwrap();
        let read = ShapeFile::read(&path, circle().perimeter_m()).unwrap();
        assert_eq!(read, file());
        assert_eq!(read.displacement(), Some(file().field()));
        let only = ShapeFile::of_bend(BEND, circle().perimeter_m());
        std::fs::write(&path, serde_json::to_string(&only).unwrap()).unwrap();
        let read = ShapeFile::read(&path, circle().perimeter_m()).unwrap();
        assert_eq!((read.bend, read.displacement()), (Some(BEND), None));
    }

    #[test]
    fn impossible_values_are_named() {
        type Change = fn(&mut ShapeFile);
        let changes: [(Change, &str); 9] = [
            (|f| f.format = "x".to_owned(), "format"),
            (|f| f.perimeter_m = 17.0, "perimeter_m"),
            (|f| f.columns = 12, "columns"),
            (|f| f.origin.h_m = f64::NAN, "origin"),
            (|f| f.coefficients_m[3] = 5.0, "coefficient"),
            (|f| f.coefficients_m.truncate(23), "coefficients_m"),
            (|f| f.sigma_m.truncate(2), "sigma_m"),
            (
                |f| f.bend.as_mut().unwrap().curvature_per_m[0] = 0.1,
                "bend",
            ),
            (|f| f.deviation_sigma_m.truncate(2), "deviation_sigma_m"),
        ];
        for (change, named) in changes {
            let mut file = file();
            change(&mut file);
            let error = file.check(circle().perimeter_m()).unwrap_err();
            assert!(error.contains(named), "{error}");
        }
        assert_eq!(file().check(circle().perimeter_m()), Ok(()));
    }
}
