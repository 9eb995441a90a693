//! Estimation context, prior and frames on a [`TestWall`], for tests.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::prior::Prior;
use crate::parameters::calibration::{Calibration, Kappa};
use crate::samples::visibility::PosedFrame;
use crate::tiles::grid::WallGrid;
use std::sync::LazyLock;
use tunnelstitch_core::frames::{FrameCache, GreyImage, PictureNoise, Pyramid};
use tunnelstitch_core::test_wall::{TestWall, waves};
use tunnelstitch_geometry::camera::{Camera, Sweep};
use tunnelstitch_geometry::surface::{Circle, Footprint, GaugeMotion, WallPoint, WallRegions};
use tunnelstitch_geometry::trajectory::{Jitter, JitterModel, Pose, Shutter, spiral};

/// Bricks around.
const BRICKS: f64 = 60.0;

/// Bricks, each of its own grey value, 10 × 6 cm, between light joints of 1 cm.
pub fn bricks(wall: WallPoint, perimeter_m: f64) -> f64 {
    let (x, y) = (BRICKS * wall.s_m / perimeter_m, wall.h_m / 0.06);
    let of_brick = |x: f64, joint: f64| x.rem_euclid(1.0) > joint;
    if !of_brick(x, 0.1) || !of_brick(y, 0.17) {
        return 160.0;
    }
    let brick = 12.9898 * x.floor().rem_euclid(BRICKS) + 78.233 * y.floor();
    90.0 + 80.0 * (43758.5453 * brick.sin()).rem_euclid(1.0)
}

/// Poses of which one is turned about the axis by a brick.
pub fn displaced_by_a_brick(poses: &[Pose], displaced: usize) -> Vec<Pose> {
    let mut poses = poses.to_vec();
    let brick = GaugeMotion::about_y(std::f64::consts::TAU / BRICKS, 0.0);
    poses[displaced] = brick.apply(&poses[displaced]);
    poses
}

/// A faint wall, and pictures of it with patches that are bright in every other one and dark in the
/// rest.
pub fn faint_wall_with_glints() -> (TestWall, Vec<GreyImage>) {
    let faint =
        |wall: WallPoint, perimeter_m: f64| 128.0 + 0.1 * (waves(wall, perimeter_m) - 128.0);
    let wall = TestWall::ring(faint);
    let mut pictures = wall.frames();
    for (k, picture) in pictures.iter_mut().enumerate() {
        let (w, glint) = (picture.width(), if k % 2 == 0 { 240.0 } else { 20.0 });
        for (n, value) in picture.data_mut().iter_mut().enumerate() {
            if (n % w + 7 * k) % 40 < 6 && (n / w) % 30 < 6 {
                *value = glint;
            }
        }
    }
    (wall, pictures)
}

/// Calls a function with the context of pictures of the wall, and frames at these poses.
pub fn with_context<T>(
    wall: &TestWall,
    pictures: Vec<GreyImage>,
    poses: &[Pose],
    function: impl FnOnce(&EstimationContext, &FrameStates) -> T,
) -> T {
    let pyramids = pictures.into_iter().map(|frame| Pyramid::new(frame, 1));
    let frames = FrameCache::of_pyramids(pyramids);
    let prior = independent_prior(poses);
    let context = test_context(wall, &frames, &prior);
    function(&context, &frame_states(poses))
}

/// Prior of independent poses with 1-σ of 0.05 rad and 5 cm, one frame per second.
pub fn independent_prior(initial: &[Pose]) -> Prior {
    Prior {
        jitter: Jitter {
            model: JitterModel::Independent,
            rotation_sigma_rad: 0.05,
            translation_sigma_m: [0.05; 3],
        },
        times_s: (0..initial.len()).map(|k| k as f64).collect(),
        median_step_s: 1.0,
        variance_ratios: vec![1.0; initial.len()],
        rig: None,
        initial: initial.to_vec(),
        log_gain_sigma: 0.3,
        bias_sigma: 10.0,
    }
}

/// No part of the wall is ignored.
static NO_PATCHES: WallRegions = WallRegions::NONE;
/// A global shutter.
static GLOBAL_SHUTTER: LazyLock<Shutter> = LazyLock::new(Shutter::default);

/// Context of noise-free frames of the wall; only poses and exposures are estimated.
pub fn test_context<'a>(
    wall: &'a TestWall,
    frames: &'a FrameCache,
    prior: &'a Prior,
) -> EstimationContext<'a> {
    EstimationContext {
        planned: std::sync::Arc::new(wall.circle),
        is_deviation_known: false,
        nominal: std::sync::Arc::new(wall.circle),
        displacement: None,
        shape: None,
        points: None,
        surface: std::sync::Arc::new(wall.circle),
        ignored: &NO_PATCHES,
        cameras: wall.camera.into(),
        shutter: &GLOBAL_SHUTTER,
        calibration: Calibration::none(wall.camera),
        kappa: Kappa::zeros(),
        frames,
        prior,
        dispersion: 1.0,
        noise: PictureNoise::default(),
    }
}

/// States of frames at these poses, all inliers.
pub fn frame_states(poses: &[Pose]) -> FrameStates {
    FrameStates::at(poses, vec![None; poses.len()])
}

/// A tunnel of 3 m radius, a camera, the lattice of its pixels, and a spiral of `frames` frames,
/// all active.
pub fn posed_spiral(frames: usize) -> (Circle, Camera, WallGrid, Vec<PosedFrame>) {
    let circle = Circle::new(3.0).unwrap();
    let camera = Camera::from_vertical_fov(160, 120, 60f64.to_radians());
    let grid = WallGrid::new(&circle, 3.0 / camera.fy, 1.0);
    let posed = spiral(frames, 0.1, 30f64.to_radians())
        .into_iter()
        .enumerate()
        .map(|(index, pose)| PosedFrame {
            index,
            sweep: Sweep::default(),
            pose,
            footprint: Footprint::trace(&circle, &camera, &pose).unwrap(),
            active: true,
        });
    let posed = posed.collect();
    (circle, camera, grid, posed)
}
