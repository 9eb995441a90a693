//! Rows of a patch of the chart, from where they appear in a frame to the bytes of the panorama,
//! without a stop between.
//!
//! The numbers are those of [`crate::render::sampling::point_batch::Run`], to the bit.

use super::super::format::{missing, scale};
use super::super::inputs::{Block, Patch};
use super::patch_sums::{colours, greys, numbers};
use super::pixels::{colour_bytes, grey_bytes, put};
use super::positions::{EIGHTS, NOWHERE, eights, place};
use crate::render::warp::patches::EIGHT;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::ops::Range;

/// See [`fn@crate::render::sampling::fixed_point::block`].
#[inline(always)]
pub fn draw<const C: usize, const TAPS: usize>(simd: V3, block: &Block, pixels: &mut [&mut [u8]]) {
    let patch = &block.patch;
    let columns = eights(simd, &block.columns);
    let mut places = [NOWHERE; EIGHTS];
    for (n, pixels) in pixels.iter_mut().enumerate() {
        place::<C, TAPS>(simd, patch, block.row + n, &columns, &mut places);
        for (columns, places) in columns.iter().zip(&places) {
            let eight = match C {
                3 => colour_bytes::<TAPS>(simd, colours::<TAPS>(simd, patch, places)),
                _ => grey_bytes::<TAPS>(simd, greys::<TAPS>(simd, patch, places)),
            };
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// See [`crate::render::sampling::fixed_point::values`].
#[inline(always)]
pub fn values<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &Patch,
    row: usize,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let scale = avx._mm256_set1_ps(scale(TAPS));
    let columns = eights(simd, &columns);
    let mut places = [NOWHERE; EIGHTS];
    place::<C, TAPS>(simd, patch, row, &columns, &mut places);
    for (columns, places) in columns.iter().zip(&places) {
        let own = &mut values[columns.first..columns.first + EIGHT];
        if C == 3 {
            let [a, b, c, d] = colours::<TAPS>(simd, patch, places);
            [own[0], own[4]] = cast(numbers(simd, a, missing, scale));
            [own[1], own[5]] = cast(numbers(simd, b, missing, scale));
            [own[2], own[6]] = cast(numbers(simd, c, missing, scale));
            [own[3], own[7]] = cast(numbers(simd, d, missing, scale));
        } else {
            let sums = greys::<TAPS>(simd, patch, places);
            let all: [f32; EIGHT] = cast(numbers(simd, sums, missing, scale));
            for (own, value) in own.iter_mut().zip(all) {
                *own = [value, 0.0, 0.0, 0.0];
            }
        }
    }
}
