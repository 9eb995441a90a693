//! The panorama as a whole, on walls whose texture is known everywhere.

use crate::compositing::band::{Band, Target};
use crate::compositing::options::{Mode, RenderOptions};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::layout::placement::{NO_FRAME, place_frames};
use crate::output::panorama::Panorama;
use crate::output::plan::Plan;
use crate::output::stitch::{on_the_axis, render};
use crate::sampling::picture_cache::PictureCache;
use crate::sampling::pixel_format::PixelFormat;
use crate::sampling::sample::Samples;
use crate::tests::pictures::{changed_pictures, pictures};
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::test_wall::{self, TestWall};
use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};
use tunnelstitch_geometry::trajectory::Shutter;

/// Frames as they are, all of them averaged: what shows geometry alone.
const PLAIN: RenderOptions = RenderOptions {
    interpolation: Interpolation::Bicubic,
    mode: Mode::Average,
    blend: false,
    super_resolve: false,
};

const BEST: RenderOptions = RenderOptions {
    mode: Mode::BestView,
    blend: true,
    ..PLAIN
};

fn draw(wall: &TestWall, mut cache: PictureCache, ppm: f64, options: &RenderOptions) -> Panorama {
    let placements =
        place_frames(&wall.circle, wall.camera, &wall.poses, &Shutter::default()).unwrap();
    let canvas = Canvas::of_placements(&wall.circle, &placements, ppm).unwrap();
    let progress = &Silent;
    render(
        &wall.circle,
        &mut cache,
        &placements,
        &canvas,
        options,
        progress,
    )
    .unwrap()
}

fn draw_wall(wall: &TestWall, ppm: f64, options: &RenderOptions) -> Panorama {
    draw(wall, pictures(wall), ppm, options)
}

/// Root mean square and largest difference from the texture, grey levels, and the number of covered
/// pixels.
fn difference(panorama: &Panorama, perimeter_m: f64) -> (f64, f64, usize) {
    let canvas = *panorama.canvas();
    let (grey, covered) = panorama.grey();
    let (mut squares, mut worst, mut count) = (0.0, 0.0f64, 0usize);
    for row in 0..canvas.rows {
        for column in 0..canvas.columns {
            let at = row as usize * canvas.columns as usize + column as usize;
            if covered[at] {
                let truth = test_wall::waves(canvas.wall(column, row), perimeter_m);
                let error = f64::from(grey.data()[at]) - truth;
                squares += error * error;
                worst = worst.max(error.abs());
                count += 1;
            }
        }
    }
    ((squares / count as f64).sqrt(), worst, count)
}

/// The golden test: off-centre, turned cameras; the texture is known everywhere.
#[test]
fn the_panorama_is_the_texture() {
    let wall = TestWall::ring(test_wall::waves);
    for options in [
        PLAIN,
        RenderOptions {
            mode: Mode::Median,
            ..PLAIN
        },
        RenderOptions {
            blend: false,
            ..BEST
        },
        RenderOptions {
            interpolation: Interpolation::Lanczos3,
            blend: false,
            ..BEST
        },
    ] {
        let panorama = draw_wall(&wall, 60.0, &options);
        let (rms, worst, count) = difference(&panorama, wall.perimeter_m());
        assert!(
            count * 10 > panorama.canvas().pixels() * 7,
            "{count} pixels"
        );
        // Frames and panorama are rounded to whole grey levels: 0.29 each where one frame sees the
        // wall.
        assert!(rms < 0.5, "{options:?}: {rms} grey levels");
        assert!(worst < 2.5, "{options:?}: {worst} grey levels");
    }
}

/// All modes cover exactly what the frames see.
#[test]
fn every_mode_covers_what_the_frames_see() {
    let wall = TestWall::ring(test_wall::waves);
    let covered = |options| draw_wall(&wall, 45.0, options).grey().1;
    let plain = covered(&PLAIN);
    assert_eq!(plain, covered(&BEST));
    let hard = RenderOptions {
        blend: false,
        ..BEST
    };
    assert_eq!(plain, covered(&hard));
}

#[test]
fn what_one_frame_alone_shows_is_left_out_where_others_see_the_wall() {
    let wall = TestWall::ring(test_wall::waves);
    // Something dark before the wall in frames that overlap at least two others there.
    let cache = changed_pictures(&wall, |k, u, v, value| {
        let off = (u as f64 - 80.0).hypot(v as f64 - 60.0);
        if k == 6 && off < 12.0 { 5.0 } else { value }
    });
    let with = |options| {
        difference(
            &draw(&wall, cache.clone(), 60.0, options),
            wall.perimeter_m(),
        )
        .0
    };
    let (mean, best) = (with(&PLAIN), with(&BEST));
    let median = with(&RenderOptions {
        mode: Mode::Median,
        ..PLAIN
    });
    assert!(
        mean > 2.0 * best && mean > median,
        "{mean}, {best}, {median}"
    );
}

/// Without blending and with the nearest pixel, every pixel of the panorama is one of the frame
/// that it is said to be from.
#[test]
fn raw_pixels_are_those_of_the_frames() {
    struct Check<'a>(&'a TestWall, &'a PictureCache, usize);
    impl Target for Check<'_> {
        fn wants_sources(&self) -> bool {
            true
        }

        fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
            let Samples::Eight(samples) = &band.samples else {
                panic!("8 bits");
            };
            for (k, source) in band.sources.iter().enumerate() {
                let (row, column) = (
                    band.row + k as u32 / canvas.columns,
                    k as u32 % canvas.columns,
                );
                if *source == NO_FRAME {
                    assert_eq!(samples[2 * k + 1], 0);
                    continue;
                }
                let frame = *source as usize;
                let wall = canvas.wall(column, row);
                let x_w = tunnelstitch_geometry::surface::Surface::frame(&self.0.circle, wall).x_w;
                let x_c = self.0.poses[frame].to_camera(&x_w);
                let pixel = self.0.camera.project(&x_c).unwrap();
                // Single precision may take the other one in the middle between two.
                let between = |t: f64| ((t - t.floor()) - 0.5).abs() < 1e-3;
                if between(pixel.x) || between(pixel.y) {
                    continue;
                }
                let picture = self.1.picture(frame).unwrap();
                let nearest = Kernel::new(Interpolation::Nearest, 1.0);
                let own = picture.at(pixel.x as f32, pixel.y as f32, &nearest)[0];
                assert_eq!(f32::from(samples[2 * k]), own, "{column}, {row}");
                self.2 += 1;
            }
            Ok(())
        }
    }
    let wall = TestWall::ring(test_wall::waves);
    let mut cache = changed_pictures(&wall, |k, u, v, value| {
        // Different light and noise in every frame.
        0.8 * value + (2 * k) as f32 + ((7 * u + 13 * v + 5 * k) % 11) as f32
    });
    let frames = cache.clone();
    let placements =
        place_frames(&wall.circle, wall.camera, &wall.poses, &Shutter::default()).unwrap();
    let canvas = Canvas::of_placements(&wall.circle, &placements, 70.0).unwrap();
    let options = RenderOptions {
        interpolation: Interpolation::Nearest,
        blend: false,
        ..BEST
    };
    let plan = Plan::new(
        &wall.circle,
        &cache,
        &placements,
        &canvas,
        &options,
        &Silent,
    )
    .unwrap();
    let mut check = Check(&wall, &frames, 0);
    plan.draw(&mut cache, u64::MAX, &mut [&mut check], &Silent)
        .unwrap();
    assert!(check.2 * 2 > canvas.pixels(), "{} pixels", check.2);
}

#[test]
fn a_mark_on_the_wall_is_not_mirrored_and_chainage_right_is_a_turn() {
    // Bright towards larger θ and larger h from the point that the first camera looks at.
    let wall = TestWall::one(|point, perimeter_m| {
        let s = tunnelstitch_geometry::surface::shortest_arc(point.s_m, perimeter_m);
        if s > 0.0 && point.h_m > 0.0 {
            250.0
        } else if s > 0.0 {
            150.0
        } else {
            50.0
        }
    });
    let panorama = draw_wall(&wall, 60.0, &PLAIN);
    let (columns, rows) = (panorama.canvas().columns, panorama.canvas().rows);
    let upright = panorama.clone().into_image(Layout::ThetaRight).to_luma8();
    assert_eq!(upright.dimensions(), (columns, rows));
    let near = 20;
    // Just right of θ = 0, lower half: bright. Upper half: middling. Left of it (the last columns):
    // dark.
    assert_eq!(upright.get_pixel(near, rows * 3 / 4).0, [250]);
    assert_eq!(upright.get_pixel(near, rows / 4).0, [150]);
    assert_eq!(upright.get_pixel(columns - near, rows / 4).0, [50]);
    let turned = panorama.into_image(Layout::ChainageRight).to_luma8();
    assert_eq!(turned.dimensions(), (rows, columns));
    for (x, y, pixel) in turned.enumerate_pixels() {
        assert_eq!(pixel, upright.get_pixel(columns - 1 - y, x));
    }
}

#[test]
fn what_no_frame_sees_is_transparent() {
    let wall = TestWall::one(|_, _| 200.0);
    for options in [PLAIN, BEST] {
        let panorama = draw_wall(&wall, 30.0, &options);
        let columns = panorama.canvas().columns;
        let rows = panorama.canvas().rows;
        assert!(panorama.coverage() > 0.1 && panorama.coverage() < 0.3);
        let image = panorama.into_image(Layout::ThetaRight).to_luma_alpha8();
        assert_eq!(image.get_pixel(0, rows / 2).0, [200, 255]);
        assert_eq!(image.get_pixel(columns / 2, rows / 2).0, [0, 0]);
    }
}

#[test]
fn the_bytes_do_not_depend_on_the_threads() {
    let wall = TestWall::ring(test_wall::waves);
    let fine = RenderOptions {
        super_resolve: true,
        ..BEST
    };
    for (options, ppm) in [(BEST, 50.0), (fine, 150.0)] {
        let draw = |threads| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .unwrap()
                .install(|| draw_wall(&wall, ppm, &options))
        };
        assert!(draw(1) == draw(2), "{options:?}");
    }
}

#[test]
fn colour_and_depth_change_nothing_in_grey() {
    let wall = TestWall::ring(test_wall::waves);
    let grey = draw_wall(&wall, 40.0, &PLAIN).into_image(Layout::ThetaRight);
    assert_eq!(grey.color(), image::ColorType::La8);
    for (channels, deep, colour) in [
        (3, false, image::ColorType::Rgba8),
        (1, true, image::ColorType::La16),
        (3, true, image::ColorType::Rgba16),
    ] {
        let cache = pictures(&wall);
        let format = PixelFormat { channels, deep };
        let wide = (0..cache.len()).map(|k| cache.picture(k).unwrap().clone().widened(format));
        let cache = PictureCache::from_pictures(wall.camera, wide.collect());
        let drawn = draw(&wall, cache, 40.0, &PLAIN).into_image(Layout::ThetaRight);
        assert_eq!(drawn.color(), colour);
        let pairs = grey
            .to_rgba16()
            .into_raw()
            .into_iter()
            .zip(drawn.to_rgba16().into_raw());
        let most = pairs.map(|(a, b)| a.abs_diff(b)).max();
        // Half a grey level of 8 bits that the deeper picture keeps, and 1/40 that sums in whole
        // numbers may be off.
        assert!(most <= Some(if deep { 135 } else { 0 }), "{most:?}");
    }
}

/// A canvas half as fine as the frames shows no pattern that is too fine for it.
#[test]
fn what_is_finer_than_the_canvas_becomes_grey() {
    let wall = TestWall::ring(|_, _| 0.0);
    let cache = changed_pictures(
        &wall,
        |_, u, v, _| if (u + v) % 2 == 0 { 100.0 } else { 200.0 },
    );
    let options = RenderOptions {
        mode: Mode::BestView,
        ..PLAIN
    };
    let panorama = draw(&wall, cache, 62.0, &options);
    let (grey, covered) = panorama.grey();
    let seen = grey
        .data()
        .iter()
        .zip(&covered)
        .filter(|(_, covered)| **covered);
    let squares: f64 = seen
        .clone()
        .map(|(v, _)| (f64::from(*v) - 150.0).powi(2))
        .sum();
    let rms = (squares / seen.count() as f64).sqrt();
    assert!(rms < 15.0, "{rms} of 50");
}

/// Frames on disk, drawn with room for all of them and for one band's only.
#[test]
fn little_memory_changes_nothing_but_the_time() {
    use tunnelstitch_core::frames::{FrameFile, FrameSet};
    let wall = TestWall::ring(test_wall::waves);
    let folder = tempfile::tempdir().unwrap();
    let cache = pictures(&wall);
    let files: Vec<FrameFile> = (0..cache.len())
        .map(|index| {
            let path = folder.path().join(format!("{index:03}.png"));
            let Samples::Eight(samples) = cache.picture(index).unwrap().samples() else {
                panic!("8 bits");
            };
            let (width, height) = (wall.camera.width, wall.camera.height);
            let picture = samples[..(width * height) as usize].to_vec();
            let picture = image::GrayImage::from_raw(width, height, picture).unwrap();
            picture.save(&path).unwrap();
            FrameFile::picture(index, path)
        })
        .collect();
    let files = FrameSet::from(files);
    let placements =
        place_frames(&wall.circle, wall.camera, &wall.poses, &Shutter::default()).unwrap();
    let canvas = Canvas::of_placements(&wall.circle, &placements, 700.0).unwrap();
    let draw = |room| {
        let mut frames = PictureCache::open(&files, wall.camera, 0).unwrap();
        let plan = Plan::new(&wall.circle, &frames, &placements, &canvas, &BEST, &Silent);
        let plan = plan.unwrap();
        let mut panorama = Panorama::empty(canvas, frames.format());
        plan.draw(&mut frames, room, &mut [&mut panorama], &Silent)
            .unwrap();
        panorama
    };
    assert!(canvas.rows > 1024, "{} rows", canvas.rows);
    assert!(draw(u64::MAX) == draw(0));
}

/// The paper's zoom effect: an off-centre camera that is treated as centred puts the wall
/// elsewhere.
#[test]
fn ignoring_the_offset_moves_the_camera_to_the_axis_only() {
    let wall = TestWall::ring(test_wall::waves);
    for (pose, moved) in wall.poses.iter().zip(on_the_axis(&wall.poses)) {
        assert_eq!((moved.t_wc.x, moved.t_wc.z), (0.0, 0.0));
        assert_eq!((moved.t_wc.y, moved.r_wc), (pose.t_wc.y, pose.r_wc));
    }
}
