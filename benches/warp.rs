//! `cargo bench --bench warp [-- --json]`: how fast a frame is laid on the wall.
//!
//! One RGB frame of 1920 × 1080 px is drawn on the wall it sees, at its own resolution, with every interpolation, and a
//! picture of the same size is copied. Millions of pixels a second, median and range over rounds. `benches/opencv_warp.py` runs this beside
//! OpenCV.

use std::time::Instant;
use tunnelstitch::camera::Pinhole;
use tunnelstitch::progress::Silent;
use tunnelstitch::render::{
    Band, Canvas, FrameStack, Interpolation, Mode, Picture, Plan, RenderError, RenderOptions,
    Target, place,
};
use tunnelstitch::surface::Circle;
use tunnelstitch::trajectory::Pose;

const ROUNDS: usize = 15;

/// Counts what is covered.
#[derive(Default)]
struct Count(usize);

impl Target for Count {
    fn put(&mut self, _: &Canvas, band: &Band) -> Result<(), RenderError> {
        self.0 += band.covered().iter().filter(|yes| **yes).count();
        Ok(())
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let json = std::env::args().any(|argument| argument == "--json");
    let camera = Pinhole::from_vertical_fov(1920, 1080, 60f64.to_radians());
    let circle = Circle::new(3.0)?;
    let samples: Vec<u8> = (0..1920 * 1080 * 3)
        .map(|k: usize| (k * 2_654_435_761 >> 13) as u8)
        .collect();
    let picture = Picture::new(1920, 1080, 3, samples.clone());
    let mut frames = FrameStack::from_pictures(camera, vec![picture]);
    let placements = place(&circle, &camera, &[Pose::identity()])?;
    let canvas = Canvas::of_placements(&circle, &placements, camera.fx / 3.0)?;
    let mut rows = Vec::new();
    for interpolation in [
        Interpolation::Bilinear,
        Interpolation::Bicubic,
        Interpolation::Lanczos3,
    ] {
        let options = RenderOptions {
            interpolation,
            mode: Mode::BestView,
            blend: false,
        };
        let plan = Plan::new(&circle, &frames, &placements, &canvas, &options, 8.0, &Silent)?;
        let mut speeds = Vec::new();
        for _ in 0..ROUNDS {
            let mut count = Count::default();
            let since = Instant::now();
            plan.draw(&mut frames, u64::MAX, &mut [&mut count], &Silent)?;
            speeds.push(count.0 as f64 / since.elapsed().as_secs_f64() / 1e6);
        }
        rows.push((format!("{interpolation:?}").to_lowercase(), speeds));
    }
    let mut copies = Vec::new();
    for _ in 0..ROUNDS {
        let since = Instant::now();
        let copy = std::hint::black_box(samples.clone());
        copies.push(copy.len() as f64 / 3.0 / since.elapsed().as_secs_f64() / 1e6);
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
