//! Tests of lamp, view and motion in whole frames.

use crate::camera_lamp::CameraLamp;
use crate::effects::effect_options::FrameEffects;
use crate::options::{Illumination, SimulateOptions, Wall};
use crate::scene::Scene;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::Camera;

/// Frames from the axis without jitter, under even light.
fn level() -> SimulateOptions {
    SimulateOptions {
        camera: Camera::from_vertical_fov(80, 61, 1.0),
        frames: 6,
        jitter: None,
        turn_deg: 0.0,
        light: Illumination::Even,
        supersample: 4,
        ..SimulateOptions::free()
    }
}

fn exact(options: &SimulateOptions, frame: usize) -> GreyImage {
    Scene::new(options).unwrap().render_exact(frame)
}

/// On the middle column, the wall at the slope y = Y/Z of the ray is lit by (1 + y²)^(−3/2).
#[test]
fn the_lamp_lights_the_wall_by_cosine_and_distance() {
    let lit = SimulateOptions {
        camera_lamp: Some(CameraLamp {
            offset_m: [0.0; 3],
            sheen_percent: 0.0,
        }),
        ..level()
    };
    let (lit, plain) = (exact(&lit, 1), exact(&level(), 1));
    let camera = level().camera;
    for v in 0..61 {
        let y = (v as f64 - camera.cy) / camera.fy;
        let expected = plain.at(40, v) * (1.0 + y * y).powf(-1.5) as f32;
        assert!((lit.at(40, v) - expected).abs() < 0.5, "{v}");
    }
}

#[test]
fn the_sheen_adds_light_where_lamp_and_wall_face_each_other() {
    let options = |sheen_percent| SimulateOptions {
        camera_lamp: Some(CameraLamp {
            offset_m: [0.0; 3],
            sheen_percent,
        }),
        ..level()
    };
    let (dull, shiny) = (exact(&options(0.0), 1), exact(&options(50.0), 1));
    let added = |u, v| shiny.at(u, v) - dull.at(u, v);
    assert!((added(40, 30) - 127.5).abs() < 1.0, "{}", added(40, 30));
    // cos^30 of 25° is 0.052, at 0.82 of the light.
    let off = added(40, 30 + 26);
    assert!((2.0..12.0).contains(&off), "{off}");
}

/// Odd rows are those of a frame half way to the next.
#[test]
fn interlaced_frames_are_woven_of_two() {
    let interlaced = SimulateOptions {
        interlaced: true,
        advance_m: 0.2,
        ..level()
    };
    let woven = exact(&interlaced, 2);
    let fields = [4, 5].map(|frame| exact(&level(), frame));
    for v in 0..61 {
        for u in 0..80 {
            let difference = (woven.at(u, v) - fields[v % 2].at(u, v)).abs();
            assert!(difference < 1e-2, "{u} {v}: {difference}");
        }
    }
}

/// A camera that turns about the vertical blurs across columns, not across rows.
#[test]
fn motion_blurs_along_the_motion() {
    let turning = SimulateOptions {
        turn_deg: 20.0,
        advance_m: 0.0,
        ..level()
    };
    let blurred = SimulateOptions {
        effects: FrameEffects {
            motion_blur_px: 6.0,
            ..FrameEffects::default()
        },
        ..turning.clone()
    };
    let (sharp, blurred) = (exact(&turning, 2), exact(&blurred, 2));
    let roughness = |image: &GreyImage, du: usize, dv: usize| {
        // In the middle rows, where the wall moves along them.
        let pixels = (0..79 * 12).map(|k| (k % 79, 24 + k / 79));
        let steps = pixels.map(|(u, v)| (image.at(u + du, v + dv) - image.at(u, v)).powi(2));
        steps.sum::<f32>()
    };
    let across = roughness(&blurred, 1, 0) / roughness(&sharp, 1, 0);
    let down = roughness(&blurred, 0, 1) / roughness(&sharp, 0, 1);
    assert!(across < 0.5 && down > 0.5, "{across} {down}");
    let means = [&sharp, &blurred].map(|image| image.data().iter().sum::<f32>() / 4880.0);
    assert!((means[0] - means[1]).abs() < 1.5, "{means:?}");
}

#[test]
fn a_dark_survey_has_little_light_and_all_its_noise() {
    let options = SimulateOptions {
        wall: Wall::Concrete,
        effects: FrameEffects {
            dark: true,
            ..FrameEffects::default()
        },
        ..level()
    };
    let scene = Scene::new(&options).unwrap();
    let (light, picture) = (scene.render_exact(3), scene.render(3).unwrap().into_luma8());
    let mean = light.data().iter().sum::<f32>() / light.data().len() as f32;
    assert!((mean - 12.0).abs() < 1.0, "{mean}");
    let noise = light.data().iter().zip(picture.iter());
    let square = noise.map(|(light, grey)| (f32::from(*grey) - light).powi(2));
    let sigma = (square.sum::<f32>() / light.data().len() as f32).sqrt();
    assert!(
        (sigma - (4.0f32 + 1.0 / 12.0).sqrt()).abs() < 0.1,
        "{sigma}"
    );
}

/// Frames do not depend on the others of their batch, whose rasters have other ends.
#[test]
fn a_forward_view_fades_into_fog_and_does_not_depend_on_the_batch() {
    let options = SimulateOptions {
        view_deg: 0.0,
        frames: 3,
        advance_m: 1.0,
        supersample: 1,
        camera: Camera::from_vertical_fov(64, 49, 1.0),
        wall: Wall::Concrete,
        ..level()
    };
    let scene = Scene::new(&options).unwrap();
    let batches = scene.batches();
    assert_eq!(batches.len(), 1);
    let rasters = scene.rasters(&batches[0].stretches);
    for frame in [0, 2] {
        assert_eq!(
            scene.digitised_frame(&rasters, frame),
            scene.render(frame).unwrap()
        );
    }
    let light = scene.render_exact(1);
    assert!(light.at(32, 24) < 30.0, "{}", light.at(32, 24));
    assert!(light.at(2, 2) > 100.0, "{}", light.at(2, 2));
    assert!(light.data().iter().all(|value| value.is_finite()));
}
