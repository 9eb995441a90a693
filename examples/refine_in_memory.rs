//! Refines frames and poses that are in memory, without a file.
//!
//! Two turns of a camera in a pipe of 1 m radius: the frames are cast from a known texture at the
//! true poses, the initial poses are those of the plan, and the refined poses are compared with the
//! truth.
//!
//! Run it with `cargo run --release --example refine_in_memory`.

use image::{DynamicImage, GrayImage, Luma};
use rand::SeedableRng;
use std::error::Error;
use std::sync::Arc;
use tunnelstitch::camera::Camera;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::frames::FrameSet;
use tunnelstitch::progress::{Progress, Silent};
use tunnelstitch::refine::{FrameFlag, RefineInput, RefineOptions, refine};
use tunnelstitch::surface::{Circle, Surface, WallPoint};
use tunnelstitch::trajectory::{Jitter, JitterModel, Pose, StampedPose, poses_of, spiral};

fn main() -> Result<(), Box<dyn Error>> {
    let pipe = Circle::new(1.0)?;
    let camera = Camera::from_vertical_fov(320, 240, 60f64.to_radians());
    // The plan advances 5 cm and turns 30° a frame; each step goes wrong by 1° and a centimetre.
    let plan = spiral(24, 0.05, 30f64.to_radians());
    let prior = Jitter {
        model: JitterModel::RandomWalk,
        rotation_sigma_rad: 1f64.to_radians(),
        translation_sigma_m: [0.01; 3],
    };
    let truth = prior.apply(&plan, &mut rand_chacha::ChaCha8Rng::seed_from_u64(1));
    let pictures = truth.iter().map(|pose| picture(&pipe, &camera, pose));
    let frames = FrameSet::in_memory(pictures.collect::<Vec<_>>());
    let initial: Vec<StampedPose> = plan
        .iter()
        .enumerate()
        .map(|(k, pose)| StampedPose {
            time_s: k as f64,
            pose: *pose,
        })
        .collect();

    let input = RefineInput::new(camera, Arc::new(pipe), &frames, &initial, prior);
    let silent: Arc<dyn Progress> = Arc::new(Silent);
    let refined = refine(input, &RefineOptions::default(), &silent)?;

    let photometric = refined.report.frames.iter();
    let photometric = photometric.filter(|frame| frame.flag == FrameFlag::Photometric);
    println!(
        "{} of {} frames photometric",
        photometric.count(),
        frames.len()
    );
    for (name, poses) in [
        ("initial", plan),
        ("refined", poses_of(&refined.trajectory)),
    ] {
        let error = wall_error(&pipe, camera, &poses, &truth)?;
        println!("{name} poses: {:.4} px RMS on the wall", error.px.rms);
    }
    let sigma = &refined.report.frames[23].sigma;
    println!(
        "last frame: 1-sigma {:.4} degrees, {:.3} mm",
        sigma.rotation_deg,
        1e3 * sigma.translation_m
    );
    Ok(())
}

/// Casts the frame of a camera at `pose`.
fn picture(pipe: &Circle, camera: &Camera, pose: &Pose) -> DynamicImage {
    let grey = |u: u32, v: u32| {
        let ray = camera.ray(f64::from(u), f64::from(v))?;
        let hit = pipe.hit(&pose.t_wc, &(pose.r_wc * ray)).ok()?;
        Some(texture(hit.wall))
    };
    let cast = |u, v| Luma([grey(u, v).unwrap_or(0.0).round() as u8]);
    GrayImage::from_fn(camera.width, camera.height, cast).into()
}

/// Grey value of a wall point: waves of several lengths, periodic around the pipe.
fn texture(wall: WallPoint) -> f64 {
    let WallPoint { s_m: theta, h_m } = wall;
    128.0
        + 40.0 * (19.0 * theta + 3.0 * h_m).sin()
        + 30.0 * (17.0 * h_m - 4.0 * theta).cos()
        + 20.0 * (31.0 * theta + 23.0 * h_m).sin()
}
