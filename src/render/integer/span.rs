//! A row of a patch of the chart, from where it appears in a frame to the bytes of the panorama, without a stop between.
//!
//! The numbers are those of [`super::super::run::Run::copy`], to the bit.

use super::super::chart::{PATCH, SCALE};
use super::avx2;
use super::avx2::Eight;
use super::{Kernel, Span, bits, missing, rounding, scale};
use crate::vectors;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256, __m256i};
use std::ops::Range;

/// Pixels at a time.
const EIGHT: usize = 8;

/// See [`super::span_bytes`].
#[inline(always)]
pub fn copy<const C: usize>(simd: V3, span: &Span, columns: Range<usize>, pixels: &mut [u8]) {
    let mut from = columns.start;
    let pixel = C + 1;
    while from < columns.end {
        // Where eight do not fit any more, some are done again.
        let first = from.min(PATCH - EIGHT);
        let places = places::<C>(simd, span, first);
        let eight = match C {
            3 => colour_bytes(simd, span.kernel, colours(simd, span, &places)),
            _ => grey_bytes(simd, span.kernel, greys(simd, span, &places)),
        };
        let to = (first + EIGHT).min(columns.end);
        let own = &mut pixels[(from - columns.start) * pixel..(to - columns.start) * pixel];
        match own.len() == EIGHT * pixel {
            true => own.copy_from_slice(&eight[..EIGHT * pixel]),
            false => own.copy_from_slice(&eight[(from - first) * pixel..(to - first) * pixel]),
        }
        from = to;
    }
}

/// See [`super::span_values`].
#[inline(always)]
pub fn values<const C: usize>(
    simd: V3,
    span: &Span,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(span.kernel));
    let scale = avx._mm256_set1_ps(scale(span.kernel));
    for first in (columns.start / EIGHT * EIGHT..columns.end).step_by(EIGHT) {
        let places = places::<C>(simd, span, first);
        let own = &mut values[first..first + EIGHT];
        if C == 3 {
            let [a, b, c, d] = colours(simd, span, &places);
            [own[0], own[4]] = cast(numbers(simd, a, missing, scale));
            [own[1], own[5]] = cast(numbers(simd, b, missing, scale));
            [own[2], own[6]] = cast(numbers(simd, c, missing, scale));
            [own[3], own[7]] = cast(numbers(simd, d, missing, scale));
        } else {
            let sums = greys(simd, span, &places);
            let all: [f32; EIGHT] = cast(numbers(simd, sums, missing, scale));
            for (own, value) in own.iter_mut().zip(all) {
                *own = [value, 0.0, 0.0, 0.0];
            }
        }
    }
}

/// What sums are as numbers.
#[inline(always)]
fn numbers(simd: V3, sums: __m256i, missing: __m256i, scale: __m256) -> __m256 {
    let whole = simd.avx2._mm256_add_epi32(sums, missing);
    simd.avx
        ._mm256_mul_ps(simd.avx._mm256_cvtepi32_ps(whole), scale)
}

#[inline(always)]
fn colours(simd: V3, span: &Span, (first, phases): &Eights) -> [__m256i; 4] {
    avx2::colours(simd, span.source, span.kernel, first, *phases)
}

#[inline(always)]
fn greys(simd: V3, span: &Span, (first, phases): &Eights) -> __m256i {
    avx2::greys(simd, span.source, span.kernel, first, *phases)
}

/// Where eight kernels begin, and their phases along u and v.
type Eights = (Eight<u32>, [Eight<i32>; 2]);

/// Of the pixels from column `first` of the patch on.
#[inline(always)]
fn places<const C: usize>(simd: V3, span: &Span, first: usize) -> Eights {
    let Span {
        source,
        kernel,
        line,
    } = span;
    let (avx, avx2) = (simd.avx, simd.avx2);
    let steps: __m256 = cast([0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let column = avx._mm256_add_ps(steps, avx._mm256_set1_ps(first as f32));
    let x = avx._mm256_sub_ps(
        avx._mm256_mul_ps(column, avx._mm256_set1_ps(SCALE)),
        avx._mm256_set1_ps(1.0),
    );
    let phases = kernel.integer_phases();
    let (left, s) = whole(simd, cubic(simd, x, &line[..4]), phases);
    let (top, t) = whole(simd, cubic(simd, x, &line[4..]), phases);
    let before = avx._mm256_set1_epi32(kernel.before() as i32);
    let left = avx2._mm256_sub_epi32(left, before);
    let top = avx2._mm256_sub_epi32(top, before);
    let row = avx2._mm256_mullo_epi32(top, avx._mm256_set1_epi32(source.stride as i32));
    let at = match C {
        1 => left,
        _ => avx2._mm256_add_epi32(left, avx2._mm256_add_epi32(left, left)),
    };
    let at: Eight<u32> = cast(avx2._mm256_add_epi32(row, at));
    // What the next rows need.
    let below = at[0] as usize + (kernel.taps() + 1) * source.stride;
    vectors::prefetch(simd, source.samples, below);
    (at, [cast(s), cast(t)])
}

#[inline(always)]
fn cubic(simd: V3, x: __m256, c: &[f32]) -> __m256 {
    let avx = simd.avx;
    let mut value = avx._mm256_set1_ps(c[3]);
    for c in [c[2], c[1], c[0]] {
        value = avx._mm256_add_ps(avx._mm256_mul_ps(value, x), avx._mm256_set1_ps(c));
    }
    value
}

/// Numbers from 0 on cut to the whole numbers below them, and the phases of what was cut off.
#[inline(always)]
fn whole(simd: V3, value: __m256, phases: f32) -> (__m256i, __m256i) {
    let avx = simd.avx;
    let below = avx._mm256_cvttps_epi32(value);
    let rest = avx._mm256_sub_ps(value, avx._mm256_cvtepi32_ps(below));
    let phase = avx._mm256_mul_ps(rest, avx._mm256_set1_ps(phases));
    (below, avx._mm256_cvtps_epi32(phase))
}

/// The pixels whose sums are those of k and k + 4 in the halves of the k-th vector, alpha last and full.
#[inline(always)]
fn colour_bytes(simd: V3, kernel: &Kernel, sums: [__m256i; 4]) -> [u8; 32] {
    let (bits, half) = (bits(kernel), rounding(kernel));
    let more = cast([[half, half, half, 255 << bits]; 2]);
    cast(avx2::packed(simd, sums, more, bits))
}

/// The same of grey pixels.
#[inline(always)]
fn grey_bytes(simd: V3, kernel: &Kernel, sums: __m256i) -> [u8; 32] {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let count: __m128i = cast([bits(kernel), 0, 0, 0]);
    let value = avx2._mm256_add_epi32(sums, avx._mm256_set1_epi32(rounding(kernel)));
    let value = avx2._mm256_sra_epi32(value, count);
    let value = avx2._mm256_max_epi32(value, avx._mm256_setzero_si256());
    let value = avx2._mm256_min_epi32(value, avx._mm256_set1_epi32(255));
    let pixel = avx2._mm256_or_si256(value, avx._mm256_set1_epi32(255 << 8));
    // The lower 16 bits of each number.
    let lower = avx._mm256_castsi256_si128(pixel);
    let upper = avx2._mm256_extracti128_si256::<1>(pixel);
    let packed = simd.sse4_1._mm_packus_epi32(lower, upper);
    let bytes: [u8; 16] = cast(packed);
    let mut all = [0; 32];
    all[..16].copy_from_slice(&bytes);
    all
}
