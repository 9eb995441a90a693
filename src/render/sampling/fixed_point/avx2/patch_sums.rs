//! Sums of eight pixels of a patch, and their values.

use super::super::inputs::Patch;
use super::positions::Eights;
use super::{colour, grey, near_grey};
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};

#[inline(always)]
pub fn colours<const TAPS: usize>(simd: V3, patch: &Patch, eight: &Eights) -> [__m256i; 4] {
    colour::colours::<TAPS>(simd, patch.source, patch.kernel, &eight.first, eight.phases)
}

#[inline(always)]
pub fn greys<const TAPS: usize>(simd: V3, patch: &Patch, eight: &Eights) -> __m256i {
    let Patch { source, kernel, .. } = *patch;
    let near = near_grey::greys::<TAPS>(simd, source, kernel, cast(eight.corner), eight.phases);
    if let Some(sums) = near {
        return sums;
    }
    grey::greys::<TAPS>(simd, source, kernel, &eight.first, eight.phases)
}

/// What sums are as numbers.
#[inline(always)]
pub fn numbers(simd: V3, sums: __m256i, missing: __m256i, scale: __m256) -> __m256 {
    let whole = simd.avx2._mm256_add_epi32(sums, missing);
    simd.avx
        ._mm256_mul_ps(simd.avx._mm256_cvtepi32_ps(whole), scale)
}
