//! `cargo bench --bench warp [-- --json] [bilinear] [bicubic] [lanczos3]`: how fast a frame is laid on the wall.
//!
//! RGB frames of 1920 × 1080 px that just meet around a tunnel are drawn at their own resolution with every interpolation, each
//! pixel from one frame, and pictures of a frame's size are copied. Nowhere are the frames so much finer than the panorama that
//! kernels are stretched: `remap` of OpenCV does not stretch them either. Millions of pixels (those that some frame shows) a second of
//! processor time, median and range over rounds. `benches/opencv_warp.py` runs this beside OpenCV.

use cpu_time::ProcessTime;
use std::f64::consts::TAU;
use tunnelstitch::camera::Camera;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{
    Band, Canvas, FrameStack, Interpolation, Mode, Picture, Plan, RenderError, RenderOptions,
    Target, place,
};
use tunnelstitch::surface::Circle;
use tunnelstitch::trajectory::{Shutter, spiral};

const ROUNDS: usize = 7;
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

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().collect();
    let json = arguments.iter().any(|argument| argument == "--json");
    let named = |name: &str| arguments.iter().any(|argument| argument == name);
    let all = !["bilinear", "bicubic", "lanczos3"].into_iter().any(named);
    let camera = Camera::from_vertical_fov(1920, 1080, FOV_DEG.to_radians());
    let circle = Circle::new(RADIUS_M)?;
    let samples: Vec<u8> = (0..1920 * 1080 * 3)
        .map(|k: usize| ((k * 2_654_435_761) >> 13) as u8)
        .collect();
    let pictures = (0..FRAMES).map(|_| Picture::new(1920, 1080, 3, samples.clone()));
    let advance_m = 2.0 * RADIUS_M * (0.5 * FOV_DEG.to_radians()).tan() / AROUND as f64;
    let mut frames = FrameStack::from_pictures(camera, pictures.collect());
    let placements = place(
        &circle,
        &camera,
        &spiral(FRAMES, advance_m, TAU / AROUND as f64),
        &Shutter::default(),
    )?;
    let canvas = Canvas::of_placements(&circle, &placements, camera.fx / RADIUS_M)?;
    let mut rows = Vec::new();
    for interpolation in [
        Interpolation::Bilinear,
        Interpolation::Bicubic,
        Interpolation::Lanczos3,
    ] {
        let name = format!("{interpolation:?}").to_lowercase();
        if !all && !named(&name) {
            continue;
        }
        let options = RenderOptions {
            interpolation,
            mode: Mode::BestView,
            blend: false,
            super_resolve: false,
        };
        let plan = Plan::new(&circle, &frames, &placements, &canvas, &options, &Silent)?;
        let mut covered = Covered(0);
        plan.draw(&mut frames, u64::MAX, &mut [&mut covered], &Silent)?;
        let mut speeds = Vec::new();
        for _ in 0..ROUNDS {
            let since = ProcessTime::now();
            plan.draw(&mut frames, u64::MAX, &mut [&mut Nowhere], &Silent)?;
            speeds.push(covered.0 as f64 / since.elapsed().as_secs_f64() / 1e6);
        }
        rows.push((name, speeds));
    }
    let mut copies = Vec::new();
    let mut targets = vec![samples.clone(); FRAMES];
    for _ in 0..ROUNDS {
        let since = ProcessTime::now();
        for copy in &mut targets {
            copy.copy_from_slice(std::hint::black_box(&samples));
        }
        let pixels = targets.len() * samples.len() / 3;
        copies.push(pixels as f64 / since.elapsed().as_secs_f64() / 1e6);
    }
    rows.push(("copy".to_owned(), copies));
    for (name, speeds) in &mut rows {
        speeds.sort_by(f64::total_cmp);
        let (low, median, high) = (speeds[0], speeds[ROUNDS / 2], speeds[ROUNDS - 1]);
        if json {
            println!("{{\"what\":\"{name}\",\"mpx_per_s\":{median:.2}}}");
        } else {
            println!("{name:>10}  {median:>8.1} Mpx/s  ({low:.1} to {high:.1})");
        }
    }
    Ok(())
}
