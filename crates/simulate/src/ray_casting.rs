//! Rendering of frames by ray casting.

use crate::fittings::occlusion::{Candidates, Occluders};
use crate::ray_rows::{CELLS, RayRow, WallHits, corners, lerp_angle};
use crate::tunnel::Tunnel;
use crate::wall_light::WallLight;
use crate::wall_raster::BATCH_POINTS;
use crate::wall_view::WallView;
use std::f64::consts::TAU;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::trajectory::Pose;

/// Scenery that rays meet.
pub(super) struct Scenery<'a> {
    /// Shape of the wall.
    pub tunnel: &'a Tunnel,
    /// Grey levels of the wall.
    pub wall: WallView<'a>,
    /// Light that depends on the camera.
    pub light: WallLight<'a>,
    /// Cables and lamps before the wall.
    pub occluders: Occluders,
}

/// Renders a frame whose pixels are the means of `n × n` points spread evenly over their squares.
///
/// Rays are cast through the corners of half pixels, and points between them are interpolated on
/// the wall, to within some 10⁻⁴ of a pixel (an eighth of the square of half a pixel times the
/// map's curvature; more towards the vanishing points of the axis).
///
/// `pose`: the camera's pose while a row of pixels is read, at a vertical position v within it.
pub(super) fn cast_rays(
    scenery: &Scenery,
    camera: &Camera,
    pose: impl Fn(usize, f64) -> Pose,
    n: u32,
) -> GreyImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let points: Vec<SubpixelOffset> = (0..n).map(|k| SubpixelOffset::new(k, n)).collect();
    let line =
        |row: usize, v: f64| RayRow::cast(scenery.tunnel, &scenery.light, camera, &pose(row, v), v);
    let share = 1.0 / (n * n) as f32;
    let mut data = vec![0.0f32; width * height];
    let mut lines: Vec<RayRow> = Vec::new();
    let mut between = WallHits::default();
    for (v, row) in data.chunks_exact_mut(width).enumerate() {
        let top = v as f64 - 0.5;
        // The last line of rays of a pixel row is the first of the next, unless the camera has
        // moved in between.
        match lines.last() {
            Some(last) if last.pose == pose(v, top) => {
                lines.drain(..lines.len() - 1);
            }
            _ => lines = vec![line(v, top)],
        }
        lines.extend((1..=CELLS).map(|k| line(v, top + k as f64 / CELLS as f64)));
        // Batches of neighbouring pixels, whose points lie close together on the wall.
        for (n, pixels) in row.chunks_mut(BATCH_POINTS).enumerate() {
            let first = n * BATCH_POINTS;
            let directions = corners(&lines, first, pixels.len());
            let t = lines[0].pose.t_wc;
            let candidates = scenery.occluders.towards(&t, directions);
            let of_pixel = |k: usize| candidates.towards(&t, corners(&lines, first + k, 1));
            let count = if candidates.is_empty() {
                0
            } else {
                pixels.len()
            };
            let of_pixels: Vec<Candidates> = (0..count).map(of_pixel).collect();
            dispatch_simd(
                #[inline(always)]
                || {
                    for down in &points {
                        let ends = [&lines[down.cell], &lines[down.cell + 1]];
                        between.interpolate(ends, down.share, first..first + pixels.len());
                        for across in &points {
                            let points = [down, across];
                            let scenery = (&scenery.wall, &of_pixels[..]);
                            add_points(scenery, ends, &between, points, first, pixels);
                        }
                    }
                },
            );
        }
        row.iter_mut().for_each(|pixel| *pixel *= share);
    }
    GreyImage::new(width, height, data)
}

/// Adds the grey level at one sample point of each pixel of a batch.
///
/// The candidates are the fittings that each pixel may show; none for a batch without any. The
/// batch starts at column `first`; `between` are the hits at the points' vertical position.
#[inline(always)]
fn add_points(
    (wall, candidates): (&WallView, &[Candidates]),
    [upper, lower]: [&RayRow; 2],
    between: &WallHits,
    [down, across]: [&SubpixelOffset; 2],
    first: usize,
    pixels: &mut [f32],
) {
    let (left, right) = (across.cell, across.cell + 1);
    let count = pixels.len();
    let (mut theta, mut h_m, mut values) = (
        [0.0; BATCH_POINTS],
        [0.0; BATCH_POINTS],
        [0.0; BATCH_POINTS],
    );
    let [a, b] = [left, right].map(|k| &between.thetas(k)[..count]);
    let [p, q] = [left, right].map(|k| &between.chainages(k)[..count]);
    for k in 0..count {
        let angle = lerp_angle(a[k], b[k], across.share);
        theta[k] = if angle >= TAU { angle - TAU } else { angle };
        h_m[k] = p[k] + (q[k] - p[k]) * across.share;
    }
    let (theta, h_m) = (&theta[..count], &h_m[..count]);
    let d = |k: usize| {
        let edge = |corner: usize| {
            let (from, to) = (
                upper.direction(first + k, corner),
                lower.direction(first + k, corner),
            );
            from + (to - from) * down.share
        };
        edge(left) + (edge(right) - edge(left)) * across.share
    };
    wall.sample(theta, h_m, d, &mut values);
    if upper.has_light() {
        light_points([upper, lower], [down, across], first, &mut values[..count]);
    }
    if candidates.iter().any(|candidates| !candidates.is_empty()) {
        let (from, to) = (upper.pose.t_wc, lower.pose.t_wc);
        let t = from + (to - from) * down.share;
        let pixels = values.iter_mut().zip(candidates).enumerate();
        for (k, (value, candidates)) in pixels {
            let grey = candidates.grey(t, d(k), upper.lamp.as_ref());
            *value = grey.unwrap_or(*value);
        }
    }
    for (pixel, value) in pixels.iter_mut().zip(&values) {
        *pixel += value;
    }
}

/// Applies the light that depends on the camera to the wall's radiance at one sample point of each
/// pixel of a batch, interpolated between the corners of cells.
fn light_points(
    [upper, lower]: [&RayRow; 2],
    [down, across]: [&SubpixelOffset; 2],
    first: usize,
    values: &mut [f32],
) {
    let lerp = |a: f32, b: f32, share: f64| a + (b - a) * share as f32;
    for (k, value) in values.iter_mut().enumerate() {
        let edge = |row: &RayRow| {
            let [a, b] = [across.cell, across.cell + 1].map(|corner| row.light(first + k, corner));
            [
                lerp(a.gain, b.gain, across.share),
                lerp(a.added, b.added, across.share),
            ]
        };
        let (a, b) = (edge(upper), edge(lower));
        let lit = lerp(a[0], b[0], down.share) * *value + lerp(a[1], b[1], down.share);
        // Where the lens shows nothing.
        *value = if lit.is_nan() { 0.0 } else { lit };
    }
}

/// Position of a sample point in a pixel along one axis.
struct SubpixelOffset {
    cell: usize,
    /// Position within the cell, 0–1.
    share: f64,
}

impl SubpixelOffset {
    /// Position of point `k` of `n`.
    fn new(k: u32, n: u32) -> Self {
        let position = (f64::from(k) + 0.5) / f64::from(n) * CELLS as f64;
        let cell = (position as usize).min(CELLS - 1);
        Self {
            cell,
            share: position - cell as f64,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fittings::solid::Solid;
    use crate::options::Illumination;
    use crate::texture::wall_texture::WallTexture;
    use crate::wall_raster::{TexelGrid, WallPaint, WallRaster};
    use nalgebra::Vector3;
    use tunnelstitch_geometry::trajectory::so3;

    /// A smooth texture.
    struct Waves;

    fn waves(theta: f64, h_m: f64) -> f64 {
        128.0 + 60.0 * (9.0 * theta + 2.0 * h_m).sin() + 30.0 * (8.0 * h_m).cos()
    }

    impl WallTexture for Waves {
        fn fill_row(&self, h_m: f64, _texel_m: f64, row: &mut [f32]) {
            let count = row.len() as f64;
            for (k, value) in row.iter_mut().enumerate() {
                *value = waves(TAU * (k as f64 + 0.5) / count, h_m) as f32;
            }
        }
    }

    fn waves_raster(columns: usize, texel_m: f64, h_m: [f64; 2]) -> WallRaster {
        let paint = WallPaint {
            texture: &Waves,
            light: Illumination::Even,
            wet_patches: None,
        };
        let grid = TexelGrid {
            columns,
            texel_m,
            points: 1,
        };
        WallRaster::paint(&paint, grid, h_m)
    }

    fn scenery<'a>(raster: &'a WallRaster, tunnel: &'a Tunnel, solids: Vec<Solid>) -> Scenery<'a> {
        Scenery {
            tunnel,
            wall: WallView::of(raster),
            light: WallLight::default(),
            occluders: Occluders::new(solids, Illumination::Even),
        }
    }

    /// Known wall points, projected forward by the camera's equation, show the wall's grey value
    /// there.
    #[test]
    fn pixels_show_the_wall_that_projects_onto_them() {
        let (radius_m, columns) = (2.0, 4000);
        let texel_m = TAU * radius_m / columns as f64;
        let camera = Camera::from_vertical_fov(160, 120, 1.0);
        let raster = waves_raster(columns, texel_m, [-2.0, 3.0]);
        // The second looks across θ = 0.
        for turn_rad in [0.7, 0.0] {
            let turn = so3::exp(&Vector3::new(0.1, turn_rad, -0.05));
            let pose = Pose::new(turn, Vector3::new(0.4, 0.3, -0.2));
            shows_the_wall(&raster, radius_m, &camera, &pose);
        }
    }

    fn shows_the_wall(raster: &WallRaster, radius_m: f64, camera: &Camera, pose: &Pose) {
        let tunnel = Tunnel::Round(radius_m);
        let scenery = scenery(raster, &tunnel, Vec::new());
        let frame = cast_rays(&scenery, camera, |_, _| *pose, 4);
        let mut compared = 0;
        for k in 0..160_000 {
            let (theta, h_m) = (
                TAU * f64::from(k % 400) / 400.0,
                f64::from(k / 400) * 0.01 - 1.7,
            );
            let x_w = Vector3::new(radius_m * theta.sin(), h_m, radius_m * theta.cos());
            let x_c = pose.to_camera(&x_w);
            if x_c.z <= 0.0 {
                continue;
            }
            let u = camera.fx * x_c.x / x_c.z + camera.cx;
            let v = camera.fy * x_c.y / x_c.z + camera.cy;
            // Near a pixel's centre, so that nothing needs to be interpolated.
            let (i, j) = (u.round(), v.round());
            let near = (u - i).hypot(v - j) < 0.05;
            if near && i >= 0.0 && j >= 0.0 && i < 160.0 && j < 120.0 {
                let seen = f64::from(frame.at(i as usize, j as usize));
                assert!((seen - waves(theta, h_m)).abs() < 1.0, "at {u} {v}");
                compared += 1;
            }
        }
        assert!(compared > 20, "{compared}");
    }

    /// The outline of a cable is where its tangents are; from another place it hides another part
    /// of the wall.
    #[test]
    fn a_cable_hides_the_wall_behind_it() {
        let (radius_m, x_m, z_m) = (0.02, 0.3, 2.9);
        let camera = Camera::from_vertical_fov(320, 20, 0.08);
        let (tunnel, columns) = (Tunnel::Round(3.0), 4000);
        let texel_m = TAU * 3.0 / columns as f64;
        let raster = waves_raster(columns, texel_m, [-1.0, 1.0]);
        let cable = Solid::vertical_cable(x_m, z_m, radius_m);
        for camera_x_m in [0.0, 0.25] {
            let pose = Pose::new(Default::default(), Vector3::new(camera_x_m, 0.0, 0.0));
            let render = |solids: Vec<Solid>| {
                cast_rays(&scenery(&raster, &tunnel, solids), &camera, |_, _| pose, 8)
            };
            let (bare, hidden) = (render(Vec::new()), render(vec![cable.clone()]));
            let (aside_m, distance_m) = (x_m - camera_x_m, (x_m - camera_x_m).hypot(z_m));
            let edges = [-1.0, 1.0].map(|side| {
                let angle = (aside_m / z_m).atan() + side * (radius_m / distance_m).asin();
                camera.fx * angle.tan() + camera.cx
            });
            for u in 0..320 {
                let (at, differs) = (u as f64, hidden.at(u, 9) != bare.at(u, 9));
                let covered = (at + 0.5).min(edges[1]) - (at - 0.5).max(edges[0]);
                // An eighth of a pixel lies between sample points.
                if covered <= -0.01 {
                    assert!(!differs, "{u}");
                } else if covered > 0.13 {
                    assert!(differs, "{u}");
                }
            }
        }
    }
}
