//! Sums of 8-bit samples under a kernel, in whole numbers.
//!
//! Two taps along each axis: with the phases s, t in 1/128 px, `Σ = Σ_ij w_i(s) w_j(t) I_ij` with
//! `w = (128 − s, s)`, exact, in units of 2⁻¹⁴.
//!
//! More: weights in units of 2⁻¹⁴ ([`Kernel::integers`]). Rows are summed first, the first and the
//! last two of every four taps by themselves (a, b); these are cut to units of 2⁻⁶ and then summed
//! down the columns: `Σ = Σ_j w_j (⌊a_j/2⁸⌋ + ⌊b_j/2⁸⌋)`, in units of 2⁻²⁰. What cutting takes
//! away, half a unit of a and of b each in the mean, is given back at the end.
//!
//! The same numbers come out of vectors (AVX2) and of the plain loops of [`plain`], to the bit:
//! nothing is rounded but by the cut.

#[cfg(target_arch = "x86_64")]
mod avx2;
#[cfg(target_arch = "x86_64")]
mod block;
mod scalar;
#[cfg(target_arch = "x86_64")]
mod window;

use crate::numerics::kernel::Kernel;
#[cfg(target_arch = "x86_64")]
use crate::numerics::simd_dispatch;
use crate::render::sampling::patch_light::Light;
use crate::render::warp::local_polynomial::Lanes;
use crate::render::warp::patches::{EIGHT, PATCH};
use std::ops::Range;

/// Does the work with code made for the kernel's taps; 0 stands for any other number of them.
#[cfg(target_arch = "x86_64")]
macro_rules! by_taps {
    ($kernel:expr, |$simd:ident, $taps:ident| $work:expr) => {
        match $kernel.taps() {
            2 => by_taps!(2, $simd, $taps, $work),
            4 => by_taps!(4, $simd, $taps, $work),
            6 => by_taps!(6, $simd, $taps, $work),
            8 => by_taps!(8, $simd, $taps, $work),
            _ => by_taps!(0, $simd, $taps, $work),
        }
    };
    ($number:literal, $simd:ident, $taps:ident, $work:expr) => {{
        const $taps: usize = $number;
        simd_dispatch::avx2(
            #[inline(always)]
            |$simd| $work,
        )
    }};
}

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

/// Sums at each place, one lane a channel: colour in the first three, grey in the first. `C`: 1 or
/// 3 channels.
pub fn sums<const C: usize>(
    source: Source,
    kernel: &Kernel,
    places: Places,
    sums: &mut [[i32; 4]],
) {
    #[cfg(target_arch = "x86_64")]
    if by_taps!(kernel, |simd, TAPS| avx2::sums::<C, TAPS>(
        simd, source, kernel, places, sums
    )) {
        return;
    }
    scalar::sums::<C>(source, kernel, places, sums);
}

/// The nearest 8-bit samples of sums, alpha last and full.
pub fn pixels<const C: usize>(kernel: &Kernel, sums: &[[i32; 4]], pixels: &mut [u8]) {
    let bits = bits(kernel.taps());
    let mut more = [rounding(kernel.taps()); 4];
    more[C] = 255 << bits;
    #[cfg(target_arch = "x86_64")]
    if simd_dispatch::avx2(
        #[inline(always)]
        |simd| avx2::pixels::<C>(simd, sums, &more, bits, pixels),
    ) {
        return;
    }
    scalar::pixels::<C>(sums, &more, bits, pixels);
}

/// A patch of the chart that lies inside a frame, kernels and all.
#[derive(Clone, Copy)]
pub struct Patch<'a> {
    /// The frame.
    pub source: Source<'a>,
    /// The kernel, of two taps at least.
    pub kernel: &'a Kernel,
    /// Where its pixels appear, by powers of y.
    pub lines: &'a [Lanes; 4],
}

/// The columns of a patch that are looked at for the sake of these: whole eights.
pub fn reach(columns: &Range<usize>) -> Range<usize> {
    let start = columns.start.min(PATCH - EIGHT);
    start..columns.end.max(start + EIGHT)
}

/// Some columns of a patch, from one of its rows on.
pub struct Block<'a> {
    /// The patch.
    pub patch: Patch<'a>,
    /// Its first row that is meant.
    pub row: usize,
    /// The columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
}

/// The most parts of a block: one for each corner of a cell.
pub const PARTS: usize = 4;

/// What a frame has in a block: `(value − bias) light`, with some weight.
pub struct Part<'a> {
    /// The frame's patch.
    pub patch: Patch<'a>,
    /// What is taken away.
    pub bias: f32,
    /// What is multiplied by; None for 1.
    pub light: Option<Light>,
    /// Weights at the corners of a cell between four nodes, bilinear in between: the upper two,
    /// then the lower two.
    pub corners: [f32; 4],
}

/// Some rows and columns of a patch, the mean of parts with corrections added.
pub struct LitBlock<'a, const L: usize> {
    /// The parts, [`PARTS`] at the most, in the order of their frames; their kernels have equally
    /// many taps. One alone weighs 1 everywhere.
    pub parts: &'a [Part<'a>],
    /// The first row, of the patch.
    pub row: usize,
    /// The columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
    /// How far each of the tile's columns lies between the nodes, [`crate::render::sampling::point_batch::RUN`] of them.
    pub across: &'a [f32],
    /// How far each of the rows lies between the nodes.
    pub down: &'a [f32],
    /// What is added, in all columns of each of the rows, [`crate::render::sampling::point_batch::RUN`] a row.
    pub corrections: &'a [[f32; L]],
}

/// Draws a block into rows of a tile, alpha last and full: the bytes nearest to the sums. False
/// without doing it where the processor lacks the vectors for it.
pub fn block<const C: usize>(block: &Block, pixels: &mut [&mut [u8]]) -> bool {
    #[cfg(target_arch = "x86_64")]
    return by_taps!(block.patch.kernel, |simd, TAPS| block::plain::<C, TAPS>(
        simd, block, pixels
    ));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Draws a block with light undone and corrections added. False without doing it where the
/// processor lacks the vectors for it, or kernels have different taps.
pub fn lit_block<const C: usize, const L: usize>(
    block: &LitBlock<L>,
    pixels: &mut [&mut [u8]],
) -> bool {
    let Some((one, others)) = block.parts.split_first() else {
        return false;
    };
    let taps = one.patch.kernel.taps();
    let odd = |part: &Part| part.patch.kernel.taps() != taps;
    if others.iter().any(odd) || others.len() >= PARTS {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    return by_taps!(one.patch.kernel, |simd, TAPS| block::lit::<C, L, TAPS>(
        simd, block, pixels
    ));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// The values in some columns of a row of a patch, in the lanes of [`sums`]; `values`: of all the
/// patch, those around `columns` are anything.
pub fn values<const C: usize>(
    patch: &Patch,
    row: usize,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    return by_taps!(patch.kernel, |simd, TAPS| block::values::<C, TAPS>(
        simd,
        patch,
        row,
        columns.clone(),
        values
    ));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Bits of a sum below its whole part.
const fn bits(taps: usize) -> u32 {
    match taps {
        2 => 14,
        _ => 20,
    }
}

/// A sum under so many taps in units of a whole one.
pub const fn scale(taps: usize) -> f32 {
    1.0 / (1u32 << bits(taps)) as f32
}

/// What is added to a sum that is then cut to the nearest whole one.
const fn rounding(taps: usize) -> i32 {
    missing(taps) + (1 << (bits(taps) - 1))
}

/// What is missing of a sum: what cutting has taken away in the mean.
pub const fn missing(taps: usize) -> i32 {
    match taps {
        2 => 0,
        _ => 1 << 14,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::sampling::point_batch::RUN;
    use crate::render::sampling::sample::Sample;
    use crate::render::warp::local_polynomial::Chart;
    use crate::render::warp::patches::SCALE;
    use crate::render::{Interpolation, Picture, Samples};

    const KERNELS: [(Interpolation, f64); 7] = [
        (Interpolation::Bilinear, 1.0),
        (Interpolation::Bicubic, 1.0),
        (Interpolation::Lanczos3, 1.0),
        (Interpolation::Bilinear, 1.75),
        (Interpolation::Bicubic, 1.5),
        (Interpolation::Bicubic, 2.5),
        (Interpolation::Lanczos3, 4.0),
    ];
    const SIZE: usize = 64;

    /// Noise over the full scale, and edges from end to end of it: nothing overshoots more.
    fn picture<const C: usize>() -> Picture {
        let samples = (0..SIZE * SIZE * C).map(|k| {
            let (x, y) = (k / C % SIZE, k / C / SIZE);
            let noise = (k * 2_654_435_761) >> 13;
            if x < SIZE / 2 {
                noise as u8
            } else {
                255 * (((x / 3) ^ (y / 2)) & 1) as u8
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
        scalar::sums::<C>(source, &kernel, places, &mut slow);
        assert_eq!(fast, slow, "{interpolation:?} {stretch}");
        let (bits_of, half) = (
            bits(kernel.taps()),
            missing(kernel.taps()) + (1 << (bits(kernel.taps()) - 1)),
        );
        let mut more = [half; 4];
        more[C] = 255 << bits_of;
        let mut bytes = [vec![1; (C + 1) * fast.len()], vec![2; (C + 1) * fast.len()]];
        pixels::<C>(&kernel, &fast, &mut bytes[0]);
        scalar::pixels::<C>(&fast, &more, bits_of, &mut bytes[1]);
        assert_eq!(bytes[0], bytes[1]);
        // Against single precision at the same phases, and where phases are 1/1024 px off at the
        // most.
        let scale = f64::from(1u32 << bits(kernel.taps())).recip();
        let (mut worst, mut squares) = (0.0f64, 0.0);
        for ((u, v), sum) in coordinates().zip(&fast) {
            let near = |t: f32| t.floor() + Kernel::phase_of(t.fract(), phases) as f32 / phases;
            let exact = picture.at(near(u), near(v), &kernel);
            for (sum, exact) in sum[..C].iter().zip(exact) {
                let error = f64::from(sum + missing(kernel.taps())) * scale - f64::from(exact);
                worst = worst.max(error.abs());
                squares += error * error;
            }
        }
        let rms = (squares / (C * fast.len()) as f64).sqrt();
        assert!(
            worst < 0.1 && rms < 0.03,
            "{interpolation:?} {stretch}: {worst}, {rms}"
        );
    }

    #[test]
    fn vectors_sum_as_plain_loops_do_and_both_to_a_tenth_of_a_grey_level() {
        for (interpolation, stretch) in KERNELS {
            check::<1>(interpolation, stretch);
            check::<3>(interpolation, stretch);
        }
    }

    /// Blocks of a curved patch of the picture: as the same pixels one by one.
    fn check_blocks<const C: usize, const L: usize>(interpolation: Interpolation, stretch: f64) {
        let kernel = Kernel::new(interpolation, stretch);
        let picture = picture::<C>();
        let Samples::Eight(samples) = picture.samples() else {
            panic!("8 bits");
        };
        let stride = SIZE * C;
        let source = Source { samples, stride };
        let lines = [
            [31.3, 12.7, -1.9, 0.7, 30.1, -3.2, 1.3, 0.4],
            [1.1, 0.2, -0.3, 0.1, 11.4, 0.3, 0.1, -0.1],
            [0.4, 0.0, 0.1, 0.0, -0.3, 0.2, 0.0, 0.0],
            [0.1; 8],
        ];
        let patch = Patch {
            source,
            kernel: &kernel,
            lines: &lines,
        };
        let mut shifted = lines;
        (shifted[0][0], shifted[0][4]) = (33.7, 28.9);
        let other = Patch {
            lines: &shifted,
            ..patch
        };
        let across: Vec<f32> = (0..RUN).map(|k| (k % 8) as f32 / 8.0 + 0.01).collect();
        let down: Vec<f32> = (0..8).map(|k| k as f32 / 8.0 + 0.03).collect();
        let light = Light::through([[1.1, 1.0, 0.9], [1.3, 1.2, 1.1], [1.0, 0.7, 0.8]]);
        let bias = 3.25;
        let corrections: Vec<[f32; L]> = (0..RUN * 8)
            .map(|k| std::array::from_fn(|c| (k % 37) as f32 * 0.3 - 5.0 + c as f32))
            .collect();
        // The patch begins at the tile's column 64.
        let (tile_first, step) = (64, C + 1);
        for (row, columns) in [
            (0, 0..PATCH),
            (7, 0..3),
            (13, 5..14),
            (24, 27..PATCH),
            (9, 3..30),
        ] {
            let block_of = Block {
                patch,
                row,
                columns: columns.clone(),
                first: tile_first,
            };
            let mut drawn = vec![vec![7; RUN * step]; 8];
            let mut rows: Vec<&mut [u8]> = drawn.iter_mut().map(|row| &mut row[..]).collect();
            if !block::<C>(&block_of, &mut rows) {
                return;
            }
            let mut lit = vec![vec![7; RUN * step]; 8];
            let mut rows: Vec<&mut [u8]> = lit.iter_mut().map(|row| &mut row[..]).collect();
            let part = |patch, corners| Part {
                patch,
                bias,
                light: Some(light),
                corners,
            };
            let parts = [
                part(patch, [1.0, 0.0, 0.0, 1.0]),
                part(other, [0.0, 1.0, 1.0, 0.0]),
            ];
            let lit_of = |parts| LitBlock::<L> {
                parts,
                row,
                columns: columns.clone(),
                first: tile_first,
                across: &across,
                down: &down,
                corrections: &corrections,
            };
            assert!(lit_block::<C, L>(&lit_of(&parts[..1]), &mut rows));
            let mut mixed = vec![vec![7; RUN * step]; 8];
            let mut rows: Vec<&mut [u8]> = mixed.iter_mut().map(|row| &mut row[..]).collect();
            assert!(lit_block::<C, L>(&lit_of(&parts), &mut rows));
            for n in 0..8 {
                let slow = slow_sums::<C>(&patch, row + n);
                let slow_other = slow_sums::<C>(&other, row + n);
                let mut bytes = vec![0; PATCH * step];
                pixels::<C>(&kernel, &slow, &mut bytes);
                let mut expected = vec![7; RUN * step];
                let own = columns.start * step..columns.end * step;
                expected[tile_first * step..][own.clone()].copy_from_slice(&bytes[own]);
                assert_eq!(
                    drawn[n], expected,
                    "{interpolation:?} {stretch} {columns:?}"
                );
                let mut values = vec![[0.0; 4]; PATCH];
                assert!(super::values::<C>(
                    &patch,
                    row + n,
                    columns.clone(),
                    &mut values
                ));
                let [a, b, c] = light.row(row + n);
                for k in columns.clone() {
                    for channel in 0..C {
                        let value = (slow[k][channel] + missing(kernel.taps())) as f32
                            * scale(kernel.taps());
                        assert_eq!(values[k][channel], value, "{interpolation:?} {stretch}");
                        let x = k as f32 * SCALE - 1.0;
                        let undone = |value: f32| (value - bias) * ((c * x + b) * x + a);
                        let more = corrections[n * RUN + tile_first + k][channel];
                        let even = undone(value) + more;
                        // Crosswise: the second is half of all in the middle, nothing at two
                        // corners.
                        let (s, t) = (across[tile_first + k], down[n]);
                        let w = [(1.0 - s) * (1.0 - t) + s * t, s * (1.0 - t) + (1.0 - s) * t];
                        let second = (slow_other[k][channel] + missing(kernel.taps())) as f32
                            * scale(kernel.taps());
                        let both = w[0] * undone(value) + w[1] * undone(second);
                        let both = both * (1.0 / (w[0] + w[1])) + more;
                        let there = &mixed[n][(tile_first + k) * step..][..step];
                        assert_eq!(there[channel], u8::nearest(both));
                        let there = &lit[n][(tile_first + k) * step..][..step];
                        assert_eq!(there[channel], u8::nearest(even));
                        assert_eq!(there[C], 255);
                    }
                }
            }
        }
    }

    fn slow_sums<const C: usize>(patch: &Patch, row: usize) -> Vec<[i32; 4]> {
        let (kernel, stride) = (patch.kernel, patch.source.stride);
        let (mut first, mut across, mut down) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..PATCH {
            let at = |k: usize| k as f32 * SCALE - 1.0;
            let [u, v] = Chart::pixel(patch.lines, at(k), at(row));
            let corner = |t: f32| t as usize - kernel.before();
            first.push((corner(v) * stride + corner(u) * C) as u32);
            across.push(Kernel::phase_of(u.fract(), kernel.integer_phases()));
            down.push(Kernel::phase_of(v.fract(), kernel.integer_phases()));
        }
        let places = Places {
            first: &first,
            phases: [&across, &down],
        };
        let mut slow = vec![[0; 4]; PATCH];
        scalar::sums::<C>(patch.source, kernel, places, &mut slow);
        slow
    }

    #[test]
    fn blocks_are_their_pixels_one_by_one() {
        for (interpolation, stretch) in KERNELS {
            check_blocks::<1, 1>(interpolation, stretch);
            check_blocks::<3, 4>(interpolation, stretch);
        }
    }
}
