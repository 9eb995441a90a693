//! Panoramas of a wall in the light of the camera.

use crate::compositing::options::{Mode, RenderOptions};
use crate::layout::canvas::Canvas;
use crate::layout::placement::place_frames;
use crate::output::panorama::Panorama;
use crate::output::stitch::render;
use crate::tests::pictures::changed_pictures;
use nalgebra::Vector3;
use tunnelstitch_core::frames::Lamp;
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::test_wall::{self, TestWall};
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::{Shutter, spiral};

/// The panorama of a wall whose frames show it in a light, `light(frame, u, v)`.
fn draw_lit(
    wall: &TestWall,
    options: &RenderOptions,
    light: impl Fn(usize, f64, f64) -> f64,
) -> Panorama {
    let mut frames = changed_pictures(wall, |k, u, v, value| {
        (f64::from(value) * light(k, u as f64, v as f64)).min(255.0) as f32
    });
    let (circle, shutter) = (&wall.circle, Shutter::default());
    let placements = place_frames(circle, wall.camera, &wall.poses, &shutter).unwrap();
    let canvas = Canvas::of_placements(circle, &placements, 60.0).unwrap();
    render(circle, &mut frames, &placements, &canvas, options, &Silent).unwrap()
}

/// Root mean square of a panorama's errors after one common factor, which cannot be known, and
/// that factor.
fn error_after_one_factor(panorama: &Panorama, perimeter_m: f64) -> (f64, f64) {
    let (grey, covered) = panorama.grey();
    let canvas = *panorama.canvas();
    let truth = (0..canvas.pixels()).map(|k| {
        let (row, column) = (k as u32 / canvas.columns, k as u32 % canvas.columns);
        test_wall::waves(canvas.wall(column, row), perimeter_m)
    });
    let pairs: Vec<(f64, f64)> = (grey.data().iter().zip(truth).zip(&covered))
        .filter(|(_, covered)| **covered)
        .map(|((a, b), _)| (f64::from(*a), b))
        .collect();
    let products: f64 = pairs.iter().map(|(a, b)| a * b).sum();
    let factor = products / pairs.iter().map(|(a, _)| a * a).sum::<f64>();
    let squares: f64 = pairs.iter().map(|(a, b)| (factor * a - b).powi(2)).sum();
    ((squares / pairs.len() as f64).sqrt(), factor)
}

#[test]
fn gains_and_a_headlight_are_undone() {
    let wall = TestWall::ring(test_wall::waves);
    let (w, h) = (f64::from(wall.camera.width), f64::from(wall.camera.height));
    let light = |k: usize, u: f64, v: f64| {
        let gain = 1.0 + 0.25 * (2.3 * k as f64).sin();
        let (x, y) = (2.0 * u / w - 1.0, 2.0 * v / h - 1.0);
        gain * (1.0 - 0.25 * (x * x + y * y))
    };
    let as_they_are = RenderOptions {
        mode: Mode::Average,
        blend: false,
        ..RenderOptions::default()
    };
    let raw = draw_lit(&wall, &as_they_are, light);
    let (before, _) = error_after_one_factor(&raw, wall.perimeter_m());
    let lit = draw_lit(&wall, &RenderOptions::default(), light);
    let (after, factor) = error_after_one_factor(&lit, wall.perimeter_m());
    assert!((0.9..1.1).contains(&factor), "{factor}");
    // Once around, two frames overlap only where both are dark; turns that overlap one another tell
    // more.
    assert!(
        before > 10.0 && after < 3.0,
        "{before} before, {after} after"
    );
}

/// The light of a lamp on a wall that it is nearer to in some frames than in others is no shading
/// that these have in common.
#[test]
fn a_lamp_beside_a_camera_off_the_axis_leaves_no_bands() {
    let mut wall = TestWall::ring(test_wall::waves);
    let plan = spiral(36, 0.04, 30f64.to_radians()).into_iter().enumerate();
    let off_axis = plan.map(|(k, mut pose)| {
        let k = k as f64;
        pose.t_wc += 0.2 * Vector3::new((0.4 * k).sin(), 0.0, (0.7 * k).cos());
        pose
    });
    wall.poses = off_axis.collect();
    let lamp = Lamp {
        position: Vector3::new(0.1, -0.05, 0.0),
        reach_m: 1.0,
    };
    let of_lamp = |k: usize, u: f64, v: f64| {
        let pose = &wall.poses[k];
        let ray = wall.camera.ray(u, v).unwrap();
        let hit = wall.circle.hit(&pose.t_wc, &(pose.r_wc * ray)).unwrap();
        let normal = wall.circle.frame(hit.wall).normal();
        0.5 * lamp.log_at(pose, &hit.x_w, &normal).exp()
    };
    let lit = draw_lit(&wall, &RenderOptions::default(), of_lamp);
    let (error, _) = error_after_one_factor(&lit, wall.perimeter_m());
    // A shading alone leaves 15 grey levels.
    assert!(error < 5.0, "{error}");
}
