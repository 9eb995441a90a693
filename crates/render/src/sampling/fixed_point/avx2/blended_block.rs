//! Blocks of one frame or several, exposure undone and corrections added.

use super::super::format::{missing, scale};
use super::super::inputs::{BlendPart, BlendedBlock, MAX_BLEND_PARTS};
use super::patch_sums::{colour_sums, grey_sums, to_floats};
use super::pixels::{grey_pixels, pack_bytes, store_pixels};
use super::positions::{
    ColumnGroup, EMPTY_GROUP, KernelGroup, PATCH_GROUPS, column_groups, evaluate_polynomial,
    find_positions,
};
use crate::layout::tiles::TILE_COLUMNS;
use crate::sampling::patch_light::PatchLight;
use crate::warp::patches::LANES;
use arrayvec::ArrayVec;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};

/// Draws a block of one or several frames; see [`super::super::draw_blended_block`].
#[inline(always)]
pub fn draw<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &BlendedBlock<L>,
    pixels: &mut [&mut [u8]],
) {
    match block.parts {
        [part] => alone::<C, L, TAPS>(simd, block, part, pixels),
        _ => mixed::<C, L, TAPS>(simd, block, pixels),
    }
}

/// A block with one part.
#[inline(always)]
fn alone<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &BlendedBlock<L>,
    part: &BlendPart,
    pixels: &mut [&mut [u8]],
) {
    let columns = column_groups(simd, &block.columns);
    let rows = pixels
        .iter_mut()
        .zip(block.corrections.chunks_exact(TILE_COLUMNS));
    for (n, (pixels, corrections)) in rows.enumerate() {
        let row = PartRow::of::<C, TAPS>(simd, part, block.row + n, &columns);
        for (k, columns) in columns.iter().enumerate() {
            let corrections = &corrections[block.first + columns.first..][..LANES];
            let values = row.values::<C, TAPS>(simd, k, cast(columns.x));
            let eight = corrected_pixels::<C, L>(simd, values, corrections);
            store_pixels::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// A block with several parts.
#[inline(always)]
fn mixed<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &BlendedBlock<L>,
    pixels: &mut [&mut [u8]],
) {
    let avx = simd.avx;
    let columns = column_groups(simd, &block.columns);
    let rows = pixels
        .iter_mut()
        .zip(block.corrections.chunks_exact(TILE_COLUMNS));
    let mut parts: ArrayVec<PartRow, MAX_BLEND_PARTS> = ArrayVec::new();
    for (n, ((pixels, corrections), t)) in rows.zip(block.down).enumerate() {
        parts.clear();
        for part in block.parts {
            parts.push(PartRow::of::<C, TAPS>(simd, part, block.row + n, &columns));
        }
        for (k, columns) in columns.iter().enumerate() {
            let at = block.first + columns.first;
            let corrections = &corrections[at..][..LANES];
            let mut s = [0.0; LANES];
            s.copy_from_slice(&block.across[at..][..LANES]);
            let mut sums = [avx._mm256_setzero_ps(); 4];
            let mut all = avx._mm256_setzero_ps();
            for row in &parts {
                let weights = bilinear(simd, cast(s), *t, row.part.corners);
                let values = row.values::<C, TAPS>(simd, k, cast(columns.x));
                all = avx._mm256_add_ps(all, weights);
                add::<C>(simd, &mut sums, values, weights);
            }
            let inverse = avx._mm256_div_ps(avx._mm256_set1_ps(1.0), all);
            let mut means = [avx._mm256_setzero_ps(); 4];
            add::<C>(simd, &mut means, sums, inverse);
            let eight = corrected_pixels::<C, L>(simd, means, corrections);
            store_pixels::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// Interpolates between the corners of a cell, bilinear: before and after along `s`, the upper two
/// and the lower two along `t`.
#[inline(always)]
fn bilinear(simd: V3, s: __m256, t: f32, corners: [f32; 4]) -> __m256 {
    let avx = simd.avx;
    let one = avx._mm256_set1_ps(1.0);
    let (up, down) = (avx._mm256_set1_ps(1.0 - t), avx._mm256_set1_ps(t));
    let rest = avx._mm256_sub_ps(one, s);
    let (a, b) = (avx._mm256_mul_ps(rest, up), avx._mm256_mul_ps(s, up));
    let (c, d) = (avx._mm256_mul_ps(rest, down), avx._mm256_mul_ps(s, down));
    let of = |w: __m256, corner: f32| avx._mm256_mul_ps(w, avx._mm256_set1_ps(corner));
    let sum = avx._mm256_add_ps(of(a, corners[0]), of(b, corners[1]));
    let sum = avx._mm256_add_ps(sum, of(c, corners[2]));
    avx._mm256_add_ps(sum, of(d, corners[3]))
}

/// A row of a part.
struct PartRow<'a> {
    part: &'a BlendPart<'a>,
    places: [KernelGroup; PATCH_GROUPS],
    light: [f32; 3],
}

impl<'a> PartRow<'a> {
    #[inline(always)]
    fn of<const C: usize, const TAPS: usize>(
        simd: V3,
        part: &'a BlendPart<'a>,
        row: usize,
        columns: &[ColumnGroup],
    ) -> Self {
        let mut places = [EMPTY_GROUP; PATCH_GROUPS];
        find_positions::<C, TAPS>(simd, &part.patch, row, columns, &mut places);
        Self {
            part,
            places,
            light: part.light.unwrap_or(PatchLight::even(1.0)).row(row),
        }
    }

    /// Values in the k-th eight columns, at `x`, exposure undone:
    /// `((sum + missing) scale − bias) light`. In colour the k-th vector holds the pixels k and k +
    /// 4 in its halves; in grey the first one holds all.
    #[inline(always)]
    fn values<const C: usize, const TAPS: usize>(
        &self,
        simd: V3,
        k: usize,
        x: __m256,
    ) -> [__m256; 4] {
        let (patch, places) = (&self.part.patch, &self.places[k]);
        let light = evaluate_polynomial(simd, x, &self.light);
        let bias = simd.avx._mm256_set1_ps(self.part.bias);
        if C == 3 {
            let [a, b, c, d] = colour_sums::<TAPS>(simd, patch, places);
            [
                without_exposure::<TAPS>(simd, a, bias, spread_over_channels(simd, light, 0)),
                without_exposure::<TAPS>(simd, b, bias, spread_over_channels(simd, light, 1)),
                without_exposure::<TAPS>(simd, c, bias, spread_over_channels(simd, light, 2)),
                without_exposure::<TAPS>(simd, d, bias, spread_over_channels(simd, light, 3)),
            ]
        } else {
            let sums = grey_sums::<TAPS>(simd, patch, places);
            let nothing = simd.avx._mm256_setzero_ps();
            let values = without_exposure::<TAPS>(simd, sums, bias, light);
            [values, nothing, nothing, nothing]
        }
    }
}

/// Adds values, weighted by one factor for each of eight pixels, to sums of them.
#[inline(always)]
fn add<const C: usize>(simd: V3, sums: &mut [__m256; 4], values: [__m256; 4], factors: __m256) {
    let avx = simd.avx;
    if C == 3 {
        for k in 0..4 {
            let own = avx._mm256_mul_ps(spread_over_channels(simd, factors, k as i32), values[k]);
            sums[k] = avx._mm256_add_ps(sums[k], own);
        }
    } else {
        sums[0] = avx._mm256_add_ps(sums[0], avx._mm256_mul_ps(factors, values[0]));
    }
}

/// Pixels of values with corrections added, alpha last and full.
#[inline(always)]
fn corrected_pixels<const C: usize, const L: usize>(
    simd: V3,
    values: [__m256; 4],
    corrections: &[[f32; L]],
) -> __m256i {
    let avx = simd.avx;
    if C == 3 {
        let a = corrected_colour(simd, values[0], corrections, 0);
        let b = corrected_colour(simd, values[1], corrections, 1);
        let c = corrected_colour(simd, values[2], corrections, 2);
        let d = corrected_colour(simd, values[3], corrections, 3);
        let all = pack_bytes(simd, [a, b, c, d]);
        let alpha = avx._mm256_set1_epi32(0xff00_0000_u32.cast_signed());
        return simd.avx2._mm256_or_si256(all, alpha);
    }
    let mut own = [0.0; LANES];
    for (own, correction) in own.iter_mut().zip(corrections) {
        *own = correction[0];
    }
    let value = avx._mm256_add_ps(values[0], cast(own));
    grey_pixels(simd, avx._mm256_cvtps_epi32(value))
}

/// Values of the pixels k and k + 4 in colour with corrections added, as whole numbers.
#[inline(always)]
fn corrected_colour<const L: usize>(
    simd: V3,
    values: __m256,
    corrections: &[[f32; L]],
    k: usize,
) -> __m256i {
    let avx = simd.avx;
    let mut own = [[0.0; 4]; 2];
    for (own, correction) in own.iter_mut().zip([&corrections[k], &corrections[k + 4]]) {
        for (own, correction) in own.iter_mut().zip(correction) {
            *own = *correction;
        }
    }
    avx._mm256_cvtps_epi32(avx._mm256_add_ps(values, cast(own)))
}

/// Converts sums to numbers with exposure undone.
#[inline(always)]
fn without_exposure<const TAPS: usize>(
    simd: V3,
    sums: __m256i,
    bias: __m256,
    light: __m256,
) -> __m256 {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let value = to_floats(simd, sums, missing, avx._mm256_set1_ps(scale(TAPS)));
    avx._mm256_mul_ps(avx._mm256_sub_ps(value, bias), light)
}

/// Spreads one number for each of eight pixels over the four channels of the pixels k and k + 4.
#[inline(always)]
fn spread_over_channels(simd: V3, eight: __m256, k: i32) -> __m256 {
    let lanes: __m256i = cast([[k; 4], [k + 4; 4]]);
    simd.avx2._mm256_permutevar8x32_ps(eight, lanes)
}
