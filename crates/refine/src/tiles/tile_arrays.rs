//! Arrays over the samples of a tile, and sums over them.
//!
//! Sums run in [`LANES`] lanes in a fixed order, so that they vectorise and are the same on every
//! processor.

use crate::tiles::grid::{LANES, Plane, SIDE, TILE, ZERO};
use crate::tiles::lanes::{Lanes, lanewise, load, store};

/// Samples of a tile without its ring.
pub const SAMPLES: usize = TILE * TILE;

/// A value at every sample of a tile's interior rows, the ring's columns included: index k belongs
/// to index `k + SIDE` of a [`Plane`].
pub type Rows = [f32; TILE * SIDE];
/// Zero everywhere.
pub const ZERO_ROWS: Rows = [0.0; TILE * SIDE];

/// 1 at the tile's interior samples, 0 at the ring's.
pub const INTERIOR: Rows = {
    let mut interior = ZERO_ROWS;
    let mut k = 0;
    while k < interior.len() {
        let column = k % SIDE;
        interior[k] = if column > 0 && column <= TILE {
            1.0
        } else {
            0.0
        };
        k += 1;
    }
    interior
};

/// Squared gradient of a texture, (grey levels per sample)², from one-sided differences.
#[inline(always)]
pub fn squared_gradients(texture: &Plane) -> Rows {
    let mut squares = ZERO_ROWS;
    for k in (0..ZERO_ROWS.len()).step_by(LANES) {
        store(&mut squares, k, squared_gradients_at(texture, k));
    }
    squares
}

/// [`squared_gradients`] at the samples from `k` of [`Rows`] on.
#[inline(always)]
pub fn squared_gradients_at(texture: &Plane, k: usize) -> Lanes {
    let c = k + SIDE;
    let (own, left, right) = (load(texture, c), load(texture, c - 1), load(texture, c + 1));
    let (above, below) = (load(texture, c - SIDE), load(texture, c + SIDE));
    lanewise(
        #[inline(always)]
        |l| {
            let (left, right) = (left[l] - own[l], right[l] - own[l]);
            let (above, below) = (above[l] - own[l], below[l] - own[l]);
            0.5 * (left * left + right * right + above * above + below * below)
        },
    )
}

/// The plane of a tile's interior samples, with a ring that repeats its neighbours.
#[inline(always)]
pub fn with_ring(rows: &Rows) -> Plane {
    let mut plane = ZERO;
    plane[SIDE..SIDE + rows.len()].copy_from_slice(rows);
    for row in plane[SIDE..SIDE + rows.len()].chunks_exact_mut(SIDE) {
        (row[0], row[TILE + 1]) = (row[1], row[TILE]);
    }
    plane.copy_within(SIDE..2 * SIDE, 0);
    plane.copy_within(TILE * SIDE..(TILE + 1) * SIDE, (TILE + 1) * SIDE);
    plane
}

/// Sum of products.
#[inline(always)]
pub fn dot<const N: usize>(a: &[f32; N], b: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for k in (0..N).step_by(LANES) {
        for lane in 0..LANES {
            sums[lane] += a[k + lane] * b[k + lane];
        }
    }
    add_lanes(sums)
}

/// Sum of all values.
#[inline(always)]
pub fn sum<const N: usize>(a: &[f32; N]) -> f32 {
    let mut sums = [0.0f32; LANES];
    for k in (0..N).step_by(LANES) {
        for lane in 0..LANES {
            sums[lane] += a[k + lane];
        }
    }
    add_lanes(sums)
}

/// Adds the lanes.
#[inline(always)]
pub fn add_lanes(s: [f32; LANES]) -> f32 {
    ((s[0] + s[4]) + (s[2] + s[6])) + ((s[1] + s[5]) + (s[3] + s[7]))
}
