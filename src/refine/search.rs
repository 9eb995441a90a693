//! Looking for a frame beyond the basin of Gauss–Newton.
//!
//! A wall of bricks correlates with itself over a fraction of a brick only; the prior is wider than that. So
//! before a frame is refined, poses over the whole width of the prior are compared with the wall fused from
//! the frames already placed, at a coarse level: turns about the three camera axes on a regular grid (a
//! shift of the camera looks nearly like a turn, and refinement tells them apart). The best local maxima are
//! handed on as hypotheses.
//!
//! The score of a pose is its log-posterior with gain, bias and noise profiled out:
//! `ℓ = −(n/2ν) ln(1 − c²) − ½ ωᵀΣ⁻¹ω`, with c the correlation of the frame with the wall on the n samples
//! that both show, and ν the number of samples that share one independent piece of texture.

use super::estimate::FrameEstimate;
use super::problem::{ProblemError, Scene, sample_spacing};
use crate::surface::{Footprint, WallPoint};
use crate::trajectory::{Pose, so3};
use nalgebra::Vector3;
use rayon::prelude::*;

/// Half width of the search, in standard deviations of the prior.
const REACH: f64 = 3.5;
/// Step of the grid: movement of the picture, pixels of the search level.
const STEP_PX: f64 = 0.6;
/// ν: samples per independent piece of texture.
const SAMPLES_PER_PIECE: f64 = 4.0;
/// Least share of the frame that must lie on known wall.
const LEAST_OVERLAP: f64 = 0.1;
/// Candidates at the most; a wider prior is searched with a coarser grid.
const MOST_CANDIDATES: f64 = 50_000.0;

/// A pose worth refining.
#[derive(Clone, Copy, Debug)]
pub struct Hypothesis {
    /// Pose, with the gain and bias that fit the wall best.
    pub estimate: FrameEstimate,
    /// Log-posterior ℓ.
    pub score: f64,
}

/// The wall around a frame as the frames already placed show it, on a lattice of one sample a pixel.
pub struct FusedWall<'a> {
    scene: &'a Scene<'a>,
    level: usize,
    origin: Vector3<f64>,
    points: Vec<[f32; 3]>,
    values: Vec<f32>,
}

impl<'a> FusedWall<'a> {
    /// Fuses the `placed` frames around where `pose` looks, `margin_m` metres more on every side.
    ///
    /// # Errors
    /// A pose that does not go with the tunnel, named as frame `frame`.
    pub fn new(
        scene: &'a Scene<'a>,
        level: usize,
        placed: &[(usize, FrameEstimate)],
        frame: usize,
        pose: &Pose,
        margin_m: f64,
    ) -> Result<Self, ProblemError> {
        let camera = scene.camera.at_level(level);
        let fail = |source| ProblemError::Placement { frame, source };
        let footprint = Footprint::trace(scene.surface, &camera, pose)
            .map_err(fail)?
            .widened(margin_m);
        let spacing = sample_spacing(scene.surface, &camera, std::slice::from_ref(pose))
            .map_err(|(_, source)| fail(source))?;
        let axis = |from: f64, to: f64| -> Vec<f64> {
            (0..=((to - from) / spacing) as usize)
                .map(|k| from + k as f64 * spacing)
                .collect()
        };
        let (s, h) = (
            axis(footprint.s_min_m, footprint.s_max_m),
            axis(footprint.h_min_m, footprint.h_max_m),
        );
        let origin = scene
            .surface
            .frame(WallPoint {
                s_m: 0.5 * (footprint.s_min_m + footprint.s_max_m),
                h_m: 0.5 * (footprint.h_min_m + footprint.h_max_m),
            })
            .x_w;
        let mut lattice = Vec::new();
        scene.surface.lattice(&s, &h, &mut lattice);
        let lattice: Vec<[f32; 3]> = lattice
            .iter()
            .map(|x_w| {
                let offset = x_w - origin;
                [offset.x as f32, offset.y as f32, offset.z as f32]
            })
            .collect();
        let samplers: Vec<Sampler> = placed
            .iter()
            .map(|(k, estimate)| Sampler::new(scene, level, *k, estimate, &origin))
            .collect();
        let fused: Vec<([f32; 3], f32)> = lattice
            .par_chunks(256)
            .flat_map_iter(|points| {
                let samplers = &samplers;
                points.iter().filter_map(move |point| {
                    let (mut sum, mut seen) = (0.0, 0.0);
                    for value in samplers.iter().filter_map(|sampler| sampler.at(point)) {
                        sum += value;
                        seen += 1.0;
                    }
                    (seen > 0.0).then_some((*point, sum / seen))
                })
            })
            .collect();
        let (points, values) = fused.into_iter().unzip();
        Ok(Self {
            scene,
            level,
            origin,
            points,
            values,
        })
    }

    /// Scores `pose` for frame `frame`; `prior` is its `½ ωᵀΣ⁻¹ω`. None without enough common wall or
    /// where the two do not correlate at all.
    pub fn score(&self, frame: usize, pose: &Pose, prior: f64) -> Option<Hypothesis> {
        let estimate = FrameEstimate::at(*pose);
        let sampler = Sampler::new(self.scene, self.level, frame, &estimate, &self.origin);
        let (mut n, mut x, mut y) = (0.0f64, 0.0f64, 0.0f64);
        let (mut xx, mut yy, mut xy) = (0.0f64, 0.0f64, 0.0f64);
        for (point, wall) in self.points.iter().zip(&self.values) {
            if let Some(value) = sampler.at(point) {
                let (wall, value) = (f64::from(*wall), f64::from(value));
                n += 1.0;
                x += wall;
                y += value;
                xx += wall * wall;
                yy += value * value;
                xy += wall * value;
            }
        }
        let camera = self.scene.camera.at_level(self.level);
        let pixels = f64::from(camera.width) * f64::from(camera.height);
        if n < LEAST_OVERLAP * pixels {
            return None;
        }
        let (variance_x, variance_y) = (xx / n - (x / n).powi(2), yy / n - (y / n).powi(2));
        let covariance = xy / n - x * y / (n * n);
        if !(covariance > 0.0 && variance_x > 0.0 && variance_y > 0.0) {
            return None;
        }
        let c2 = (covariance * covariance / (variance_x * variance_y)).min(1.0 - 1e-9);
        let gain = (covariance / variance_x).clamp(0.4, 2.5);
        Some(Hypothesis {
            estimate: FrameEstimate {
                pose: *pose,
                log_gain: gain.ln(),
                bias: y / n - gain * x / n,
            },
            score: -0.5 * n / SAMPLES_PER_PIECE * (1.0 - c2).ln() - prior,
        })
    }

    /// Searches around `predicted` for frame `frame`; returns at most `count` local maxima, best first.
    /// `sigma_rad`: prior σ of pitch, yaw and roll as seen in the picture.
    pub fn search(
        &self,
        frame: usize,
        predicted: &Pose,
        sigma_rad: [f64; 3],
        count: usize,
    ) -> Vec<Hypothesis> {
        let camera = self.scene.camera.at_level(self.level);
        let half_diagonal = 0.5 * f64::from(camera.width).hypot(f64::from(camera.height));
        let finest = [
            STEP_PX / camera.fy,
            STEP_PX / camera.fx,
            1.5 * STEP_PX / half_diagonal,
        ];
        let total: f64 = (0..3)
            .map(|k| 1.0 + 2.0 * REACH * sigma_rad[k] / finest[k])
            .product();
        let widen = (total / MOST_CANDIDATES).max(1.0).cbrt();
        let step = finest.map(|s| s * widen);
        let half: [i32; 3] =
            std::array::from_fn(|k| (REACH * sigma_rad[k] / step[k]).ceil() as i32);
        let side = half.map(|n| 2 * n + 1);
        let cells: Vec<[i32; 3]> = (0..side[0] * side[1] * side[2])
            .map(|k| {
                [
                    k / (side[1] * side[2]) - half[0],
                    k / side[2] % side[1] - half[1],
                    k % side[2] - half[2],
                ]
            })
            .collect();
        let scored: Vec<Option<Hypothesis>> = cells
            .par_iter()
            .map(|cell| {
                let omega = Vector3::from_fn(|k, _| f64::from(cell[k]) * step[k]);
                let prior: f64 = (0..3)
                    .map(|k| 0.5 * (omega[k] / sigma_rad[k]).powi(2))
                    .sum();
                let pose = Pose::new(predicted.r_wc * so3::exp(&omega), predicted.t_wc);
                self.scene.surface.check_inside(&pose.t_wc).ok()?;
                self.score(frame, &pose, prior)
            })
            .collect();
        let index = |cell: [i32; 3]| -> Option<usize> {
            (0..3).all(|k| cell[k].abs() <= half[k]).then(|| {
                (((cell[0] + half[0]) * side[1] + cell[1] + half[1]) * side[2] + cell[2] + half[2])
                    as usize
            })
        };
        let score = |cell: [i32; 3]| {
            index(cell)
                .and_then(|k| scored[k])
                .map_or(f64::NEG_INFINITY, |hypothesis| hypothesis.score)
        };
        let mut maxima: Vec<Hypothesis> = cells
            .iter()
            .filter(|cell| {
                let own = score(**cell);
                own.is_finite()
                    && (0..27).all(|k| {
                        let neighbour = [
                            cell[0] + k / 9 - 1,
                            cell[1] + k / 3 % 3 - 1,
                            cell[2] + k % 3 - 1,
                        ];
                        score(neighbour) <= own
                    })
            })
            .filter_map(|cell| index(*cell).and_then(|k| scored[k]))
            .collect();
        maxima.sort_by(|a, b| b.score.total_cmp(&a.score));
        maxima.truncate(count);
        maxima
    }
}

/// One frame ready to be sampled point by point.
struct Sampler<'a> {
    image: &'a crate::frames::GreyImage,
    r_cw: nalgebra::Matrix3<f32>,
    centre: Vector3<f32>,
    focal: (f32, f32),
    principal: (f32, f32),
    limit: (f32, f32),
    inverse_gain: f32,
    bias: f32,
}

impl<'a> Sampler<'a> {
    fn new(
        scene: &Scene<'a>,
        level: usize,
        frame: usize,
        estimate: &FrameEstimate,
        origin: &Vector3<f64>,
    ) -> Self {
        let camera = scene.camera.at_level(level);
        let image = scene.frames[frame].level(level);
        let r_wc = estimate.pose.r_wc.to_rotation_matrix();
        Self {
            image,
            r_cw: r_wc.matrix().transpose().cast(),
            centre: estimate.pose.to_camera(origin).cast(),
            focal: (camera.fx as f32, camera.fy as f32),
            principal: (camera.cx as f32, camera.cy as f32),
            limit: ((image.width() - 1) as f32, (image.height() - 1) as f32),
            inverse_gain: (-estimate.log_gain).exp() as f32,
            bias: estimate.bias as f32,
        }
    }

    /// The wall's value at a point (relative to the origin) as this frame shows it, if it does.
    #[inline]
    fn at(&self, point: &[f32; 3]) -> Option<f32> {
        let r = &self.r_cw;
        let dot =
            |row: usize| r[(row, 0)] * point[0] + r[(row, 1)] * point[1] + r[(row, 2)] * point[2];
        let z = self.centre.z + dot(2);
        if z <= 0.0 {
            return None;
        }
        let inverse = 1.0 / z;
        let u = self.focal.0 * (self.centre.x + dot(0)) * inverse + self.principal.0;
        let v = self.focal.1 * (self.centre.y + dot(1)) * inverse + self.principal.1;
        if !(u >= 0.0 && v >= 0.0 && u < self.limit.0 && v < self.limit.1) {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        let (fu, fv) = (u - x as f32, v - y as f32);
        let width = self.image.width();
        let data = &self.image.data()[y * width + x..][..width + 2];
        let a = data[0] + fu * (data[1] - data[0]);
        let b = data[width] + fu * (data[width + 1] - data[width]);
        Some((a + fv * (b - a) - self.bias) * self.inverse_gain)
    }
}
