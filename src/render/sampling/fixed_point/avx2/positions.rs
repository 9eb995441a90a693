//! Where the kernels of a row of a patch lie.

use super::super::inputs::{Patch, reach};
use super::lanes::Eight;
use super::weights::taps;
use crate::numerics::kernel::Kernel;
use crate::numerics::simd_dispatch;
use crate::render::warp::local_polynomial::Lanes;
use crate::render::warp::patches::{EIGHT, PATCH, SCALE};
use arrayvec::ArrayVec;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m256, __m256i};
use std::ops::Range;

/// Eights of columns of a patch.
pub const EIGHTS: usize = PATCH / EIGHT;

/// Eight columns of a patch.
pub struct Columns {
    /// The first of them.
    pub first: usize,
    /// Those that are meant.
    pub own: Range<usize>,
    /// The patch's coordinates.
    pub x: [f32; EIGHT],
}

/// Columns of a patch, eight at a time. Where eight do not fit any more, some are done again.
#[inline(always)]
pub fn eights(simd: V3, columns: &Range<usize>) -> ArrayVec<Columns, EIGHTS> {
    let Range { start, end } = *columns;
    let last = reach(columns).end - EIGHT;
    let mut all = ArrayVec::new();
    for from in (start..end).step_by(EIGHT) {
        let first = from.min(last);
        all.push(Columns {
            first,
            own: first.max(start)..(first + EIGHT).min(end),
            x: cast(x_of(simd, first)),
        });
    }
    all
}

/// The patch's coordinates of eight columns.
#[inline(always)]
fn x_of(simd: V3, first: usize) -> __m256 {
    let avx = simd.avx;
    let steps: __m256 = cast([0.0f32, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]);
    let column = avx._mm256_add_ps(steps, avx._mm256_set1_ps(first as f32));
    avx._mm256_sub_ps(
        avx._mm256_mul_ps(column, avx._mm256_set1_ps(SCALE)),
        avx._mm256_set1_ps(1.0),
    )
}

/// Where eight kernels lie: aligned, as what crosses lines of the cache must reach it before it can
/// be read again.
#[derive(Clone, Copy)]
#[repr(align(64))]
pub struct Eights {
    /// Columns and rows in which they begin.
    pub corner: [Eight<i32>; 2],
    /// The samples with which they begin.
    pub first: Eight<u32>,
    /// Their phases along u and v.
    pub phases: [Eight<i32>; 2],
}

pub const NOWHERE: Eights = Eights {
    corner: [[0; EIGHT]; 2],
    first: [0; EIGHT],
    phases: [[0; EIGHT]; 2],
};

/// Where the kernels of a row lie: of all its columns before the first is looked up, or each would
/// wait for its own.
#[inline(always)]
pub fn place<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &Patch,
    row: usize,
    columns: &[Columns],
    places: &mut [Eights; EIGHTS],
) {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let taps = taps::<TAPS>(patch.kernel);
    let phases = Kernel::integer_phases_of(taps);
    let before = avx._mm256_set1_epi32(Kernel::before_of(taps) as i32);
    let stride = avx._mm256_set1_epi32(patch.source.stride as i32);
    let line = line(simd, patch.lines, row);
    for (k, (columns, place)) in columns.iter().zip(places).enumerate() {
        let x: __m256 = cast(columns.x);
        let (left, s) = whole(simd, polynomial(simd, x, &line[..4]), phases);
        let (top, t) = whole(simd, polynomial(simd, x, &line[4..]), phases);
        let left = avx2._mm256_sub_epi32(left, before);
        let top = avx2._mm256_sub_epi32(top, before);
        let sample = match C {
            1 => left,
            _ => avx2._mm256_add_epi32(left, avx2._mm256_add_epi32(left, left)),
        };
        let first = avx2._mm256_add_epi32(avx2._mm256_mullo_epi32(top, stride), sample);
        *place = Eights {
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

/// Where the pixels of a row of a patch appear, by powers of x.
#[inline(always)]
fn line(simd: V3, lines: &[Lanes; 4], row: usize) -> Lanes {
    let avx = simd.avx;
    let y = avx._mm256_set1_ps(row as f32 * SCALE - 1.0);
    let mut at: __m256 = cast(lines[3]);
    for c in [lines[2], lines[1], lines[0]] {
        at = avx._mm256_add_ps(avx._mm256_mul_ps(at, y), cast(c));
    }
    cast(at)
}

#[inline(always)]
pub fn polynomial(simd: V3, x: __m256, c: &[f32]) -> __m256 {
    let avx = simd.avx;
    let (last, rest) = c.split_last().unwrap_or((&0.0, &[]));
    let mut value = avx._mm256_set1_ps(*last);
    for c in rest.iter().rev() {
        value = avx._mm256_add_ps(avx._mm256_mul_ps(value, x), avx._mm256_set1_ps(*c));
    }
    value
}

/// Numbers from 0 on cut to the whole numbers below them, and the phases of what was cut off.
#[inline(always)]
fn whole(simd: V3, value: __m256, phases: f32) -> (__m256i, __m256i) {
    let avx = simd.avx;
    let below = avx._mm256_cvttps_epi32(value);
    let rest = avx._mm256_sub_ps(value, avx._mm256_cvtepi32_ps(below));
    let phase = avx._mm256_mul_ps(rest, avx._mm256_set1_ps(phases));
    (below, avx._mm256_cvtps_epi32(phase))
}
