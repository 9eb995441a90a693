//! A tile cut into patches.

use std::ops::Range;

/// Pixels of the canvas along each side of a patch.
pub const PATCH: usize = 32;
/// Pixels of a row that are looked at together.
pub const EIGHT: usize = 8;
/// From pixels to the patch's coordinates.
pub const SCALE: f32 = 2.0 / PATCH as f32;

/// Where the patch of some rows or columns of a tile, all in one patch, begins, and which of its
/// own they are.
pub fn of_patch(all: &Range<usize>) -> (usize, Range<usize>) {
    let first = all.start - all.start % PATCH;
    (first, all.start - first..all.end - first)
}

/// Columns of a row, patch by patch.
pub fn pieces(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    cut::<PATCH>(columns)
}

/// Columns of a row, cut at multiples of `N`.
pub fn cut<const N: usize>(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let mut from = columns.start;
    std::iter::from_fn(move || {
        let to = columns.end.min((from / N + 1) * N);
        let piece = from..to;
        from = to;
        (!piece.is_empty()).then_some(piece)
    })
}
