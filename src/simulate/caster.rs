//! The ray caster.

use super::band::{Band, RUN};
use super::tunnel::{Place, Rays, Tunnel};
use crate::camera::Camera;
use crate::frames::GreyImage;
use crate::numerics::simd_dispatch::dispatch_simd;
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;

/// Cells of a pixel along each axis, at whose corners rays are cast.
const CELLS: usize = 2;

/// Renders a frame: each pixel is the mean of `n × n` points spread evenly over its square.
///
/// Rays are cast through the corners of half pixels; what lies between meets the wall between them,
/// to within some 10⁻⁴ of a pixel (an eighth of the square of half a pixel times the map's
/// curvature; more towards the axis's vanishing points).
///
/// `pose`: where the camera is when a row is read.
pub(super) fn cast(
    band: &Band,
    tunnel: &Tunnel,
    camera: &Camera,
    pose: impl Fn(f64) -> Pose,
    n: u32,
) -> GreyImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let points: Vec<Point> = (0..n).map(|k| Point::new(k, n)).collect();
    let line = |v: f64| {
        let pose = pose(v);
        let rays = tunnel.rays(pose.t_wc);
        cast_line(&rays, camera, &pose, v)
    };
    let share = 1.0 / (n * n) as f32;
    let mut data = vec![0.0f32; width * height];
    let mut lines = vec![line(-0.5)];
    let mut between = Places::default();
    for (v, row) in data.chunks_exact_mut(width).enumerate() {
        // The last line of a row of pixels is the first of the next.
        lines.drain(..lines.len() - 1);
        lines.extend((1..=CELLS).map(|k| line(v as f64 - 0.5 + k as f64 / CELLS as f64)));
        // All of some pixels' points lie close together on the wall.
        for (n, pixels) in row.chunks_mut(RUN).enumerate() {
            let first = n * RUN;
            dispatch_simd(
                #[inline(always)]
                || {
                    for down in &points {
                        let ends = [&lines[down.cell], &lines[down.cell + 1]];
                        between.set(ends, down.share, first..first + pixels.len());
                        for across in &points {
                            let points = [down, across];
                            add_points(band, ends, &between, points, first, pixels);
                        }
                    }
                },
            );
        }
        row.iter_mut().for_each(|pixel| *pixel *= share);
    }
    GreyImage::new(width, height, data)
}

/// Adds what is seen at one point of each of some pixels of a row, from column `first` on;
/// `between`: theirs.
#[inline(always)]
fn add_points(
    band: &Band,
    [upper, lower]: [&Line; 2],
    between: &Places,
    [down, across]: [&Point; 2],
    first: usize,
    pixels: &mut [f32],
) {
    let (left, right) = (across.cell, across.cell + 1);
    let count = pixels.len();
    let (mut theta, mut h_m, mut values) = ([0.0; RUN], [0.0; RUN], [0.0; RUN]);
    let [a, b] = [left, right].map(|k| &between.thetas(k)[..count]);
    let [p, q] = [left, right].map(|k| &between.chainages(k)[..count]);
    for k in 0..count {
        let angle = turned(a[k], b[k], across.share);
        theta[k] = if angle >= TAU { angle - TAU } else { angle };
        h_m[k] = p[k] + (q[k] - p[k]) * across.share;
    }
    let (theta, h_m) = (&theta[..count], &h_m[..count]);
    band.look(theta, h_m, &mut values);
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
    band.add_glints(theta, h_m, d, &mut values);
    for (pixel, value) in pixels.iter_mut().zip(&values) {
        *pixel += value;
    }
}

/// What lies between two angles at some share of the shorter way around; it may come out beyond 2π.
#[inline(always)]
fn turned(from: f64, to: f64, share: f64) -> f64 {
    let turn = to - from;
    let more = if turn > 0.5 * TAU { TAU } else { 0.0 };
    let less = if turn < -0.5 * TAU { TAU } else { 0.0 };
    from + more + (turn - more + less) * share
}

/// Where a point lies in a pixel, along one axis.
struct Point {
    cell: usize,
    /// 0 to 1 within the cell.
    share: f64,
}

impl Point {
    /// Point `k` of `n`.
    fn new(k: u32, n: u32) -> Self {
        let place = (f64::from(k) + 0.5) / f64::from(n) * CELLS as f64;
        let cell = (place as usize).min(CELLS - 1);
        Self {
            cell,
            share: place - cell as f64,
        }
    }
}

/// Where rays through the corners of cells meet the wall: for each of a pixel's [`CELLS`] first
/// corners along a row a list, in which entry u is that of pixel u. The first list is longer by
/// one: the last corner of a pixel is the first one of the next.
#[derive(Default)]
struct Places {
    /// Places, radians; NaN where the lens shows nothing, and so is all that lies next to it.
    theta: [Vec<f64>; CELLS],
    /// Chainages, metres.
    h_m: [Vec<f64>; CELLS],
}

impl Places {
    /// Those of all pixels' corner `k`, up to [`CELLS`].
    fn thetas(&self, k: usize) -> &[f64] {
        &self.theta[k % CELLS][k / CELLS..]
    }

    /// The same of chainages.
    fn chainages(&self, k: usize) -> &[f64] {
        &self.h_m[k % CELLS][k / CELLS..]
    }

    /// Makes them what lies between those of two lines, of some pixels only.
    #[inline(always)]
    fn set(&mut self, [upper, lower]: [&Line; 2], share: f64, pixels: Range<usize>) {
        for k in 0..CELLS {
            let own = pixels.start..(pixels.end + 1).min(upper.at.theta[k].len());
            let (theta, h_m) = (&mut self.theta[k], &mut self.h_m[k]);
            theta.resize(own.len(), 0.0);
            h_m.resize(own.len(), 0.0);
            let (a, b) = (&upper.at.theta[k], &lower.at.theta[k]);
            let ends = a[own.clone()].iter().zip(&b[own.clone()]);
            for (theta, (a, b)) in theta.iter_mut().zip(ends) {
                *theta = turned(*a, *b, share);
            }
            let (p, q) = (&upper.at.h_m[k], &lower.at.h_m[k]);
            let ends = p[own.clone()].iter().zip(&q[own]);
            for (h_m, (p, q)) in h_m.iter_mut().zip(ends) {
                *h_m = p + (q - p) * share;
            }
        }
    }
}

/// Rays that have been cast through the corners of cells along a line of the picture.
#[derive(Default)]
struct Line {
    at: Places,
    /// Their directions.
    d: [Vec<Vector3<f64>>; CELLS],
}

impl Line {
    /// The direction through corner `k` of pixel u, up to [`CELLS`].
    fn direction(&self, u: usize, k: usize) -> Vector3<f64> {
        self.d[k % CELLS][u + k / CELLS]
    }

    fn push(&mut self, corner: usize, Place { theta, h_m }: Place, d: Vector3<f64>) {
        self.at.theta[corner % CELLS].push(theta);
        self.at.h_m[corner % CELLS].push(h_m);
        self.d[corner % CELLS].push(d);
    }
}

/// The rays along a line of the picture at row `v`.
fn cast_line(rays: &Rays, camera: &Camera, pose: &Pose, v: f64) -> Line {
    let corners = camera.width as usize * CELLS + 1;
    let column = |k: usize| k as f64 / CELLS as f64 - 0.5;
    let mut line = Line::default();
    // Without distortion rays move evenly along a row.
    if let (true, Some(first)) = (camera.lens.is_distortion_free(), camera.ray(0.0, v)) {
        let first = pose.r_wc * first;
        let right = pose.r_wc * Vector3::x() / camera.fx;
        for k in 0..corners {
            let d = first + right * column(k);
            line.push(k, rays.hit(&d), d);
        }
        return line;
    }
    for k in 0..corners {
        match camera.ray(column(k), v).map(|ray| pose.r_wc * ray) {
            Some(d) => line.push(k, rays.hit(&d), d),
            None => line.push(k, Place::NOWHERE, Vector3::repeat(f64::NAN)),
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::Lens;
    use crate::simulate::Light;
    use crate::simulate::wall::Texture;
    use crate::trajectory::so3;

    /// A smooth wall.
    struct Waves;

    fn waves(theta: f64, h_m: f64) -> f64 {
        128.0 + 60.0 * (9.0 * theta + 2.0 * h_m).sin() + 30.0 * (8.0 * h_m).cos()
    }

    impl Texture for Waves {
        fn row(&self, h_m: f64, _texel_m: f64, row: &mut [f32]) {
            let count = row.len() as f64;
            for (k, value) in row.iter_mut().enumerate() {
                *value = waves(TAU * (k as f64 + 0.5) / count, h_m) as f32;
            }
        }
    }

    /// The hit satisfies the wall's equation and lies ahead on the ray.
    #[test]
    fn a_hit_lies_on_the_wall_and_on_the_ray() {
        let tunnel = Tunnel::Round(2.0);
        let caster = tunnel.rays(Vector3::new(0.9, 7.0, -1.1));
        for k in 0..50 {
            let k = f64::from(k);
            let d = Vector3::new((1.7 * k).sin(), 0.8 * (0.9 * k).cos(), (2.3 * k).cos());
            let Place { theta, h_m } = caster.hit(&d);
            let x_w = Vector3::new(2.0 * theta.sin(), h_m, 2.0 * theta.cos());
            let along = x_w - caster.t;
            assert!(along.cross(&d).norm() < 1e-5 * along.norm() * d.norm() + 1e-6);
            assert!(along.dot(&d) > 0.0);
        }
    }

    /// What lies between rays is where rays of its own would meet the wall, across θ = 0 and
    /// through a lens, too.
    #[test]
    fn points_between_rays_lie_where_their_own_rays_would() {
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.1, 0.05, -0.05)),
            Vector3::new(0.4, 0.3, -0.2),
        );
        let tunnel = Tunnel::Round(2.0);
        let caster = tunnel.rays(pose.t_wc);
        let mut camera = Camera::from_vertical_fov(160, 120, 1.0);
        for k1 in [0.0, -0.08] {
            camera.lens = Lens::radial(k1, 0.0);
            let pixel_m = 2.0 / camera.fy;
            for v in [0.0, 59.0, 119.0] {
                let lines = [v, v + 0.5].map(|v| cast_line(&caster, &camera, &pose, v));
                let mut between = Places::default();
                between.set([&lines[0], &lines[1]], 0.3, 0..camera.width as usize);
                for k in 0..CELLS * camera.width as usize {
                    let (pixel, cell) = (k / CELLS, k % CELLS);
                    let [left, right] = [cell, cell + 1].map(|k| between.thetas(k)[pixel]);
                    let [before, after] = [cell, cell + 1].map(|k| between.chainages(k)[pixel]);
                    let u = 0.5 * (k as f64 + 0.6) - 0.5;
                    let d = pose.r_wc * camera.ray(u, v + 0.15).unwrap();
                    let Place { theta, h_m } = caster.hit(&d);
                    let off = turned(left, right, 0.6) - theta;
                    let off = (off + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                    assert!(2.0 * off.abs() < 1e-3 * pixel_m, "{u} {v}: {off}");
                    let h_off = before + 0.6 * (after - before) - h_m;
                    assert!(h_off.abs() < 1e-3 * pixel_m, "{u} {v}");
                }
            }
        }
    }

    /// Known wall points, projected forward by the camera's equation, show the wall's grey value
    /// there.
    #[test]
    fn pixels_show_the_wall_that_projects_onto_them() {
        let (radius_m, columns) = (2.0, 4000);
        let texel_m = TAU * radius_m / columns as f64;
        let camera = Camera::from_vertical_fov(160, 120, 1.0);
        let band = Band::paint(&Waves, Light::Even, None, columns, texel_m, [-2.0, 3.0]);
        // The second looks across θ = 0.
        for turn_rad in [0.7, 0.0] {
            let turn = so3::exp(&Vector3::new(0.1, turn_rad, -0.05));
            let pose = Pose::new(turn, Vector3::new(0.4, 0.3, -0.2));
            shows_the_wall(&band, radius_m, &camera, &pose);
        }
    }

    fn shows_the_wall(band: &Band, radius_m: f64, camera: &Camera, pose: &Pose) {
        let frame = cast(band, &Tunnel::Round(radius_m), camera, |_| *pose, 4);
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
}
