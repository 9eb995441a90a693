//! Mapping of a tile's pixels into a frame by polynomials, patch by patch.
//!
//! From the wall to a frame everything is smooth: surface, pose, lens, a camera that moves while it
//! reads its rows. Over a patch of 32 × 32 canvas pixels, u and v are cubic in each of the patch's
//! coordinates `x, y ∈ [−1, 1]`,
//!
//! `u(x, y) = Σ_kl c_kl x^k y^l`, `k, l = 0 … 3`,
//!
//! through the exact projections of 4 × 4 points at ±1 and ±(√2 − 1). There the error of an
//! interpolated cubic is the same on the border as in the middle, `0.17/4! ∂⁴u` to first order; in
//! between, at 0, it is measured against the exact projection of nine points more. A patch where
//! that finds more than [`MAX_RESIDUAL_PX`] is projected point by point.

use super::control_points::{ControlPoints, PATCH_POINTS, POINTS_PER_PATCH};
use super::patches::{LANES, PATCH_EDGE, PATCH_SCALE};
use super::projection::LocalProjection;
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// Largest error of a polynomial, pixels of the frame. A higher value is faster, as fewer patches
/// are projected point by point, and less exact.
const MAX_RESIDUAL_PX: f32 = 1e-3;
/// Margin around the frame, pixels: a patch whose control points all lie beyond the same side of it
/// by more is not in the frame.
const OUTSIDE_MARGIN_PX: f32 = 2.0;

/// Coefficients of u by powers of x, then those of v: side by side, they are one vector.
pub type PatchCoefficients = [f32; 8];

#[derive(Clone, Copy, Debug)]
enum PatchWarp {
    /// Polynomials by powers of y.
    Polynomial([PatchCoefficients; 4]),
    /// No pixel of it lies in the frame.
    Outside,
    /// Projected point by point.
    Exact,
}

/// Mapping of a tile's pixels into a frame: one pair of bicubic polynomials a patch.
#[derive(Debug)]
pub struct LocalPolynomialWarp {
    /// Number of patches across.
    across: usize,
    patches: Vec<PatchWarp>,
}

/// Projections of a tile's control points, and which of them the lens shows; buffers that are used
/// again for the next tile.
#[derive(Debug, Default)]
pub struct ProjectedControlPoints {
    u: Vec<f32>,
    v: Vec<f32>,
    shown: Vec<bool>,
}

impl LocalPolynomialWarp {
    /// Fits the polynomials of a tile for a frame with the given `projection`.
    pub fn new(
        projection: &LocalProjection,
        control_points: &ControlPoints,
        projected: &mut ProjectedControlPoints,
    ) -> Self {
        let count = control_points.points().len();
        let ProjectedControlPoints { u, v, shown } = projected;
        u.resize(count, 0.0);
        v.resize(count, 0.0);
        shown.resize(count, false);
        projection.project_all(control_points.points(), 0, (u, v, shown));
        let [across, down] = control_points.patches;
        let columns = control_points.columns();
        let limit = projection.limit();
        let patches = (0..across * down).map(|patch| {
            let first = (patch / across * columns + patch % across) * POINTS_PER_PATCH;
            let mut all_shown = true;
            let (mut u_all, mut v_all) = ([[0.0; 5]; 5], [[0.0; 5]; 5]);
            for row in 0..5 {
                let at = first + row * columns;
                u_all[row].copy_from_slice(&u[at..at + 5]);
                v_all[row].copy_from_slice(&v[at..at + 5]);
                all_shown &= shown[at..at + 5].iter().all(|shown| *shown);
            }
            if !all_shown {
                return PatchWarp::Exact;
            }
            if outside(&u_all, limit[0]) || outside(&v_all, limit[1]) {
                return PatchWarp::Outside;
            }
            Self::fit_both(&u_all, &v_all)
        });
        Self {
            across,
            patches: patches.collect(),
        }
    }

    fn fit_both(u: &[[f32; 5]; 5], v: &[[f32; 5]; 5]) -> PatchWarp {
        let (u, v) = (fit_patch(u), fit_patch(v));
        match (u, v) {
            (Some(u), Some(v)) => {
                let mut lines = [[0.0; 8]; 4];
                for (line, (u, v)) in lines.iter_mut().zip(u.iter().zip(&v)) {
                    line[..4].copy_from_slice(u);
                    line[4..].copy_from_slice(v);
                }
                PatchWarp::Polynomial(lines)
            }
            _ => PatchWarp::Exact,
        }
    }

    /// Bounds of u and of v over some rows and columns of a patch.
    ///
    /// Around the middle `(x, y)` of `2a × 2b`: `|Δu| ≤ a max|∂u/∂x| + b max|∂u/∂y|`, and as all
    /// powers of x and y are at most 1, `|∂u/∂x| ≤ Σ k |c_kl|`, `|∂u/∂y| ≤ Σ l |c_kl|`.
    pub fn pixel_bounds(
        lines: &[PatchCoefficients; 4],
        rows: Range<usize>,
        columns: Range<usize>,
    ) -> [[f32; 2]; 2] {
        let along = |range: Range<usize>| {
            let (first, last) = (range.start as f32, range.end as f32 - 1.0);
            (
                0.5 * (first + last) * PATCH_SCALE - 1.0,
                0.5 * (last - first) * PATCH_SCALE,
            )
        };
        let ((x, a), (y, b)) = (along(columns), along(rows));
        let middle = Self::pixel(lines, x, y);
        let mut around = [0.0; 8];
        for (l, c) in lines.iter().enumerate() {
            for k in 0..around.len() {
                around[k] += ((k % 4) as f32 * a + l as f32 * b) * c[k].abs();
            }
        }
        let [u0, u1, u2, u3, v0, v1, v2, v3] = around;
        let (u, v) = ((u0 + u1) + (u2 + u3), (v0 + v1) + (v2 + v3));
        [
            [middle[0] - u, middle[0] + u],
            [middle[1] - v, middle[1] + v],
        ]
    }

    /// Index of the patch that a pixel of the tile lies in.
    #[inline(always)]
    pub fn patch_index(&self, row: usize, column: usize) -> usize {
        row / PATCH_EDGE * self.across + column / PATCH_EDGE
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// Change of u and v from one canvas pixel to the next in the middle of a patch with
    /// polynomials, along its row and along its column.
    pub fn pixel_steps(&self, patch: usize) -> Option<[[f32; 2]; 2]> {
        match &self.patches[patch] {
            PatchWarp::Polynomial(c) => Some([
                [PATCH_SCALE * c[0][1], PATCH_SCALE * c[0][5]],
                [PATCH_SCALE * c[1][0], PATCH_SCALE * c[1][4]],
            ]),
            _ => None,
        }
    }

    /// True if no pixel of the tile lies in the frame.
    pub fn is_outside(&self) -> bool {
        self.patches
            .iter()
            .all(|patch| matches!(patch, PatchWarp::Outside))
    }

    /// True if the patch around a pixel of the tile has no pixel in the frame.
    pub fn is_outside_at(&self, row: usize, column: usize) -> bool {
        matches!(
            self.patches[self.patch_index(row, column)],
            PatchWarp::Outside
        )
    }

    /// True if some pixels must be projected one by one.
    pub fn needs_exact_projection(&self) -> bool {
        self.patches
            .iter()
            .any(|patch| matches!(patch, PatchWarp::Exact))
    }

    /// Polynomials of a patch by powers of y, if it has them.
    pub fn coefficients(&self, patch: usize) -> Option<&[PatchCoefficients; 4]> {
        match &self.patches[patch] {
            PatchWarp::Polynomial(c) => Some(c),
            _ => None,
        }
    }

    /// Pixel of the frame at a point of a patch with polynomials.
    #[inline]
    pub fn pixel(lines: &[PatchCoefficients; 4], x: f32, y: f32) -> [f32; 2] {
        let c = Self::at(lines, y);
        [
            ((c[3] * x + c[2]) * x + c[1]) * x + c[0],
            ((c[7] * x + c[6]) * x + c[5]) * x + c[4],
        ]
    }

    /// Polynomials along a row of the tile within a patch, by powers of x.
    #[inline(always)]
    fn row_coefficients(&self, row: usize, patch: usize) -> Option<PatchCoefficients> {
        let PatchWarp::Polynomial(c) = &self.patches[patch] else {
            return None;
        };
        Some(Self::at(c, (row % PATCH_EDGE) as f32 * PATCH_SCALE - 1.0))
    }

    #[inline(always)]
    fn at(c: &[PatchCoefficients; 4], y: f32) -> PatchCoefficients {
        let mut at = c[3];
        for c in [&c[2], &c[1], &c[0]] {
            for k in 0..at.len() {
                at[k] = at[k] * y + c[k];
            }
        }
        at
    }

    /// Finds u and v of eight pixels of the tile's `row`, from column 8 times `eight` on. False if
    /// they are to be projected point by point.
    #[inline(always)]
    pub fn locate_eight(
        &self,
        row: usize,
        eight: usize,
        u: &mut [f32; LANES],
        v: &mut [f32; LANES],
    ) -> bool {
        let patch = self.patch_index(row, eight * LANES);
        if let Some(at) = self.row_coefficients(row, patch) {
            let first = eight * LANES % PATCH_EDGE;
            for k in 0..LANES {
                let x = (first + k) as f32 * PATCH_SCALE - 1.0;
                u[k] = ((at[3] * x + at[2]) * x + at[1]) * x + at[0];
                v[k] = ((at[7] * x + at[6]) * x + at[5]) * x + at[4];
            }
            return true;
        }
        u.fill(-OUTSIDE_MARGIN_PX);
        v.fill(-OUTSIDE_MARGIN_PX);
        matches!(self.patches[patch], PatchWarp::Outside)
    }
}

/// True if all values lie beyond the same end of `0 … limit`.
fn outside(at: &[[f32; 5]; 5], limit: f32) -> bool {
    let all = || at.as_flattened().iter();
    all().all(|at| *at < -OUTSIDE_MARGIN_PX) || all().all(|at| *at > limit + OUTSIDE_MARGIN_PX)
}

/// Coefficients of a cubic, the lowest power first, from its values at ±1 and ±(√2 − 1).
///
/// With `a = √2 − 1`, the even part of the values `e_1 = (p(1) + p(−1))/2`, `e_a` likewise:
/// `c_2 = (e_1 − e_a)/(1 − a²)`, `c_0 = e_1 − c_2`; odd parts over their place:
/// `o_1 = (p(1) − p(−1))/2`, `o_a = (p(a) − p(−a))/2a`, `c_3 = (o_1 − o_a)/(1 − a²)`,
/// `c_1 = o_1 − c_3`.
fn fit_cubic([p, q, r, s]: [f32; 4]) -> [f32; 4] {
    const A: f32 = SQRT_2 as f32 - 1.0;
    const INVERSE: f32 = 1.0 / (1.0 - A * A);
    let (even_1, even_a) = (0.5 * (s + p), 0.5 * (r + q));
    let (odd_1, odd_a) = (0.5 * (s - p), (0.5 / A) * (r - q));
    let c_2 = (even_1 - even_a) * INVERSE;
    let c_3 = (odd_1 - odd_a) * INVERSE;
    [even_1 - c_2, odd_1 - c_3, c_2, c_3]
}

/// Coefficients of a patch, `[l][k]` that of `x^k y^l`; None if the polynomial is too far off at
/// the points between those it is fitted to.
fn fit_patch(at: &[[f32; 5]; 5]) -> Option<[[f32; 4]; 4]> {
    // Small numbers round less.
    let middle = at[2][2];
    let mut along_x = [[0.0; 4]; 4];
    for (along_x, row) in along_x.iter_mut().zip([0, 1, 3, 4]) {
        let [p, q, _, r, s] = at[row];
        *along_x = fit_cubic([p - middle, q - middle, r - middle, s - middle]);
    }
    let mut c = [[0.0; 4]; 4];
    for k in 0..4 {
        let [p, q, r, s] = along_x;
        let along_y = fit_cubic([p[k], q[k], r[k], s[k]]);
        for l in 0..4 {
            c[l][k] = along_y[l];
        }
    }
    let value = |x: f32, y: f32| {
        let at = |k: usize| ((c[3][k] * y + c[2][k]) * y + c[1][k]) * y + c[0][k];
        ((at(3) * x + at(2)) * x + at(1)) * x + at(0)
    };
    for (row, y) in PATCH_POINTS.iter().enumerate() {
        for (column, x) in PATCH_POINTS.iter().enumerate() {
            if row != 2 && column != 2 {
                continue;
            }
            let off = value(*x as f32, *y as f32) - (at[row][column] - middle);
            // NaN does not fit, either.
            if off.is_nan() || off.abs() > MAX_RESIDUAL_PX {
                return None;
            }
        }
    }
    c[0][0] += middle;
    Some(c)
}
