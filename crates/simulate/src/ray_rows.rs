//! Rows of rays, and where they meet the wall.

use crate::lamp_light::PosedLamp;
use crate::tunnel::Tunnel;
use crate::wall_intersection::{RayCaster, WallHit};
use crate::wall_light::{PointLight, WallLight};
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::Pose;

/// Number of cells of a pixel along each axis, at whose corners rays are cast.
pub(super) const CELLS: usize = 2;

/// Interpolates between two angles along the shorter arc; the result may exceed 2π.
#[inline(always)]
pub(super) fn lerp_angle(from: f64, to: f64, share: f64) -> f64 {
    let turn = to - from;
    let more = if turn > 0.5 * TAU { TAU } else { 0.0 };
    let less = if turn < -0.5 * TAU { TAU } else { 0.0 };
    from + more + (turn - more + less) * share
}

/// Wall hits of the rays through the corners of the cells of a pixel row.
///
/// There is one list for each of a pixel's first [`CELLS`] corners, with entry u for pixel u. The
/// first list has one more entry, since a pixel's last corner is the next one's first.
#[derive(Default)]
pub(super) struct WallHits {
    /// Angles, radians; NaN where the lens shows nothing, which also invalidates neighbours.
    theta: [Vec<f64>; CELLS],
    /// Chainages, metres.
    h_m: [Vec<f64>; CELLS],
    /// Positions on the rays; not interpolated.
    lambda: [Vec<f64>; CELLS],
}

impl WallHits {
    /// Angles at corner `k` (0 to [`CELLS`]) of all pixels.
    pub fn thetas(&self, k: usize) -> &[f64] {
        &self.theta[k % CELLS][k / CELLS..]
    }

    /// Chainages at corner `k` (0 to [`CELLS`]) of all pixels.
    pub fn chainages(&self, k: usize) -> &[f64] {
        &self.h_m[k % CELLS][k / CELLS..]
    }

    /// Sets the hits of some pixels to an interpolation between two lines of rays.
    #[inline(always)]
    pub fn interpolate(&mut self, [upper, lower]: [&RayRow; 2], share: f64, pixels: Range<usize>) {
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
pub(super) struct RayRow {
    /// Pose of the camera.
    pub pose: Pose,
    /// The camera's lamp.
    pub lamp: Option<PosedLamp>,
    at: WallHits,
    /// Directions of the rays.
    d: [Vec<Vector3<f64>>; CELLS],
    /// Light of the wall there; empty where it does not depend on the camera.
    light: [Vec<PointLight>; CELLS],
}

impl RayRow {
    /// Direction through corner `k` (0 to [`CELLS`]) of pixel u.
    pub fn direction(&self, u: usize, k: usize) -> Vector3<f64> {
        self.d[k % CELLS][u + k / CELLS]
    }

    /// Light of the wall at corner `k` (0 to [`CELLS`]) of pixel u.
    pub fn light(&self, u: usize, k: usize) -> PointLight {
        self.light[k % CELLS][u + k / CELLS]
    }

    /// True if the light of the wall depends on the camera.
    pub fn has_light(&self) -> bool {
        !self.light[0].is_empty()
    }

    /// Casts the rays along the line of the image at row `v`.
    pub fn cast(
        tunnel: &Tunnel,
        light: &WallLight,
        camera: &Camera,
        pose: &Pose,
        v: f64,
    ) -> RayRow {
        let caster = RayCaster::new(tunnel, pose.t_wc).with_reach(light.reach_m());
        let mut row = RayRow {
            pose: *pose,
            lamp: light.lamp_at(pose),
            at: WallHits::default(),
            d: Default::default(),
            light: Default::default(),
        };
        row.cast_rays(&caster, camera, v);
        if !light.is_none() {
            row.add_light(tunnel, light, caster.h_m);
        }
        row
    }

    fn cast_rays(&mut self, caster: &RayCaster, camera: &Camera, v: f64) {
        let corners = camera.width as usize * CELLS + 1;
        let column = |k: usize| k as f64 / CELLS as f64 - 0.5;
        let pose = self.pose;
        // Without distortion the directions are linear along a row.
        if let (true, Some(first)) = (camera.lens.is_distortion_free(), camera.ray(0.0, v)) {
            let first = pose.r_wc * first;
            let right = pose.r_wc * Vector3::x() / camera.fx;
            for k in 0..corners {
                let d = first + right * column(k);
                self.push(k, caster.intersect(&d), d);
            }
            return;
        }
        for k in 0..corners {
            match camera.ray(column(k), v).map(|ray| pose.r_wc * ray) {
                Some(d) => self.push(k, caster.intersect(&d), d),
                None => self.push(k, WallHit::NONE, Vector3::repeat(f64::NAN)),
            }
        }
    }

    fn push(&mut self, corner: usize, hit: WallHit, d: Vector3<f64>) {
        self.at.theta[corner % CELLS].push(hit.theta);
        self.at.h_m[corner % CELLS].push(hit.h_m);
        self.at.lambda[corner % CELLS].push(hit.lambda);
        self.d[corner % CELLS].push(d);
    }

    /// Adds the light at every corner, for a camera at chainage `camera_h_m`, metres.
    fn add_light(&mut self, tunnel: &Tunnel, light: &WallLight, camera_h_m: f64) {
        let camera = (&self.pose.t_wc, camera_h_m);
        for k in 0..CELLS {
            let lights = self.d[k].iter().enumerate().map(|(u, d)| {
                let hit = WallHit {
                    theta: self.at.theta[k][u],
                    h_m: self.at.h_m[k][u],
                    lambda: self.at.lambda[k][u],
                };
                if hit.theta.is_nan() {
                    PointLight::NONE
                } else {
                    light.at(tunnel, self.lamp.as_ref(), camera, d, &hit)
                }
            });
            self.light[k] = lights.collect();
        }
    }
}

/// Directions through the outer corners of `count` pixels of a row from column `first`.
pub(super) fn corners(lines: &[RayRow], first: usize, count: usize) -> [Vector3<f64>; 4] {
    let ends = |line: &RayRow| {
        let last = first + count - 1;
        [line.direction(first, 0), line.direction(last, CELLS)]
    };
    let ([a, b], [c, d]) = (ends(&lines[0]), ends(&lines[CELLS]));
    [a, b, c, d]
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::Lens;
    use tunnelstitch_geometry::trajectory::so3;

    /// The hit satisfies the wall's equation and lies ahead on the ray.
    #[test]
    fn a_hit_lies_on_the_wall_and_on_the_ray() {
        let tunnel = Tunnel::Round(2.0);
        let caster = RayCaster::new(&tunnel, Vector3::new(0.9, 7.0, -1.1));
        for k in 0..50 {
            let k = f64::from(k);
            let d = Vector3::new((1.7 * k).sin(), 0.8 * (0.9 * k).cos(), (2.3 * k).cos());
            let WallHit { theta, h_m, .. } = caster.intersect(&d);
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
        let none = WallLight::default();
        let mut camera = Camera::from_vertical_fov(160, 120, 1.0);
        for k1 in [0.0, -0.08] {
            camera.lens = Lens::radial(k1, 0.0);
            let pixel_m = 2.0 / camera.fy;
            for v in [0.0, 59.0, 119.0] {
                let lines = [v, v + 0.5].map(|v| RayRow::cast(&tunnel, &none, &camera, &pose, v));
                let mut between = WallHits::default();
                between.interpolate([&lines[0], &lines[1]], 0.3, 0..camera.width as usize);
                for k in 0..CELLS * camera.width as usize {
                    let (pixel, cell) = (k / CELLS, k % CELLS);
                    let [left, right] = [cell, cell + 1].map(|k| between.thetas(k)[pixel]);
                    let [before, after] = [cell, cell + 1].map(|k| between.chainages(k)[pixel]);
                    let u = 0.5 * (k as f64 + 0.6) - 0.5;
                    let d = pose.r_wc * camera.ray(u, v + 0.15).unwrap();
                    let WallHit { theta, h_m, .. } = caster.intersect(&d);
                    let off = lerp_angle(left, right, 0.6) - theta;
                    let off = (off + 0.5 * TAU).rem_euclid(TAU) - 0.5 * TAU;
                    assert!(2.0 * off.abs() < 1e-3 * pixel_m, "{u} {v}: {off}");
                    let h_off = before + 0.6 * (after - before) - h_m;
                    assert!(h_off.abs() < 1e-3 * pixel_m, "{u} {v}");
                }
            }
        }
    }
}
