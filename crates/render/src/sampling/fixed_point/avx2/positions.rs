//! Positions of the kernels of a row of a patch.

use super::super::inputs::{SampledPatch, reach};
use super::lanes::Eight;
use super::weights::taps;
use crate::warp::local_polynomial::PatchCoefficients;
use crate::warp::patches::{LANES, PATCH_EDGE, PATCH_SCALE};
use arrayvec::ArrayVec;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};
use std::ops::Range;
use tunnelstitch_geometry::numerics::kernel::Kernel;
use tunnelstitch_geometry::numerics::simd_dispatch;

/// Groups of eight columns of a patch.
pub const PATCH_GROUPS: usize = PATCH_EDGE / LANES;

/// Eight columns of a patch.
pub struct ColumnGroup {
    /// The first of them.
    pub first: usize,
    /// Those that are drawn.
    pub own: Range<usize>,
    /// The patch's coordinates.
    pub x: [f32; LANES],
}

/// Divides columns of a patch into groups of eight. Where eight do not fit any more, some are
/// processed again.
#[inline(always)]
pub fn column_groups(simd: V3, columns: &Range<usize>) -> ArrayVec<ColumnGroup, PATCH_GROUPS> {
    let Range { start, end } = *columns;
    let last = reach(columns).end - LANES;
    let mut all = ArrayVec::new();
    for from in (start..end).step_by(LANES) {
        let first = from.min(last);
        all.push(ColumnGroup {
            first,
            own: first.max(start)..(first + LANES).min(end),
            x: cast(patch_x(simd, first)),
        });
    }
    all
}

/// Coordinates of eight columns in the patch.
#[inline(always)]
fn patch_x(simd: V3, first: usize) -> __m256 {
    let avx = simd.avx;
    let steps: __m256 = cast([0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let column = avx._mm256_add_ps(steps, avx._mm256_set1_ps(first as f32));
    avx._mm256_sub_ps(
        avx._mm256_mul_ps(column, avx._mm256_set1_ps(PATCH_SCALE)),
        avx._mm256_set1_ps(1.0),
    )
}

/// Positions of eight kernels, aligned: a store that crosses lines of the cache delays the next
/// read of it.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct KernelGroup {
    /// Columns and rows where they begin.
    pub corner: [Eight<i32>; 2],
    /// Samples where they begin.
    pub first: Eight<u32>,
    /// Phases along u and v.
    pub phases: [Eight<i32>; 2],
}

pub const EMPTY_GROUP: KernelGroup = KernelGroup {
    corner: [[0; LANES]; 2],
    first: [0; LANES],
    phases: [[0; LANES]; 2],
};

/// Finds the positions of a row's kernels: of all its columns before the first is sampled, or each
/// would wait for its own.
#[inline(always)]
pub fn find_positions<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &SampledPatch,
    row: usize,
    columns: &[ColumnGroup],
    places: &mut [KernelGroup; PATCH_GROUPS],
) {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let taps = taps::<TAPS>(patch.kernel);
    let phases = Kernel::integer_phases_of(taps);
    let before = avx._mm256_set1_epi32(Kernel::taps_before_of(taps) as i32);
    let stride = avx._mm256_set1_epi32(patch.source.stride as i32);
    let line = row_coefficients(simd, patch.lines, row);
    for (k, (columns, place)) in columns.iter().zip(places).enumerate() {
        let x: __m256 = cast(columns.x);
        let (left, s) = floor_and_phase(simd, evaluate_polynomial(simd, x, &line[..4]), phases);
        let (top, t) = floor_and_phase(simd, evaluate_polynomial(simd, x, &line[4..]), phases);
        let left = avx2._mm256_sub_epi32(left, before);
        let top = avx2._mm256_sub_epi32(top, before);
        let sample = match C {
            1 => left,
            _ => avx2._mm256_add_epi32(left, avx2._mm256_add_epi32(left, left)),
        };
        let first = avx2._mm256_add_epi32(avx2._mm256_mullo_epi32(top, stride), sample);
        *place = KernelGroup {
            corner: [cast(left), cast(top)],
            first: cast(first),
            phases: [cast(s), cast(t)],
        };
        // What the next rows need: sixteen pixels in colour take less than a line of the cache, or
        // little more.
        if k % 2 == 0 {
            let below = place.first[0] as usize + (taps + 1) * patch.source.stride;
            simd_dispatch::prefetch(simd, patch.source.samples, below);
        }
    }
}

/// Polynomials along a row of a patch, by powers of x.
#[inline(always)]
fn row_coefficients(simd: V3, lines: &[PatchCoefficients; 4], row: usize) -> PatchCoefficients {
    let avx = simd.avx;
    let y = avx._mm256_set1_ps(row as f32 * PATCH_SCALE - 1.0);
    let mut at: __m256 = cast(lines[3]);
    for c in [lines[2], lines[1], lines[0]] {
        at = avx._mm256_add_ps(avx._mm256_mul_ps(at, y), cast(c));
    }
    cast(at)
}

#[inline(always)]
pub fn evaluate_polynomial(simd: V3, x: __m256, c: &[f32]) -> __m256 {
    let avx = simd.avx;
    let (last, rest) = c.split_last().unwrap_or((&0.0, &[]));
    let mut value = avx._mm256_set1_ps(*last);
    for c in rest.iter().rev() {
        value = avx._mm256_add_ps(avx._mm256_mul_ps(value, x), avx._mm256_set1_ps(*c));
    }
    value
}

/// Splits numbers from 0 on into the whole numbers below them and the phases of the fractions.
#[inline(always)]
fn floor_and_phase(simd: V3, value: __m256, phases: f32) -> (__m256i, __m256i) {
    let avx = simd.avx;
    let below = avx._mm256_cvttps_epi32(value);
    let rest = avx._mm256_sub_ps(value, avx._mm256_cvtepi32_ps(below));
    let phase = avx._mm256_mul_ps(rest, avx._mm256_set1_ps(phases));
    (below, avx._mm256_cvtps_epi32(phase))
}
