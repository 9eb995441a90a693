//! Blocks of one frame: from the polynomials of a patch to the bytes of the panorama in one pass.
//!
//! The numbers are identical to those of [`crate::sampling::point_batch::PointBatch`].

use super::super::format::{missing, scale};
use super::super::inputs::{PatchBlock, SampledPatch};
use super::patch_sums::{colour_sums, grey_sums, to_floats};
use super::pixels::{colour_bytes, grey_bytes, store_pixels};
use super::positions::{EMPTY_GROUP, PATCH_GROUPS, column_groups, find_positions};
use crate::warp::patches::LANES;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::ops::Range;

/// Draws a block of one frame into rows of a tile; see [`super::super::draw_block`].
#[inline(always)]
pub fn draw<const C: usize, const TAPS: usize>(
    simd: V3,
    block: &PatchBlock,
    pixels: &mut [&mut [u8]],
) {
    let patch = &block.patch;
    let columns = column_groups(simd, &block.columns);
    let mut places = [EMPTY_GROUP; PATCH_GROUPS];
    for (n, pixels) in pixels.iter_mut().enumerate() {
        find_positions::<C, TAPS>(simd, patch, block.row + n, &columns, &mut places);
        for (columns, places) in columns.iter().zip(&places) {
            let eight = match C {
                3 => colour_bytes::<TAPS>(simd, colour_sums::<TAPS>(simd, patch, places)),
                _ => grey_bytes::<TAPS>(simd, grey_sums::<TAPS>(simd, patch, places)),
            };
            store_pixels::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// Samples some columns of a row of a patch; see [`super::super::sample_values`].
#[inline(always)]
pub fn sample_values<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &SampledPatch,
    row: usize,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let scale = avx._mm256_set1_ps(scale(TAPS));
    let columns = column_groups(simd, &columns);
    let mut places = [EMPTY_GROUP; PATCH_GROUPS];
    find_positions::<C, TAPS>(simd, patch, row, &columns, &mut places);
    for (columns, places) in columns.iter().zip(&places) {
        let own = &mut values[columns.first..columns.first + LANES];
        if C == 3 {
            let [a, b, c, d] = colour_sums::<TAPS>(simd, patch, places);
            [own[0], own[4]] = cast(to_floats(simd, a, missing, scale));
            [own[1], own[5]] = cast(to_floats(simd, b, missing, scale));
            [own[2], own[6]] = cast(to_floats(simd, c, missing, scale));
            [own[3], own[7]] = cast(to_floats(simd, d, missing, scale));
        } else {
            let sums = grey_sums::<TAPS>(simd, patch, places);
            let all: [f32; LANES] = cast(to_floats(simd, sums, missing, scale));
            for (own, value) in own.iter_mut().zip(all) {
                *own = [value, 0.0, 0.0, 0.0];
            }
        }
    }
}
