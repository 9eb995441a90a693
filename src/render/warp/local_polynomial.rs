//! Where the pixels of a tile appear in a frame: polynomials, patch by patch.
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
//! that finds more than [`MOST_OFF_PX`] is projected point by point.

use super::control_points::{Lattice, POINTS, STEP};
use super::patches::{EIGHT, PATCH, SCALE};
use super::projection::Look;
use std::f64::consts::SQRT_2;
use std::ops::Range;

/// Error of a polynomial at the most, pixels of the frame.
const MOST_OFF_PX: f32 = 1e-3;
/// Farther than this outside the frame, pixels, everywhere: nothing in between is inside.
const OUTSIDE_PX: f32 = 2.0;

/// Powers of x with u's coefficients, then with v's: side by side, they are one vector.
pub type Lanes = [f32; 8];

#[derive(Clone, Copy, Debug)]
enum Patch {
    /// By powers of y.
    Smooth([Lanes; 4]),
    /// No pixel of it lies in the frame.
    Outside,
    /// To be projected point by point.
    Rough,
}

/// Where the pixels of a tile appear in a frame.
#[derive(Debug)]
pub struct Chart {
    /// Patches across.
    across: usize,
    patches: Vec<Patch>,
}

/// Where the lattice's points appear, and whether the lens shows them.
#[derive(Debug, Default)]
pub struct Projected {
    u: Vec<f32>,
    v: Vec<f32>,
    shown: Vec<bool>,
}

impl Chart {
    /// The chart of a tile for a frame that is looked at by `look`.
    pub fn new(look: &Look, lattice: &Lattice, projected: &mut Projected) -> Self {
        let count = lattice.points().len();
        let Projected { u, v, shown } = projected;
        u.resize(count, 0.0);
        v.resize(count, 0.0);
        shown.resize(count, false);
        look.project_all(lattice.points(), 0, (u, v, shown));
        let [across, down] = lattice.patches;
        let columns = lattice.columns();
        let limit = look.limit();
        let patches = (0..across * down).map(|patch| {
            let first = (patch / across * columns + patch % across) * STEP;
            let mut all_shown = true;
            let (mut u_all, mut v_all) = ([[0.0; 5]; 5], [[0.0; 5]; 5]);
            for row in 0..5 {
                let at = first + row * columns;
                u_all[row].copy_from_slice(&u[at..at + 5]);
                v_all[row].copy_from_slice(&v[at..at + 5]);
                all_shown &= shown[at..at + 5].iter().all(|shown| *shown);
            }
            if !all_shown {
                return Patch::Rough;
            }
            if outside(&u_all, limit[0]) || outside(&v_all, limit[1]) {
                return Patch::Outside;
            }
            Self::fit(&u_all, &v_all)
        });
        Self {
            across,
            patches: patches.collect(),
        }
    }

    fn fit(u: &[[f32; 5]; 5], v: &[[f32; 5]; 5]) -> Patch {
        let (u, v) = (coefficients(u), coefficients(v));
        match (u, v) {
            (Some(u), Some(v)) => {
                let mut lines = [[0.0; 8]; 4];
                for (line, (u, v)) in lines.iter_mut().zip(u.iter().zip(&v)) {
                    line[..4].copy_from_slice(u);
                    line[4..].copy_from_slice(v);
                }
                Patch::Smooth(lines)
            }
            _ => Patch::Rough,
        }
    }

    /// Where these rows and columns of a smooth patch lie, to be sure: between these, along u and
    /// along v.
    ///
    /// Around the middle `(x, y)` of `2a × 2b`: `|Δu| ≤ a max|∂u/∂x| + b max|∂u/∂y|`, and as all
    /// powers of x and y are at most 1, `|∂u/∂x| ≤ Σ k |c_kl|`, `|∂u/∂y| ≤ Σ l |c_kl|`.
    pub fn range(lines: &[Lanes; 4], rows: Range<usize>, columns: Range<usize>) -> [[f32; 2]; 2] {
        let along = |range: Range<usize>| {
            let (first, last) = (range.start as f32, range.end as f32 - 1.0);
            (
                0.5 * (first + last) * SCALE - 1.0,
                0.5 * (last - first) * SCALE,
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

    /// The patch of a pixel of the tile.
    #[inline(always)]
    pub fn patch(&self, row: usize, column: usize) -> usize {
        row / PATCH * self.across + column / PATCH
    }

    /// Number of patches.
    pub fn len(&self) -> usize {
        self.patches.len()
    }

    /// How far u and v move from one canvas pixel to the next in the middle of a smooth patch,
    /// along its row and along its column.
    pub fn steps(&self, patch: usize) -> Option<[[f32; 2]; 2]> {
        match &self.patches[patch] {
            Patch::Smooth(c) => Some([
                [SCALE * c[0][1], SCALE * c[0][5]],
                [SCALE * c[1][0], SCALE * c[1][4]],
            ]),
            _ => None,
        }
    }

    /// True if no pixel of the tile lies in the frame.
    pub fn is_outside(&self) -> bool {
        self.patches
            .iter()
            .all(|patch| matches!(patch, Patch::Outside))
    }

    /// True if no pixel of the patch that a pixel of the tile lies in lies in the frame.
    pub fn is_outside_at(&self, row: usize, column: usize) -> bool {
        matches!(self.patches[self.patch(row, column)], Patch::Outside)
    }

    /// True if some pixels must be projected one by one.
    pub fn is_rough(&self) -> bool {
        self.patches
            .iter()
            .any(|patch| matches!(patch, Patch::Rough))
    }

    /// Where the pixels of a smooth patch appear, by powers of y.
    pub fn lines(&self, patch: usize) -> Option<&[Lanes; 4]> {
        match &self.patches[patch] {
            Patch::Smooth(c) => Some(c),
            _ => None,
        }
    }

    /// Where a point of a smooth patch appears.
    #[inline]
    pub fn pixel(lines: &[Lanes; 4], x: f32, y: f32) -> [f32; 2] {
        let c = Self::at(lines, y);
        [
            ((c[3] * x + c[2]) * x + c[1]) * x + c[0],
            ((c[7] * x + c[6]) * x + c[5]) * x + c[4],
        ]
    }

    /// Where the pixels of a row of a smooth patch appear, by powers of x; `row`: of the tile.
    #[inline(always)]
    fn line(&self, row: usize, patch: usize) -> Option<Lanes> {
        let Patch::Smooth(c) = &self.patches[patch] else {
            return None;
        };
        Some(Self::at(c, (row % PATCH) as f32 * SCALE - 1.0))
    }

    #[inline(always)]
    fn at(c: &[Lanes; 4], y: f32) -> Lanes {
        let mut at = c[3];
        for c in [&c[2], &c[1], &c[0]] {
            for k in 0..at.len() {
                at[k] = at[k] * y + c[k];
            }
        }
        at
    }

    /// Finds where the pixels of the tile's `row` appear, eight of them (of u and v) from column 8
    /// times `eight` on. False if they are to be projected one by one.
    #[inline(always)]
    pub fn eight(
        &self,
        row: usize,
        eight: usize,
        u: &mut [f32; EIGHT],
        v: &mut [f32; EIGHT],
    ) -> bool {
        let patch = self.patch(row, eight * EIGHT);
        if let Some(at) = self.line(row, patch) {
            let first = eight * EIGHT % PATCH;
            for k in 0..EIGHT {
                let x = (first + k) as f32 * SCALE - 1.0;
                u[k] = ((at[3] * x + at[2]) * x + at[1]) * x + at[0];
                v[k] = ((at[7] * x + at[6]) * x + at[5]) * x + at[4];
            }
            return true;
        }
        u.fill(-OUTSIDE_PX);
        v.fill(-OUTSIDE_PX);
        matches!(self.patches[patch], Patch::Outside)
    }
}

/// True if all lie on the same side outside `0 … limit`.
fn outside(at: &[[f32; 5]; 5], limit: f32) -> bool {
    let all = || at.as_flattened().iter();
    all().all(|at| *at < -OUTSIDE_PX) || all().all(|at| *at > limit + OUTSIDE_PX)
}

/// From values at ±1 and ±(√2 − 1) to the coefficients of the cubic, the lowest first.
///
/// With `a = √2 − 1`, the even part of the values `e_1 = (p(1) + p(−1))/2`, `e_a` likewise:
/// `c_2 = (e_1 − e_a)/(1 − a²)`, `c_0 = e_1 − c_2`; odd parts over their place:
/// `o_1 = (p(1) − p(−1))/2`, `o_a = (p(a) − p(−a))/2a`, `c_3 = (o_1 − o_a)/(1 − a²)`,
/// `c_1 = o_1 − c_3`.
fn cubic([p, q, r, s]: [f32; 4]) -> [f32; 4] {
    const A: f32 = SQRT_2 as f32 - 1.0;
    const INVERSE: f32 = 1.0 / (1.0 - A * A);
    let (even_1, even_a) = (0.5 * (s + p), 0.5 * (r + q));
    let (odd_1, odd_a) = (0.5 * (s - p), (0.5 / A) * (r - q));
    let c_2 = (even_1 - even_a) * INVERSE;
    let c_3 = (odd_1 - odd_a) * INVERSE;
    [even_1 - c_2, odd_1 - c_3, c_2, c_3]
}

/// The coefficients of a patch, `[l][k]` that of `x^k y^l`; None if they do not fit in between.
fn coefficients(at: &[[f32; 5]; 5]) -> Option<[[f32; 4]; 4]> {
    // Small numbers round less.
    let middle = at[2][2];
    let mut along_x = [[0.0; 4]; 4];
    for (along_x, row) in along_x.iter_mut().zip([0, 1, 3, 4]) {
        let [p, q, _, r, s] = at[row];
        *along_x = cubic([p - middle, q - middle, r - middle, s - middle]);
    }
    let mut c = [[0.0; 4]; 4];
    for k in 0..4 {
        let [p, q, r, s] = along_x;
        let along_y = cubic([p[k], q[k], r[k], s[k]]);
        for l in 0..4 {
            c[l][k] = along_y[l];
        }
    }
    let value = |x: f32, y: f32| {
        let at = |k: usize| ((c[3][k] * y + c[2][k]) * y + c[1][k]) * y + c[0][k];
        ((at(3) * x + at(2)) * x + at(1)) * x + at(0)
    };
    for (row, y) in POINTS.iter().enumerate() {
        for (column, x) in POINTS.iter().enumerate() {
            if row != 2 && column != 2 {
                continue;
            }
            let off = value(*x as f32, *y as f32) - (at[row][column] - middle);
            // NaN does not fit, either.
            if off.is_nan() || off.abs() > MOST_OFF_PX {
                return None;
            }
        }
    }
    c[0][0] += middle;
    Some(c)
}
