//! Sums of pixels in colour.

use super::super::inputs::PictureSamples;
use super::lanes::{
    Eight, ZERO_BYTE, complement, read, sum_of_halves, truncated_pair, two_rows, weight_pairs,
};
use super::weights::{four, taps, weights};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Sums of eight pixels in colour: of the k-th and the k + 4th in the halves of the k-th vector.
#[inline(always)]
pub fn colour_sums<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
) -> [__m256i; 4] {
    if TAPS == 2 {
        let [s, t] = phases;
        return bilinear_colour(simd, source, first, cast(s), cast(t));
    }
    let a = both_colours::<TAPS>(simd, source, kernel, first, phases, 0);
    let b = both_colours::<TAPS>(simd, source, kernel, first, phases, 1);
    let c = both_colours::<TAPS>(simd, source, kernel, first, phases, 2);
    let d = both_colours::<TAPS>(simd, source, kernel, first, phases, 3);
    [a, b, c, d]
}

/// Sums of pixels `k` and `k + 4`.
#[inline(always)]
fn both_colours<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m256i {
    let lower = one_colour::<TAPS>(simd, source, kernel, first, phases, k);
    let upper = one_colour::<TAPS>(simd, source, kernel, first, phases, k + 4);
    simd.avx._mm256_set_m128i(upper, lower)
}

/// Sums of pixel `k`.
#[inline(always)]
fn one_colour<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights::<TAPS>(kernel, phases, k);
    let at = first[k] as usize;
    colour(simd, source, weights, at, taps::<TAPS>(kernel).div_ceil(4))
}

/// Sixteen bytes of a row from `a` on in the lower half, from `b` on in the upper one.
#[inline(always)]
fn two_sixteens(simd: V3, row: &[u8], a: u32, b: u32) -> __m256i {
    let (a, b): ([u8; 16], [u8; 16]) = (read(row, a as usize), read(row, b as usize));
    simd.avx._mm256_set_m128i(cast(b), cast(a))
}

/// Two pixels side by side, channel by channel: (r, r′, g, g′, b, b′).
const SIDE_BY_SIDE: [i8; 16] = [
    0, ZERO_BYTE, 3, ZERO_BYTE, 1, ZERO_BYTE, 4, ZERO_BYTE, 2, ZERO_BYTE, 5, ZERO_BYTE, ZERO_BYTE,
    ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
];

/// Sums of the two pixels at `a` and `b`, with their rows' weights.
#[inline(always)]
fn two_colours(
    simd: V3,
    [upper_row, lower_row]: [&[u8]; 2],
    a: u32,
    b: u32,
    upper: __m256i,
    lower: __m256i,
) -> __m256i {
    let avx2 = simd.avx2;
    let above = two_sixteens(simd, upper_row, a, b);
    let below = two_sixteens(simd, lower_row, a, b);
    let above = avx2._mm256_shuffle_epi8(above, cast([SIDE_BY_SIDE; 2]));
    let below = avx2._mm256_shuffle_epi8(below, cast([SIDE_BY_SIDE; 2]));
    avx2._mm256_add_epi32(
        avx2._mm256_madd_epi16(above, upper),
        avx2._mm256_madd_epi16(below, lower),
    )
}

#[inline(always)]
fn bilinear_colour(
    simd: V3,
    source: PictureSamples,
    first: &Eight<u32>,
    s: __m256i,
    t: __m256i,
) -> [__m256i; 4] {
    let avx2 = simd.avx2;
    let rows = two_rows(source);
    let across = weight_pairs(simd, s);
    let upper = avx2._mm256_mullo_epi32(across, complement(simd, t));
    let lower = avx2._mm256_mullo_epi32(across, t);
    let (w, x) = (
        avx2._mm256_shuffle_epi32::<0x00>(upper),
        avx2._mm256_shuffle_epi32::<0x00>(lower),
    );
    let a = two_colours(simd, rows, first[0], first[4], w, x);
    let (w, x) = (
        avx2._mm256_shuffle_epi32::<0x55>(upper),
        avx2._mm256_shuffle_epi32::<0x55>(lower),
    );
    let b = two_colours(simd, rows, first[1], first[5], w, x);
    let (w, x) = (
        avx2._mm256_shuffle_epi32::<0xaa>(upper),
        avx2._mm256_shuffle_epi32::<0xaa>(lower),
    );
    let c = two_colours(simd, rows, first[2], first[6], w, x);
    let (w, x) = (
        avx2._mm256_shuffle_epi32::<0xff>(upper),
        avx2._mm256_shuffle_epi32::<0xff>(lower),
    );
    let d = two_colours(simd, rows, first[3], first[7], w, x);
    [a, b, c, d]
}

/// Pixels 0 and 1 side by side in the lower half, 2 and 3 in the upper one.
const TWO_BY_TWO: [[i8; 16]; 2] = [
    SIDE_BY_SIDE,
    [
        6, ZERO_BYTE, 9, ZERO_BYTE, 7, ZERO_BYTE, 10, ZERO_BYTE, 8, ZERO_BYTE, 11, ZERO_BYTE,
        ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
    ],
];

/// The first two of four weights in the lower half, the last two in the upper one.
const HALVES: [[i8; 16]; 2] = [
    [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3],
    [4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7],
];

/// Sums of a row that begins at `at`: a in the lower half, b in the upper one.
#[inline(always)]
fn colour_row(simd: V3, samples: &[u8], at: usize, w_x: &[i16], blocks: usize) -> __m256i {
    let avx2 = simd.avx2;
    let mut sum = simd.avx._mm256_setzero_si256();
    for block in 0..blocks {
        let four_pixels: [u8; 16] = read(samples, at + 12 * block);
        let pixels = avx2._mm256_broadcastsi128_si256(cast(four_pixels));
        let pixels = avx2._mm256_shuffle_epi8(pixels, cast(TWO_BY_TWO));
        let w = avx2._mm256_shuffle_epi8(four(simd, w_x, 4 * block), cast(HALVES));
        sum = avx2._mm256_add_epi32(sum, avx2._mm256_madd_epi16(pixels, w));
    }
    sum
}

/// Sums of a pixel; `blocks`: quarters of the taps.
#[inline(always)]
fn colour(
    simd: V3,
    source: PictureSamples,
    (w_x, w_y): (&[i16], &[i16]),
    mut at: usize,
    blocks: usize,
) -> __m128i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let mut total = avx._mm256_setzero_si256();
    for w_y in w_y.as_chunks::<2>().0 {
        let upper = colour_row(simd, source.samples, at, w_x, blocks);
        let lower = colour_row(simd, source.samples, at + source.stride, w_x, blocks);
        at += 2 * source.stride;
        let two = truncated_pair(simd, upper, lower);
        let w = avx._mm256_set1_epi32(cast(*w_y));
        total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(two, w));
    }
    sum_of_halves(simd, total)
}
