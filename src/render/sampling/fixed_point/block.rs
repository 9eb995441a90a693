//! Rows of a patch of the chart, from where they appear in a frame to the bytes of the panorama,
//! without a stop between.
//!
//! The numbers are those of [`crate::render::sampling::point_batch::Run`], to the bit.

use super::avx2::Eight;
use super::{
    Block, LitBlock, PARTS, Part, Patch, avx2, bits, missing, reach, rounding, scale, window,
};
use crate::numerics::kernel::Kernel;
use crate::numerics::simd_dispatch;
use crate::render::sampling::patch_light::Light;
use crate::render::sampling::point_batch::RUN;
use crate::render::warp::local_polynomial::Lanes;
use crate::render::warp::patches::{EIGHT, PATCH, SCALE};
use arrayvec::ArrayVec;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256, __m256i};
use std::ops::Range;

/// Eights of columns of a patch.
const EIGHTS: usize = PATCH / EIGHT;

/// Eight columns of a patch.
struct Columns {
    /// The first of them.
    first: usize,
    /// Those that are meant.
    own: Range<usize>,
    /// The patch's coordinates.
    x: [f32; EIGHT],
}

/// See [`fn@crate::render::sampling::fixed_point::block`].
#[inline(always)]
pub fn plain<const C: usize, const TAPS: usize>(simd: V3, block: &Block, pixels: &mut [&mut [u8]]) {
    let patch = &block.patch;
    let columns = eights(simd, &block.columns);
    let mut places = [NOWHERE; EIGHTS];
    for (n, pixels) in pixels.iter_mut().enumerate() {
        place::<C, TAPS>(simd, patch, block.row + n, &columns, &mut places);
        for (columns, places) in columns.iter().zip(&places) {
            let eight = match C {
                3 => colour_bytes::<TAPS>(simd, colours::<TAPS>(simd, patch, places)),
                _ => grey_bytes::<TAPS>(simd, greys::<TAPS>(simd, patch, places)),
            };
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// See [`crate::render::sampling::fixed_point::lit_block`].
#[inline(always)]
pub fn lit<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &LitBlock<L>,
    pixels: &mut [&mut [u8]],
) {
    match block.parts {
        [part] => alone::<C, L, TAPS>(simd, block, part, pixels),
        _ => mixed::<C, L, TAPS>(simd, block, pixels),
    }
}

/// A block with one part.
#[inline(always)]
fn alone<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &LitBlock<L>,
    part: &Part,
    pixels: &mut [&mut [u8]],
) {
    let columns = eights(simd, &block.columns);
    let rows = pixels.iter_mut().zip(block.corrections.chunks_exact(RUN));
    for (n, (pixels, corrections)) in rows.enumerate() {
        let row = Row::of::<C, TAPS>(simd, part, block.row + n, &columns);
        for (k, columns) in columns.iter().enumerate() {
            let corrections = &corrections[block.first + columns.first..][..EIGHT];
            let values = row.values::<C, TAPS>(simd, k, cast(columns.x));
            let eight = corrected::<C, L>(simd, values, corrections);
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// A block with several parts.
#[inline(always)]
fn mixed<const C: usize, const L: usize, const TAPS: usize>(
    simd: V3,
    block: &LitBlock<L>,
    pixels: &mut [&mut [u8]],
) {
    let avx = simd.avx;
    let columns = eights(simd, &block.columns);
    let rows = pixels.iter_mut().zip(block.corrections.chunks_exact(RUN));
    let mut parts: ArrayVec<Row, PARTS> = ArrayVec::new();
    for (n, ((pixels, corrections), t)) in rows.zip(block.down).enumerate() {
        parts.clear();
        for part in block.parts {
            parts.push(Row::of::<C, TAPS>(simd, part, block.row + n, &columns));
        }
        for (k, columns) in columns.iter().enumerate() {
            let at = block.first + columns.first;
            let corrections = &corrections[at..][..EIGHT];
            let mut s = [0.0; EIGHT];
            s.copy_from_slice(&block.across[at..][..EIGHT]);
            let mut sums = [avx._mm256_setzero_ps(); 4];
            let mut all = avx._mm256_setzero_ps();
            for row in &parts {
                let weights = bilinear(simd, cast(s), *t, row.part.corners);
                let values = row.values::<C, TAPS>(simd, k, cast(columns.x));
                all = avx._mm256_add_ps(all, weights);
                add::<C>(simd, &mut sums, values, weights);
            }
            let inverse = avx._mm256_div_ps(avx._mm256_set1_ps(1.0), all);
            let mut means = [avx._mm256_setzero_ps(); 4];
            add::<C>(simd, &mut means, sums, inverse);
            let eight = corrected::<C, L>(simd, means, corrections);
            put::<C>(simd, eight, columns, block.first, pixels);
        }
    }
}

/// Between corners before and after along `s`, the upper two and then the lower two along `t`: what
/// is given at them, bilinear.
#[inline(always)]
fn bilinear(simd: V3, s: __m256, t: f32, corners: [f32; 4]) -> __m256 {
    let avx = simd.avx;
    let one = avx._mm256_set1_ps(1.0);
    let (up, down) = (avx._mm256_set1_ps(1.0 - t), avx._mm256_set1_ps(t));
    let rest = avx._mm256_sub_ps(one, s);
    let (a, b) = (avx._mm256_mul_ps(rest, up), avx._mm256_mul_ps(s, up));
    let (c, d) = (avx._mm256_mul_ps(rest, down), avx._mm256_mul_ps(s, down));
    let of = |w: __m256, corner: f32| avx._mm256_mul_ps(w, avx._mm256_set1_ps(corner));
    let sum = avx._mm256_add_ps(of(a, corners[0]), of(b, corners[1]));
    let sum = avx._mm256_add_ps(sum, of(c, corners[2]));
    avx._mm256_add_ps(sum, of(d, corners[3]))
}

/// A row of a part.
struct Row<'a> {
    part: &'a Part<'a>,
    places: [Eights; EIGHTS],
    light: [f32; 3],
}

impl<'a> Row<'a> {
    #[inline(always)]
    fn of<const C: usize, const TAPS: usize>(
        simd: V3,
        part: &'a Part<'a>,
        row: usize,
        columns: &[Columns],
    ) -> Self {
        let mut places = [NOWHERE; EIGHTS];
        place::<C, TAPS>(simd, &part.patch, row, columns, &mut places);
        Self {
            part,
            places,
            light: part.light.unwrap_or(Light::even(1.0)).row(row),
        }
    }

    /// What the frame shows in the k-th eight columns, at `x`, light undone:
    /// `((sum + missing) scale − bias) light`. Of the pixels k and k + 4 in the halves of the k-th
    /// vector in colour, of all in the first one if they are grey.
    #[inline(always)]
    fn values<const C: usize, const TAPS: usize>(
        &self,
        simd: V3,
        k: usize,
        x: __m256,
    ) -> [__m256; 4] {
        let (patch, places) = (&self.part.patch, &self.places[k]);
        let light = polynomial(simd, x, &self.light);
        let bias = simd.avx._mm256_set1_ps(self.part.bias);
        if C == 3 {
            let [a, b, c, d] = colours::<TAPS>(simd, patch, places);
            [
                undone::<TAPS>(simd, a, bias, four_times(simd, light, 0)),
                undone::<TAPS>(simd, b, bias, four_times(simd, light, 1)),
                undone::<TAPS>(simd, c, bias, four_times(simd, light, 2)),
                undone::<TAPS>(simd, d, bias, four_times(simd, light, 3)),
            ]
        } else {
            let sums = greys::<TAPS>(simd, patch, places);
            let nothing = simd.avx._mm256_setzero_ps();
            let values = undone::<TAPS>(simd, sums, bias, light);
            [values, nothing, nothing, nothing]
        }
    }
}

/// Adds values times what is one number for each of eight pixels to sums of them.
#[inline(always)]
fn add<const C: usize>(simd: V3, sums: &mut [__m256; 4], values: [__m256; 4], factors: __m256) {
    let avx = simd.avx;
    if C == 3 {
        for k in 0..4 {
            let own = avx._mm256_mul_ps(four_times(simd, factors, k as i32), values[k]);
            sums[k] = avx._mm256_add_ps(sums[k], own);
        }
    } else {
        sums[0] = avx._mm256_add_ps(sums[0], avx._mm256_mul_ps(factors, values[0]));
    }
}

/// Values with corrections added, as pixels, alpha last and full.
#[inline(always)]
fn corrected<const C: usize, const L: usize>(
    simd: V3,
    values: [__m256; 4],
    corrections: &[[f32; L]],
) -> __m256i {
    let avx = simd.avx;
    if C == 3 {
        let a = corrected_colour(simd, values[0], corrections, 0);
        let b = corrected_colour(simd, values[1], corrections, 1);
        let c = corrected_colour(simd, values[2], corrections, 2);
        let d = corrected_colour(simd, values[3], corrections, 3);
        let all = avx2::bytes(simd, [a, b, c, d]);
        let alpha = avx._mm256_set1_epi32(0xff00_0000_u32.cast_signed());
        return simd.avx2._mm256_or_si256(all, alpha);
    }
    let mut own = [0.0; EIGHT];
    for (own, correction) in own.iter_mut().zip(corrections) {
        *own = correction[0];
    }
    let value = avx._mm256_add_ps(values[0], cast(own));
    grey_pixels(simd, avx._mm256_cvtps_epi32(value))
}

/// Sums as numbers, light undone.
#[inline(always)]
fn undone<const TAPS: usize>(simd: V3, sums: __m256i, bias: __m256, light: __m256) -> __m256 {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let value = numbers(simd, sums, missing, avx._mm256_set1_ps(scale(TAPS)));
    avx._mm256_mul_ps(avx._mm256_sub_ps(value, bias), light)
}

/// What is one number for each of eight pixels, four times for the pixels k and k + 4.
#[inline(always)]
fn four_times(simd: V3, eight: __m256, k: i32) -> __m256 {
    let lanes: __m256i = cast([[k; 4], [k + 4; 4]]);
    simd.avx2._mm256_permutevar8x32_ps(eight, lanes)
}

/// Values of the pixels k and k + 4 in colour with corrections added, as whole numbers.
#[inline(always)]
fn corrected_colour<const L: usize>(
    simd: V3,
    values: __m256,
    corrections: &[[f32; L]],
    k: usize,
) -> __m256i {
    let avx = simd.avx;
    let mut own = [[0.0; 4]; 2];
    for (own, correction) in own.iter_mut().zip([&corrections[k], &corrections[k + 4]]) {
        for (own, correction) in own.iter_mut().zip(correction) {
            *own = *correction;
        }
    }
    avx._mm256_cvtps_epi32(avx._mm256_add_ps(values, cast(own)))
}

/// See [`crate::render::sampling::fixed_point::values`].
#[inline(always)]
pub fn values<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &Patch,
    row: usize,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) {
    let avx = simd.avx;
    let missing = avx._mm256_set1_epi32(missing(TAPS));
    let scale = avx._mm256_set1_ps(scale(TAPS));
    let columns = eights(simd, &columns);
    let mut places = [NOWHERE; EIGHTS];
    place::<C, TAPS>(simd, patch, row, &columns, &mut places);
    for (columns, places) in columns.iter().zip(&places) {
        let own = &mut values[columns.first..columns.first + EIGHT];
        if C == 3 {
            let [a, b, c, d] = colours::<TAPS>(simd, patch, places);
            [own[0], own[4]] = cast(numbers(simd, a, missing, scale));
            [own[1], own[5]] = cast(numbers(simd, b, missing, scale));
            [own[2], own[6]] = cast(numbers(simd, c, missing, scale));
            [own[3], own[7]] = cast(numbers(simd, d, missing, scale));
        } else {
            let sums = greys::<TAPS>(simd, patch, places);
            let all: [f32; EIGHT] = cast(numbers(simd, sums, missing, scale));
            for (own, value) in own.iter_mut().zip(all) {
                *own = [value, 0.0, 0.0, 0.0];
            }
        }
    }
}

/// Columns of a patch, eight at a time. Where eight do not fit any more, some are done again.
#[inline(always)]
fn eights(simd: V3, columns: &Range<usize>) -> ArrayVec<Columns, EIGHTS> {
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

/// Puts those of eight pixels that are meant into a row of the tile, where the patch begins at
/// column `patch`.
#[inline(always)]
fn put<const C: usize>(
    simd: V3,
    eight: __m256i,
    Columns { first, own, .. }: &Columns,
    patch: usize,
    pixels: &mut [u8],
) {
    let pixel = C + 1;
    if own.len() < EIGHT {
        let there = &mut pixels[(patch + own.start) * pixel..(patch + own.end) * pixel];
        let eight: [u8; 32] = cast(eight);
        let eight = &eight[(own.start - first) * pixel..];
        for (there, own) in there.iter_mut().zip(eight) {
            *there = *own;
        }
        return;
    }
    let there = &mut pixels[(patch + first) * pixel..][..EIGHT * pixel];
    if C == 1 {
        let eight: [u8; 16] = cast(simd.avx._mm256_castsi256_si128(eight));
        there.copy_from_slice(&eight);
    } else {
        let eight: [u8; 32] = cast(eight);
        there.copy_from_slice(&eight);
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

/// What sums are as numbers.
#[inline(always)]
fn numbers(simd: V3, sums: __m256i, missing: __m256i, scale: __m256) -> __m256 {
    let whole = simd.avx2._mm256_add_epi32(sums, missing);
    simd.avx
        ._mm256_mul_ps(simd.avx._mm256_cvtepi32_ps(whole), scale)
}

#[inline(always)]
fn colours<const TAPS: usize>(simd: V3, patch: &Patch, eight: &Eights) -> [__m256i; 4] {
    avx2::colours::<TAPS>(simd, patch.source, patch.kernel, &eight.first, eight.phases)
}

#[inline(always)]
fn greys<const TAPS: usize>(simd: V3, patch: &Patch, eight: &Eights) -> __m256i {
    let Patch { source, kernel, .. } = *patch;
    let near = window::greys::<TAPS>(simd, source, kernel, cast(eight.corner), eight.phases);
    if let Some(sums) = near {
        return sums;
    }
    avx2::greys::<TAPS>(simd, source, kernel, &eight.first, eight.phases)
}

/// Where eight kernels lie: aligned, as what crosses lines of the cache must reach it before it can
/// be read again.
#[derive(Clone, Copy)]
#[repr(align(64))]
struct Eights {
    /// Columns and rows in which they begin.
    corner: [Eight<i32>; 2],
    /// The samples with which they begin.
    first: Eight<u32>,
    /// Their phases along u and v.
    phases: [Eight<i32>; 2],
}

const NOWHERE: Eights = Eights {
    corner: [[0; EIGHT]; 2],
    first: [0; EIGHT],
    phases: [[0; EIGHT]; 2],
};

/// Where the kernels of a row lie: of all its columns before the first is looked up, or each would
/// wait for its own.
#[inline(always)]
fn place<const C: usize, const TAPS: usize>(
    simd: V3,
    patch: &Patch,
    row: usize,
    columns: &[Columns],
    places: &mut [Eights; EIGHTS],
) {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let taps = avx2::taps::<TAPS>(patch.kernel);
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

#[inline(always)]
fn polynomial(simd: V3, x: __m256, c: &[f32]) -> __m256 {
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

/// The pixels whose sums are those of k and k + 4 in the halves of the k-th vector, alpha last and
/// full.
#[inline(always)]
fn colour_bytes<const TAPS: usize>(simd: V3, sums: [__m256i; 4]) -> __m256i {
    let (bits, half) = (bits(TAPS), rounding(TAPS));
    let more = cast([[half, half, half, 255 << bits]; 2]);
    avx2::packed(simd, sums, more, bits)
}

/// The same of grey pixels.
#[inline(always)]
fn grey_bytes<const TAPS: usize>(simd: V3, sums: __m256i) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let count: __m128i = cast([bits(TAPS), 0, 0, 0]);
    let value = avx2._mm256_add_epi32(sums, avx._mm256_set1_epi32(rounding(TAPS)));
    grey_pixels(simd, avx2._mm256_sra_epi32(value, count))
}

/// Eight grey pixels of these values, alpha last and full.
#[inline(always)]
fn grey_pixels(simd: V3, value: __m256i) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let value = avx2._mm256_max_epi32(value, avx._mm256_setzero_si256());
    let value = avx2._mm256_min_epi32(value, avx._mm256_set1_epi32(255));
    let pixel = avx2._mm256_or_si256(value, avx._mm256_set1_epi32(255 << 8));
    // The lower 16 bits of each number.
    let lower = avx._mm256_castsi256_si128(pixel);
    let upper = avx2._mm256_extracti128_si256::<1>(pixel);
    let packed = simd.sse4_1._mm_packus_epi32(lower, upper);
    avx._mm256_castsi128_si256(packed)
}
