//! Sums of 8-bit samples under a kernel, in whole numbers.
//!
//! Two taps along each axis: with the phases s, t in 1/128 px, `Σ = Σ_ij w_i(s) w_j(t) I_ij` with `w = (128 − s, s)`, exact, in units of
//! 2⁻¹⁴.
//!
//! More: weights in units of 2⁻¹⁴ ([`Kernel::integers`]). Rows are summed first, the first and the last two of every four taps by
//! themselves (a, b); these are cut to units of 2⁻⁶ and then summed down the columns: `Σ = Σ_j w_j (⌊a_j/2⁸⌋ + ⌊b_j/2⁸⌋)`, in units of 2⁻²⁰. What
//! cutting takes away, half a unit of a and of b each in the mean, is given back at the end.
//!
//! The same numbers come out of vectors (AVX2) and of the plain loops of [`plain`], to the bit: nothing is rounded but by
//! the cut.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod plain;
#[cfg(target_arch = "x86_64")]
mod span;

use super::chart::Lanes;
use super::kernel::Kernel;
#[cfg(target_arch = "x86_64")]
use crate::vectors;
use std::ops::Range;

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

/// Sums at each place, one lane a channel: colour in the first three, grey in the first. `C`: 1 or 3 channels.
pub fn sums<const C: usize>(
    source: Source,
    kernel: &Kernel,
    places: Places,
    sums: &mut [[i32; 4]],
) {
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| avx2::sums::<C>(simd, source, kernel, places, sums),
    ) {
        return;
    }
    plain::sums::<C>(source, kernel, places, sums);
}

/// The nearest 8-bit samples of sums, alpha last and full.
pub fn pixels<const C: usize>(kernel: &Kernel, sums: &[[i32; 4]], pixels: &mut [u8]) {
    let bits = bits(kernel);
    let mut more = [rounding(kernel); 4];
    more[C] = 255 << bits;
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| avx2::pixels::<C>(simd, sums, &more, bits, pixels),
    ) {
        return;
    }
    plain::pixels::<C>(sums, &more, bits, pixels);
}

/// A row of a patch of the chart that lies inside a frame, kernels and all.
pub struct Span<'a> {
    /// The frame.
    pub source: Source<'a>,
    /// The kernel, of two taps at least.
    pub kernel: &'a Kernel,
    /// Where its pixels appear.
    pub line: Lanes,
}

/// The bytes of some `columns` of a span, alpha last and full, straight from where they appear. False without doing it where the
/// processor lacks the vectors for it.
pub fn span_bytes<const C: usize>(span: &Span, columns: Range<usize>, pixels: &mut [u8]) -> bool {
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| span::copy::<C>(simd, span, columns.clone(), pixels),
    ) {
        return true;
    }
    false
}

/// The same with the values as numbers, in the lanes of [`sums`]; `values`: of all the patch, those around `columns` are anything.
pub fn span_values<const C: usize>(
    span: &Span,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if vectors::avx2(
        #[inline(always)]
        |simd| span::values::<C>(simd, span, columns.clone(), values),
    ) {
        return true;
    }
    false
}

/// Bits of a sum below its whole part.
fn bits(kernel: &Kernel) -> u32 {
    match kernel.taps() {
        2 => 14,
        _ => 20,
    }
}

/// A sum in units of a whole one.
pub fn scale(kernel: &Kernel) -> f32 {
    1.0 / (1u32 << bits(kernel)) as f32
}

/// What is added to a sum that is then cut to the nearest whole one.
fn rounding(kernel: &Kernel) -> i32 {
    missing(kernel) + (1 << (bits(kernel) - 1))
}

/// What is missing of a sum: what cutting has taken away in the mean.
pub fn missing(kernel: &Kernel) -> i32 {
    match kernel.taps() {
        2 => 0,
        _ => 1 << 14,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::chart::{PATCH, SCALE};
    use crate::render::{Interpolation, Picture, Samples};

    const KERNELS: [(Interpolation, f64); 6] = [
        (Interpolation::Bilinear, 1.0),
        (Interpolation::Bicubic, 1.0),
        (Interpolation::Lanczos3, 1.0),
        (Interpolation::Bilinear, 1.75),
        (Interpolation::Bicubic, 2.5),
        (Interpolation::Lanczos3, 4.0),
    ];
    const SIZE: usize = 64;

    /// Noise over the full scale, and edges from end to end of it: nothing overshoots more.
    fn picture<const C: usize>() -> Picture {
        let samples = (0..SIZE * SIZE * C).map(|k| {
            let (x, y) = (k / C % SIZE, k / C / SIZE);
            let noise = (k * 2_654_435_761) >> 13;
            match x < SIZE / 2 {
                true => noise as u8,
                false => 255 * (((x / 3) ^ (y / 2)) & 1) as u8,
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
        plain::sums::<C>(source, &kernel, places, &mut slow);
        assert_eq!(fast, slow, "{interpolation:?} {stretch}");
        let (bits_of, half) = (bits(&kernel), missing(&kernel) + (1 << (bits(&kernel) - 1)));
        let mut more = [half; 4];
        more[C] = 255 << bits_of;
        let mut bytes = [vec![1; (C + 1) * fast.len()], vec![2; (C + 1) * fast.len()]];
        pixels::<C>(&kernel, &fast, &mut bytes[0]);
        plain::pixels::<C>(&fast, &more, bits_of, &mut bytes[1]);
        assert_eq!(bytes[0], bytes[1]);
        // Against single precision at the same phases, and where phases are 1/1024 px off at the most.
        let scale = f64::from(1u32 << bits(&kernel)).recip();
        let (mut worst, mut squares) = (0.0f64, 0.0);
        for ((u, v), sum) in coordinates().zip(&fast) {
            let near = |t: f32| t.floor() + Kernel::phase_of(t.fract(), phases) as f32 / phases;
            let exact = picture.at(near(u), near(v), &kernel);
            for (sum, exact) in sum[..C].iter().zip(exact) {
                let error = f64::from(sum + missing(&kernel)) * scale - f64::from(exact);
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

    /// A curved line through the picture, patch's columns along it: as the same pixels one by one.
    fn check_span<const C: usize>(interpolation: Interpolation, stretch: f64) {
        let kernel = Kernel::new(interpolation, stretch);
        let picture = picture::<C>();
        let Samples::Eight(samples) = picture.samples() else {
            panic!("8 bits");
        };
        let stride = SIZE * C;
        let source = Source { samples, stride };
        let line = [31.3, 14.7, -1.9, 0.7, 30.1, -11.2, 2.3, 1.1];
        let all = Span {
            source,
            kernel: &kernel,
            line,
        };
        let (mut first, mut across, mut down) = (Vec::new(), Vec::new(), Vec::new());
        let cubic = |c: &[f32], x: f32| ((c[3] * x + c[2]) * x + c[1]) * x + c[0];
        for k in 0..PATCH {
            let x = k as f32 * SCALE - 1.0;
            let (u, v) = (cubic(&line[..4], x), cubic(&line[4..], x));
            let corner = |t: f32| t as usize - kernel.before();
            first.push(((corner(v) * SIZE + corner(u)) * C) as u32);
            across.push(Kernel::phase_of(u.fract(), kernel.integer_phases()));
            down.push(Kernel::phase_of(v.fract(), kernel.integer_phases()));
        }
        let places = Places {
            first: &first,
            phases: [&across, &down],
        };
        let mut slow = vec![[0; 4]; PATCH];
        plain::sums::<C>(source, &kernel, places, &mut slow);
        let mut slow_bytes = vec![0; PATCH * (C + 1)];
        pixels::<C>(&kernel, &slow, &mut slow_bytes);
        for columns in [0..PATCH, 0..3, 5..14, 27..PATCH] {
            let expected = &slow_bytes[columns.start * (C + 1)..columns.end * (C + 1)];
            let mut bytes = vec![7; expected.len()];
            if !span_bytes::<C>(&all, columns.clone(), &mut bytes) {
                return;
            }
            assert_eq!(bytes, expected, "{interpolation:?} {stretch} {columns:?}");
            let mut values = vec![[0.0; 4]; PATCH];
            assert!(span_values::<C>(&all, columns.clone(), &mut values));
            let scale = 1.0 / (1u32 << bits(&kernel)) as f32;
            for k in columns {
                for c in 0..C {
                    let value = (slow[k][c] + missing(&kernel)) as f32 * scale;
                    assert_eq!(values[k][c], value, "{interpolation:?} {stretch}");
                }
            }
        }
    }

    #[test]
    fn spans_are_their_pixels_one_by_one() {
        for (interpolation, stretch) in KERNELS {
            check_span::<1>(interpolation, stretch);
            check_span::<3>(interpolation, stretch);
        }
    }
}
