//! Reading samples into vectors, and summing what vectors hold.

use super::super::inputs::Source;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};

/// In an order of bytes: nothing.
pub const NO: i8 = -1;

/// Where kernels begin and their phases along u and v, eight of each.
pub type Eight<T> = [T; 8];

/// The `N` samples from `at`.
#[inline(always)]
pub fn read<const N: usize>(samples: &[u8], at: usize) -> [u8; N] {
    let mut read = [0; N];
    read.copy_from_slice(&samples[at..at + N]);
    read
}

/// `128 − w`.
#[inline(always)]
pub fn rest(simd: V3, w: __m256i) -> __m256i {
    simd.avx2
        ._mm256_sub_epi32(simd.avx._mm256_set1_epi32(128), w)
}

/// `(128 − w, w)` in the halves of each number: a product of it and a number up to 128 has no carry
/// from half to half, as 128 · 128 = 2¹⁴.
#[inline(always)]
pub fn pair(simd: V3, w: __m256i) -> __m256i {
    let avx2 = simd.avx2;
    avx2._mm256_or_si256(rest(simd, w), avx2._mm256_slli_epi32::<16>(w))
}

/// The samples from a row on and from the next one on, as many of both.
#[inline(always)]
pub fn two_rows(source: Source<'_>) -> [&[u8]; 2] {
    let count = source.samples.len().saturating_sub(source.stride);
    let lower = &source.samples[source.stride..];
    [&source.samples[..count], &lower[..count]]
}

/// The lower half and the upper one, added.
#[inline(always)]
pub fn sum_of_halves(simd: V3, all: __m256i) -> __m128i {
    let lower = simd.avx._mm256_castsi256_si128(all);
    let upper = simd.avx2._mm256_extracti128_si256::<1>(all);
    simd.sse2._mm_add_epi32(lower, upper)
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
