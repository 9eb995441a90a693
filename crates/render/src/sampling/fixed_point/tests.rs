//! Vectors against plain loops, and both against single precision.

use super::dispatch::{draw_blended_block, draw_block, sum_samples, write_pixels};
use super::format::{bits, missing, scale};
use super::inputs::{
    BlendPart, BlendedBlock, KernelPositions, PatchBlock, PictureSamples, SampledPatch,
};
use super::scalar;
use crate::layout::tiles::TILE_COLUMNS;
use crate::sampling::patch_light::PatchLight;
use crate::sampling::picture::Picture;
use crate::sampling::sample::{Sample, Samples};
use crate::warp::local_polynomial::LocalPolynomialWarp;
use crate::warp::patches::{PATCH_EDGE, PATCH_SCALE};
use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};

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
    let source = PictureSamples {
        samples,
        stride: SIZE * C,
    };
    let phases = kernel.integer_phases();
    let phase = |t: f32| Kernel::phase_of(t.fract(), phases);
    let across: Vec<i32> = coordinates().map(|(u, _)| phase(u)).collect();
    let down: Vec<i32> = coordinates().map(|(_, v)| phase(v)).collect();
    let first = coordinates().map(|(u, v)| {
        let (x, y) = (
            u as usize - kernel.taps_before(),
            v as usize - kernel.taps_before(),
        );
        ((y * SIZE + x) * C) as u32
    });
    let first: Vec<u32> = first.collect();
    let places = KernelPositions {
        first: &first,
        phases: [&across, &down],
    };
    let (mut fast, mut slow) = (vec![[7; 4]; first.len()], vec![[9; 4]; first.len()]);
    sum_samples::<C>(source, &kernel, places, &mut fast);
    scalar::sum_samples::<C>(source, &kernel, places, &mut slow);
    assert_eq!(fast, slow, "{interpolation:?} {stretch}");
    let (bits_of, half) = (
        bits(kernel.taps()),
        missing(kernel.taps()) + (1 << (bits(kernel.taps()) - 1)),
    );
    let mut more = [half; 4];
    more[C] = 255 << bits_of;
    let mut bytes = [vec![1; (C + 1) * fast.len()], vec![2; (C + 1) * fast.len()]];
    write_pixels::<C>(&kernel, &fast, &mut bytes[0]);
    scalar::write_pixels::<C>(&fast, &more, bits_of, &mut bytes[1]);
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
    let source = PictureSamples { samples, stride };
    let lines = [
        [31.3, 12.7, -1.9, 0.7, 30.1, -3.2, 1.3, 0.4],
        [1.1, 0.2, -0.3, 0.1, 11.4, 0.3, 0.1, -0.1],
        [0.4, 0.0, 0.1, 0.0, -0.3, 0.2, 0.0, 0.0],
        [0.1; 8],
    ];
    let patch = SampledPatch {
        source,
        kernel: &kernel,
        lines: &lines,
    };
    let mut shifted = lines;
    (shifted[0][0], shifted[0][4]) = (33.7, 28.9);
    let other = SampledPatch {
        lines: &shifted,
        ..patch
    };
    let across: Vec<f32> = (0..TILE_COLUMNS)
        .map(|k| (k % 8) as f32 / 8.0 + 0.01)
        .collect();
    let down: Vec<f32> = (0..8).map(|k| k as f32 / 8.0 + 0.03).collect();
    let light = PatchLight::through([[1.1, 1.0, 0.9], [1.3, 1.2, 1.1], [1.0, 0.7, 0.8]]);
    let bias = 3.25;
    let corrections: Vec<[f32; L]> = (0..TILE_COLUMNS * 8)
        .map(|k| std::array::from_fn(|c| (k % 37) as f32 * 0.3 - 5.0 + c as f32))
        .collect();
    // The patch begins at the tile's column 64.
    let (tile_first, step) = (64, C + 1);
    for (row, columns) in [
        (0, 0..PATCH_EDGE),
        (7, 0..3),
        (13, 5..14),
        (24, 27..PATCH_EDGE),
        (9, 3..30),
    ] {
        let block_of = PatchBlock {
            patch,
            row,
            columns: columns.clone(),
            first: tile_first,
        };
        let mut drawn = vec![vec![7; TILE_COLUMNS * step]; 8];
        let mut rows: Vec<&mut [u8]> = drawn.iter_mut().map(|row| &mut row[..]).collect();
        if !draw_block::<C>(&block_of, &mut rows) {
            return;
        }
        let mut lit = vec![vec![7; TILE_COLUMNS * step]; 8];
        let mut rows: Vec<&mut [u8]> = lit.iter_mut().map(|row| &mut row[..]).collect();
        let part = |patch, corners| BlendPart {
            patch,
            bias,
            light: Some(light),
            corners,
        };
        let parts = [
            part(patch, [1.0, 0.0, 0.0, 1.0]),
            part(other, [0.0, 1.0, 1.0, 0.0]),
        ];
        let lit_of = |parts| BlendedBlock::<L> {
            parts,
            row,
            columns: columns.clone(),
            first: tile_first,
            across: &across,
            down: &down,
            corrections: &corrections,
        };
        assert!(draw_blended_block::<C, L>(&lit_of(&parts[..1]), &mut rows));
        let mut mixed = vec![vec![7; TILE_COLUMNS * step]; 8];
        let mut rows: Vec<&mut [u8]> = mixed.iter_mut().map(|row| &mut row[..]).collect();
        assert!(draw_blended_block::<C, L>(&lit_of(&parts), &mut rows));
        for n in 0..8 {
            let slow = slow_sums::<C>(&patch, row + n);
            let slow_other = slow_sums::<C>(&other, row + n);
            let mut bytes = vec![0; PATCH_EDGE * step];
            write_pixels::<C>(&kernel, &slow, &mut bytes);
            let mut expected = vec![7; TILE_COLUMNS * step];
            let own = columns.start * step..columns.end * step;
            expected[tile_first * step..][own.clone()].copy_from_slice(&bytes[own]);
            assert_eq!(
                drawn[n], expected,
                "{interpolation:?} {stretch} {columns:?}"
            );
            let mut values = vec![[0.0; 4]; PATCH_EDGE];
            assert!(super::sample_values::<C>(
                &patch,
                row + n,
                columns.clone(),
                &mut values
            ));
            let [a, b, c] = light.row(row + n);
            for k in columns.clone() {
                for channel in 0..C {
                    let value =
                        (slow[k][channel] + missing(kernel.taps())) as f32 * scale(kernel.taps());
                    assert_eq!(values[k][channel], value, "{interpolation:?} {stretch}");
                    let x = k as f32 * PATCH_SCALE - 1.0;
                    let undone = |value: f32| (value - bias) * ((c * x + b) * x + a);
                    let more = corrections[n * TILE_COLUMNS + tile_first + k][channel];
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

fn slow_sums<const C: usize>(patch: &SampledPatch, row: usize) -> Vec<[i32; 4]> {
    let (kernel, stride) = (patch.kernel, patch.source.stride);
    let (mut first, mut across, mut down) = (Vec::new(), Vec::new(), Vec::new());
    for k in 0..PATCH_EDGE {
        let at = |k: usize| k as f32 * PATCH_SCALE - 1.0;
        let [u, v] = LocalPolynomialWarp::pixel(patch.lines, at(k), at(row));
        let corner = |t: f32| t as usize - kernel.taps_before();
        first.push((corner(v) * stride + corner(u) * C) as u32);
        across.push(Kernel::phase_of(u.fract(), kernel.integer_phases()));
        down.push(Kernel::phase_of(v.fract(), kernel.integer_phases()));
    }
    let places = KernelPositions {
        first: &first,
        phases: [&across, &down],
    };
    let mut slow = vec![[0; 4]; PATCH_EDGE];
    scalar::sum_samples::<C>(patch.source, kernel, places, &mut slow);
    slow
}

#[test]
fn blocks_are_their_pixels_one_by_one() {
    for (interpolation, stretch) in KERNELS {
        check_blocks::<1, 1>(interpolation, stretch);
        check_blocks::<3, 4>(interpolation, stretch);
    }
}
