//! Time of the kernels of a tile, beside the speed of the processor:
//! `cargo test --release -p tunnelstitch-refine --lib roofline -- --ignored --nocapture`.

use crate::parameters::frame_estimate::FrameEstimate;
use crate::tiles::denoising::TextureSpectrum;
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{LANES, TileId, TilePoints, WallGrid, ZERO};
use crate::tiles::interpolation::Interpolation;
use crate::tiles::residual_weighting::NoiseModel;
use crate::tiles::tile::ResidualWeighting;
use crate::tiles::tile_arrays::SAMPLES;
use crate::tiles::workspace::{TileObservation, TileWorkspace};
use nalgebra::Vector3;
use std::hint::black_box;
use std::time::Instant;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::Circle;
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Observers of a tile.
const OBSERVERS: usize = 9;
/// Repetitions, of which the fastest counts.
const REPETITIONS: usize = 300;

/// Shortest time of some work, nanoseconds.
fn shortest_ns(mut work: impl FnMut()) -> f64 {
    let times = (0..REPETITIONS).map(|_| {
        let start = Instant::now();
        work();
        start.elapsed().as_secs_f64() * 1e9
    });
    times.fold(f64::INFINITY, f64::min)
}

/// Multiplications and additions per nanosecond, in vectors that stay in registers.
fn operations_per_ns() -> f64 {
    const ROUNDS: usize = 20_000;
    let factor = black_box(0.999f32);
    let ns = shortest_ns(|| {
        let mut sums = black_box([[1.0f32; LANES]; 8]);
        dispatch_simd(
            #[inline(always)]
            || {
                let [mut a, mut b, mut c, mut d, mut e, mut f, mut g, mut h] = sums;
                for _ in 0..ROUNDS {
                    for l in 0..LANES {
                        a[l] = a[l] * factor + factor;
                        b[l] = b[l] * factor + factor;
                        c[l] = c[l] * factor + factor;
                        d[l] = d[l] * factor + factor;
                        e[l] = e[l] * factor + factor;
                        f[l] = f[l] * factor + factor;
                        g[l] = g[l] * factor + factor;
                        h[l] = h[l] * factor + factor;
                    }
                }
                sums = [a, b, c, d, e, f, g, h];
            },
        );
        black_box(sums);
    });
    (2 * LANES * 8 * ROUNDS) as f64 / ns
}

/// Bytes read per nanosecond from values that are `count` in number.
fn bytes_per_ns(count: usize) -> f64 {
    let values = black_box(vec![1.0f32; count]);
    let ns = shortest_ns(|| {
        let mut sums = [[0.0f32; LANES]; 4];
        dispatch_simd(
            #[inline(always)]
            || {
                let [mut a, mut b, mut c, mut d] = [[0.0f32; LANES]; 4];
                for values in values.as_chunks::<{ 4 * LANES }>().0 {
                    for l in 0..LANES {
                        a[l] += values[l];
                        b[l] += values[LANES + l];
                        c[l] += values[2 * LANES + l];
                        d[l] += values[3 * LANES + l];
                    }
                }
                sums = [a, b, c, d];
            },
        );
        black_box(sums);
    });
    (4 * count) as f64 / ns
}

#[test]
#[ignore = "prints times"]
fn roofline() {
    println!("multiply–add: {:.0} operations/ns", operations_per_ns());
    println!("read from L1: {:.0} bytes/ns", bytes_per_ns(4096));
    println!("from memory: {:.1} bytes/ns", bytes_per_ns(1 << 25));
    let circle = Circle::new(3.0).unwrap();
    let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
    let grid = WallGrid::new(&circle, 3.0 / camera.fy, 2.0);
    let grey = |k: usize| 100.0 + ((7919 * k) % 53) as f32;
    let image = GreyImage::new(640, 480, (0..640 * 480).map(grey).collect());
    let frame = |k: usize| {
        let turn = Vector3::new(0.01, 0.02, 0.05) * k as f64 / OBSERVERS as f64;
        let pose = Pose::new(so3::exp(&turn), Vector3::zeros());
        SampledFrame::new(&image, camera, &FrameEstimate::at(pose))
    };
    let tile = TileId { column: 3, row: 2 };
    let points = TilePoints::new(&grid, &circle, tile, &mut Vec::new());
    let noise = NoiseModel {
        floor: 4.0,
        steepness: 0.01,
    };
    let denoiser = TextureSpectrum::default().denoiser();
    let weighting = ResidualWeighting {
        noise: &noise,
        variance_weighting: true,
        denoiser: Some(&denoiser),
    };
    let observations = (OBSERVERS * SAMPLES) as f64;
    for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
        let frames: Vec<SampledFrame> = (0..OBSERVERS)
            .map(|k| frame(k).with_interpolation(interpolation))
            .collect();
        let mut values = ZERO;
        let sampling_ns = shortest_ns(|| {
            for frame in &frames {
                frame.sample(black_box(&points), 1.0, &mut values);
            }
            black_box(&values);
        });
        let mut workspace = TileWorkspace::default();
        let all_ns = shortest_ns(|| {
            dispatch_simd(
                #[inline(always)]
                || {
                    let observations = frames.iter().map(|frame| TileObservation {
                        frame,
                        pixels: 0.25,
                        shade: 1.0,
                    });
                    let spacing_m = (grid.spacing_s_m, grid.spacing_h_m);
                    workspace.compute_moments(&points, observations, spacing_m, &weighting);
                },
            );
            black_box(&workspace.moments);
        });
        println!(
            "{interpolation:?}: sampling {:.2} ns, texture and moments {:.2} ns per observation",
            sampling_ns / observations,
            (all_ns - sampling_ns) / observations
        );
    }
}
