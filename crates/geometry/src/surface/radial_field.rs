//! The wall's displacement from its nominal shape, a field over the unrolled wall.

use super::spline_lattice::{SUPPORT, SplineLattice, Support, halve_spacing};
use super::wall::WallPoint;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// The displacement `δ(s, h)` of a wall along the normal of its nominal shape, metres, positive
/// outwards: a cubic B-spline on a [`SplineLattice`], zero beyond its rows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RadialField {
    lattice: SplineLattice,
    /// Number of the first row.
    first_row: i64,
    /// Coefficients, metres, row by row.
    coefficients_m: Vec<f64>,
}

/// A field and its derivatives at a point of the wall.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FieldValue {
    /// δ, metres.
    pub delta_m: f64,
    /// `∂δ/∂s`.
    pub slope_s: f64,
    /// `∂δ/∂h`.
    pub slope_h: f64,
}

impl RadialField {
    /// The field with the given coefficients, metres, row by row from `first_row`.
    ///
    /// What is left of the last row, if it is not whole, has the coefficient 0.
    pub fn new(lattice: SplineLattice, first_row: i64, mut coefficients_m: Vec<f64>) -> Self {
        let rows = coefficients_m.len().div_ceil(lattice.columns);
        coefficients_m.resize(rows * lattice.columns, 0.0);
        Self {
            lattice,
            first_row,
            coefficients_m,
        }
    }

    /// The field of these values at the nodes of some rows of a lattice, metres, to the fourth
    /// order of the spacing: with `c = (1 − δ²/6) v` along either axis, δ² the second difference.
    ///
    /// Source: C. de Boor, G. J. Fix, "Spline approximation by quasiinterpolants", Journal of
    /// Approximation Theory 8(1), 1973.
    pub fn through(
        lattice: SplineLattice,
        rows: Range<i64>,
        value_m: impl Fn(WallPoint) -> f64,
    ) -> Self {
        let columns = lattice.columns;
        let nodes = rows
            .clone()
            .flat_map(|row| (0..columns).map(move |k| (row, k)));
        let values: Vec<f64> = nodes
            .map(|(row, k)| value_m(lattice.node(row, k)))
            .collect();
        let sharpened = |before: f64, at: f64, after: f64| at - (before - 2.0 * at + after) / 6.0;
        let along_s = (0..values.len()).map(|k| {
            let (start, column) = (k - k % columns, k % columns);
            let beside = |step: usize| values[start + (column + step) % columns];
            sharpened(beside(columns - 1), values[k], beside(1))
        });
        let along_s: Vec<f64> = along_s.collect();
        let coefficients_m = (0..along_s.len()).map(|k| {
            let own = along_s[k];
            let beside = k.checked_sub(columns).zip(along_s.get(k + columns));
            beside.map_or(own, |(before, after)| {
                sharpened(along_s[before], own, *after)
            })
        });
        Self::new(lattice, rows.start, coefficients_m.collect())
    }

    /// The lattice.
    pub fn lattice(&self) -> &SplineLattice {
        &self.lattice
    }

    /// The rows.
    pub fn rows(&self) -> Range<i64> {
        let rows = self.coefficients_m.len() / self.lattice.columns;
        self.first_row..self.first_row + rows as i64
    }

    /// The coefficients, metres, row by row.
    pub fn coefficients_m(&self) -> &[f64] {
        &self.coefficients_m
    }

    /// A coefficient, metres; 0 beyond the rows.
    fn coefficient_m(&self, row: i64, column: usize) -> f64 {
        if self.rows().contains(&row) {
            self.coefficients_m[(row - self.first_row) as usize * self.lattice.columns + column]
        } else {
            0.0
        }
    }

    /// The field at a point of the wall.
    pub fn at(&self, wall: WallPoint) -> FieldValue {
        let support = self.lattice.support(wall);
        let mut value = FieldValue::default();
        for j in 0..SUPPORT {
            let row = support.first_row + j as i64;
            let (mut along, mut slope) = (0.0, 0.0);
            for i in 0..SUPPORT {
                let coefficient_m = self.coefficient_m(row, support.columns[i]);
                along += coefficient_m * support.along_s[i];
                slope += coefficient_m * support.slope_s[i];
            }
            value.delta_m += along * support.along_h[j];
            value.slope_h += along * support.slope_h[j];
            value.slope_s += slope * support.along_h[j];
        }
        value
    }

    /// δ (metres) on the grid `s_m × h_m` of wall points, row by row (s runs fastest).
    pub fn grid(&self, s_m: &[f64], h_m: &[f64]) -> Vec<f64> {
        let support = |s_m: f64, h_m: f64| self.lattice.support(WallPoint { s_m, h_m });
        let columns: Vec<Support> = s_m.iter().map(|s_m| support(*s_m, 0.0)).collect();
        let mut grid = Vec::with_capacity(s_m.len() * h_m.len());
        // Sums along s at every s, which all h between two rows of nodes have in common.
        let mut along_s: (Option<i64>, Vec<[f64; SUPPORT]>) = (None, Vec::new());
        for h_m in h_m {
            let across = support(0.0, *h_m);
            if along_s.0 != Some(across.first_row) {
                let rows: [&[f64]; SUPPORT] =
                    std::array::from_fn(|j| self.row(across.first_row + j as i64));
                let sums = columns
                    .iter()
                    .map(|column| rows.map(|row| column.values_of(row)));
                along_s = (Some(across.first_row), sums.collect());
            }
            grid.extend(along_s.1.iter().map(|values| {
                let terms = values.iter().zip(across.along_h);
                terms.fold(0.0, |delta_m, (value, weight)| delta_m + weight * value)
            }));
        }
        grid
    }

    /// Coefficients of a row, metres; empty beyond the rows.
    fn row(&self, row: i64) -> &[f64] {
        if self.rows().contains(&row) {
            let start = (row - self.first_row) as usize * self.lattice.columns;
            &self.coefficients_m[start..start + self.lattice.columns]
        } else {
            &[]
        }
    }

    /// This field on a lattice of half the spacing.
    pub fn halved(&self) -> Self {
        let lattice = self.lattice.halved();
        let rows = self.rows();
        // A function of the last rows reaches two of its spacings beyond them.
        let (first, last) = (2 * rows.start - 1, 2 * rows.end);
        let columns = self.lattice.columns as i64;
        let mut coefficients_m = Vec::with_capacity((last - first) as usize * lattice.columns);
        for row in first..last {
            for column in 0..lattice.columns as i64 {
                let along_s = |row: i64| {
                    let at = |i: i64| self.coefficient_m(row, i.rem_euclid(columns) as usize);
                    halve_spacing(at, column)
                };
                coefficients_m.push(halve_spacing(along_s, row));
            }
        }
        Self::new(lattice, first, coefficients_m)
    }

    /// The sum of this field and another on a lattice of the same origin, on the finer of the two
    /// and over the rows of both.
    pub fn plus(&self, other: &Self) -> Self {
        if self.lattice.columns < other.lattice.columns {
            return self.halved().plus(other);
        }
        if other.lattice.columns < self.lattice.columns {
            return self.plus(&other.halved());
        }
        let (a, b) = (self.rows(), other.rows());
        let rows = a.start.min(b.start)..a.end.max(b.end);
        let first_row = rows.start;
        let columns = 0..self.lattice.columns;
        let coefficients_m = rows
            .flat_map(|row| columns.clone().map(move |column| (row, column)))
            .map(|(row, column)| self.coefficient_m(row, column) + other.coefficient_m(row, column))
            .collect();
        Self::new(self.lattice, first_row, coefficients_m)
    }

    /// The field of a wall that is scaled as a whole.
    pub fn scaled(mut self, scale: f64) -> Self {
        self.lattice.perimeter_m *= scale;
        self.lattice.origin.s_m *= scale;
        self.lattice.origin.h_m *= scale;
        self.coefficients_m.iter_mut().for_each(|c| *c *= scale);
        self
    }

    /// The field moved by `by` on the unrolled wall.
    pub fn moved(mut self, by: WallPoint) -> Self {
        let origin = &mut self.lattice.origin;
        origin.s_m = (origin.s_m + by.s_m).rem_euclid(self.lattice.perimeter_m);
        origin.h_m += by.h_m;
        self
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// A field of irregular coefficients of up to `amplitude_m` on the wall of a circle of 3 m.
    pub fn irregular(amplitude_m: f64) -> RadialField {
        let lattice = SplineLattice {
            perimeter_m: 3.0 * TAU,
            columns: 32,
            origin: WallPoint {
                s_m: 0.3,
                h_m: -0.7,
            },
        };
        let coefficients_m = (0..32 * 20)
            .map(|k| amplitude_m * (12.9898 * f64::from(k)).sin())
            .collect();
        RadialField::new(lattice, -4, coefficients_m)
    }

    #[test]
    fn slopes_are_the_derivatives() {
        let field = irregular(0.01);
        let step = 1e-6;
        for (s_m, h_m) in [(0.1, 0.2), (18.8, 3.3), (7.0, -2.9)] {
            let at = |s_m, h_m| field.at(WallPoint { s_m, h_m }).delta_m;
            let value = field.at(WallPoint { s_m, h_m });
            let by_s = (at(s_m + step, h_m) - at(s_m - step, h_m)) / (2.0 * step);
            let by_h = (at(s_m, h_m + step) - at(s_m, h_m - step)) / (2.0 * step);
            assert!((by_s - value.slope_s).abs() < 1e-9);
            assert!((by_h - value.slope_h).abs() < 1e-9);
        }
    }

    #[test]
    fn the_grid_is_the_field_point_by_point() {
        let field = irregular(0.01);
        let (s, h) = ([0.1, 7.0, 18.8], [-50.0, -2.2, 3.3, 5.9]);
        for (k, delta_m) in field.grid(&s, &h).into_iter().enumerate() {
            let (s_m, h_m) = (s[k % 3], h[k / 3]);
            assert!((field.at(WallPoint { s_m, h_m }).delta_m - delta_m).abs() < 1e-16);
        }
    }

    #[test]
    fn the_field_stays_on_half_the_spacing_and_moves_with_its_origin() {
        let field = irregular(0.01);
        let (halved, by) = (field.halved(), WallPoint { s_m: 2.0, h_m: 5.0 });
        let (moved, twice) = (field.clone().moved(by), halved.plus(&halved));
        // A sum is on the finer lattice.
        assert_eq!(field.plus(&halved), twice);
        assert_eq!(halved.plus(&field), twice);
        for (s_m, h_m) in [(0.1, 0.2), (18.8, 3.3), (7.0, -2.9), (1.0, -50.0)] {
            let delta_m = field.at(WallPoint { s_m, h_m }).delta_m;
            assert!((halved.at(WallPoint { s_m, h_m }).delta_m - delta_m).abs() < 1e-15);
            assert!((twice.at(WallPoint { s_m, h_m }).delta_m - 2.0 * delta_m).abs() < 1e-15);
            let there = WallPoint {
                s_m: s_m + 2.0,
                h_m: h_m + 5.0,
            };
            assert!((moved.at(there).delta_m - delta_m).abs() < 1e-14);
        }
        assert_eq!(
            field
                .at(WallPoint {
                    s_m: 1.0,
                    h_m: 99.0
                })
                .delta_m,
            0.0
        );
    }
}
