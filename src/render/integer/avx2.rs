//! Eight places at a time.

use super::{Kernel, Places, Source, plain};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};

/// In an order of bytes: nothing.
const NO: i8 = -1;

/// Eight at a time, the rest plainly.
#[inline(always)]
pub fn sums<const C: usize>(
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
            let all: [i32; 8] = cast(greys(simd, source, kernel, first, [*s, *t]));
            for (sum, value) in sums.iter_mut().zip(all) {
                *sum = [value, 0, 0, 0];
            }
        } else {
            let [a, b, c, d] = colours(simd, source, kernel, first, [*s, *t]);
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
    plain::sums::<C>(source, kernel, places, rest);
}

/// Where kernels begin and their phases along u and v, eight of each.
pub type Eight<T> = [T; 8];

/// The sums of eight grey pixels.
#[inline(always)]
pub fn greys(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
) -> __m256i {
    if kernel.taps() == 2 {
        let [s, t] = phases;
        return bilinear_grey(simd, source, first, cast(s), cast(t));
    }
    let lower = four_greys(simd, source, kernel, first, phases, 0);
    let upper = four_greys(simd, source, kernel, first, phases, 4);
    simd.avx._mm256_set_m128i(upper, lower)
}

/// The sums of grey pixels `k` to `k + 3`.
#[inline(always)]
fn four_greys(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let a = one_grey(simd, source, kernel, first, phases, k);
    let b = one_grey(simd, source, kernel, first, phases, k + 1);
    let c = one_grey(simd, source, kernel, first, phases, k + 2);
    let d = one_grey(simd, source, kernel, first, phases, k + 3);
    let ssse3 = simd.ssse3;
    ssse3._mm_hadd_epi32(ssse3._mm_hadd_epi32(a, b), ssse3._mm_hadd_epi32(c, d))
}

/// The weights along u and v of pixel `k`.
#[inline(always)]
fn weights(kernel: &Kernel, [s, t]: [Eight<i32>; 2], k: usize) -> (&[i16], &[i16]) {
    (
        kernel.integers(s[k] as usize),
        kernel.integers(t[k] as usize),
    )
}

/// Four numbers whose sum is that of grey pixel `k`.
#[inline(always)]
fn one_grey(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights(kernel, phases, k);
    let at = first[k] as usize;
    match kernel.taps() {
        4 => grey(simd, source, weights, at),
        8 => wide_grey(simd, source, weights, at, 1),
        taps => wide_grey(simd, source, weights, at, taps.div_ceil(8)),
    }
}

/// The sums of eight pixels in colour: of the k-th and the k + 4th in the halves of the k-th vector.
#[inline(always)]
pub fn colours(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
) -> [__m256i; 4] {
    if kernel.taps() == 2 {
        let [s, t] = phases;
        return bilinear_colour(simd, source, first, cast(s), cast(t));
    }
    let a = both_colours(simd, source, kernel, first, phases, 0);
    let b = both_colours(simd, source, kernel, first, phases, 1);
    let c = both_colours(simd, source, kernel, first, phases, 2);
    let d = both_colours(simd, source, kernel, first, phases, 3);
    [a, b, c, d]
}

/// The sums of pixels `k` and `k + 4`.
#[inline(always)]
fn both_colours(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m256i {
    let lower = one_colour(simd, source, kernel, first, phases, k);
    let upper = one_colour(simd, source, kernel, first, phases, k + 4);
    simd.avx._mm256_set_m128i(upper, lower)
}

/// The sums of pixel `k`.
#[inline(always)]
fn one_colour(
    simd: V3,
    source: Source,
    kernel: &Kernel,
    first: &Eight<u32>,
    phases: [Eight<i32>; 2],
    k: usize,
) -> __m128i {
    let weights = weights(kernel, phases, k);
    let at = first[k] as usize;
    match kernel.taps() {
        4 => colour(simd, source, weights, at, 1),
        taps => colour(simd, source, weights, at, taps / 4),
    }
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
    plain::pixels::<C>(rest, more, bits, there_rest);
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

/// `(128 − w, w)` in the halves of each number: a product of it and a number up to 128 has no carry from half to half, as
/// 128 · 128 = 2¹⁴.
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

/// Eight bytes of both.
#[inline(always)]
fn eight_of_both(simd: V3, [upper, lower]: [&[u8]; 2], at: u32) -> __m128i {
    let upper = i64::from_le_bytes(read(upper, at as usize));
    let lower = i64::from_le_bytes(read(lower, at as usize));
    simd.sse2._mm_set_epi64x(lower, upper)
}

/// The two pixels of a row side by side, channel by channel: (r, r′, g, g′, b, b′).
const UPPER: [i8; 16] = [0, NO, 3, NO, 1, NO, 4, NO, 2, NO, 5, NO, NO, NO, NO, NO];
/// The same of the next row.
const LOWER: [i8; 16] = [8, NO, 11, NO, 9, NO, 12, NO, 10, NO, 13, NO, NO, NO, NO, NO];

/// The sums of the two pixels at `a` and `b`, with their rows' weights.
#[inline(always)]
fn two_colours(
    simd: V3,
    rows: [&[u8]; 2],
    a: u32,
    b: u32,
    upper: __m256i,
    lower: __m256i,
) -> __m256i {
    let avx2 = simd.avx2;
    let (a, b) = (eight_of_both(simd, rows, a), eight_of_both(simd, rows, b));
    let pixels = simd.avx._mm256_set_m128i(b, a);
    let above = avx2._mm256_shuffle_epi8(pixels, cast([UPPER; 2]));
    let below = avx2._mm256_shuffle_epi8(pixels, cast([LOWER; 2]));
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
    UPPER,
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
        // Cut, and two rows in the halves of each number.
        let two = avx2._mm256_blend_epi16::<0b1010_1010>(
            avx2._mm256_srai_epi32::<8>(upper),
            avx2._mm256_slli_epi32::<8>(lower),
        );
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

/// Each of four weights twice, in the lower halves of the numbers.
const TWICE: [i8; 32] = [
    0, 1, NO, NO, 0, 1, NO, NO, 2, 3, NO, NO, 2, 3, NO, NO, //
    4, 5, NO, NO, 4, 5, NO, NO, 6, 7, NO, NO, 6, 7, NO, NO,
];

/// Four numbers whose sum is that of a pixel under four taps.
#[inline(always)]
fn grey(simd: V3, source: Source, (w_x, w_y): (&[i16], &[i16]), at: usize) -> __m128i {
    let (avx2, stride) = (simd.avx2, source.stride);
    let pixels = simd.sse2._mm_set_epi32(
        i32::from_le_bytes(read(source.samples, at + 3 * stride)),
        i32::from_le_bytes(read(source.samples, at + 2 * stride)),
        i32::from_le_bytes(read(source.samples, at + stride)),
        i32::from_le_bytes(read(source.samples, at)),
    );
    let pixels = avx2._mm256_cvtepu8_epi16(pixels);
    let cut = avx2._mm256_srai_epi32::<8>(avx2._mm256_madd_epi16(pixels, four(simd, w_x, 0)));
    let w = avx2._mm256_shuffle_epi8(four(simd, w_y, 0), cast(TWICE));
    sum_of_halves(simd, avx2._mm256_madd_epi16(cut, w))
}

/// Two weights: the first twice in the lower half, the second in the upper one.
const ROW_BY_ROW: [[i8; 16]; 2] = [
    [0, 1, NO, NO, 0, 1, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
    [2, 3, NO, NO, 2, 3, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
];

/// Numbers whose sum is that of a pixel under eight taps and more, `blocks` times eight at the most: a row in each half of a vector.
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
