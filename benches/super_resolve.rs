//! `cargo bench --bench super_resolve`: super-resolved against bicubic best-view panoramas, on simulated surveys.

use rayon::prelude::*;
use std::time::Instant;
use tunnelstitch::camera::Pinhole;
use tunnelstitch::evaluate::mtf50;
use tunnelstitch::frames::GreyImage;
use tunnelstitch::render::super_resolve::{Footprints, Region, View};
use tunnelstitch::render::{Canvas, Interpolation, Picture, native_px_per_metre, place};
use tunnelstitch::simulate::{Scene, SimulateOptions, SlantedEdge, Wall, Light};
use tunnelstitch::surface::{Circle, Surface};
use tunnelstitch::trajectory::Pose;

const TILE: usize = 128;

struct Case<'a> {
    circle: Circle,
    canvas: Canvas,
    camera: &'a Pinhole,
    poses: &'a [Pose],
    pictures: Vec<Picture>,
    values: Vec<Vec<f32>>,
}

impl Case<'_> {
    /// Best view and mean, bicubic; views a point.
    fn bicubic(&self, column: i64, row: i64) -> Option<(f32, f32, usize)> {
        let wall = self.canvas.wall_at([column as f64, row as f64]);
        let frame = self.circle.frame(wall);
        let (mut best, mut value, mut sum, mut weights, mut count) = (0.0, 0.0, 0.0, 0.0, 0);
        for (pose, picture) in self.poses.iter().zip(&self.pictures) {
            let x_c = pose.to_camera(&frame.x_w);
            let Some(pixel) = self.camera.project(&x_c).filter(|p| self.camera.sees(p, 0.0)) else { continue };
            let j = self.camera.project_jacobian(&x_c) * pose.r_wc.inverse().to_rotation_matrix().matrix();
            let (a, b) = (j * frame.e_s, j * frame.e_h);
            let resolution = (a.x * b.y - a.y * b.x).abs();
            let v: [f32; 1] = picture.sample(pixel.x, pixel.y, Interpolation::Bicubic);
            let tent = |u: f64, width: u32| ((u + 0.5).min(f64::from(width) - 0.5 - u) * (2.0 / f64::from(width))) as f32;
            let w = tent(pixel.x, self.camera.width) * tent(pixel.y, self.camera.height);
            sum += w * v[0];
            weights += w;
            count += 1;
            if resolution > best {
                (best, value) = (resolution, v[0]);
            }
        }
        (count > 0).then(|| (value, sum / weights, count))
    }
}

fn psnr(error: f64, count: usize) -> f64 {
    10.0 * (255.0 * 255.0 * count as f64 / error).log10()
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let margin: usize = std::env::var("SR_MARGIN").ok().and_then(|v| v.parse().ok()).unwrap_or(8);
    let frames: usize = std::env::var("SR_FRAMES").ok().and_then(|v| v.parse().ok()).unwrap_or(24);
    let moving: u32 = std::env::var("SR_MOVING").ok().and_then(|v| v.parse().ok()).unwrap_or(0);
    let only = args.iter().skip(1).find(|a| !a.starts_with("--"));
    for (wall, noise) in [(Wall::Brick, 2.0), (Wall::Brick, 0.0), (Wall::Brick, 4.0), (Wall::Concrete, 0.0), (Wall::Concrete, 2.0), (Wall::Concrete, 4.0), (Wall::Target, 2.0)] {
        let name = format!("{wall:?}{noise}");
        if only.is_some_and(|o| !name.contains(o.as_str())) { continue; }
        let options = SimulateOptions { frames, wall: wall.clone(), noise_grey: noise, moving,
            light: if wall == Wall::Target { Light::Even } else { Light::Downward }, ..SimulateOptions::free() };
        let scene = Scene::new(&options).unwrap();
        let circle = Circle::new(options.radius_m).unwrap();
        let placements = place(&circle, scene.camera(), scene.truth()).unwrap();
        let ppm = 2.0 * native_px_per_metre(&circle, scene.camera(), scene.truth()).unwrap();
        let canvas = Canvas::of_placements(&circle, &placements, ppm).unwrap();
        let pictures: Vec<Picture> = (0..frames).into_par_iter().map(|k| Picture::from_decoded(scene.render(k).unwrap())).collect();
        let values: Vec<Vec<f32>> = (0..frames).into_par_iter().map(|k| scene.render(k).unwrap().to_luma8().iter().map(|v| if *v == 0 || *v == 255 { f32::NAN } else { f32::from(*v) }).collect()).collect();
        let case = Case { circle, canvas, camera: scene.camera(), poses: scene.truth(), pictures, values };
        let truth = scene.wall(canvas.columns as usize, canvas.rows as usize, canvas.h_start_m);
        // Tiles: a band in the middle of the survey.
        let middle = (canvas.rows as usize / 2 / TILE) * TILE;
        let bands = if wall == Wall::Target { -3..3i64 } else { 0..1i64 };
        let sigma = (noise * noise + 1.0 / 12.0).sqrt() as f32;
        let views: Vec<View> = case.poses.iter().map(|pose| View { camera: case.camera, pose }).collect();
        let mut all_best = vec![f32::NAN; canvas.pixels()];
        let mut all_mean = all_best.clone();
        let mut all_super = all_best.clone();
        let (mut seconds, mut views_sum, mut pixels, mut build) = (0.0, 0usize, 0usize, 0.0);
        let mut errors = [0f64; 3];
        for band in bands {
            let row0 = (middle as i64 + band * TILE as i64).max(0);
            let tiles: Vec<_> = (0..(canvas.columns as usize / TILE)).into_par_iter().filter(|t| wall == Wall::Target || t % 3 == 0).map(|t| {
                let region = Region { column: (t * TILE) as i64 - margin as i64, row: row0 - margin as i64, columns: TILE + 2 * margin, rows: TILE + 2 * margin };
                let bic: Vec<_> = (0..region.pixels()).map(|k| case.bicubic(region.column + (k % region.columns) as i64, region.row + (k / region.columns) as i64)).collect();
                let start: Vec<f32> = bic.iter().map(|b| b.map_or(f32::NAN, |b| b.1)).collect();
                let clock = Instant::now();
                let footprints = Footprints::new(&case.circle, &canvas, region, &views);
                let built = clock.elapsed().as_secs_f64();
                let values: Vec<&[f32]> = case.values.iter().map(Vec::as_slice).collect();
                let x = footprints.solve(&values, &vec![sigma; frames], &start);
                (region, bic, x, built, clock.elapsed().as_secs_f64())
            }).collect();
            for (region, bic, x, built, time) in tiles {
                seconds += time;
                build += built;
                for r in margin..margin + TILE {
                    for c in margin..margin + TILE {
                        let k = r * region.columns + c;
                        let (column, row) = ((region.column + c as i64).rem_euclid(i64::from(canvas.columns)) as usize, region.row + r as i64);
                        if row >= i64::from(canvas.rows) { continue; }
                        let at = row as usize * canvas.columns as usize + column;
                        let (Some((best, mean, count)), true) = (bic[k], x[k].is_finite()) else { continue };
                        views_sum += count;
                        pixels += 1;
                        all_best[at] = best; all_mean[at] = mean; all_super[at] = x[k];
                        let t = truth.data()[at];
                        for (e, v) in errors.iter_mut().zip([best, mean, x[k]]) {
                            *e += f64::from(v - t).powi(2);
                        }
                    }
                }
            }
        }
        let [best, mean, sup] = errors.map(|e| psnr(e, pixels));
        println!("{name}: best {best:.2} dB, mean {mean:.2}, super {sup:.2}: gain {:.2} dB; {:.1} views, {:.1} us/px (build {:.1})", sup - best, views_sum as f64 / pixels as f64, 1e6 * seconds / pixels as f64, 1e6 * build / pixels as f64);
        if wall == Wall::Target {
            let h = [row_h(&canvas, middle as f64 - 380.0), row_h(&canvas, middle as f64 + 380.0)];
            let perimeter = case.circle.perimeter_m();
            let edges = SlantedEdge::all(perimeter, h);
            for (what, picture) in [("truth", truth.data()), ("best", &all_best[..]), ("mean", &all_mean), ("super", &all_super)] {
                let mut found: Vec<f64> = edges.par_iter().filter_map(|edge| {
                    let image = picture;
                    let [c0, r0] = canvas.pixel_of(edge.middle);
                    let reach = (0.15 * canvas.px_per_metre) as i64;
                    let mut samples = Vec::new();
                    for r in r0 as i64 - reach..r0 as i64 + reach {
                        for c in c0 as i64 - reach..c0 as i64 + reach {
                            if r < 0 || r >= i64::from(canvas.rows) { continue; }
                            let c = c.rem_euclid(i64::from(canvas.columns));
                            let wall = canvas.wall(c as u32, r as u32);
                            if let Some(d) = edge.distance_m(&wall, perimeter) {
                                let v = image[r as usize * canvas.columns as usize + c as usize];
                                if v.is_nan() { return None; }
                                samples.push((d, f64::from(v)));
                            }
                        }
                    }
                    mtf50(samples, 1.0 / canvas.px_per_metre)
                }).collect();
                found.sort_by(f64::total_cmp);
                if !found.is_empty() { println!("  MTF50 {what}: median {:.1} cycles/m of {} edges, nyquist {:.1}", found[found.len() / 2], found.len(), 0.5 * canvas.px_per_metre); }
            }
        }
        let _ = GreyImage::new(0, 0, vec![]);
    }
}

fn row_h(canvas: &Canvas, row: f64) -> f64 {
    canvas.wall_at([0.0, row]).h_m
}
