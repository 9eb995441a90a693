//! Displacement of a wall by the cubic B-spline of a shape.json.
//!
//! Only the numbers of the file are shared with the estimator. δ is evaluated here by the closed
//! form of the B-spline,
//!
//! `δ(s, h) = Σ_ji c_ji B((s − s_0)/Δ − i) B((h − h_0)/Δ − j)`,
//! `B(x) = 2/3 − x² + |x|³/2` for `|x| < 1`, `(2 − |x|)³/6` for `1 ≤ |x| < 2`, otherwise 0.

use std::path::Path;
use tunnelstitch_core::survey::{ShapeFile, SurveyError};

/// The displacement of a shape.json.
#[derive(Clone, Debug)]
pub(super) struct ShapeSpline {
    /// Distance Δ of the nodes, metres.
    spacing_m: f64,
    /// The node of row 0 and column 0, metres.
    origin: [f64; 2],
    columns: usize,
    first_row: i64,
    /// Coefficients, metres, row by row.
    c_m: Vec<f64>,
}

impl ShapeSpline {
    /// Reads the file for a tunnel of the given perimeter, metres.
    ///
    /// # Errors
    /// [`SurveyError`] that names the file and what is wrong.
    pub fn read(path: &Path, perimeter_m: f64) -> Result<Self, SurveyError> {
        let file = ShapeFile::read(path, perimeter_m)?;
        if file.bend.is_some() {
            return Err(SurveyError::Value {
                path: path.to_owned(),
                what: "has a bend, which is not drawn; remove it, or draw a curved tunnel \
                       (--centreline)"
                    .to_owned(),
            });
        }
        let field = file.field();
        let lattice = field.lattice();
        Ok(Self {
            spacing_m: lattice.perimeter_m / lattice.columns as f64,
            origin: [lattice.origin.s_m, lattice.origin.h_m],
            columns: lattice.columns,
            first_row: field.rows().start,
            c_m: field.coefficients_m().to_vec(),
        })
    }

    /// δ at a point of the unrolled wall, metres, positive outwards.
    pub fn delta_m(&self, s_m: f64, h_m: f64) -> f64 {
        let u = (s_m - self.origin[0]) / self.spacing_m;
        let v = (h_m - self.origin[1]) / self.spacing_m;
        // B reaches two nodes to either side.
        let nodes = |x: f64| (-1..3).map(move |k| (x.floor() as i64).saturating_add(k));
        nodes(v)
            .filter_map(|j| {
                let row = usize::try_from(j.checked_sub(self.first_row)?).ok()?;
                let row = self.c_m.chunks_exact(self.columns).nth(row)?;
                let along_s = nodes(u).map(|i| {
                    row[i.rem_euclid(self.columns as i64) as usize] * b_spline(u - i as f64)
                });
                Some(along_s.sum::<f64>() * b_spline(v - j as f64))
            })
            .sum()
    }
}

/// The cubic B-spline of unit spacing.
fn b_spline(x: f64) -> f64 {
    let x = x.abs();
    if x < 1.0 {
        2.0 / 3.0 - x * x + 0.5 * x * x * x
    } else if x < 2.0 {
        (2.0 - x).powi(3) / 6.0
    } else {
        0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::{RadialField, SplineLattice, WallPoint};

    /// The estimator's own evaluation of the same file, as a check of the conventions.
    #[test]
    fn the_spline_is_that_of_the_documented_format() {
        let lattice = SplineLattice {
            perimeter_m: 18.0,
            columns: 16,
            origin: WallPoint { s_m: 0.4, h_m: 2.0 },
        };
        let c_m = (0..16 * 7).map(|k| 0.01 * (12.9 * f64::from(k)).sin());
        let field = RadialField::new(lattice, -3, c_m.collect());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("shape.json");
        let text = serde_json::to_string(&ShapeFile::new(&field, Vec::new())).unwrap();
        std::fs::write(&path, text).unwrap();
        let spline = ShapeSpline::read(&path, 18.0).unwrap();
        for k in 0..200 {
            let (s_m, h_m) = (0.37 * f64::from(k) - 9.0, 0.11 * f64::from(k) - 6.0);
            let expected_m = field.at(WallPoint { s_m, h_m }).delta_m;
            assert!((spline.delta_m(s_m, h_m) - expected_m).abs() < 1e-15);
        }
        assert!(ShapeSpline::read(&path, 17.0).is_err());
        assert!(ShapeSpline::read(&folder.path().join("none.json"), 18.0).is_err());
    }

    #[test]
    fn equal_coefficients_are_an_even_displacement() {
        let spline = ShapeSpline {
            spacing_m: 0.5,
            origin: [0.1, 0.0],
            columns: 8,
            first_row: -2,
            c_m: vec![0.02; 8 * 8],
        };
        for (s_m, h_m) in [(0.0, 0.0), (3.99, 1.3), (1.7, 0.77)] {
            assert!((spline.delta_m(s_m, h_m) - 0.02).abs() < 1e-15);
        }
        assert_eq!(spline.delta_m(1.0, 10.0), 0.0);
        assert_eq!(spline.delta_m(1.0, 1e300), 0.0);
    }
}
