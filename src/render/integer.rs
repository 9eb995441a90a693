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
    if let Some(simd) = pulp::x86::V3::try_new() {
        pulp::Simd::vectorize(
            simd,
            #[inline(always)]
            || avx2::sums::<C>(simd, source, kernel, places, sums),
        );
        return;
    }
    plain::sums::<C>(source, kernel, places, sums);
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

    #[inline(always)]
    pub fn sums<const C: usize>(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
    ) {
        match (kernel.taps(), C) {
            (2, 1) => bilinear::<C>(simd, source, kernel, places, sums, bilinear_grey),
            (2, _) => bilinear::<C>(simd, source, kernel, places, sums, bilinear_colour),
            (4, 1) => grey(simd, source, kernel, places, sums, 1),
            (4, _) => colour(simd, source, kernel, places, sums, 1),
            (taps, 1) => grey(simd, source, kernel, places, sums, taps / 4),
            (taps, _) => colour(simd, source, kernel, places, sums, taps / 4),
        }
    }

    /// The `N` samples from `at`; nothing where there are not as many.
    #[inline(always)]
    fn read<const N: usize>(samples: &[u8], at: usize) -> [u8; N] {
        match samples.get(at..).and_then(|own| own.first_chunk()) {
            Some(read) => *read,
            None => [0; N],
        }
    }

    /// Eight at a time with `work`, the rest plainly.
    #[inline(always)]
    fn bilinear<const C: usize>(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
        work: impl Fn(V3, Source, &[u32; 8], [__m256i; 2], &mut [[i32; 4]; 8]),
    ) {
        let (chunks, rest) = sums.as_chunks_mut::<8>();
        let first = places.first.as_chunks::<8>().0;
        let [across, down] = places.phases.map(|phases| phases.as_chunks::<8>().0);
        let done = 8 * chunks.len();
        for (((sums, first), s), t) in chunks.iter_mut().zip(first).zip(across).zip(down) {
            work(simd, source, first, [cast(*s), cast(*t)], sums);
        }
        let places = Places {
            first: &places.first[done..],
            phases: places.phases.map(|phases| &phases[done..]),
        };
        plain::sums::<C>(source, kernel, places, rest);
    }

    /// `(128 − w, w)` in the halves of each number.
    #[inline(always)]
    fn pair(simd: V3, w: __m256i) -> __m256i {
        let low = simd.avx2._mm256_sub_epi32(simd.avx._mm256_set1_epi32(128), w);
        simd.avx2._mm256_or_si256(low, simd.avx2._mm256_slli_epi32::<16>(w))
    }

    #[inline(always)]
    fn bilinear_colour(
        simd: V3,
        source: Source,
        first: &[u32; 8],
        [s, t]: [__m256i; 2],
        sums: &mut [[i32; 4]; 8],
    ) {
        let (avx, avx2) = (simd.avx, simd.avx2);
        // No carry from half to half: 128 · 128 = 2¹⁴.
        let across = pair(simd, s);
        let rest = avx2._mm256_sub_epi32(avx._mm256_set1_epi32(128), t);
        let upper = avx2._mm256_mullo_epi32(across, rest);
        let lower = avx2._mm256_mullo_epi32(across, t);
        // The two pixels of a row side by side, channel by channel: (r, r′, g, g′, b, b′).
        const NO: i8 = -1;
        let row = |at: i8| {
            [0, 3, 1, 4, 2, 5].map(|k| at + k)
        };
        let order = |at: i8| {
            let [r, r1, g, g1, b, b1] = row(at);
            [r, NO, r1, NO, g, NO, g1, NO, b, NO, b1, NO, NO, NO, NO, NO]
        };
        let orders: [__m256i; 2] = [0, 8].map(|at| cast([order(at); 2]));
        let both_rows = |k: usize| -> __m128i {
            let at = first[k] as usize;
            let rows: [[u8; 8]; 2] = [
                read(source.samples, at),
                read(source.samples, at + source.stride),
            ];
            cast(rows)
        };
        // Pixels k and k + 4, and their weights in the halves of the vectors.
        let two = |k: usize, upper: __m256i, lower: __m256i| -> [[i32; 4]; 2] {
            let pixels = avx._mm256_set_m128i(both_rows(k + 4), both_rows(k));
            let sum = |order: __m256i, w: __m256i| {
                avx2._mm256_madd_epi16(avx2._mm256_shuffle_epi8(pixels, order), w)
            };
            let [above, below] = orders;
            cast(avx2._mm256_add_epi32(sum(above, upper), sum(below, lower)))
        };
        let each = |w: __m256i| {
            [
                avx2._mm256_shuffle_epi32::<0x00>(w),
                avx2._mm256_shuffle_epi32::<0x55>(w),
                avx2._mm256_shuffle_epi32::<0xaa>(w),
                avx2._mm256_shuffle_epi32::<0xff>(w),
            ]
        };
        let (upper, lower) = (each(upper), each(lower));
        for k in 0..4 {
            [sums[k], sums[k + 4]] = two(k, upper[k], lower[k]);
        }
    }

    #[inline(always)]
    fn bilinear_grey(
        simd: V3,
        source: Source,
        first: &[u32; 8],
        [s, t]: [__m256i; 2],
        sums: &mut [[i32; 4]; 8],
    ) {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let down = pair(simd, t);
        let rest = avx2._mm256_sub_epi32(avx._mm256_set1_epi32(128), s);
        let left = avx2._mm256_mullo_epi32(down, rest);
        let right = avx2._mm256_mullo_epi32(down, s);
        let four: [[[u8; 2]; 2]; 8] = std::array::from_fn(|k| {
            let at = first[k] as usize;
            [
                read(source.samples, at),
                read(source.samples, at + source.stride),
            ]
        });
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

    /// The four weights from `at`, over and over.
    #[inline(always)]
    fn four(simd: V3, weights: &[i16], at: usize) -> __m256i {
        let four: [i16; 4] = match weights.get(at..).and_then(|own| own.first_chunk()) {
            Some(four) => *four,
            None => [0; 4],
        };
        simd.avx._mm256_set1_epi64x(cast(four))
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
        const NO: i8 = -1;
        let (avx, avx2) = (simd.avx, simd.avx2);
        // Pixels 0 and 1 side by side in the lower half, 2 and 3 in the upper one.
        let half = |at: i8| {
            let [r, r1, g, g1, b, b1] = [0, 3, 1, 4, 2, 5].map(|k: i8| at + k);
            [r, NO, r1, NO, g, NO, g1, NO, b, NO, b1, NO, NO, NO, NO, NO]
        };
        let order: __m256i = cast([half(0), half(6)]);
        let halves: __m256i = cast([[0i8, 1, 2, 3].repeated(), [4i8, 5, 6, 7].repeated()]);
        for (k, sum) in sums.iter_mut().enumerate() {
            let w_x = kernel.integers(places.phases[0][k] as usize);
            let w_y = kernel.integers(places.phases[1][k] as usize);
            let at = places.first[k] as usize;
            let row = |j: usize| {
                let mut sum = avx._mm256_setzero_si256();
                for block in 0..blocks {
                    let four_pixels: [u8; 16] =
                        read(source.samples, at + j * source.stride + 12 * block);
                    let pixels = avx2._mm256_broadcastsi128_si256(cast(four_pixels));
                    let pixels = avx2._mm256_shuffle_epi8(pixels, order);
                    let w = avx2._mm256_shuffle_epi8(four(simd, w_x, 4 * block), halves);
                    sum = avx2._mm256_add_epi32(sum, avx2._mm256_madd_epi16(pixels, w));
                }
                sum
            };
            let mut total = avx._mm256_setzero_si256();
            for j in (0..4 * blocks).step_by(2) {
                // Cut, and two rows in the halves of each number.
                let two = avx2._mm256_blend_epi16::<0b1010_1010>(
                    avx2._mm256_srai_epi32::<8>(row(j)),
                    avx2._mm256_slli_epi32::<8>(row(j + 1)),
                );
                let w: [i16; 2] = [w_y[j], w_y[j + 1]];
                let w = avx._mm256_set1_epi32(cast(w));
                total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(two, w));
            }
            let [a, b]: [[i32; 4]; 2] = cast(total);
            *sum = std::array::from_fn(|c| a[c] + b[c]);
        }
    }

    /// `blocks`: quarters of the taps.
    #[inline(always)]
    fn grey(
        simd: V3,
        source: Source,
        kernel: &Kernel,
        places: Places,
        sums: &mut [[i32; 4]],
        blocks: usize,
    ) {
        const NO: i8 = -1;
        let (avx, avx2) = (simd.avx, simd.avx2);
        // Each row's weight twice, in the lower halves of the numbers.
        let half = |at: i8| {
            let twice = |at: i8| [at, at + 1, NO, NO, at, at + 1, NO, NO];
            [twice(at), twice(at + 2)]
        };
        let order: __m256i = cast([half(0), half(4)]);
        for (k, sum) in sums.iter_mut().enumerate() {
            let w_x = kernel.integers(places.phases[0][k] as usize);
            let w_y = kernel.integers(places.phases[1][k] as usize);
            let at = places.first[k] as usize;
            let mut total = avx._mm256_setzero_si256();
            for rows in 0..blocks {
                let mut four_rows = avx._mm256_setzero_si256();
                for block in 0..blocks {
                    let pixels: [[u8; 4]; 4] = std::array::from_fn(|j| {
                        read(
                            source.samples,
                            at + (4 * rows + j) * source.stride + 4 * block,
                        )
                    });
                    let pixels = avx2._mm256_cvtepu8_epi16(cast(pixels));
                    let w = four(simd, w_x, 4 * block);
                    four_rows = avx2._mm256_add_epi32(four_rows, avx2._mm256_madd_epi16(pixels, w));
                }
                let cut = avx2._mm256_srai_epi32::<8>(four_rows);
                let w = avx2._mm256_shuffle_epi8(four(simd, w_y, 4 * rows), order);
                total = avx2._mm256_add_epi32(total, avx2._mm256_madd_epi16(cut, w));
            }
            let values: [i32; 8] = cast(total);
            *sum = [values.iter().sum(), 0, 0, 0];
        }
    }

    /// Four bytes, four times.
    trait Repeated {
        fn repeated(self) -> [i8; 16];
    }

    impl Repeated for [i8; 4] {
        #[inline(always)]
        fn repeated(self) -> [i8; 16] {
            cast([self; 4])
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
        assert!(worst < 0.1 && rms < 0.03, "{interpolation:?} {stretch}: {worst}, {rms}");
    }

    #[test]
    fn vectors_sum_as_plain_loops_do_and_both_to_a_tenth_of_a_grey_level() {
        for (interpolation, stretch) in KERNELS {
            check::<1>(interpolation, stretch);
            check::<3>(interpolation, stretch);
        }
    }
}
