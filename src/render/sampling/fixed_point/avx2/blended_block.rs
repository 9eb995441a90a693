//! Blocks of one frame or several, light undone and corrections added.

use super::super::format::{missing, scale};
use super::super::inputs::{LitBlock, PARTS, Part};
use super::patch_sums::{colours, greys, numbers};
use super::pixels::{bytes, grey_pixels, put};
use super::positions::{Columns, EIGHTS, Eights, NOWHERE, eights, place, polynomial};
use crate::render::layout::tiles::TILE_COLUMNS;
use crate::render::sampling::patch_light::Light;
use crate::render::warp::patches::EIGHT;
use arrayvec::ArrayVec;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};

/// See [`crate::render::sampling::fixed_point::lit_block`].
#[inline(always)]
pub fn draw<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &LitBlock<L>,
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
    block: &LitBlock<L>,
    part: &Part,
    pixels: &mut [&mut [u8]],
) {
    let columns = eights(simd, &block.columns);
    let rows = pixels
        .iter_mut()
        .zip(block.corrections.chunks_exact(TILE_COLUMNS));
    for (n, (pixels, corrections)) in rows.enumerate() {
        let row = Row::of::<C, TAPS>(simd, part, block.row + n, &columns);
        for (k, columns) in columns.iter().enumerate() {
            let corrections = &corrections[block.first + columns.first..][..EIGHT];
            let values = row.values::<C, TAPS>(simd, k, cast(columns.x));
            let eight = corrected::<C, L>(simd, values, corrections);
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// A block with several parts.
#[inline(always)]
fn mixed<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &LitBlock<L>,
    pixels: &mut [&mut [u8]],
) {
    let avx = simd.avx;
    let columns = eights(simd, &block.columns);
    let rows = pixels
        .iter_mut()
        .zip(block.corrections.chunks_exact(TILE_COLUMNS));
    let mut parts: ArrayVec<Row, PARTS> = ArrayVec::new();
    for (n, ((pixels, corrections), t)) in rows.zip(block.down).enumerate() {
        parts.clear();
        for part in block.parts {
            parts.push(Row::of::<C, TAPS>(simd, part, block.row + n, &columns));
        }
        for (k, columns) in columns.iter().enumerate() {
            let at = block.first + columns.first;
            let corrections = &corrections[at..][..EIGHT];
            let mut s = [0.0; EIGHT];
            s.copy_from_slice(&block.across[at..][..EIGHT]);
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
            let eight = corrected::<C, L>(simd, means, corrections);
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// Between corners before and after along `s`, the upper two and then the lower two along `t`: what
/// is given at them, bilinear.
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
struct Row<'a> {
    part: &'a Part<'a>,
    places: [Eights; EIGHTS],
    light: [f32; 3],
}

impl<'a> Row<'a> {
    #[inline(always)]
    fn of<const C: usize, const TAPS: usize>(
        simd: V3,
        part: &'a Part<'a>,
        row: usize,
        columns: &[Columns],
    ) -> Self {
        let mut places = [NOWHERE; EIGHTS];
        place::<C, TAPS>(simd, &part.patch, row, columns, &mut places);
        Self {
            part,
            places,
            light: part.light.unwrap_or(Light::even(1.0)).row(row),
        }
    }

    /// What the frame shows in the k-th eight columns, at `x`, light undone:
    /// `((sum + missing) scale − bias) light`. Of the pixels k and k + 4 in the halves of the k-th
    /// vector in colour, of all in the first one if they are grey.
    #[inline(always)]
    fn values<const C: usize, const TAPS: usize>(
        &self,
        simd: V3,
        k: usize,
        x: __m256,
    ) -> [__m256; 4] {
        let (patch, places) = (&self.part.patch, &self.places[k]);
        let light = polynomial(simd, x, &self.light);
        let bias = simd.avx._mm256_set1_ps(self.part.bias);
        if C == 3 {
            let [a, b, c, d] = colours::<TAPS>(simd, patch, places);
            [
                undone::<TAPS>(simd, a, bias, four_times(simd, light, 0)),
                undone::<TAPS>(simd, b, bias, four_times(simd, light, 1)),
                undone::<TAPS>(simd, c, bias, four_times(simd, light, 2)),
                undone::<TAPS>(simd, d, bias, four_times(simd, light, 3)),
            ]
        } else {
            let sums = greys::<TAPS>(simd, patch, places);
            let nothing = simd.avx._mm256_setzero_ps();
            let values = undone::<TAPS>(simd, sums, bias, light);
            [values, nothing, nothing, nothing]
        }
    }
}

/// Adds values times what is one number for each of eight pixels to sums of them.
#[inline(always)]
fn add<const C: usize>(simd: V3, sums: &mut [__m256; 4], values: [__m256; 4], factors: __m256) {
    let avx = simd.avx;
    if C == 3 {
        for k in 0..4 {
            let own = avx._mm256_mul_ps(four_times(simd, factors, k as i32), values[k]);
            sums[k] = avx._mm256_add_ps(sums[k], own);
        }
    } else {
        sums[0] = avx._mm256_add_ps(sums[0], avx._mm256_mul_ps(factors, values[0]));
    }
}

/// Values with corrections added, as pixels, alpha last and full.
#[inline(always)]
fn corrected<const C: usize, const L: usize>(
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
        let all = bytes(simd, [a, b, c, d]);
        let alpha = avx._mm256_set1_epi32(0xff00_0000_u32.cast_signed());
        return simd.avx2._mm256_or_si256(all, alpha);
    }
    let mut own = [0.0; EIGHT];
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

/// Sums as numbers, light undone.
#[inline(always)]
fn undone<const TAPS: usize>(simd: V3, sums: __m256i, bias: __m256, light: __m256) -> __m256 {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let value = numbers(simd, sums, missing, avx._mm256_set1_ps(scale(TAPS)));
    avx._mm256_mul_ps(avx._mm256_sub_ps(value, bias), light)
}

/// What is one number for each of eight pixels, four times for the pixels k and k + 4.
#[inline(always)]
fn four_times(simd: V3, eight: __m256, k: i32) -> __m256 {
    let lanes: __m256i = cast([[k; 4], [k + 4; 4]]);
    simd.avx2._mm256_permutevar8x32_ps(eight, lanes)
}
