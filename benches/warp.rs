//! Throughput of the warp from frames to the wall:
//! `cargo bench --bench warp [-- bilinear] [bicubic] [lanczos3] [copy]`.
//!
//! RGB frames of 1920 × 1080 px that just meet around a tunnel are rendered at their own resolution
//! with every interpolation, each pixel from one frame, and images of a frame's size are copied.
//! The frames are never so much finer than the panorama that kernels are widened, since `remap` of
//! OpenCV does not widen them either. The result is in millions of covered pixels per second of
//! processor time, as median and range over the repetitions. `-- --ask` measures one repetition for
//! each of these names on the standard input and prints a line, so that `benches/opencv_warp.py`
//! can alternate between this program and OpenCV.

use cpu_time::ProcessTime;
use std::error::Error;
use std::f64::consts::TAU;
use std::io::BufRead;
use tunnelstitch::camera::Camera;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{
    Band, Canvas, Interpolation, Mode, Picture, PictureCache, Placement, Plan, RenderError,
    RenderOptions, Target, place_frames,
};
use tunnelstitch::surface::Circle;
use tunnelstitch::trajectory::{Shutter, spiral};

/// Number of repetitions.
const REPETITIONS: usize = 7;
/// Name of the copy benchmark.
const COPY: &str = "copy";
/// Number of frames around the tunnel.
const FRAMES_AROUND: usize = 7;
/// Number of all frames.
const FRAMES: usize = 4 * FRAMES_AROUND;
/// Vertical field of view of the camera.
const FOV_DEG: f64 = 30.0;
/// Radius of the tunnel, metres.
const RADIUS_M: f64 = 3.0;

/// Render target that discards the pixels.
struct NullTarget;

impl Target for NullTarget {
    fn put(&mut self, _: &Canvas, band: &Band) -> Result<(), RenderError> {
        std::hint::black_box(band);
        Ok(())
    }
}

/// Render target that counts the covered pixels.
struct CoverageCounter(usize);

impl Target for CoverageCounter {
    fn put(&mut self, _: &Canvas, band: &Band) -> Result<(), RenderError> {
        self.0 += band.covered().into_iter().filter(|yes| *yes).count();
        Ok(())
    }
}

/// Benchmark with its frames and plans.
struct Bench<'a> {
    frames: PictureCache,
    plans: Vec<(String, Plan<'a>)>,
    /// Number of covered pixels.
    covered: usize,
    samples: Vec<u8>,
    copies: Vec<Vec<u8>>,
}

impl<'a> Bench<'a> {
    fn new(
        circle: &'a Circle,
        camera: &Camera,
        placements: &'a [Placement],
        canvas: &Canvas,
    ) -> Result<Self, Box<dyn Error>> {
        let samples: Vec<u8> = (0..1920 * 1080 * 3)
            .map(|k: usize| ((k * 2_654_435_761) >> 13) as u8)
            .collect();
        let pictures = (0..FRAMES).map(|_| Picture::new(1920, 1080, 3, samples.clone()));
        let mut frames = PictureCache::from_pictures(*camera, pictures.collect());
        let mut plans = Vec::new();
        for interpolation in [
            Interpolation::Bilinear,
            Interpolation::Bicubic,
            Interpolation::Lanczos3,
        ] {
            let options = RenderOptions {
                interpolation,
                mode: Mode::BestView,
                blend: false,
                super_resolve: false,
            };
            let plan = Plan::new(circle, &frames, placements, canvas, &options, &Silent)?;
            plans.push((format!("{interpolation:?}").to_lowercase(), plan));
        }
        let mut covered = CoverageCounter(0);
        let (_, first) = &plans[0];
        first.draw(&mut frames, u64::MAX, &mut [&mut covered], &Silent)?;
        Ok(Self {
            frames,
            plans,
            covered: covered.0,
            copies: vec![samples.clone(); FRAMES],
            samples,
        })
    }

    /// Measures one repetition, Mpx per second of processor time.
    fn measure(&mut self, what: &str) -> Result<f64, Box<dyn Error>> {
        let since = ProcessTime::now();
        let pixels = if what == COPY {
            for copy in &mut self.copies {
                copy.copy_from_slice(std::hint::black_box(&self.samples));
            }
            self.copies.len() * self.samples.len() / 3
        } else {
            let (_, plan) = self
                .plans
                .iter()
                .find(|(name, _)| name == what)
                .ok_or_else(|| format!("`{what}` is not a benchmark"))?;
            plan.draw(&mut self.frames, u64::MAX, &mut [&mut NullTarget], &Silent)?;
            self.covered
        };
        Ok(pixels as f64 / since.elapsed().as_secs_f64() / 1e6)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo adds `--bench`.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let camera = Camera::from_vertical_fov(1920, 1080, FOV_DEG.to_radians());
    let circle = Circle::new(RADIUS_M)?;
    let advance_m = 2.0 * RADIUS_M * (0.5 * FOV_DEG.to_radians()).tan() / FRAMES_AROUND as f64;
    let placements = place_frames(
        &circle,
        camera,
        &spiral(FRAMES, advance_m, TAU / FRAMES_AROUND as f64),
        &Shutter::default(),
    )?;
    let canvas = Canvas::of_placements(&circle, &placements, camera.fx / RADIUS_M)?;
    let mut bench = Bench::new(&circle, &camera, &placements, &canvas)?;
    if arguments.iter().any(|argument| argument == "--ask") {
        for what in std::io::stdin().lock().lines() {
            println!("{}", bench.measure(&what?)?);
        }
        return Ok(());
    }
    let all = bench.plans.iter().map(|(name, _)| name.clone());
    let all: Vec<String> = all.chain([COPY.to_owned()]).collect();
    for what in if arguments.is_empty() { all } else { arguments } {
        let mut speeds = [0.0; REPETITIONS];
        for speed in &mut speeds {
            *speed = bench.measure(&what)?;
        }
        speeds.sort_by(f64::total_cmp);
        let (low, median, high) = (speeds[0], speeds[REPETITIONS / 2], speeds[REPETITIONS - 1]);
        println!("{what:>10}  {median:>8.1} Mpx/s  ({low:.1} to {high:.1})");
    }
    Ok(())
}
