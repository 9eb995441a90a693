//! Reading samples into vectors, and summing what vectors hold.

use super::super::inputs::PictureSamples;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};

/// Index of a byte shuffle that gives zero.
pub const ZERO_BYTE: i8 = -1;

/// Eight kernels' first samples, or their phases along u or v.
pub type Eight<T> = [T; 8];

/// Reads the `N` samples from `at`.
#[inline(always)]
pub fn read<const N: usize>(samples: &[u8], at: usize) -> [u8; N] {
    let mut read = [0; N];
    read.copy_from_slice(&samples[at..at + N]);
    read
}

/// Complement `128 − w`.
#[inline(always)]
pub fn complement(simd: V3, w: __m256i) -> __m256i {
    simd.avx2
        ._mm256_sub_epi32(simd.avx._mm256_set1_epi32(128), w)
}

/// Weights `(128 − w, w)` in the halves of each number: a product of it and a number up to 128 has
/// no carry from half to half, as 128 · 128 = 2¹⁴.
#[inline(always)]
pub fn weight_pairs(simd: V3, w: __m256i) -> __m256i {
    let avx2 = simd.avx2;
    avx2._mm256_or_si256(complement(simd, w), avx2._mm256_slli_epi32::<16>(w))
}

/// Samples from a row on and from the next one on, as many of both.
#[inline(always)]
pub fn two_rows(source: PictureSamples<'_>) -> [&[u8]; 2] {
    let count = source.samples.len().saturating_sub(source.stride);
    let lower = &source.samples[source.stride..];
    [&source.samples[..count], &lower[..count]]
}

/// Adds the lower half and the upper one.
#[inline(always)]
pub fn sum_of_halves(simd: V3, all: __m256i) -> __m128i {
    let lower = simd.avx._mm256_castsi256_si128(all);
    let upper = simd.avx2._mm256_extracti128_si256::<1>(all);
    simd.sse2._mm_add_epi32(lower, upper)
}

/// Two rows, truncated, in the halves of each number.
#[inline(always)]
pub fn truncated_pair(simd: V3, upper: __m256i, lower: __m256i) -> __m256i {
    let avx2 = simd.avx2;
    avx2._mm256_blend_epi16::<0b1010_1010>(
        avx2._mm256_srai_epi32::<8>(upper),
        avx2._mm256_slli_epi32::<8>(lower),
    )
}
