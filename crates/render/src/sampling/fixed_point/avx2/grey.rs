//! Sums of grey pixels.

use super::super::inputs::PictureSamples;
use super::lanes::{
    Eight, ZERO_BYTE, complement, read, sum_of_halves, truncated_pair, two_rows, weight_pairs,
};
use super::weights::{four_of, taps, weights};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Sums of eight grey pixels.
#[inline(always)]
pub fn grey_sums<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
) -> __m256i {
    if TAPS == 2 {
        let [s, t] = phases;
        return bilinear_grey(simd, source, first, cast(s), cast(t));
    }
    if TAPS == 4 {
        return bicubic_grey(simd, source, kernel, first, phases);
    }
    let lower = four_greys::<TAPS>(simd, source, kernel, first, phases, 0);
    let upper = four_greys::<TAPS>(simd, source, kernel, first, phases, 4);
    simd.avx._mm256_set_m128i(upper, lower)
}

/// Sums of grey pixels `k` to `k + 3`.
#[inline(always)]
fn four_greys<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let a = one_grey::<TAPS>(simd, source, kernel, first, phases, k);
    let b = one_grey::<TAPS>(simd, source, kernel, first, phases, k + 1);
    let c = one_grey::<TAPS>(simd, source, kernel, first, phases, k + 2);
    let d = one_grey::<TAPS>(simd, source, kernel, first, phases, k + 3);
    let ssse3 = simd.ssse3;
    ssse3._mm_hadd_epi32(ssse3._mm_hadd_epi32(a, b), ssse3._mm_hadd_epi32(c, d))
}

/// Four numbers whose sum is that of grey pixel `k`.
#[inline(always)]
fn one_grey<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights::<TAPS>(kernel, phases, k);
    let at = first[k] as usize;
    wide_grey(simd, source, weights, at, taps::<TAPS>(kernel).div_ceil(8))
}

/// Four times two bytes of a row, and two of the next.
#[inline(always)]
fn four_of_both(simd: V3, rows: [&[u8]; 2], [a, b, c, d]: [u32; 4]) -> __m128i {
    simd.sse2._mm_set_epi32(
        two_of_both(rows, d),
        two_of_both(rows, c),
        two_of_both(rows, b),
        two_of_both(rows, a),
    )
}

/// Two bytes of a row in the lower half, two of the next in the upper one.
#[inline(always)]
fn two_of_both([upper, lower]: [&[u8]; 2], at: u32) -> i32 {
    let upper = u16::from_le_bytes(read(upper, at as usize));
    let lower = u16::from_le_bytes(read(lower, at as usize));
    (u32::from(upper) | u32::from(lower) << 16).cast_signed()
}

#[inline(always)]
fn bilinear_grey(
    simd: V3,
    source: PictureSamples,
    first: &Eight<u32>,
    s: __m256i,
    t: __m256i,
) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let down = weight_pairs(simd, t);
    let left = avx2._mm256_mullo_epi32(down, complement(simd, s));
    let right = avx2._mm256_mullo_epi32(down, s);
    let rows = two_rows(source);
    let four = avx._mm256_set_m128i(
        four_of_both(simd, rows, [first[4], first[5], first[6], first[7]]),
        four_of_both(simd, rows, [first[0], first[1], first[2], first[3]]),
    );
    // Upper and lower pixel in the halves of each number.
    let bytes = avx._mm256_set1_epi32(0x00ff_00ff);
    let own = avx2._mm256_and_si256(four, bytes);
    let next = avx2._mm256_and_si256(avx2._mm256_srli_epi32::<8>(four), bytes);
    avx2._mm256_add_epi32(
        avx2._mm256_madd_epi16(own, left),
        avx2._mm256_madd_epi16(next, right),
    )
}

/// Four rows of samples, as many of each.
#[inline(always)]
fn four_rows(source: PictureSamples<'_>) -> [&[u8]; 4] {
    let PictureSamples { samples, stride } = source;
    let count = samples.len().saturating_sub(3 * stride);
    [
        &samples[..count],
        &samples[stride..][..count],
        &samples[2 * stride..][..count],
        &samples[3 * stride..][..count],
    ]
}

/// Samples under four taps of a row for pixels `k` to `k + 3`, times their weights: a and b of
/// each.
#[inline(always)]
fn four_across(simd: V3, row: &[u8], first: &Eight<u32>, k: usize, w_x: __m256i) -> __m256i {
    let pixels = simd.sse2._mm_set_epi32(
        i32::from_le_bytes(read(row, first[k + 3] as usize)),
        i32::from_le_bytes(read(row, first[k + 2] as usize)),
        i32::from_le_bytes(read(row, first[k + 1] as usize)),
        i32::from_le_bytes(read(row, first[k] as usize)),
    );
    let avx2 = simd.avx2;
    avx2._mm256_madd_epi16(avx2._mm256_cvtepu8_epi16(pixels), w_x)
}

/// Twice four numbers, two of which add up to the sum of each of pixels `k` to `k + 3` under four
/// taps.
#[inline(always)]
fn four_by_four(
    simd: V3,
    rows: [&[u8]; 4],
    kernel: &Kernel,
    first: &Eight<u32>,
    [s, t]: [Eight<i32>; 2],
    k: usize,
) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let w = kernel.all_integer_weights().as_chunks::<4>().0;
    let of = |phase: i32| -> i64 { cast(w[phase as usize]) };
    let w_x = avx._mm256_set_epi64x(of(s[k + 3]), of(s[k + 2]), of(s[k + 1]), of(s[k]));
    let w_y = avx._mm256_set_epi64x(of(t[k + 3]), of(t[k + 2]), of(t[k + 1]), of(t[k]));
    let a = four_across(simd, rows[0], first, k, w_x);
    let b = four_across(simd, rows[1], first, k, w_x);
    let c = four_across(simd, rows[2], first, k, w_x);
    let d = four_across(simd, rows[3], first, k, w_x);
    avx2._mm256_add_epi32(
        avx2._mm256_madd_epi16(
            truncated_pair(simd, a, b),
            avx2._mm256_shuffle_epi32::<0xa0>(w_y),
        ),
        avx2._mm256_madd_epi16(
            truncated_pair(simd, c, d),
            avx2._mm256_shuffle_epi32::<0xf5>(w_y),
        ),
    )
}

/// Sums of eight grey pixels under four taps.
#[inline(always)]
fn bicubic_grey(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
) -> __m256i {
    let rows = four_rows(source);
    let lower = four_by_four(simd, rows, kernel, first, phases, 0);
    let upper = four_by_four(simd, rows, kernel, first, phases, 4);
    // Pixels 0, 1, 4, 5 and 2, 3, 6, 7.
    let both = simd.avx2._mm256_hadd_epi32(lower, upper);
    simd.avx2._mm256_permute4x64_epi64::<0b11_01_10_00>(both)
}

/// Two weights: the first twice in the lower half, the second in the upper one.
const ROW_BY_ROW: [[i8; 16]; 2] = [
    [
        0, 1, ZERO_BYTE, ZERO_BYTE, 0, 1, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
        ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
    ],
    [
        2, 3, ZERO_BYTE, ZERO_BYTE, 2, 3, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
        ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
    ],
];

/// Numbers whose sum is that of a pixel under eight taps and more, `blocks` times eight at the
/// most: a row in each half of a vector.
#[inline(always)]
fn wide_grey(
    simd: V3,
    source: PictureSamples,
    (w_x, w_y): (&[i16], &[i16]),
    mut at: usize,
    blocks: usize,
) -> __m128i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let mut total = avx._mm256_setzero_si256();
    for w_y in w_y.as_chunks::<2>().0 {
        let mut rows = avx._mm256_setzero_si256();
        for block in 0..blocks {
            let (own, next) = (at + 8 * block, at + source.stride + 8 * block);
            let pixels = simd.sse2._mm_set_epi64x(
                i64::from_le_bytes(read(source.samples, next)),
                i64::from_le_bytes(read(source.samples, own)),
            );
            let pixels = avx2._mm256_cvtepu8_epi16(pixels);
            let w = simd
                .sse2
                ._mm_set_epi64x(four_of(w_x, 8 * block + 4), four_of(w_x, 8 * block));
            let w = avx2._mm256_broadcastsi128_si256(w);
            rows = avx2._mm256_add_epi32(rows, avx2._mm256_madd_epi16(pixels, w));
        }
        at += 2 * source.stride;
        // a and b of a row: the first and the third number, the second and the fourth.
        let rows = avx2._mm256_add_epi32(rows, avx2._mm256_shuffle_epi32::<0xee>(rows));
        let cut = avx2._mm256_srai_epi32::<8>(rows);
        let w = avx._mm256_set1_epi32(cast(*w_y));
        let w = avx2._mm256_shuffle_epi8(w, cast(ROW_BY_ROW));
        total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(cut, w));
    }
    sum_of_halves(simd, total)
}
