//! Eight places at a time.

use super::{Places, Source, scalar};
use crate::numerics::kernel::Kernel;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};

/// In an order of bytes: nothing.
const NO: i8 = -1;

/// Eight at a time, the rest plainly.
#[inline(always)]
pub fn sums<const C: usize, const TAPS: usize>(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    places: Places,
    sums: &mut [[i32; 4]],
) {
    let (chunks, rest) = sums.as_chunks_mut::<8>();
    let [across, down] = places.phases;
    let first = places.first.as_chunks::<8>().0;
    let (s, t) = (across.as_chunks::<8>().0, down.as_chunks::<8>().0);
    let done = 8 * chunks.len();
    for (((sums, first), s), t) in chunks.iter_mut().zip(first).zip(s).zip(t) {
        if C == 1 {
            let all: [i32; 8] = cast(greys::<TAPS>(simd, source, kernel, first, [*s, *t]));
            for (sum, value) in sums.iter_mut().zip(all) {
                *sum = [value, 0, 0, 0];
            }
        } else {
            let [a, b, c, d] = colours::<TAPS>(simd, source, kernel, first, [*s, *t]);
            [sums[0], sums[4]] = cast(a);
            [sums[1], sums[5]] = cast(b);
            [sums[2], sums[6]] = cast(c);
            [sums[3], sums[7]] = cast(d);
        }
    }
    let places = Places {
        first: &places.first[done..],
        phases: [&across[done..], &down[done..]],
    };
    scalar::sums::<C>(source, kernel, places, rest);
}

/// Where kernels begin and their phases along u and v, eight of each.
pub type Eight<T> = [T; 8];

/// The sums of eight grey pixels.
#[inline(always)]
pub fn greys<const TAPS: usize>(
    simd: V3,
    source: Source,
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

/// The sums of grey pixels `k` to `k + 3`.
#[inline(always)]
fn four_greys<const TAPS: usize>(
    simd: V3,
    source: Source,
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

/// The kernel's taps, known beforehand or not (0).
#[inline(always)]
pub fn taps<const TAPS: usize>(kernel: &Kernel) -> usize {
    match TAPS {
        0 => kernel.taps(),
        taps => taps,
    }
}

/// The weights along u and v of pixel `k`, those along u filled up with nothing.
#[inline(always)]
fn weights<const TAPS: usize>(
    kernel: &Kernel,
    [s, t]: [Eight<i32>; 2],
    k: usize,
) -> (&[i16], &[i16]) {
    let taps = taps::<TAPS>(kernel);
    let row = Kernel::row_of(taps);
    let of = |phase: i32| &kernel.all_integers()[phase as usize * row..][..row];
    (of(s[k]), &of(t[k])[..taps])
}

/// Four numbers whose sum is that of grey pixel `k`.
#[inline(always)]
fn one_grey<const TAPS: usize>(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights::<TAPS>(kernel, phases, k);
    let at = first[k] as usize;
    wide_grey(simd, source, weights, at, taps::<TAPS>(kernel).div_ceil(8))
}

/// The sums of eight pixels in colour: of the k-th and the k + 4th in the halves of the k-th
/// vector.
#[inline(always)]
pub fn colours<const TAPS: usize>(
    simd: V3,
    source: Source,
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

/// The sums of pixels `k` and `k + 4`.
#[inline(always)]
fn both_colours<const TAPS: usize>(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m256i {
    let lower = one_colour::<TAPS>(simd, source, kernel, first, phases, k);
    let upper = one_colour::<TAPS>(simd, source, kernel, first, phases, k + 4);
    simd.avx._mm256_set_m128i(upper, lower)
}

/// The sums of pixel `k`.
#[inline(always)]
fn one_colour<const TAPS: usize>(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights::<TAPS>(kernel, phases, k);
    let at = first[k] as usize;
    colour(simd, source, weights, at, taps::<TAPS>(kernel).div_ceil(4))
}

/// Sums with `more` and without their last `bits`, as bytes: the lower halves of all vectors first.
#[inline(always)]
pub fn packed(simd: V3, [a, b, c, d]: [__m256i; 4], more: __m256i, bits: u32) -> __m256i {
    let avx2 = simd.avx2;
    let count: __m128i = cast([bits, 0, 0, 0]);
    let a = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(a, more), count);
    let b = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(b, more), count);
    let c = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(c, more), count);
    let d = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(d, more), count);
    bytes(simd, [a, b, c, d])
}

/// Whole numbers as bytes, those beyond the scale its ends: the lower halves of all vectors first.
#[inline(always)]
pub fn bytes(simd: V3, [a, b, c, d]: [__m256i; 4]) -> __m256i {
    let avx2 = simd.avx2;
    let (ab, cd) = (avx2._mm256_packs_epi32(a, b), avx2._mm256_packs_epi32(c, d));
    avx2._mm256_packus_epi16(ab, cd)
}

#[inline(always)]
pub fn pixels<const C: usize>(
    simd: V3,
    sums: &[[i32; 4]],
    more: &[i32; 4],
    bits: u32,
    pixels: &mut [u8],
) {
    let avx2 = simd.avx2;
    let (eights, rest) = sums.as_chunks::<8>();
    let (there, there_rest) = pixels.split_at_mut(8 * (C + 1) * eights.len());
    let more_twice: __m256i = cast([*more; 2]);
    // Packing leaves pixels 0, 2, 4, 6 in the lower half and 1, 3, 5, 7 in the upper one.
    let order: __m256i = cast([0, 4, 1, 5, 2, 6, 3, 7]);
    let first_two: __m256i =
        cast([[0i8, 1, 4, 5, 8, 9, 12, 13, NO, NO, NO, NO, NO, NO, NO, NO]; 2]);
    for (eight, there) in eights.iter().zip(there.chunks_exact_mut(8 * (C + 1))) {
        let all = packed(simd, cast(*eight), more_twice, bits);
        let all = avx2._mm256_permutevar8x32_epi32(all, order);
        if C == 3 {
            let all: [u8; 32] = cast(all);
            there.copy_from_slice(&all);
        } else {
            let [low, _, high, _]: [[u8; 8]; 4] = cast(avx2._mm256_shuffle_epi8(all, first_two));
            let (first, last) = there.split_at_mut(8);
            first.copy_from_slice(&low);
            last.copy_from_slice(&high);
        }
    }
    scalar::pixels::<C>(rest, more, bits, there_rest);
}

/// The `N` samples from `at`.
#[inline(always)]
fn read<const N: usize>(samples: &[u8], at: usize) -> [u8; N] {
    let mut read = [0; N];
    read.copy_from_slice(&samples[at..at + N]);
    read
}

/// `128 − w`.
#[inline(always)]
fn rest(simd: V3, w: __m256i) -> __m256i {
    simd.avx2
        ._mm256_sub_epi32(simd.avx._mm256_set1_epi32(128), w)
}

/// `(128 − w, w)` in the halves of each number: a product of it and a number up to 128 has no carry
/// from half to half, as 128 · 128 = 2¹⁴.
#[inline(always)]
fn pair(simd: V3, w: __m256i) -> __m256i {
    let avx2 = simd.avx2;
    avx2._mm256_or_si256(rest(simd, w), avx2._mm256_slli_epi32::<16>(w))
}

/// The samples from a row on and from the next one on, as many of both.
#[inline(always)]
fn two_rows(source: Source<'_>) -> [&[u8]; 2] {
    let count = source.samples.len().saturating_sub(source.stride);
    let lower = &source.samples[source.stride..];
    [&source.samples[..count], &lower[..count]]
}

/// Sixteen bytes of a row from `a` on in the lower half, from `b` on in the upper one.
#[inline(always)]
fn two_sixteens(simd: V3, row: &[u8], a: u32, b: u32) -> __m256i {
    let (a, b): ([u8; 16], [u8; 16]) = (read(row, a as usize), read(row, b as usize));
    simd.avx._mm256_set_m128i(cast(b), cast(a))
}

/// Two pixels side by side, channel by channel: (r, r′, g, g′, b, b′).
const SIDE_BY_SIDE: [i8; 16] = [0, NO, 3, NO, 1, NO, 4, NO, 2, NO, 5, NO, NO, NO, NO, NO];

/// The sums of the two pixels at `a` and `b`, with their rows' weights.
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
    source: Source,
    first: &Eight<u32>,
    s: __m256i,
    t: __m256i,
) -> [__m256i; 4] {
    let avx2 = simd.avx2;
    let rows = two_rows(source);
    let across = pair(simd, s);
    let upper = avx2._mm256_mullo_epi32(across, rest(simd, t));
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
fn bilinear_grey(simd: V3, source: Source, first: &Eight<u32>, s: __m256i, t: __m256i) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let down = pair(simd, t);
    let left = avx2._mm256_mullo_epi32(down, rest(simd, s));
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

/// The four weights from `at`; nothing beyond the last.
#[inline(always)]
fn four_of(weights: &[i16], at: usize) -> i64 {
    if at >= weights.len() {
        return 0;
    }
    let w = &weights[at..at + 4];
    cast([w[0], w[1], w[2], w[3]])
}

/// The same, over and over.
#[inline(always)]
fn four(simd: V3, weights: &[i16], at: usize) -> __m256i {
    simd.avx._mm256_set1_epi64x(four_of(weights, at))
}

/// Pixels 0 and 1 side by side in the lower half, 2 and 3 in the upper one.
const TWO_BY_TWO: [[i8; 16]; 2] = [
    SIDE_BY_SIDE,
    [6, NO, 9, NO, 7, NO, 10, NO, 8, NO, 11, NO, NO, NO, NO, NO],
];
/// The first two of four weights in the lower half, the last two in the upper one.
const HALVES: [[i8; 16]; 2] = [
    [0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3, 0, 1, 2, 3],
    [4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7, 4, 5, 6, 7],
];

/// The sums of a row that begins at `at`: a in the lower half, b in the upper one.
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

/// The sums of a pixel; `blocks`: quarters of the taps.
#[inline(always)]
fn colour(
    simd: V3,
    source: Source,
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
        let two = cut_pair(simd, upper, lower);
        let w = avx._mm256_set1_epi32(cast(*w_y));
        total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(two, w));
    }
    sum_of_halves(simd, total)
}

/// The lower half and the upper one, added.
#[inline(always)]
fn sum_of_halves(simd: V3, all: __m256i) -> __m128i {
    let lower = simd.avx._mm256_castsi256_si128(all);
    let upper = simd.avx2._mm256_extracti128_si256::<1>(all);
    simd.sse2._mm_add_epi32(lower, upper)
}

/// Four rows of samples, as many of each.
#[inline(always)]
fn four_rows(source: Source<'_>) -> [&[u8]; 4] {
    let Source { samples, stride } = source;
    let count = samples.len().saturating_sub(3 * stride);
    [
        &samples[..count],
        &samples[stride..][..count],
        &samples[2 * stride..][..count],
        &samples[3 * stride..][..count],
    ]
}

/// The samples under four taps of a row for pixels `k` to `k + 3`, times their weights: a and b of
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
    let w = kernel.all_integers().as_chunks::<4>().0;
    let of = |phase: i32| -> i64 { cast(w[phase as usize]) };
    let w_x = avx._mm256_set_epi64x(of(s[k + 3]), of(s[k + 2]), of(s[k + 1]), of(s[k]));
    let w_y = avx._mm256_set_epi64x(of(t[k + 3]), of(t[k + 2]), of(t[k + 1]), of(t[k]));
    let a = four_across(simd, rows[0], first, k, w_x);
    let b = four_across(simd, rows[1], first, k, w_x);
    let c = four_across(simd, rows[2], first, k, w_x);
    let d = four_across(simd, rows[3], first, k, w_x);
    avx2._mm256_add_epi32(
        avx2._mm256_madd_epi16(cut_pair(simd, a, b), avx2._mm256_shuffle_epi32::<0xa0>(w_y)),
        avx2._mm256_madd_epi16(cut_pair(simd, c, d), avx2._mm256_shuffle_epi32::<0xf5>(w_y)),
    )
}

/// Two rows, cut, in the halves of each number.
#[inline(always)]
pub fn cut_pair(simd: V3, upper: __m256i, lower: __m256i) -> __m256i {
    let avx2 = simd.avx2;
    avx2._mm256_blend_epi16::<0b1010_1010>(
        avx2._mm256_srai_epi32::<8>(upper),
        avx2._mm256_slli_epi32::<8>(lower),
    )
}

/// The sums of eight grey pixels under four taps.
#[inline(always)]
fn bicubic_grey(
    simd: V3,
    source: Source,
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
    [0, 1, NO, NO, 0, 1, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
    [2, 3, NO, NO, 2, 3, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
];

/// Numbers whose sum is that of a pixel under eight taps and more, `blocks` times eight at the
/// most: a row in each half of a vector.
#[inline(always)]
fn wide_grey(
    simd: V3,
    source: Source,
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
