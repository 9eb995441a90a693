//! The ray caster.

use super::band::Band;
use super::tunnel::{Place, Rays, Tunnel};
use crate::camera::Camera;
use crate::frames::GreyImage;
use crate::trajectory::Pose;
use nalgebra::Vector3;
use std::f64::consts::TAU;

/// Cells of a pixel along each axis, at whose corners rays are cast.
const CELLS: usize = 2;

/// Renders a frame: each pixel is the mean of `n × n` points spread evenly over its square.
///
/// Rays are cast through the corners of half pixels; what lies between meets the wall between them, to within
/// some 10⁻⁴ of a pixel (an eighth of the square of half a pixel times the map's curvature; more towards the axis's
/// vanishing points).
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
    for (v, row) in data.chunks_exact_mut(width).enumerate() {
        // The last line of a row of pixels is the first of the next.
        lines.drain(..lines.len() - 1);
        lines.extend((1..=CELLS).map(|k| line(v as f64 - 0.5 + k as f64 / CELLS as f64)));
        for (u, pixel) in row.iter_mut().enumerate() {
            for down in &points {
                let (upper, lower) = (&lines[down.cell], &lines[down.cell + 1]);
                let edges: [Corner; CELLS + 1] = std::array::from_fn(|k| {
                    upper[u * CELLS + k].towards(&lower[u * CELLS + k], down.share)
                });
                for across in &points {
                    let (left, right) = (&edges[across.cell], &edges[across.cell + 1]);
                    let Corner { theta, h_m, d } = left.towards(right, across.share);
                    if theta.is_nan() {
                        continue;
                    }
                    let theta = if theta < TAU { theta } else { theta - TAU };
                    *pixel += band.at(theta, h_m) + band.glint(theta, h_m, &d);
                }
            }
        }
        row.iter_mut().for_each(|pixel| *pixel *= share);
    }
    GreyImage::new(width, height, data)
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

/// A ray that has been cast.
#[derive(Clone, Copy)]
struct Corner {
    /// Angle, radians, and chainage, metres, where it meets the wall.
    theta: f64,
    h_m: f64,
    /// Its direction.
    d: Vector3<f64>,
}

impl Corner {
    /// Where the lens shows nothing; so is all that lies next to it.
    const DARK: Self = Self {
        theta: f64::NAN,
        h_m: f64::NAN,
        d: Vector3::new(f64::NAN, f64::NAN, f64::NAN),
    };

    /// What lies between two, the shorter way around.
    #[inline]
    fn towards(&self, other: &Self, share: f64) -> Self {
        let turn = other.theta - self.theta;
        let (from, turn) = if turn > 0.5 * TAU {
            (self.theta + TAU, turn - TAU)
        } else if turn < -0.5 * TAU {
            (self.theta, turn + TAU)
        } else {
            (self.theta, turn)
        };
        Self {
            theta: from + turn * share,
            h_m: self.h_m + (other.h_m - self.h_m) * share,
            d: self.d + (other.d - self.d) * share,
        }
    }
}

/// The rays through the corners of the cells along a line of the picture at row `v`.
fn cast_line(rays: &Rays, camera: &Camera, pose: &Pose, v: f64) -> Vec<Corner> {
    let corners = camera.width as usize * CELLS + 1;
    let column = |k: usize| k as f64 / CELLS as f64 - 0.5;
    let corner = |d: Vector3<f64>| {
        let Place { theta, h_m } = rays.hit(&d);
        Corner { theta, h_m, d }
    };
    // Without distortion rays move evenly along a row.
    if let (true, Some(first)) = (camera.lens.is_straight(), camera.ray(0.0, v)) {
        let first = pose.r_wc * first;
        let right = pose.r_wc * Vector3::x() / camera.fx;
        let cast = |k: usize| corner(first + right * column(k));
        return (0..corners).map(cast).collect();
    }
    let cast = |k: usize| {
        let ray = camera.ray(column(k), v);
        ray.map_or(Corner::DARK, |ray| corner(pose.r_wc * ray))
    };
    (0..corners).map(cast).collect()
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

    /// What lies between rays is where rays of its own would meet the wall, across θ = 0 and through a lens, too.
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
                for k in 0..2 * camera.width as usize {
                    let left = lines[0][k].towards(&lines[1][k], 0.3);
                    let right = lines[0][k + 1].towards(&lines[1][k + 1], 0.3);
                    let between = left.towards(&right, 0.6);
                    let u = 0.5 * (k as f64 + 0.6) - 0.5;
                    let d = pose.r_wc * camera.ray(u, v + 0.15).unwrap();
                    let Place { theta, h_m } = caster.hit(&d);
                    let turned = (between.theta - theta + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                    assert!(2.0 * turned.abs() < 1e-3 * pixel_m, "{u} {v}: {turned}");
                    assert!((between.h_m - h_m).abs() < 1e-3 * pixel_m, "{u} {v}");
                }
            }
        }
    }

    /// Known wall points, projected forward by the camera's equation, show the wall's grey value there.
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
