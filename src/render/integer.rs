//! Sums of 8-bit samples under a kernel, in whole numbers.
//!
//! Two taps along each axis: with the phases s, t in 1/128 px, `Σ = Σ_ij w_i(s) w_j(t) I_ij` with `w = (128 − s, s)`, exact, in units of
//! 2⁻¹⁴.
//!
//! More: weights in units of 2⁻¹⁴ ([`Kernel::integers`]). Rows are summed first, the first and the last two of every four taps by
//! themselves (a, b); these are cut to units of 2⁻⁶ and then summed down the columns: `Σ = Σ_j w_j (⌊a_j/2⁸⌋ + ⌊b_j/2⁸⌋)`, in units of 2⁻²⁰. What
//! cutting takes away, half a unit of a and of b each in the mean, is given back at the end.
//!
//! The same numbers come out of vectors (AVX2) and of the plain loops of [`plain`], to the bit: nothing is rounded but by
//! the cut.

use super::kernel::Kernel;
#[cfg(target_arch = "x86_64")]
use crate::vectors;

/// What the kernel needs to know of a picture.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Row-major, channels interleaved; [`PADDING`] more at the end than there are.
    pub samples: &'a [u8],
    /// Samples of a row.
    pub stride: usize,
}

/// Where the kernel lies for each point.
#[derive(Clone, Copy)]
pub struct Places<'a> {
    /// Index of the first sample under the kernel; all of it must lie within the picture.
    pub first: &'a [u32],
    /// Phases along u and v.
    pub phases: [&'a [i32]; 2],
}

/// Samples that are read beyond those needed.
pub const PADDING: usize = 16;

/// Sums at each place, one lane a channel: colour in the first three, grey in the first. `C`: 1 or 3 channels.
pub fn sums<const C: usize>(
    source: Source,
    kernel: &Kernel,
    places: Places,
    sums: &mut [[i32; 4]],
) {
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| avx2::sums::<C>(simd, source, kernel, places, sums),
    ) {
        return;
    }
    plain::sums::<C>(source, kernel, places, sums);
}

/// The nearest 8-bit samples of sums, alpha last and full.
pub fn pixels<const C: usize>(kernel: &Kernel, sums: &[[i32; 4]], pixels: &mut [u8]) {
    let bits = bits(kernel);
    let half = missing(kernel) + (1 << (bits - 1));
    let mut more = [half; 4];
    more[C] = 255 << bits;
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| avx2::pixels::<C>(simd, sums, &more, bits, pixels),
    ) {
        return;
    }
    plain::pixels::<C>(sums, &more, bits, pixels);
}

/// Bits of a sum below its whole part.
pub fn bits(kernel: &Kernel) -> u32 {
    match kernel.taps() {
        2 => 14,
        _ => 20,
    }
}

/// What is missing of a sum: what cutting has taken away in the mean.
pub fn missing(kernel: &Kernel) -> i32 {
    match kernel.taps() {
        2 => 0,
        _ => 1 << 14,
    }
}

/// One place at a time.
mod plain {
    use super::{Kernel, Places, Source};

    pub fn sums<const C: usize>(
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
    ) {
        for (k, sum) in sums.iter_mut().enumerate() {
            let own = &source.samples[places.first[k] as usize..];
            let phases = places.phases.map(|phases| phases[k]);
            *sum = [0; 4];
            for (c, sum) in sum.iter_mut().enumerate().take(C) {
                let at = |x: usize, y: usize| i32::from(own[y * source.stride + x * C + c]);
                *sum = match kernel.taps() {
                    2 => {
                        let [s, t] = phases;
                        (128 - t) * ((128 - s) * at(0, 0) + s * at(1, 0))
                            + t * ((128 - s) * at(0, 1) + s * at(1, 1))
                    }
                    _ => {
                        let [w_x, w_y] = phases.map(|phase| kernel.integers(phase as usize));
                        cut_sum(w_x, w_y, at)
                    }
                };
            }
        }
    }

    /// Lanes up to the `C`th, with `more` and without their last `bits`.
    pub fn pixels<const C: usize>(
        sums: &[[i32; 4]],
        more: &[i32; 4],
        bits: u32,
        pixels: &mut [u8],
    ) {
        for (sum, pixel) in sums.iter().zip(pixels.chunks_exact_mut(C + 1)) {
            for (c, sample) in pixel.iter_mut().enumerate() {
                *sample = ((sum[c] + more[c]) >> bits).clamp(0, 255) as u8;
            }
        }
    }

    fn cut_sum(w_x: &[i16], w_y: &[i16], at: impl Fn(usize, usize) -> i32) -> i32 {
        let row = |y: usize| {
            let part = |first: usize| {
                let taps = (0..w_x.len()).filter(|x| x % 4 / 2 == first);
                taps.map(|x| i32::from(w_x[x]) * at(x, y)).sum::<i32>() >> 8
            };
            part(0) + part(1)
        };
        let rows = w_y.iter().enumerate();
        rows.map(|(y, w)| i32::from(*w) * row(y)).sum()
    }
}

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{Kernel, Places, Source, plain};
    use pulp::bytemuck::cast;
    use pulp::x86::V3;
    use std::arch::x86_64::{__m128i, __m256i};

    /// In an order of bytes: nothing.
    const NO: i8 = -1;

    #[inline(always)]
    pub fn sums<const C: usize>(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
    ) {
        match (kernel.taps(), C) {
            (2, _) => bilinear::<C>(simd, source, kernel, places, sums),
            (4, 1) => grey(simd, source, kernel, places, sums),
            (4, _) => colour(simd, source, kernel, places, sums, 1),
            (8, 1) => wide_grey(simd, source, kernel, places, sums, 1),
            (taps, 1) => wide_grey(simd, source, kernel, places, sums, taps.div_ceil(8)),
            (taps, _) => colour(simd, source, kernel, places, sums, taps / 4),
        }
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
        let count: __m128i = cast([bits, 0, 0, 0]);
        // Packing leaves pixels 0, 2, 4, 6 in the lower half and 1, 3, 5, 7 in the upper one.
        let order: __m256i = cast([0, 4, 1, 5, 2, 6, 3, 7]);
        let first_two: __m256i =
            cast([[0i8, 1, 4, 5, 8, 9, 12, 13, NO, NO, NO, NO, NO, NO, NO, NO]; 2]);
        for (eight, there) in eights.iter().zip(there.chunks_exact_mut(8 * (C + 1))) {
            let [a, b, c, d]: [__m256i; 4] = cast(*eight);
            let a = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(a, more_twice), count);
            let b = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(b, more_twice), count);
            let c = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(c, more_twice), count);
            let d = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(d, more_twice), count);
            let (ab, cd) = (avx2._mm256_packs_epi32(a, b), avx2._mm256_packs_epi32(c, d));
            let all = avx2._mm256_packus_epi16(ab, cd);
            let all = avx2._mm256_permutevar8x32_epi32(all, order);
            if C == 3 {
                let all: [u8; 32] = cast(all);
                there.copy_from_slice(&all);
            } else {
                let [low, _, high, _]: [[u8; 8]; 4] =
                    cast(avx2._mm256_shuffle_epi8(all, first_two));
                let (first, last) = there.split_at_mut(8);
                first.copy_from_slice(&low);
                last.copy_from_slice(&high);
            }
        }
        plain::pixels::<C>(rest, more, bits, there_rest);
    }

    /// The `N` samples from `at`; nothing where there are not as many.
    #[inline(always)]
    fn read<const N: usize>(samples: &[u8], at: usize) -> [u8; N] {
        match samples.get(at..at + N) {
            Some(read) => match read.first_chunk() {
                Some(read) => *read,
                None => [0; N],
            },
            None => [0; N],
        }
    }

    /// Eight at a time, the rest plainly.
    #[inline(always)]
    fn bilinear<const C: usize>(
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
                bilinear_grey(simd, source, first, cast(*s), cast(*t), sums);
            } else {
                bilinear_colour(simd, source, first, cast(*s), cast(*t), sums);
            }
        }
        let places = Places {
            first: &places.first[done..],
            phases: [&across[done..], &down[done..]],
        };
        plain::sums::<C>(source, kernel, places, rest);
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

    /// Eight bytes of a row and of the next.
    #[inline(always)]
    fn two_rows(source: Source, at: u32) -> __m128i {
        let at = at as usize;
        let upper: [u8; 8] = read(source.samples, at);
        let lower: [u8; 8] = read(source.samples, at + source.stride);
        cast([upper, lower])
    }

    /// The two pixels of a row side by side, channel by channel: (r, r′, g, g′, b, b′).
    const UPPER: [i8; 16] = [0, NO, 3, NO, 1, NO, 4, NO, 2, NO, 5, NO, NO, NO, NO, NO];
    /// The same of the next row.
    const LOWER: [i8; 16] = [8, NO, 11, NO, 9, NO, 12, NO, 10, NO, 13, NO, NO, NO, NO, NO];

    /// The sums of the two pixels at `a` and `b`, with their rows' weights.
    #[inline(always)]
    fn two_colours(
        simd: V3,
        source: Source,
        a: u32,
        b: u32,
        upper: __m256i,
        lower: __m256i,
    ) -> [[i32; 4]; 2] {
        let avx2 = simd.avx2;
        let pixels = simd
            .avx
            ._mm256_set_m128i(two_rows(source, b), two_rows(source, a));
        let above = avx2._mm256_shuffle_epi8(pixels, cast([UPPER; 2]));
        let below = avx2._mm256_shuffle_epi8(pixels, cast([LOWER; 2]));
        cast(avx2._mm256_add_epi32(
            avx2._mm256_madd_epi16(above, upper),
            avx2._mm256_madd_epi16(below, lower),
        ))
    }

    #[inline(always)]
    fn bilinear_colour(
        simd: V3,
        source: Source,
        first: &[u32; 8],
        s: __m256i,
        t: __m256i,
        sums: &mut [[i32; 4]; 8],
    ) {
        let avx2 = simd.avx2;
        let across = pair(simd, s);
        let upper = avx2._mm256_mullo_epi32(across, rest(simd, t));
        let lower = avx2._mm256_mullo_epi32(across, t);
        // Pixels k and k + 4 in the halves of a vector.
        let (w, x) = (
            avx2._mm256_shuffle_epi32::<0x00>(upper),
            avx2._mm256_shuffle_epi32::<0x00>(lower),
        );
        [sums[0], sums[4]] = two_colours(simd, source, first[0], first[4], w, x);
        let (w, x) = (
            avx2._mm256_shuffle_epi32::<0x55>(upper),
            avx2._mm256_shuffle_epi32::<0x55>(lower),
        );
        [sums[1], sums[5]] = two_colours(simd, source, first[1], first[5], w, x);
        let (w, x) = (
            avx2._mm256_shuffle_epi32::<0xaa>(upper),
            avx2._mm256_shuffle_epi32::<0xaa>(lower),
        );
        [sums[2], sums[6]] = two_colours(simd, source, first[2], first[6], w, x);
        let (w, x) = (
            avx2._mm256_shuffle_epi32::<0xff>(upper),
            avx2._mm256_shuffle_epi32::<0xff>(lower),
        );
        [sums[3], sums[7]] = two_colours(simd, source, first[3], first[7], w, x);
    }

    #[inline(always)]
    fn bilinear_grey(
        simd: V3,
        source: Source,
        first: &[u32; 8],
        s: __m256i,
        t: __m256i,
        sums: &mut [[i32; 4]; 8],
    ) {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let down = pair(simd, t);
        let left = avx2._mm256_mullo_epi32(down, rest(simd, s));
        let right = avx2._mm256_mullo_epi32(down, s);
        let mut four = [[[0; 2]; 2]; 8];
        for (four, first) in four.iter_mut().zip(first) {
            let at = *first as usize;
            *four = [
                read(source.samples, at),
                read(source.samples, at + source.stride),
            ];
        }
        let four: __m256i = cast(four);
        // Upper and lower pixel in the halves of each number.
        let bytes = avx._mm256_set1_epi32(0x00ff_00ff);
        let own = avx2._mm256_and_si256(four, bytes);
        let next = avx2._mm256_and_si256(avx2._mm256_srli_epi32::<8>(four), bytes);
        let sum = avx2._mm256_add_epi32(
            avx2._mm256_madd_epi16(own, left),
            avx2._mm256_madd_epi16(next, right),
        );
        let values: [i32; 8] = cast(sum);
        for (sum, value) in sums.iter_mut().zip(values) {
            *sum = [value, 0, 0, 0];
        }
    }

    /// The four weights from `at`; nothing where there are none.
    #[inline(always)]
    fn four_of(weights: &[i16], at: usize) -> [i16; 4] {
        match weights.get(at..at + 4) {
            Some(four) => match four.first_chunk() {
                Some(four) => *four,
                None => [0; 4],
            },
            None => [0; 4],
        }
    }

    /// The same, over and over.
    #[inline(always)]
    fn four(simd: V3, weights: &[i16], at: usize) -> __m256i {
        simd.avx._mm256_set1_epi64x(cast(four_of(weights, at)))
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

    /// `blocks`: quarters of the taps.
    #[inline(always)]
    fn colour(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
        blocks: usize,
    ) {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let [across, down] = places.phases;
        let phases = across.iter().zip(down);
        for ((sum, first), (s, t)) in sums.iter_mut().zip(places.first).zip(phases) {
            let (w_x, w_y) = (kernel.integers(*s as usize), kernel.integers(*t as usize));
            let mut at = *first as usize;
            let mut total = avx._mm256_setzero_si256();
            for pair in 0..2 * blocks {
                let upper = colour_row(simd, source.samples, at, w_x, blocks);
                let lower = colour_row(simd, source.samples, at + source.stride, w_x, blocks);
                at += 2 * source.stride;
                // Cut, and two rows in the halves of each number.
                let two = avx2._mm256_blend_epi16::<0b1010_1010>(
                    avx2._mm256_srai_epi32::<8>(upper),
                    avx2._mm256_slli_epi32::<8>(lower),
                );
                let w = avx._mm256_set1_epi32(cast([w_y[2 * pair], w_y[2 * pair + 1]]));
                total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(two, w));
            }
            let [a, b]: [__m128i; 2] = cast(total);
            *sum = cast(simd.sse2._mm_add_epi32(a, b));
        }
    }

    /// Each of four weights twice, in the lower halves of the numbers.
    const TWICE: [i8; 32] = [
        0, 1, NO, NO, 0, 1, NO, NO, 2, 3, NO, NO, 2, 3, NO, NO, //
        4, 5, NO, NO, 4, 5, NO, NO, 6, 7, NO, NO, 6, 7, NO, NO,
    ];

    /// Four taps.
    #[inline(always)]
    fn grey(simd: V3, source: Source, kernel: &Kernel, places: Places, sums: &mut [[i32; 4]]) {
        let (avx2, stride) = (simd.avx2, source.stride);
        let [across, down] = places.phases;
        let phases = across.iter().zip(down);
        for ((sum, first), (s, t)) in sums.iter_mut().zip(places.first).zip(phases) {
            let (w_x, w_y) = (kernel.integers(*s as usize), kernel.integers(*t as usize));
            let at = *first as usize;
            let pixels: [[u8; 4]; 4] = [
                read(source.samples, at),
                read(source.samples, at + stride),
                read(source.samples, at + 2 * stride),
                read(source.samples, at + 3 * stride),
            ];
            let pixels = avx2._mm256_cvtepu8_epi16(cast(pixels));
            let cut =
                avx2._mm256_srai_epi32::<8>(avx2._mm256_madd_epi16(pixels, four(simd, w_x, 0)));
            let w = avx2._mm256_shuffle_epi8(four(simd, w_y, 0), cast(TWICE));
            let [a, b]: [__m128i; 2] = cast(avx2._mm256_madd_epi16(cut, w));
            let [a, b, c, d]: [i32; 4] = cast(simd.sse2._mm_add_epi32(a, b));
            *sum = [a + b + c + d, 0, 0, 0];
        }
    }

    /// Two weights: the first twice in the lower half, the second in the upper one.
    const ROW_BY_ROW: [[i8; 16]; 2] = [
        [0, 1, NO, NO, 0, 1, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
        [2, 3, NO, NO, 2, 3, NO, NO, NO, NO, NO, NO, NO, NO, NO, NO],
    ];

    /// Eight taps and more, `blocks` times eight at the most: a row in each half of a vector.
    #[inline(always)]
    fn wide_grey(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
        blocks: usize,
    ) {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let [across, down] = places.phases;
        let phases = across.iter().zip(down);
        for ((sum, first), (s, t)) in sums.iter_mut().zip(places.first).zip(phases) {
            let (w_x, w_y) = (kernel.integers(*s as usize), kernel.integers(*t as usize));
            let mut at = *first as usize;
            let mut total = avx._mm256_setzero_si256();
            for w_y in w_y.as_chunks::<2>().0 {
                let mut rows = avx._mm256_setzero_si256();
                for block in 0..blocks {
                    let pixels: [[u8; 8]; 2] = [
                        read(source.samples, at + 8 * block),
                        read(source.samples, at + source.stride + 8 * block),
                    ];
                    let pixels = avx2._mm256_cvtepu8_epi16(cast(pixels));
                    let w = [four_of(w_x, 8 * block), four_of(w_x, 8 * block + 4)];
                    let w = avx2._mm256_broadcastsi128_si256(cast(w));
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
            let [upper, lower]: [__m128i; 2] = cast(total);
            let [a, b, ..]: [i32; 4] = cast(simd.sse2._mm_add_epi32(upper, lower));
            *sum = [a + b, 0, 0, 0];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{Interpolation, Picture, Samples};

    const KERNELS: [(Interpolation, f64); 6] = [
        (Interpolation::Bilinear, 1.0),
        (Interpolation::Bicubic, 1.0),
        (Interpolation::Lanczos3, 1.0),
        (Interpolation::Bilinear, 1.75),
        (Interpolation::Bicubic, 2.5),
        (Interpolation::Lanczos3, 4.0),
    ];
    const SIZE: usize = 64;

    /// Noise over the full scale, and edges from end to end of it: nothing overshoots more.
    fn picture<const C: usize>() -> Picture {
        let samples = (0..SIZE * SIZE * C).map(|k| {
            let (x, y) = (k / C % SIZE, k / C / SIZE);
            let noise = (k * 2_654_435_761) >> 13;
            match x < SIZE / 2 {
                true => noise as u8,
                false => 255 * (((x / 3) ^ (y / 2)) & 1) as u8,
            }
        });
        Picture::new(SIZE, SIZE, C, samples.collect::<Vec<u8>>())
    }

    /// Coordinates well inside, of every phase.
    fn coordinates() -> impl Iterator<Item = (f32, f32)> {
        (0..2000).map(|k| {
            let at = |step: f32| 16.0 + (k as f32 * step) % 31.0;
            (at(0.723_606_8), at(0.276_393_2))
        })
    }

    fn check<const C: usize>(interpolation: Interpolation, stretch: f64) {
        let kernel = Kernel::new(interpolation, stretch);
        let picture = picture::<C>();
        let Samples::Eight(samples) = picture.samples() else {
            panic!("8 bits");
        };
        let source = Source {
            samples,
            stride: SIZE * C,
        };
        let phases = kernel.integer_phases();
        let phase = |t: f32| Kernel::phase_of(t.fract(), phases);
        let across: Vec<i32> = coordinates().map(|(u, _)| phase(u)).collect();
        let down: Vec<i32> = coordinates().map(|(_, v)| phase(v)).collect();
        let first = coordinates().map(|(u, v)| {
            let (x, y) = (u as usize - kernel.before(), v as usize - kernel.before());
            ((y * SIZE + x) * C) as u32
        });
        let first: Vec<u32> = first.collect();
        let places = Places {
            first: &first,
            phases: [&across, &down],
        };
        let (mut fast, mut slow) = (vec![[7; 4]; first.len()], vec![[9; 4]; first.len()]);
        sums::<C>(source, &kernel, places, &mut fast);
        plain::sums::<C>(source, &kernel, places, &mut slow);
        assert_eq!(fast, slow, "{interpolation:?} {stretch}");
        let (bits_of, half) = (bits(&kernel), missing(&kernel) + (1 << (bits(&kernel) - 1)));
        let mut more = [half; 4];
        more[C] = 255 << bits_of;
        let mut bytes = [vec![1; (C + 1) * fast.len()], vec![2; (C + 1) * fast.len()]];
        pixels::<C>(&kernel, &fast, &mut bytes[0]);
        plain::pixels::<C>(&fast, &more, bits_of, &mut bytes[1]);
        assert_eq!(bytes[0], bytes[1]);
        // Against single precision at the same phases, and where phases are 1/1024 px off at the most.
        let scale = f64::from(1u32 << bits(&kernel)).recip();
        let (mut worst, mut squares) = (0.0f64, 0.0);
        for ((u, v), sum) in coordinates().zip(&fast) {
            let near = |t: f32| t.floor() + Kernel::phase_of(t.fract(), phases) as f32 / phases;
            let exact = picture.at(near(u), near(v), &kernel);
            for (sum, exact) in sum[..C].iter().zip(exact) {
                let error = f64::from(sum + missing(&kernel)) * scale - f64::from(exact);
                worst = worst.max(error.abs());
                squares += error * error;
            }
        }
        let rms = (squares / (C * fast.len()) as f64).sqrt();
        assert!(
            worst < 0.1 && rms < 0.03,
            "{interpolation:?} {stretch}: {worst}, {rms}"
        );
    }

    #[test]
    fn vectors_sum_as_plain_loops_do_and_both_to_a_tenth_of_a_grey_level() {
        for (interpolation, stretch) in KERNELS {
            check::<1>(interpolation, stretch);
            check::<3>(interpolation, stretch);
        }
    }
}
