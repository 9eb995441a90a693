//! Rendering of frames by ray casting.

use crate::fittings::occlusion::{Candidates, Occluders};
use crate::tunnel::Tunnel;
use crate::wall_intersection::{RayCaster, WallHit};
use crate::wall_raster::{BATCH_POINTS, WallRaster};
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::trajectory::Pose;

/// Number of cells of a pixel along each axis, at whose corners rays are cast.
const CELLS: usize = 2;

/// Renders a frame whose pixels are the means of `n × n` points spread evenly over their squares.
///
/// Rays are cast through the corners of half pixels, and points between them are interpolated on
/// the wall, to within some 10⁻⁴ of a pixel (an eighth of the square of half a pixel times the
/// map's curvature; more towards the vanishing points of the axis).
///
/// `pose`: the camera's pose while a row is read.
pub(super) fn cast_rays(
    raster: &WallRaster,
    tunnel: &Tunnel,
    occluders: &Occluders,
    camera: &Camera,
    pose: impl Fn(f64) -> Pose,
    n: u32,
) -> GreyImage {
    let (width, height) = (camera.width as usize, camera.height as usize);
    let points: Vec<SubpixelOffset> = (0..n).map(|k| SubpixelOffset::new(k, n)).collect();
    let line = |v: f64| {
        let pose = pose(v);
        let caster = RayCaster::new(tunnel, pose.t_wc);
        cast_row(&caster, camera, &pose, v)
    };
    let share = 1.0 / (n * n) as f32;
    let mut data = vec![0.0f32; width * height];
    let mut lines = vec![line(-0.5)];
    let mut between = WallHits::default();
    for (v, row) in data.chunks_exact_mut(width).enumerate() {
        // The last line of rays of a pixel row is the first of the next.
        lines.drain(..lines.len() - 1);
        lines.extend((1..=CELLS).map(|k| line(v as f64 - 0.5 + k as f64 / CELLS as f64)));
        // Batches of neighbouring pixels, whose points lie close together on the wall.
        for (n, pixels) in row.chunks_mut(BATCH_POINTS).enumerate() {
            let first = n * BATCH_POINTS;
            let candidates = occluders.towards(&lines[0].t, corners(&lines, first, pixels.len()));
            dispatch_simd(
                #[inline(always)]
                || {
                    for down in &points {
                        let ends = [&lines[down.cell], &lines[down.cell + 1]];
                        between.interpolate(ends, down.share, first..first + pixels.len());
                        for across in &points {
                            let points = [down, across];
                            let scenery = (raster, &candidates);
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
/// The batch starts at column `first`; `between` are the hits at the points' vertical position.
#[inline(always)]
fn add_points(
    (raster, candidates): (&WallRaster, &Candidates),
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
    raster.sample(theta, h_m, &mut values);
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
    raster.add_glints(theta, h_m, d, &mut values);
    if !candidates.is_empty() {
        let t = upper.t + (lower.t - upper.t) * down.share;
        for (k, value) in values.iter_mut().enumerate().take(count) {
            *value = candidates.grey(t, d(k)).unwrap_or(*value);
        }
    }
    for (pixel, value) in pixels.iter_mut().zip(&values) {
        *pixel += value;
    }
}

/// Interpolates between two angles along the shorter arc; the result may exceed 2π.
#[inline(always)]
fn lerp_angle(from: f64, to: f64, share: f64) -> f64 {
    let turn = to - from;
    let more = if turn > 0.5 * TAU { TAU } else { 0.0 };
    let less = if turn < -0.5 * TAU { TAU } else { 0.0 };
    from + more + (turn - more + less) * share
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

/// Wall hits of the rays through the corners of the cells of a pixel row.
///
/// There is one list for each of a pixel's first [`CELLS`] corners, with entry u for pixel u. The
/// first list has one more entry, since a pixel's last corner is the next one's first.
#[derive(Default)]
struct WallHits {
    /// Angles, radians; NaN where the lens shows nothing, which also invalidates neighbours.
    theta: [Vec<f64>; CELLS],
    /// Chainages, metres.
    h_m: [Vec<f64>; CELLS],
}

impl WallHits {
    /// Angles at corner `k` (0 to [`CELLS`]) of all pixels.
    fn thetas(&self, k: usize) -> &[f64] {
        &self.theta[k % CELLS][k / CELLS..]
    }

    /// Chainages at corner `k` (0 to [`CELLS`]) of all pixels.
    fn chainages(&self, k: usize) -> &[f64] {
        &self.h_m[k % CELLS][k / CELLS..]
    }

    /// Sets the hits of some pixels to an interpolation between two lines of rays.
    #[inline(always)]
    fn interpolate(&mut self, [upper, lower]: [&RayRow; 2], share: f64, pixels: Range<usize>) {
        for k in 0..CELLS {
            let own = pixels.start..(pixels.end + 1).min(upper.at.theta[k].len());
            let (theta, h_m) = (&mut self.theta[k], &mut self.h_m[k]);
            theta.resize(own.len(), 0.0);
            h_m.resize(own.len(), 0.0);
            let (a, b) = (&upper.at.theta[k], &lower.at.theta[k]);
            let ends = a[own.clone()].iter().zip(&b[own.clone()]);
            for (theta, (a, b)) in theta.iter_mut().zip(ends) {
                *theta = lerp_angle(*a, *b, share);
            }
            let (p, q) = (&upper.at.h_m[k], &lower.at.h_m[k]);
            let ends = p[own.clone()].iter().zip(&q[own]);
            for (h_m, (p, q)) in h_m.iter_mut().zip(ends) {
                *h_m = p + (q - p) * share;
            }
        }
    }
}

/// Rays through the corners of cells along a line of the image, with their hits.
struct RayRow {
    at: WallHits,
    /// Camera centre, metres.
    t: Vector3<f64>,
    /// Directions of the rays.
    d: [Vec<Vector3<f64>>; CELLS],
}

impl RayRow {
    /// Direction through corner `k` (0 to [`CELLS`]) of pixel u.
    fn direction(&self, u: usize, k: usize) -> Vector3<f64> {
        self.d[k % CELLS][u + k / CELLS]
    }

    fn push(&mut self, corner: usize, WallHit { theta, h_m }: WallHit, d: Vector3<f64>) {
        self.at.theta[corner % CELLS].push(theta);
        self.at.h_m[corner % CELLS].push(h_m);
        self.d[corner % CELLS].push(d);
    }
}

/// Directions through the outer corners of `count` pixels of a row from column `first`.
fn corners(lines: &[RayRow], first: usize, count: usize) -> [Vector3<f64>; 4] {
    let ends = |line: &RayRow| {
        let last = first + count - 1;
        [line.direction(first, 0), line.direction(last, CELLS)]
    };
    let ([a, b], [c, d]) = (ends(&lines[0]), ends(&lines[CELLS]));
    [a, b, c, d]
}

/// Casts the rays along the line of the image at row `v`.
fn cast_row(caster: &RayCaster, camera: &Camera, pose: &Pose, v: f64) -> RayRow {
    let corners = camera.width as usize * CELLS + 1;
    let column = |k: usize| k as f64 / CELLS as f64 - 0.5;
    let mut line = RayRow {
        at: WallHits::default(),
        t: pose.t_wc,
        d: Default::default(),
    };
    // Without distortion the directions are linear along a row.
    if let (true, Some(first)) = (camera.lens.is_distortion_free(), camera.ray(0.0, v)) {
        let first = pose.r_wc * first;
        let right = pose.r_wc * Vector3::x() / camera.fx;
        for k in 0..corners {
            let d = first + right * column(k);
            line.push(k, caster.intersect(&d), d);
        }
        return line;
    }
    for k in 0..corners {
        match camera.ray(column(k), v).map(|ray| pose.r_wc * ray) {
            Some(d) => line.push(k, caster.intersect(&d), d),
            None => line.push(k, WallHit::NONE, Vector3::repeat(f64::NAN)),
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fittings::solid::Solid;
    use crate::options::Illumination;
    use crate::texture::wall_texture::WallTexture;
    use tunnelstitch_geometry::camera::Lens;
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

    /// The hit satisfies the wall's equation and lies ahead on the ray.
    #[test]
    fn a_hit_lies_on_the_wall_and_on_the_ray() {
        let tunnel = Tunnel::Round(2.0);
        let caster = RayCaster::new(&tunnel, Vector3::new(0.9, 7.0, -1.1));
        for k in 0..50 {
            let k = f64::from(k);
            let d = Vector3::new((1.7 * k).sin(), 0.8 * (0.9 * k).cos(), (2.3 * k).cos());
            let WallHit { theta, h_m } = caster.intersect(&d);
            let x_w = Vector3::new(2.0 * theta.sin(), h_m, 2.0 * theta.cos());
            let along = x_w - caster.t;
            assert!(along.cross(&d).norm() < 1e-5 * along.norm() * d.norm() + 1e-6);
            assert!(along.dot(&d) > 0.0);
        }
    }

    /// Interpolated points lie where rays of their own would meet the wall, also across θ = 0 and
    /// with distortion.
    #[test]
    fn points_between_rays_lie_where_their_own_rays_would() {
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.1, 0.05, -0.05)),
            Vector3::new(0.4, 0.3, -0.2),
        );
        let tunnel = Tunnel::Round(2.0);
        let caster = RayCaster::new(&tunnel, pose.t_wc);
        let mut camera = Camera::from_vertical_fov(160, 120, 1.0);
        for k1 in [0.0, -0.08] {
            camera.lens = Lens::radial(k1, 0.0);
            let pixel_m = 2.0 / camera.fy;
            for v in [0.0, 59.0, 119.0] {
                let lines = [v, v + 0.5].map(|v| cast_row(&caster, &camera, &pose, v));
                let mut between = WallHits::default();
                between.interpolate([&lines[0], &lines[1]], 0.3, 0..camera.width as usize);
                for k in 0..CELLS * camera.width as usize {
                    let (pixel, cell) = (k / CELLS, k % CELLS);
                    let [left, right] = [cell, cell + 1].map(|k| between.thetas(k)[pixel]);
                    let [before, after] = [cell, cell + 1].map(|k| between.chainages(k)[pixel]);
                    let u = 0.5 * (k as f64 + 0.6) - 0.5;
                    let d = pose.r_wc * camera.ray(u, v + 0.15).unwrap();
                    let WallHit { theta, h_m } = caster.intersect(&d);
                    let off = lerp_angle(left, right, 0.6) - theta;
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
        let raster = WallRaster::paint(
            &Waves,
            Illumination::Even,
            None,
            columns,
            texel_m,
            [-2.0, 3.0],
        );
        // The second looks across θ = 0.
        for turn_rad in [0.7, 0.0] {
            let turn = so3::exp(&Vector3::new(0.1, turn_rad, -0.05));
            let pose = Pose::new(turn, Vector3::new(0.4, 0.3, -0.2));
            shows_the_wall(&raster, radius_m, &camera, &pose);
        }
    }

    fn shows_the_wall(raster: &WallRaster, radius_m: f64, camera: &Camera, pose: &Pose) {
        let (tunnel, none) = (
            Tunnel::Round(radius_m),
            Occluders::new(Vec::new(), Illumination::Even),
        );
        let frame = cast_rays(raster, &tunnel, &none, camera, |_| *pose, 4);
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
        let raster = WallRaster::paint(
            &Waves,
            Illumination::Even,
            None,
            columns,
            texel_m,
            [-1.0, 1.0],
        );
        let none = Occluders::new(Vec::new(), Illumination::Even);
        let cable = Solid::vertical_cable(x_m, z_m, radius_m);
        let cables = Occluders::new(vec![cable], Illumination::Even);
        for camera_x_m in [0.0, 0.25] {
            let pose = Pose::new(Default::default(), Vector3::new(camera_x_m, 0.0, 0.0));
            let render = |occluders: &Occluders| {
                cast_rays(&raster, &tunnel, occluders, &camera, |_| pose, 8)
            };
            let (bare, hidden) = (render(&none), render(&cables));
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
