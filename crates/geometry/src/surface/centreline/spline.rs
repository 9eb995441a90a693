//! A cubic spline through the given points of a centreline, and the interpolation of the section's
//! scale between them.

use nalgebra::{UnitQuaternion, Vector3};
use std::ops::{Add, Mul, Sub};

/// Parameter steps between two given points for the arc length.
const LENGTH_STEPS: usize = 64;

/// Slopes of the section's scale at the given points for monotone cubic interpolation, which does
/// not overshoot the given radii. The slopes at the ends are 0.
///
/// A slope is the weighted harmonic mean of the neighbouring secants if these have the same sign,
/// else 0.
///
/// Source: F. N. Fritsch, J. Butland, "A method for constructing local monotone piecewise cubic
/// interpolants", SIAM J. Sci. Stat. Comput. 5(2), 1984.
pub(super) fn monotone_slopes(scales: &[f64], chords: &[f64]) -> Vec<f64> {
    let slope = |k: usize| (scales[k + 1] - scales[k]) / chords[k];
    let mut slopes = vec![0.0; scales.len()];
    for k in 1..chords.len() {
        let (before, after) = (slope(k - 1), slope(k));
        if before * after > 0.0 {
            let (a, b) = (chords[k - 1], chords[k]);
            let (a, b) = (a + 2.0 * b, 2.0 * a + b);
            slopes[k] = (a + b) / (a / before + b / after);
        }
    }
    slopes
}

/// Value and derivative of the cubic Hermite polynomial with the given end values and end slopes.
pub(super) fn hermite<T>(p: [T; 2], m: [T; 2], t: f64) -> (T, T)
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let (t2, t3) = (t * t, t * t * t);
    let rise = t2 * (3.0 - 2.0 * t);
    let point = p[0] + (p[1] - p[0]) * rise + m[0] * (t3 - 2.0 * t2 + t) + m[1] * (t3 - t2);
    let slope = (p[1] - p[0]) * (6.0 * t - 6.0 * t2)
        + m[0] * (3.0 * t2 - 4.0 * t + 1.0)
        + m[1] * (3.0 * t2 - 2.0 * t);
    (point, slope)
}

/// A cubic spline through points, parametrised by the lengths of the chords.
pub(super) struct Spline {
    points: Vec<Vector3<f64>>,
    /// Lengths of the chords, metres.
    pub(super) chords: Vec<f64>,
    /// Derivatives at the points.
    slopes: Vec<Vector3<f64>>,
}

impl Spline {
    /// Interpolates points with C² continuity: `m_{k−1}/c_{k−1} + 2 (1/c_{k−1} + 1/c_k) m_k +
    /// m_{k+1}/c_k = 3 (Δ_{k−1}/c_{k−1}² + Δ_k/c_k²)`, a tridiagonal system; the slopes at the ends
    /// are those of the circles through three points.
    pub(super) fn through(points: Vec<Vector3<f64>>) -> Self {
        let n = points.len();
        let chords: Vec<f64> = points.windows(2).map(|p| (p[1] - p[0]).norm()).collect();
        let mut slopes = vec![Vector3::zeros(); n];
        if n == 2 {
            slopes.fill((points[1] - points[0]) / chords[0]);
            return Self {
                points,
                chords,
                slopes,
            };
        }
        slopes[0] = end_slope([points[0], points[1], points[2]]);
        slopes[n - 1] = -end_slope([points[n - 1], points[n - 2], points[n - 3]]);
        // Thomas' algorithm.
        let (mut upper, mut right) = (vec![0.0; n], slopes.clone());
        for k in 1..n - 1 {
            let (before, after) = (1.0 / chords[k - 1], 1.0 / chords[k]);
            let mut rhs = ((points[k] - points[k - 1]) * before * before
                + (points[k + 1] - points[k]) * after * after)
                * 3.0;
            let mut diagonal = 2.0 * (before + after);
            rhs -= right[k - 1] * before;
            diagonal -= upper[k - 1] * before;
            upper[k] = after / diagonal;
            right[k] = rhs / diagonal;
        }
        for k in (1..n - 1).rev() {
            slopes[k] = right[k] - slopes[k + 1] * upper[k];
        }
        Self {
            points,
            chords,
            slopes,
        }
    }

    fn ends(&self, place: usize, share: f64) -> (Vector3<f64>, Vector3<f64>) {
        let chord = self.chords[place];
        let (point, slope) = hermite(
            [self.points[place], self.points[place + 1]],
            [self.slopes[place] * chord, self.slopes[place + 1] * chord],
            share,
        );
        (point, slope / chord)
    }

    pub(super) fn point(&self, place: usize, share: f64) -> Vector3<f64> {
        self.ends(place, share).0
    }

    pub(super) fn velocity(&self, place: usize, share: f64) -> Vector3<f64> {
        self.ends(place, share).1
    }

    /// Cumulative arc length at [`LENGTH_STEPS`] steps between each two points (Simpson's rule).
    pub(super) fn lengths(&self) -> Vec<f64> {
        let mut lengths = vec![0.0];
        let mut length = 0.0;
        for (place, chord) in self.chords.iter().enumerate() {
            for k in 0..LENGTH_STEPS {
                let speed = |x: f64| {
                    self.velocity(place, (k as f64 + x) / LENGTH_STEPS as f64)
                        .norm()
                };
                length += (speed(0.0) + 4.0 * speed(0.5) + speed(1.0)) / 6.0 * chord
                    / LENGTH_STEPS as f64;
                lengths.push(length);
            }
        }
        lengths
    }

    /// Segment and local parameter at an arc length.
    pub(super) fn at_length(&self, lengths: &[f64], length_m: f64) -> (usize, f64) {
        let k = lengths.partition_point(|length| *length <= length_m);
        let k = k.clamp(1, lengths.len() - 1) - 1;
        let within = (length_m - lengths[k]) / (lengths[k + 1] - lengths[k]);
        let fine = k as f64 + within.clamp(0.0, 1.0);
        let place = (k / LENGTH_STEPS).min(self.chords.len() - 1);
        (place, fine / LENGTH_STEPS as f64 - place as f64)
    }
}

/// The tangent at the first of three points of the circle through them, or of the line if they are
/// collinear.
///
/// The angle between chord and tangent equals the angle that the chord subtends at the third point.
fn end_slope(p: [Vector3<f64>; 3]) -> Vector3<f64> {
    let (first, second) = (p[1] - p[0], p[2] - p[1]);
    let normal = first.cross(&second);
    let Some(normal) = normal.try_normalize(1e-9 * first.norm() * second.norm()) else {
        return first.normalize();
    };
    let angle = (p[0] - p[2]).angle(&(p[1] - p[2]));
    let turn = UnitQuaternion::from_scaled_axis(-normal * angle);
    turn * first.normalize()
}
