//! The ellipse.

use super::outline::{OutlineHit, OutlinePoint, Section, forward_root};
use crate::surface::error::{SurfaceError, check_size};
use nalgebra::Vector2;
use std::f64::consts::TAU;

/// An ellipse `(a sin φ, b cos φ)` with its axes along x and z.
///
/// Its length `s(φ) = ∫ √(a² cos² φ + b² sin² φ) dφ` has no closed form: it is integrated by
/// Gauss–Legendre quadrature and inverted by Newton's method, to rounding.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipse {
    a_m: f64,
    b_m: f64,
    /// `s(φ)` at [`TABLE_CELLS`] + 1 uniform steps of φ once around, metres.
    lengths_m: Vec<f64>,
}

/// Cells of φ; within one cell, quadrature with five points is exact to rounding.
const TABLE_CELLS: usize = 512;
/// Nodes and weights of Gauss–Legendre quadrature on `[0, 1]`.
const QUADRATURE: [(f64, f64); 5] = [
    (0.046_910_077_030_668, 0.118_463_442_528_095),
    (0.230_765_344_947_158, 0.239_314_335_249_683),
    (0.5, 0.284_444_444_444_444),
    (0.769_234_655_052_842, 0.239_314_335_249_683),
    (0.953_089_922_969_332, 0.118_463_442_528_095),
];

impl Ellipse {
    /// Creates an ellipse of the given width (along x) and height (along z), metres.
    ///
    /// # Errors
    /// [`SurfaceError::Size`] unless both are positive and finite.
    pub fn new(width_m: f64, height_m: f64) -> Result<Self, SurfaceError> {
        check_size("width_m", width_m)?;
        check_size("height_m", height_m)?;
        let mut ellipse = Self {
            a_m: 0.5 * width_m,
            b_m: 0.5 * height_m,
            lengths_m: vec![0.0],
        };
        let mut length_m = 0.0;
        for k in 0..TABLE_CELLS {
            length_m += ellipse.length(phi(k), phi(k + 1));
            ellipse.lengths_m.push(length_m);
        }
        Ok(ellipse)
    }

    /// `ds/dφ`.
    fn speed(&self, phi: f64) -> f64 {
        let (sin, cos) = phi.sin_cos();
        (self.a_m * cos).hypot(self.b_m * sin)
    }

    /// The length between two φ at most one cell apart, metres.
    fn length(&self, from: f64, to: f64) -> f64 {
        let wide = to - from;
        let terms = QUADRATURE.iter();
        terms
            .map(|(node, weight)| weight * self.speed(from + node * wide))
            .sum::<f64>()
            * wide
    }

    fn s_of(&self, phi_rad: f64) -> f64 {
        let phi_rad = phi_rad.rem_euclid(TAU);
        let cell = ((phi_rad / TAU * TABLE_CELLS as f64) as usize).min(TABLE_CELLS - 1);
        self.lengths_m[cell] + self.length(phi(cell), phi_rad)
    }

    fn phi_of(&self, s_m: f64) -> f64 {
        let s_m = s_m.rem_euclid(self.perimeter_m());
        let cell = self.lengths_m.partition_point(|length| *length <= s_m);
        let cell = cell.clamp(1, TABLE_CELLS) - 1;
        let mut phi_rad = phi(cell);
        let left_m = s_m - self.lengths_m[cell];
        // The speed changes by parts in a thousand within a cell, so every step gains at least
        // three digits.
        for _ in 0..6 {
            let ahead_m = left_m - self.length(phi(cell), phi_rad);
            phi_rad += ahead_m / self.speed(phi_rad);
        }
        phi_rad
    }
}

fn phi(cell: usize) -> f64 {
    TAU * cell as f64 / TABLE_CELLS as f64
}

impl Section for Ellipse {
    fn perimeter_m(&self) -> f64 {
        self.lengths_m[TABLE_CELLS]
    }

    fn at(&self, s_m: f64) -> OutlinePoint {
        let (sin, cos) = self.phi_of(s_m).sin_cos();
        OutlinePoint {
            point: Vector2::new(self.a_m * sin, self.b_m * cos),
            tangent: Vector2::new(self.a_m * cos, -self.b_m * sin).normalize(),
        }
    }

    /// Intersects the unit circle in the plane scaled by 1/a and 1/b.
    fn hit(&self, from: &Vector2<f64>, d: &Vector2<f64>) -> OutlineHit {
        let shrink = |v: &Vector2<f64>| Vector2::new(v.x / self.a_m, v.y / self.b_m);
        let (start, along) = (shrink(from), shrink(d));
        let c = start.norm_squared() - 1.0;
        let range = forward_root(along.norm_squared(), along.dot(&start), c);
        let point = start + along * range;
        OutlineHit {
            range,
            s_m: self.s_of(point.x.atan2(point.y)),
        }
    }

    fn contains(&self, point: &Vector2<f64>) -> bool {
        (point.x / self.a_m).hypot(point.y / self.b_m) < 1.0
    }

    fn is_round(&self) -> bool {
        self.a_m == self.b_m
    }

    fn farthest_m(&self) -> f64 {
        self.a_m.max(self.b_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Ramanujan's second approximation is accurate to 10⁻⁹ for such ellipses.
    #[test]
    fn the_perimeter_is_ramanujans() {
        for (width, height) in [(4.0, 3.0), (2.0, 5.0), (6.0, 6.0)] {
            let ellipse = Ellipse::new(width, height).unwrap();
            let (a, b) = (0.5 * width, 0.5 * height);
            let h = ((a - b) / (a + b)).powi(2);
            let ramanujan = 0.5 * TAU * (a + b) * (1.0 + 3.0 * h / (10.0 + (4.0 - 3.0 * h).sqrt()));
            assert!((ellipse.perimeter_m() / ramanujan - 1.0).abs() < 1e-7);
        }
        let circle = Ellipse::new(6.0, 6.0).unwrap();
        assert!((circle.perimeter_m() - 3.0 * TAU).abs() < 1e-12 && circle.is_round());
    }
}
