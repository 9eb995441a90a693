//! Super-resolved walls against the truth and against the best single view.

use rayon::prelude::*;
use std::time::Instant;
use tunnelstitch::camera::Camera;
use tunnelstitch::evaluate::mtf50;
use tunnelstitch::frames::GreyImage;
use tunnelstitch::render::{
    Canvas, Interpolation, Kernel, Picture, native_px_per_metre, place_frames,
};
use tunnelstitch::simulate::{Illumination, Scene, SimulateOptions, SlantedEdge, Wall};
use tunnelstitch::super_resolve::{Footprints, MARGIN, PosedCamera, Reading, Region};
use tunnelstitch::surface::{Circle, Surface, WallPoint};
use tunnelstitch::survey::TunnelSection;
use tunnelstitch::trajectory::Shutter;

/// Edge of a tile, fine pixels.
const TILE: usize = 128;

/// A simulated survey with the canvas of twice its frames' resolution.
struct Simulated {
    scene: Scene,
    circle: Circle,
    canvas: Canvas,
    pictures: Vec<Picture>,
    values: Vec<Vec<f32>>,
    noise: f32,
    bicubic: Kernel,
}

/// Estimated and true value of a fine pixel.
#[derive(Clone, Copy)]
struct Drawn {
    wall: WallPoint,
    views: usize,
    truth: f32,
    best_view: f32,
    super_resolved: f32,
}

impl Simulated {
    fn new(options: &SimulateOptions) -> Self {
        let scene = Scene::new(options).unwrap();
        let circle = Circle::new(options.tunnel.nominal_m()).unwrap();
        let placements =
            place_frames(&circle, scene.camera(), scene.truth(), &Shutter::default()).unwrap();
        let native = native_px_per_metre(&circle, scene.camera(), scene.truth()).unwrap();
        let canvas = Canvas::of_placements(&circle, &placements, 2.0 * native).unwrap();
        let frames: Vec<_> = (0..options.frames)
            .into_par_iter()
            .map(|k| scene.render(k).unwrap())
            .collect();
        let clipped = |v: &u8| match *v {
            0 | 255 => f32::NAN,
            v => f32::from(v),
        };
        Self {
            circle,
            canvas,
            values: frames
                .iter()
                .map(|frame| frame.to_luma8().iter().map(clipped).collect())
                .collect(),
            pictures: frames.into_iter().map(Picture::from_decoded).collect(),
            // Rounding adds 1/12.
            noise: (options.noise_grey.powi(2) + 1.0 / 12.0).sqrt() as f32,
            scene,
            bicubic: Kernel::new(Interpolation::Bicubic, 1.0),
        }
    }

    /// The frame with the highest resolution at a wall point, bicubic; the feathered mean of all;
    /// how many there are.
    fn bicubic(&self, wall: WallPoint) -> Option<(f32, f32, usize)> {
        let (frame, camera) = (self.circle.frame(wall), self.scene.camera());
        let kernel = &self.bicubic;
        let (mut best, mut finest, mut sum, mut weights, mut views) = (0.0, 0.0, 0.0, 0.0, 0);
        for (pose, picture) in self.scene.truth().iter().zip(&self.pictures) {
            let x_c = pose.to_camera(&frame.x_w);
            let pixel = camera.project(&x_c);
            let Some(pixel) = pixel.filter(|pixel| camera.is_in_image(pixel, 0.0)) else {
                continue;
            };
            let [value, ..] = picture.at(pixel.x as f32, pixel.y as f32, kernel);
            let jacobian = camera.project_jacobian(&x_c);
            let along = |e: &_| jacobian * pose.r_wc.inverse_transform_vector(e);
            let pixels = along(&frame.e_s).perp(&along(&frame.e_h)).abs();
            if pixels > finest {
                (best, finest) = (value, pixels);
            }
            let tent = |u: f64, width: u32| 1.0 - (2.0 * (u + 0.5) / f64::from(width) - 1.0).abs();
            let weight = (tent(pixel.x, camera.width) * tent(pixel.y, camera.height)) as f32;
            sum += weight * value;
            weights += weight;
            views += 1;
        }
        (views > 0).then(|| (best, sum / weights, views))
    }

    /// The tile's pixels that some frame shows, and the seconds that super-resolving took.
    fn draw(&self, column: usize, row: usize, truth: &GreyImage) -> (Vec<Drawn>, f64) {
        let side = TILE + 2 * MARGIN;
        let region = Region {
            column: column as i64 - MARGIN as i64,
            row: row as i64 - MARGIN as i64,
            columns: side,
            rows: side,
        };
        let wall = |k: usize| {
            let column = (region.column + (k % side) as i64).rem_euclid(self.canvas.columns.into());
            let row = region.row + (k / side) as i64;
            self.canvas.wall_at([column as f64, row as f64])
        };
        let bicubic: Vec<_> = (0..side * side).map(|k| self.bicubic(wall(k))).collect();
        let start: Vec<f32> = bicubic
            .iter()
            .map(|found| found.map_or(f32::NAN, |(_, mean, _)| mean))
            .collect();
        let poses = self.scene.truth().iter();
        let views: Vec<PosedCamera> = poses
            .map(|pose| PosedCamera {
                camera: *self.scene.camera(),
                pose,
            })
            .collect();
        let read = |value: f32| {
            if value.is_finite() {
                Reading {
                    value,
                    inverse_sigma: 1.0 / self.noise,
                }
            } else {
                Reading::default()
            }
        };
        let clock = Instant::now();
        let footprints = Footprints::new(&self.circle, &self.canvas.lattice(), region, &views);
        let readings: Vec<Vec<Reading>> = (self.values.iter().enumerate())
            .map(|(view, values)| {
                let pixels = footprints.pixels(view).iter();
                pixels.map(|pixel| read(values[*pixel as usize])).collect()
            })
            .collect();
        let solved = footprints.super_resolve(&readings, &start).values;
        let seconds = clock.elapsed().as_secs_f64();
        let mut drawn = Vec::new();
        for (k, found) in bicubic.into_iter().enumerate() {
            let (x, y) = (k % side, k / side);
            let within = |x: usize| (MARGIN..MARGIN + TILE).contains(&x);
            if let (Some((best_view, _, views)), true) = (found, within(x) && within(y)) {
                drawn.push(Drawn {
                    wall: wall(k),
                    views,
                    truth: truth.at(column + x - MARGIN, y - MARGIN),
                    best_view,
                    super_resolved: solved[k],
                });
            }
        }
        (drawn, seconds)
    }

    /// Tiles around the middle of the survey, `bands` high, every `stride`-th around; and the
    /// seconds.
    fn draw_middle(&self, bands: usize, stride: usize) -> (Vec<Drawn>, f64) {
        let first = (self.canvas.rows as usize / 2).saturating_sub(bands * TILE / 2);
        let (mut drawn, mut seconds) = (Vec::new(), 0.0);
        for row in (0..bands).map(|band| first + band * TILE) {
            let h_start_m = self.canvas.h_start_m + row as f64 / self.canvas.px_per_metre;
            let around = self.canvas.columns as usize;
            let truth = self.scene.wall(around, TILE, h_start_m);
            let columns: Vec<usize> = (0..around / TILE).step_by(stride).collect();
            let tiles: Vec<_> = columns
                .into_par_iter()
                .map(|k| self.draw(k * TILE, row, &truth))
                .collect();
            for (tile, taken) in tiles {
                drawn.extend(tile);
                seconds += taken;
            }
        }
        (drawn, seconds)
    }

    /// The middle one of the slanted edges' MTF50, cycles per metre, of those drawn entirely.
    fn mtf50(&self, drawn: &[Drawn], value: impl Fn(&Drawn) -> f32) -> f64 {
        let (canvas, perimeter_m) = (&self.canvas, self.circle.perimeter_m());
        let columns = i64::from(canvas.columns);
        let mut picture = vec![f32::NAN; canvas.pixels()];
        for drawn in drawn {
            let [column, row] = canvas.pixel_of(drawn.wall).map(|x| x.round() as usize);
            picture[row * canvas.columns as usize + column] = value(drawn);
        }
        let mtf50_of = |edge: &SlantedEdge| {
            let [column, row] = canvas.pixel_of(edge.middle).map(|x| x as i64);
            let reach = (edge.clear_m[0].hypot(edge.clear_m[1]) * canvas.px_per_metre) as i64 + 1;
            let mut samples = Vec::new();
            for row in row - reach..=row + reach {
                for column in (column - reach..=column + reach).map(|c| c.rem_euclid(columns)) {
                    let wall = canvas.wall_at([column as f64, row as f64]);
                    if let Some(distance_m) = edge.distance_m(&wall, perimeter_m) {
                        let value = *picture.get(usize::try_from(row * columns + column).ok()?)?;
                        samples.push((distance_m, f64::from(value)));
                    }
                }
            }
            let whole = samples.iter().all(|(_, value)| value.is_finite());
            whole
                .then(|| mtf50(samples, 1.0 / canvas.px_per_metre))
                .flatten()
        };
        let edges = SlantedEdge::all(perimeter_m, canvas.chainage_m());
        let mut found: Vec<f64> = edges.iter().filter_map(mtf50_of).collect();
        found.sort_by(f64::total_cmp);
        assert!(found.len() > 5, "{} edges", found.len());
        found[found.len() / 2]
    }
}

/// PSNR of a drawing, decibels.
fn psnr_db(drawn: &[Drawn], value: impl Fn(&Drawn) -> f32) -> f64 {
    let squares = drawn.iter().map(|d| f64::from(value(d) - d.truth).powi(2));
    10.0 * (255.0f64.powi(2) * drawn.len() as f64 / squares.sum::<f64>()).log10()
}

/// Two turns in a tunnel of half the radius, with frames of half the size: pixels of the same size
/// on the wall.
fn small(wall: Wall, noise_grey: f64) -> SimulateOptions {
    SimulateOptions {
        frames: 24,
        tunnel: TunnelSection::round(1.5),
        advance_m: 0.05,
        camera: Camera::from_vertical_fov(320, 240, 60f64.to_radians()),
        wall,
        noise_grey,
        supersample: 4,
        ..SimulateOptions::free()
    }
}

/// Moving objects hide the wall in the best view only.
#[test]
fn super_resolved_walls_are_two_decibels_closer_to_the_truth_than_the_best_view() {
    for (wall, noise_grey, moving, least_db) in [
        (Wall::Brick, 2.0, 0, 3.0),
        (Wall::Brick, 2.0, 8, 5.0),
        (Wall::Concrete, 2.0, 0, 8.0),
    ] {
        let survey = Simulated::new(&SimulateOptions {
            moving,
            ..small(wall.clone(), noise_grey)
        });
        let (drawn, _) = survey.draw_middle(1, 4);
        let gain_db = psnr_db(&drawn, |d| d.super_resolved) - psnr_db(&drawn, |d| d.best_view);
        println!("{wall:?}, noise {noise_grey}, {moving} moving: {gain_db:.2} dB");
        assert!(
            gain_db > least_db,
            "{wall:?}, {moving} moving: {gain_db:.2} dB"
        );
    }
}

#[test]
fn slanted_edges_are_sharper() {
    // Half as large once more: as many views of every place, and half of the squares.
    let survey = Simulated::new(&SimulateOptions {
        tunnel: TunnelSection::round(0.75),
        advance_m: 0.025,
        camera: Camera::from_vertical_fov(160, 120, 60f64.to_radians()),
        light: Illumination::Even,
        ..small(Wall::Target, 2.0)
    });
    let (drawn, _) = survey.draw_middle(3, 1);
    let best_view = survey.mtf50(&drawn, |d| d.best_view);
    let super_resolved = survey.mtf50(&drawn, |d| d.super_resolved);
    println!("MTF50 {super_resolved:.1} after {best_view:.1} cycles/m");
    assert!(
        super_resolved > 1.25 * best_view,
        "MTF50 {super_resolved:.1} after {best_view:.1} cycles/m"
    );
}

/// `cargo test --release --test program super_resolve:: -- --ignored --nocapture`: the figures of
/// full-size surveys.
#[test]
#[ignore = "minutes; prints a table"]
fn figures() {
    println!("wall      noise frames views  best view  super-resolved    gain  µs/px");
    let walls = [Wall::Brick, Wall::Concrete, Wall::Target];
    for (wall, frames) in walls
        .into_iter()
        .flat_map(|wall| [(wall.clone(), 24), (wall, 120)])
    {
        for noise_grey in [0.0, 1.0, 2.0, 4.0] {
            let target = wall == Wall::Target;
            if noise_grey != 2.0 && (frames == 120 || target) {
                continue;
            }
            let survey = Simulated::new(&SimulateOptions {
                frames,
                wall: wall.clone(),
                noise_grey,
                light: if target {
                    Illumination::Even
                } else {
                    Illumination::Downward
                },
                ..SimulateOptions::free()
            });
            let (drawn, seconds) = if target {
                survey.draw_middle(4, 1)
            } else {
                survey.draw_middle(1, 3)
            };
            let views = drawn.iter().map(|d| d.views).sum::<usize>() as f64 / drawn.len() as f64;
            let best_view = psnr_db(&drawn, |d| d.best_view);
            let super_resolved = psnr_db(&drawn, |d| d.super_resolved);
            println!(
                "{:<9} {noise_grey:>5} {frames:>6} {views:>5.1} {best_view:>7.2} dB \
                 {super_resolved:>12.2} dB {:>5.2} dB {:>6.1}",
                format!("{wall:?}"),
                super_resolved - best_view,
                1e6 * seconds / drawn.len() as f64,
            );
            if target {
                println!(
                    "          MTF50, cycles/m: truth {:.1}, best view {:.1}, super-resolved {:.1}",
                    survey.mtf50(&drawn, |d| d.truth),
                    survey.mtf50(&drawn, |d| d.best_view),
                    survey.mtf50(&drawn, |d| d.super_resolved)
                );
            }
        }
    }
}
