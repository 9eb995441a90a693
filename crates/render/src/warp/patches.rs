//! A tile cut into patches.

use std::ops::Range;

/// Edge of a patch, canvas pixels. Larger patches are faster where the polynomial still fits, and
/// fit in fewer places.
pub const PATCH_EDGE: usize = 32;
/// Pixels of a row that are processed together: the lanes of a vector.
pub const LANES: usize = 8;
/// Step of a patch's coordinate from one pixel to the next.
pub const PATCH_SCALE: f32 = 2.0 / PATCH_EDGE as f32;

/// First row or column of the patch that a range of rows or columns of a tile lies in (all in one
/// patch), and the range within that patch.
pub fn within_patch(all: &Range<usize>) -> (usize, Range<usize>) {
    let first = all.start - all.start % PATCH_EDGE;
    (first, all.start - first..all.end - first)
}

/// Cuts columns of a row at the patches' borders.
pub fn split_at_patches(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    split_at_multiples::<PATCH_EDGE>(columns)
}

/// Cuts columns of a row at multiples of `N`.
pub fn split_at_multiples<const N: usize>(
    columns: Range<usize>,
) -> impl Iterator<Item = Range<usize>> {
    let mut from = columns.start;
    std::iter::from_fn(move || {
        let to = columns.end.min((from / N + 1) * N);
        let piece = from..to;
        from = to;
        (!piece.is_empty()).then_some(piece)
    })
}
