//! Weights of a pixel under a kernel.

use super::lanes::Eight;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::__m256i;
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Taps of the kernel, known at compile time or not (0).
#[inline(always)]
pub fn taps<const TAPS: usize>(kernel: &Kernel) -> usize {
    match TAPS {
        0 => kernel.taps(),
        taps => taps,
    }
}

/// Weights along u and v of pixel `k`, those along u padded with zeros.
#[inline(always)]
pub fn weights<const TAPS: usize>(
    kernel: &Kernel,
    [s, t]: [Eight<i32>; 2],
    k: usize,
) -> (&[i16], &[i16]) {
    let taps = taps::<TAPS>(kernel);
    let row = Kernel::padded_taps(taps);
    let of = |phase: i32| &kernel.all_integer_weights()[phase as usize * row..][..row];
    (of(s[k]), &of(t[k])[..taps])
}

/// Four weights from `at`; zeros beyond the last.
#[inline(always)]
pub fn four_of(weights: &[i16], at: usize) -> i64 {
    if at >= weights.len() {
        return 0;
    }
    let w = &weights[at..at + 4];
    cast([w[0], w[1], w[2], w[3]])
}

/// Four weights from `at`, repeated in all lanes.
#[inline(always)]
pub fn four(simd: V3, weights: &[i16], at: usize) -> __m256i {
    simd.avx._mm256_set1_epi64x(four_of(weights, at))
}
