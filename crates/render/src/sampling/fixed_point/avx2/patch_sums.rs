//! Sums of eight pixels of a patch, and their values.

use super::super::inputs::SampledPatch;
use super::positions::KernelGroup;
use super::{colour, grey, near_grey};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};

#[inline(always)]
pub fn colour_sums<const TAPS: usize>(
    simd: V3,
    patch: &SampledPatch,
    eight: &KernelGroup,
) -> [__m256i; 4] {
    colour::colour_sums::<TAPS>(simd, patch.source, patch.kernel, &eight.first, eight.phases)
}

#[inline(always)]
pub fn grey_sums<const TAPS: usize>(
    simd: V3,
    patch: &SampledPatch,
    eight: &KernelGroup,
) -> __m256i {
    let SampledPatch { source, kernel, .. } = *patch;
    let near = near_grey::grey_sums::<TAPS>(simd, source, kernel, cast(eight.corner), eight.phases);
    if let Some(sums) = near {
        return sums;
    }
    grey::grey_sums::<TAPS>(simd, source, kernel, &eight.first, eight.phases)
}

/// Converts sums to numbers.
#[inline(always)]
pub fn to_floats(simd: V3, sums: __m256i, missing: __m256i, scale: __m256) -> __m256 {
    let whole = simd.avx2._mm256_add_epi32(sums, missing);
    simd.avx
        ._mm256_mul_ps(simd.avx._mm256_cvtepi32_ps(whole), scale)
}
