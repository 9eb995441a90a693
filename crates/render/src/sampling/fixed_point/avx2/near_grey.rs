//! Sums of eight grey pixels under four taps or six whose samples lie near one another: picked out
//! of a few rows of sixteen.
//!
//! The numbers are identical to those of [`super::grey::grey_sums`]: samples and rows that a pixel
//! has no part in have weight zero.

use super::super::inputs::PictureSamples;
use super::lanes::{Eight, truncated_pair};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Samples that are read of a row.
const ROW_SAMPLES: usize = 16;
/// Most rows by which one kernel may begin below another.
const MAX_ROWS_DOWN: usize = 2;

/// Index of a byte shuffle that gives zero, even if up to 127 is added.
const ZERO_BYTE: i8 = i8::MIN;

/// Sums of eight pixels whose kernels begin in these columns and rows; None if they lie too far
/// apart, or too near to the end of the picture, or have other taps.
#[inline(always)]
pub fn grey_sums<const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    [left, top]: [__m256i; 2],
    phases: [Eight<i32>; 2],
) -> Option<__m256i> {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let (columns, rows): (Eight<i32>, Eight<i32>) = (cast(left), cast(top));
    // Pixels follow one another: the outermost are the first and the last.
    let firsts = match TAPS {
        4 => [columns[0].min(columns[7]); 2],
        6 => [columns[0].min(columns[3]), columns[4].min(columns[7])],
        _ => return None,
    };
    let row = rows[0].min(rows[7]);
    let [a, b] = firsts;
    let across = avx2._mm256_sub_epi32(left, cast([a, a, a, a, b, b, b, b]));
    let down = avx2._mm256_sub_epi32(top, avx._mm256_set1_epi32(row));
    let near = avx2._mm256_and_si256(
        is_within(simd, across, ROW_SAMPLES - TAPS),
        is_within(simd, down, MAX_ROWS_DOWN),
    );
    if avx2._mm256_movemask_epi8(near) != -1 {
        return None;
    }
    let level = avx._mm256_testz_si256(down, down) == 1;
    let rows = SampleRows {
        source,
        firsts: firsts.map(|column| row as usize * source.stride + column as usize),
        pairs: (TAPS + if level { 0 } else { MAX_ROWS_DOWN }) / 2,
    };
    let last = firsts[0].max(firsts[1]) as usize + row as usize * source.stride;
    if last + (2 * rows.pairs - 1) * source.stride + ROW_SAMPLES > source.samples.len() {
        return None;
    }
    let sums = match TAPS {
        4 => four::grey_sums(simd, &rows, kernel, across, down, phases),
        _ => six::grey_sums(simd, &rows, kernel, across, down, phases),
    };
    Some(sums)
}

/// Mask of the numbers from 0 to `most`.
#[inline(always)]
fn is_within(simd: V3, numbers: __m256i, most: usize) -> __m256i {
    let avx2 = simd.avx2;
    let cut = avx2._mm256_min_epu32(numbers, simd.avx._mm256_set1_epi32(most as i32));
    avx2._mm256_cmpeq_epi32(cut, numbers)
}

/// Rows of sixteen samples in which those of the first four pixels and of the last four are.
struct SampleRows<'a> {
    source: PictureSamples<'a>,
    /// First samples of the first row.
    firsts: [usize; 2],
    /// Pairs of rows.
    pairs: usize,
}

impl SampleRows<'_> {
    /// Samples of a row, in both halves.
    #[inline(always)]
    fn row_twice(&self, simd: V3, half: usize, row: usize) -> __m256i {
        let at = self.firsts[half] + row * self.source.stride;
        let mut samples = [0; ROW_SAMPLES];
        samples.copy_from_slice(&self.source.samples[at..at + ROW_SAMPLES]);
        simd.avx2._mm256_broadcastsi128_si256(cast(samples))
    }
}

/// Under four taps: four pixels in a vector, two in each half.
mod four {
    use super::*;

    /// The lowest byte of the first of two numbers eight times, then that of the second.
    const FIRST_BYTES: [i8; 16] = [0, 0, 0, 0, 0, 0, 0, 0, 4, 4, 4, 4, 4, 4, 4, 4];
    /// Four samples from there on, each as a number of 16 bits.
    const SAMPLES: [i8; 16] = [
        0, ZERO_BYTE, 1, ZERO_BYTE, 2, ZERO_BYTE, 3, ZERO_BYTE, 0, ZERO_BYTE, 1, ZERO_BYTE, 2,
        ZERO_BYTE, 3, ZERO_BYTE,
    ];

    /// Four pixels.
    struct Four {
        /// Samples of a row that they take, as numbers of 16 bits.
        order: __m256i,
        w_x: __m256i,
        /// Weights of each pair of rows, for each pixel twice.
        w_y: [__m256i; 3],
    }

    #[inline(always)]
    pub fn grey_sums(
        simd: V3,
        rows: &SampleRows,
        kernel: &Kernel,
        across: __m256i,
        down: __m256i,
        [s, t]: [Eight<i32>; 2],
    ) -> __m256i {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let lower = Four::new(
            simd,
            avx2._mm256_permute4x64_epi64::<0b01_01_00_00>(across),
            avx._mm256_castsi256_si128(down),
            weights(simd, kernel, s, 0),
            weights(simd, kernel, t, 0),
        );
        let upper = Four::new(
            simd,
            avx2._mm256_permute4x64_epi64::<0b11_11_10_10>(across),
            avx2._mm256_extracti128_si256::<1>(down),
            weights(simd, kernel, s, 4),
            weights(simd, kernel, t, 4),
        );
        let mut sums = [avx._mm256_setzero_si256(); 2];
        for pair in 0..rows.pairs {
            let first = rows.row_twice(simd, 0, 2 * pair);
            let next = rows.row_twice(simd, 0, 2 * pair + 1);
            sums[0] = avx2._mm256_add_epi32(sums[0], lower.pair(simd, pair, first, next));
            sums[1] = avx2._mm256_add_epi32(sums[1], upper.pair(simd, pair, first, next));
        }
        // Pixels 0, 1, 4, 5 and 2, 3, 6, 7.
        let all = avx2._mm256_hadd_epi32(sums[0], sums[1]);
        avx2._mm256_permute4x64_epi64::<0b11_01_10_00>(all)
    }

    impl Four {
        #[inline(always)]
        fn new(simd: V3, columns: __m256i, down: __m128i, w_x: __m256i, w_y: __m256i) -> Self {
            let avx2 = simd.avx2;
            let first = avx2._mm256_shuffle_epi8(columns, cast([FIRST_BYTES; 2]));
            // Sixteen bits a row.
            let bits = avx2._mm256_slli_epi64::<4>(avx2._mm256_cvtepu32_epi64(down));
            let rest = avx2._mm256_sub_epi64(simd.avx._mm256_set1_epi64x(64), bits);
            let upper = avx2._mm256_sllv_epi64(w_y, bits);
            let lower = avx2._mm256_srlv_epi64(w_y, rest);
            Self {
                order: avx2._mm256_add_epi8(first, cast([SAMPLES; 2])),
                w_x,
                w_y: [
                    avx2._mm256_shuffle_epi32::<0xa0>(upper),
                    avx2._mm256_shuffle_epi32::<0xf5>(upper),
                    avx2._mm256_shuffle_epi32::<0xa0>(lower),
                ],
            }
        }

        /// Sums two rows: two numbers for each pixel.
        #[inline(always)]
        fn pair(&self, simd: V3, pair: usize, first: __m256i, next: __m256i) -> __m256i {
            let avx2 = simd.avx2;
            let first = avx2._mm256_shuffle_epi8(first, self.order);
            let next = avx2._mm256_shuffle_epi8(next, self.order);
            let first = avx2._mm256_madd_epi16(first, self.w_x);
            let next = avx2._mm256_madd_epi16(next, self.w_x);
            avx2._mm256_madd_epi16(truncated_pair(simd, first, next), self.w_y[pair])
        }
    }

    /// The weights of pixels `k` to `k + 3`.
    #[inline(always)]
    fn weights(simd: V3, kernel: &Kernel, phases: Eight<i32>, k: usize) -> __m256i {
        let all = kernel.all_integer_weights().as_chunks::<4>().0;
        simd.avx._mm256_set_epi64x(
            cast(all[phases[k + 3] as usize]),
            cast(all[phases[k + 2] as usize]),
            cast(all[phases[k + 1] as usize]),
            cast(all[phases[k] as usize]),
        )
    }
}

/// Under six taps, weights filled up to eight: two pixels in a vector, one in each half.
mod six {
    use super::*;

    /// Eight samples, each as a number of 16 bits. Those beyond the sixteenth, any others instead,
    /// weigh nothing.
    const SAMPLES: [i8; 16] = [
        0, ZERO_BYTE, 1, ZERO_BYTE, 2, ZERO_BYTE, 3, ZERO_BYTE, 4, ZERO_BYTE, 5, ZERO_BYTE, 6,
        ZERO_BYTE, 7, ZERO_BYTE,
    ];
    /// All bytes in their order.
    const BYTES: [i8; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];

    /// Two pixels side by side.
    struct Two {
        /// Samples of a row that they take, as numbers of 16 bits.
        order: __m256i,
        w_x: __m256i,
        /// Weights of the rows.
        w_y: __m256i,
    }

    /// Pixels 0 and 2 of four in the lower half, 1 and 3 in the upper one.
    struct Four {
        twos: [Two; 2],
        /// Weights of each pair of rows, for each pixel twice.
        w_y: [__m256i; 4],
    }

    #[inline(always)]
    pub fn grey_sums(
        simd: V3,
        rows: &SampleRows,
        kernel: &Kernel,
        across: __m256i,
        down: __m256i,
        phases: [Eight<i32>; 2],
    ) -> __m256i {
        let (avx, avx2) = (simd.avx, simd.avx2);
        let lower = Four::new(simd, kernel, across, down, &phases, 0);
        let upper = Four::new(simd, kernel, across, down, &phases, 4);
        let mut sums = [avx._mm256_setzero_si256(); 2];
        for pair in 0..rows.pairs {
            sums[0] = avx2._mm256_add_epi32(sums[0], lower.pair(simd, rows, 0, pair));
            sums[1] = avx2._mm256_add_epi32(sums[1], upper.pair(simd, rows, 1, pair));
        }
        // Pixels 0, 2, 4, 6 and 1, 3, 5, 7.
        let all = avx2._mm256_hadd_epi32(sums[0], sums[1]);
        avx2._mm256_permutevar8x32_epi32(all, cast([0, 4, 1, 5, 2, 6, 3, 7]))
    }

    impl Two {
        /// Pixels `k` and `k + 1`.
        #[inline(always)]
        fn new(
            simd: V3,
            kernel: &Kernel,
            across: __m256i,
            down: __m256i,
            [s, t]: &[Eight<i32>; 2],
            k: usize,
        ) -> Self {
            let avx2 = simd.avx2;
            let (own, next) = (k as i32, k as i32 + 1);
            let lanes: __m256i = cast([own, own, own, own, next, next, next, next]);
            let zero: __m256i = simd.avx._mm256_setzero_si256();
            let columns = avx2._mm256_permutevar8x32_epi32(across, lanes);
            let columns = avx2._mm256_shuffle_epi8(columns, zero);
            let rows = avx2._mm256_permutevar8x32_epi32(down, lanes);
            let rows = avx2._mm256_shuffle_epi8(rows, zero);
            // Two bytes a row; below the first byte there is nothing.
            let bytes = avx2._mm256_sub_epi8(cast([BYTES; 2]), avx2._mm256_add_epi8(rows, rows));
            Self {
                order: avx2._mm256_add_epi8(columns, cast([SAMPLES; 2])),
                w_x: weights(simd, kernel, s[k], s[k + 1]),
                w_y: avx2._mm256_shuffle_epi8(weights(simd, kernel, t[k], t[k + 1]), bytes),
            }
        }

        /// The sums of a row: twice a and b of each pixel, to be added.
        #[inline(always)]
        fn row(&self, simd: V3, samples: __m256i) -> __m256i {
            let own = simd.avx2._mm256_shuffle_epi8(samples, self.order);
            simd.avx2._mm256_madd_epi16(own, self.w_x)
        }
    }

    impl Four {
        /// Pixels `k` to `k + 3`.
        #[inline(always)]
        fn new(
            simd: V3,
            kernel: &Kernel,
            across: __m256i,
            down: __m256i,
            phases: &[Eight<i32>; 2],
            k: usize,
        ) -> Self {
            let avx2 = simd.avx2;
            let first = Two::new(simd, kernel, across, down, phases, k);
            let last = Two::new(simd, kernel, across, down, phases, k + 2);
            let upper = avx2._mm256_unpacklo_epi32(first.w_y, last.w_y);
            let lower = avx2._mm256_unpackhi_epi32(first.w_y, last.w_y);
            Self {
                twos: [first, last],
                w_y: [
                    avx2._mm256_shuffle_epi32::<0b01_01_00_00>(upper),
                    avx2._mm256_shuffle_epi32::<0b11_11_10_10>(upper),
                    avx2._mm256_shuffle_epi32::<0b01_01_00_00>(lower),
                    avx2._mm256_shuffle_epi32::<0b11_11_10_10>(lower),
                ],
            }
        }

        /// Sums two rows: two numbers for each pixel.
        #[inline(always)]
        fn pair(&self, simd: V3, rows: &SampleRows, half: usize, pair: usize) -> __m256i {
            let first = self.row(simd, rows.row_twice(simd, half, 2 * pair));
            let next = self.row(simd, rows.row_twice(simd, half, 2 * pair + 1));
            let cut = truncated_pair(simd, first, next);
            simd.avx2._mm256_madd_epi16(cut, self.w_y[pair])
        }

        /// The sums of a row: a and b of each pixel.
        #[inline(always)]
        fn row(&self, simd: V3, samples: __m256i) -> __m256i {
            let avx2 = simd.avx2;
            let (first, last) = (
                self.twos[0].row(simd, samples),
                self.twos[1].row(simd, samples),
            );
            avx2._mm256_add_epi32(
                avx2._mm256_unpacklo_epi64(first, last),
                avx2._mm256_unpackhi_epi64(first, last),
            )
        }
    }

    /// The weights of two phases.
    #[inline(always)]
    fn weights(simd: V3, kernel: &Kernel, first: i32, next: i32) -> __m256i {
        let all = kernel.all_integer_weights().as_chunks::<8>().0;
        simd.avx
            ._mm256_set_m128i(cast(all[next as usize]), cast(all[first as usize]))
    }
}
