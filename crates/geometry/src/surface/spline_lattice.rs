//! Lattice of cubic B-splines on the unrolled wall, periodic around the section.

use super::wall::WallPoint;
use serde::{Deserialize, Serialize};

/// Nodes on either axis that a point of the wall depends on.
pub const SUPPORT: usize = 4;

/// A square lattice of nodes on the unrolled wall. A whole number of columns goes around the
/// section; rows are numbered along the tunnel without end.
///
/// Node (row j, column i) is at `s = s_0 + i Δ`, `h = h_0 + j Δ`, with the spacing Δ the perimeter
/// over the number of columns and the origin `(s_0, h_0)`. Its basis function is
/// `B((s − s_i)/Δ) B((h − h_j)/Δ)`, B the cubic B-spline of unit spacing. A lattice of twice as
/// many columns and the same origin spans all functions of this one ([`halve_spacing`]).
///
/// Source: C. de Boor, "A Practical Guide to Splines", 1978.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SplineLattice {
    /// Period of s, metres.
    pub perimeter_m: f64,
    /// Columns around the section; at least [`SUPPORT`].
    pub columns: usize,
    /// The node of row 0 and column 0.
    pub origin: WallPoint,
}

/// The basis functions that are not zero at a point, with their values or derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Support {
    /// First of the consecutive rows.
    pub first_row: i64,
    /// The columns, in `0..columns`.
    pub columns: [usize; SUPPORT],
    /// Values of the functions along h, row by row.
    pub along_h: [f64; SUPPORT],
    /// Values of the functions along s, column by column.
    pub along_s: [f64; SUPPORT],
    /// Derivatives of the functions along h, 1/m.
    pub slope_h: [f64; SUPPORT],
    /// Derivatives of the functions along s, 1/m.
    pub slope_s: [f64; SUPPORT],
}

impl Support {
    /// Sum along s of a row of coefficients; 0 of an empty row.
    #[inline]
    pub(super) fn values_of(&self, row: &[f64]) -> f64 {
        let terms = self.columns.iter().zip(self.along_s);
        terms
            .filter_map(|(column, weight)| Some(weight * row.get(*column)?))
            .fold(0.0, |sum, term| sum + term)
    }
}

impl SplineLattice {
    /// Distance Δ between neighbouring nodes along either axis, metres.
    pub fn spacing_m(&self) -> f64 {
        self.perimeter_m / self.columns as f64
    }

    /// A node.
    pub fn node(&self, row: i64, column: usize) -> WallPoint {
        WallPoint {
            s_m: self.origin.s_m + column as f64 * self.spacing_m(),
            h_m: self.origin.h_m + row as f64 * self.spacing_m(),
        }
    }

    /// The basis functions at a point of the wall.
    pub fn support(&self, wall: WallPoint) -> Support {
        let spacing_m = self.spacing_m();
        let u = (wall.s_m - self.origin.s_m) / spacing_m;
        let v = (wall.h_m - self.origin.h_m) / spacing_m;
        let (i, j) = (u.floor(), v.floor());
        let first = (i as i64 - 1).rem_euclid(self.columns as i64) as usize;
        let (along_s, slope_s) = cubic_b_spline(u - i);
        let (along_h, slope_h) = cubic_b_spline(v - j);
        Support {
            first_row: j as i64 - 1,
            columns: std::array::from_fn(|k| match first + k {
                column if column < self.columns => column,
                beyond => beyond - self.columns,
            }),
            along_h,
            along_s,
            slope_h: slope_h.map(|slope| slope / spacing_m),
            slope_s: slope_s.map(|slope| slope / spacing_m),
        }
    }

    /// The rows whose functions are not zero somewhere between two chainages, metres.
    pub fn rows_between(&self, from_h_m: f64, to_h_m: f64) -> std::ops::Range<i64> {
        let row = |h_m: f64| ((h_m - self.origin.h_m) / self.spacing_m()).floor() as i64;
        row(from_h_m) - 1..row(to_h_m) + 3
    }

    /// The lattice of half the spacing.
    pub fn halved(&self) -> Self {
        Self {
            columns: 2 * self.columns,
            ..*self
        }
    }
}

/// Values and derivatives at `t` in 0 to 1 of the four cubic B-splines of unit spacing that are
/// centred at −1, 0, 1 and 2.
fn cubic_b_spline(t: f64) -> ([f64; SUPPORT], [f64; SUPPORT]) {
    let r = 1.0 - t;
    (
        [
            r * r * r / 6.0,
            2.0 / 3.0 - t * t * (1.0 - 0.5 * t),
            2.0 / 3.0 - r * r * (1.0 - 0.5 * r),
            t * t * t / 6.0,
        ],
        [
            -0.5 * r * r,
            t * (1.5 * t - 2.0),
            r * (2.0 - 1.5 * r),
            0.5 * t * t,
        ],
    )
}

/// Coefficients on half the spacing of the function with the coefficients `c(k)`: that at the node
/// `k`, which lies at `k/2` of the coarser lattice.
///
/// `(c(i−1) + 6 c(i) + c(i+1))/8` at its nodes, `(c(i) + c(i+1))/2` between them.
pub fn halve_spacing(c: impl Fn(i64) -> f64, k: i64) -> f64 {
    let i = k.div_euclid(2);
    if k.rem_euclid(2) == 0 {
        (c(i - 1) + 6.0 * c(i) + c(i + 1)) / 8.0
    } else {
        (c(i) + c(i + 1)) / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_sum_to_one_and_slopes_are_their_derivatives() {
        let step = 1e-6;
        for t in [0.0, 0.2, 0.71, 0.999] {
            let (values, slopes) = cubic_b_spline(t);
            assert!((values.iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let (plus, minus) = (cubic_b_spline(t + step).0, cubic_b_spline(t - step).0);
            for k in 0..SUPPORT {
                let numeric = (plus[k] - minus[k]) / (2.0 * step);
                assert!((numeric - slopes[k]).abs() < 1e-9, "function {k} at {t}");
            }
        }
    }

    #[test]
    fn a_function_is_the_same_on_half_the_spacing() {
        let coarse = |k: i64| ((k * 7919) % 13) as f64;
        let value = |c: &dyn Fn(i64) -> f64, x: f64| {
            let i = x.floor();
            let (weights, _) = cubic_b_spline(x - i);
            (0..4i64)
                .map(|k| weights[k as usize] * c(i as i64 - 1 + k))
                .sum::<f64>()
        };
        let fine = |k: i64| halve_spacing(coarse, k);
        for x in [-3.3, 0.0, 0.49, 2.75, 11.1] {
            let (a, b) = (value(&coarse, x), value(&fine, 2.0 * x));
            assert!((a - b).abs() < 1e-12, "{a} and {b} at {x}");
        }
    }
}
