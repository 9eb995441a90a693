//! `cargo bench --bench warp [-- bilinear] [bicubic] [lanczos3] [copy]`: how fast a frame is laid
//! on the wall.
//!
//! RGB frames of 1920 × 1080 px that just meet around a tunnel are drawn at their own resolution
//! with every interpolation, each pixel from one frame, and pictures of a frame's size are copied.
//! Nowhere are the frames so much finer than the panorama that kernels are stretched: `remap` of
//! OpenCV does not stretch them either. Millions of pixels (those that some frame shows) a second
//! of processor time, median and range over rounds. `-- --ask` measures one round for each of these
//! names that comes on the standard input and answers with a line: so `benches/opencv_warp.py` runs
//! this and OpenCV in turn.

use cpu_time::ProcessTime;
use std::error::Error;
use std::f64::consts::TAU;
use std::io::BufRead;
use tunnelstitch::camera::Camera;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{
    Band, Canvas, Interpolation, Mode, Picture, PictureCache, Placement, Plan, RenderError,
    RenderOptions, Target, place,
};
use tunnelstitch::surface::Circle;
use tunnelstitch::trajectory::{Shutter, spiral};

const ROUNDS: usize = 7;
const COPY: &str = "copy";
/// Frames around the tunnel, and all of them.
const AROUND: usize = 7;
const FRAMES: usize = 4 * AROUND;
/// The camera's field of view from top to bottom.
const FOV_DEG: f64 = 30.0;
const RADIUS_M: f64 = 3.0;

/// Takes the pixels and leaves them where they are.
struct Nowhere;

impl Target for Nowhere {
    fn put(&mut self, _: &Canvas, band: &Band) -> Result<(), RenderError> {
        std::hint::black_box(band);
        Ok(())
    }
}

/// Counts the pixels that some frame shows.
struct Covered(usize);

impl Target for Covered {
    fn put(&mut self, _: &Canvas, band: &Band) -> Result<(), RenderError> {
        self.0 += band.covered().into_iter().filter(|yes| *yes).count();
        Ok(())
    }
}

/// What is measured.
struct Bench<'a> {
    frames: PictureCache,
    plans: Vec<(String, Plan<'a>)>,
    /// How many pixels some frame shows.
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
        let mut covered = Covered(0);
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

    /// Mpx a second of processor time in one round.
    fn round(&mut self, what: &str) -> Result<f64, Box<dyn Error>> {
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
                .ok_or_else(|| format!("`{what}` is none of what is measured"))?;
            plan.draw(&mut self.frames, u64::MAX, &mut [&mut Nowhere], &Silent)?;
            self.covered
        };
        Ok(pixels as f64 / since.elapsed().as_secs_f64() / 1e6)
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    // Cargo says `--bench` itself.
    let arguments: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| a != "--bench")
        .collect();
    let camera = Camera::from_vertical_fov(1920, 1080, FOV_DEG.to_radians());
    let circle = Circle::new(RADIUS_M)?;
    let advance_m = 2.0 * RADIUS_M * (0.5 * FOV_DEG.to_radians()).tan() / AROUND as f64;
    let placements = place(
        &circle,
        &camera,
        &spiral(FRAMES, advance_m, TAU / AROUND as f64),
        &Shutter::default(),
    )?;
    let canvas = Canvas::of_placements(&circle, &placements, camera.fx / RADIUS_M)?;
    let mut bench = Bench::new(&circle, &camera, &placements, &canvas)?;
    if arguments.iter().any(|argument| argument == "--ask") {
        for what in std::io::stdin().lock().lines() {
            println!("{}", bench.round(&what?)?);
        }
        return Ok(());
    }
    let all = bench.plans.iter().map(|(name, _)| name.clone());
    let all: Vec<String> = all.chain([COPY.to_owned()]).collect();
    for what in if arguments.is_empty() { all } else { arguments } {
        let mut speeds = [0.0; ROUNDS];
        for speed in &mut speeds {
            *speed = bench.round(&what)?;
        }
        speeds.sort_by(f64::total_cmp);
        let (low, median, high) = (speeds[0], speeds[ROUNDS / 2], speeds[ROUNDS - 1]);
        println!("{what:>10}  {median:>8.1} Mpx/s  ({low:.1} to {high:.1})");
    }
    Ok(())
}
