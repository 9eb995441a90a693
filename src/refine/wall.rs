//! The wall around a frame as the frames already placed show it.

use super::contrast::{LocalContrast, local_contrast, wide_window};
use super::estimate::FrameEstimate;
use super::problem::{ProblemError, Scene};
use super::visibility::reach_m;
use crate::camera::Pinhole;
use crate::frames::{GreyImage, Pyramid};
use crate::surface::{Footprint, WallPoint, viewing_distance};
use crate::trajectory::Pose;
use nalgebra::{Matrix3, Vector3};
use rayon::prelude::*;
use std::sync::Arc;

/// Lattice cells at the most: a frame that looks far along the tunnel sees more, but not well.
const MOST_CELLS: usize = 1 << 20;

/// A lattice on the unrolled wall: one sample a pixel of a pyramid level, where the frame looks.
#[derive(Clone, Copy, Debug)]
pub struct Lattice {
    /// Arc length of the first column, metres.
    pub s_m: f64,
    /// Chainage of the first row, metres.
    pub h_m: f64,
    /// Distance between columns and between rows, metres.
    pub spacing_m: f64,
    /// Columns.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
}

impl Lattice {
    /// Covers `footprint` with cells of `spacing_m`, coarser if they would be too many.
    pub fn over(footprint: &Footprint, spacing_m: f64) -> Self {
        let (width, height) = (
            footprint.s_max_m - footprint.s_min_m,
            footprint.h_max_m - footprint.h_min_m,
        );
        let spacing_m = spacing_m.max((width * height / MOST_CELLS as f64).sqrt());
        let count = |length: f64| (length / spacing_m).floor() as usize + 1;
        Self {
            s_m: footprint.s_min_m,
            h_m: footprint.h_min_m,
            spacing_m,
            columns: count(width),
            rows: count(height),
        }
    }

    /// World points of the lattice, row by row.
    pub fn points(&self, scene: &Scene) -> Vec<Vector3<f64>> {
        let axis = |from: f64, n: usize| -> Vec<f64> {
            (0..n).map(|k| from + k as f64 * self.spacing_m).collect()
        };
        let mut points = Vec::new();
        let (s, h) = (axis(self.s_m, self.columns), axis(self.h_m, self.rows));
        scene.surface.lattice(&s, &h, &mut points);
        points
    }
}

/// A pixel's width on the wall where `pose` looks, metres.
pub fn pixel_m(scene: &Scene, camera: &Pinhole, pose: &Pose) -> f64 {
    let radius_m = scene.surface.perimeter_m() / std::f64::consts::TAU;
    let range = viewing_distance(scene.surface, pose).unwrap_or(radius_m);
    range.min(3.0 * radius_m) / camera.fy
}

/// One frame at a pyramid level: its grey values and its local contrast.
pub struct Portrait {
    camera: Pinhole,
    level: usize,
    picture: Arc<Pyramid>,
    local: LocalContrast,
}

impl Portrait {
    /// Frame `frame` with its contrast over a window as wide as light is smooth.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn new(scene: &Scene, level: usize, frame: usize) -> Result<Self, ProblemError> {
        let picture = scene.frames.get(frame)?;
        let window = wide_window(picture.level(level));
        Ok(Self::with_window(scene, level, picture, window))
    }

    /// Frame `frame` with its contrast over no more than `window` pixels to each side: fine detail only.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn fine(
        scene: &Scene,
        level: usize,
        frame: usize,
        window: usize,
    ) -> Result<Self, ProblemError> {
        let picture = scene.frames.get(frame)?;
        Ok(Self::with_window(scene, level, picture, window))
    }

    fn with_window(scene: &Scene, level: usize, picture: Arc<Pyramid>, window: usize) -> Self {
        Self {
            camera: scene.camera.at_level(level),
            local: local_contrast(picture.level(level), window),
            level,
            picture,
        }
    }

    /// The camera of the level.
    pub fn camera(&self) -> &Pinhole {
        &self.camera
    }

    /// Local contrast as `pose` would put it on the wall.
    pub fn contrast(&self, pose: &Pose, origin: &Vector3<f64>) -> Sampler<'_> {
        Sampler::new(&self.local.contrast, &self.camera, pose, origin)
    }

    /// Detail, grey levels, as `pose` would put it on the wall.
    pub fn detail(&self, pose: &Pose, origin: &Vector3<f64>) -> Sampler<'_> {
        Sampler::new(&self.local.detail, &self.camera, pose, origin)
    }

    /// Grey values as `pose` would put them on the wall.
    fn grey(&self, pose: &Pose, origin: &Vector3<f64>) -> Sampler<'_> {
        Sampler::new(self.picture.level(self.level), &self.camera, pose, origin)
    }
}

/// A picture and a pose, ready to be sampled at wall points relative to an origin near them.
pub struct Sampler<'a> {
    image: &'a GreyImage,
    r_cw: Matrix3<f32>,
    centre: Vector3<f32>,
    focal: (f32, f32),
    principal: (f32, f32),
    limit: (f32, f32),
}

impl<'a> Sampler<'a> {
    fn new(image: &'a GreyImage, camera: &Pinhole, pose: &Pose, origin: &Vector3<f64>) -> Self {
        let r_wc = pose.r_wc.to_rotation_matrix();
        Self {
            image,
            r_cw: r_wc.matrix().transpose().cast(),
            centre: pose.to_camera(origin).cast(),
            focal: (camera.fx as f32, camera.fy as f32),
            principal: (camera.cx as f32, camera.cy as f32),
            limit: ((image.width() - 1) as f32, (image.height() - 1) as f32),
        }
    }

    /// The picture's value at a wall point (relative to the origin), if it has one there.
    #[inline]
    pub fn at(&self, point: &[f32; 3]) -> Option<f32> {
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
        let value = a + fv * (b - a);
        (!value.is_nan()).then_some(value)
    }
}

/// The wall around a frame, fused from the frames already placed.
pub struct FusedWall {
    /// Where it is sampled.
    pub lattice: Lattice,
    /// World point that others are relative to.
    pub origin: Vector3<f64>,
    /// Points of the lattice relative to the origin.
    pub points: Vec<[f32; 3]>,
    /// Local contrast there, the mean over the frames; NaN where none looks.
    pub contrast: Vec<f32>,
    /// The wall's grey value there, likewise.
    grey: Vec<f32>,
}

/// How well a frame at some pose agrees with the wall.
#[derive(Clone, Copy, Debug)]
pub struct Agreement {
    /// Correlation of local contrast, −1 to 1.
    pub correlation: f64,
    /// Wall samples both show.
    pub samples: f64,
}

impl FusedWall {
    /// Fuses the `placed` frames over where `pose` looks, `margin_m` metres more on every side.
    ///
    /// # Errors
    /// [`ProblemError::Placement`] for a `pose` outside the tunnel, named as frame `frame`.
    pub fn new(
        scene: &Scene,
        placed: &[(Portrait, FrameEstimate)],
        camera: &Pinhole,
        (frame, pose): (usize, &Pose),
        margin_m: f64,
    ) -> Result<Self, ProblemError> {
        let footprint = Footprint::within(scene.surface, camera, pose, reach_m(scene.surface))
            .map_err(|source| ProblemError::Placement { frame, source })?
            .widened(margin_m);
        let lattice = Lattice::over(&footprint, pixel_m(scene, camera, pose));
        let middle = WallPoint {
            s_m: 0.5 * (footprint.s_min_m + footprint.s_max_m),
            h_m: 0.5 * (footprint.h_min_m + footprint.h_max_m),
        };
        let origin = scene.surface.frame(middle).x_w;
        let points: Vec<[f32; 3]> = lattice
            .points(scene)
            .iter()
            .map(|x_w| {
                let offset = x_w - origin;
                [offset.x as f32, offset.y as f32, offset.z as f32]
            })
            .collect();
        let samplers: Vec<(Sampler, Sampler, f32, f32)> = placed
            .iter()
            .map(|(portrait, estimate)| {
                (
                    portrait.contrast(&estimate.pose, &origin),
                    portrait.grey(&estimate.pose, &origin),
                    (-estimate.log_gain).exp() as f32,
                    estimate.bias as f32,
                )
            })
            .collect();
        let fused: Vec<[f32; 2]> = points
            .par_iter()
            .map(|point| {
                let (mut sum, mut seen) = ([0.0f32; 2], 0.0f32);
                for (contrast, grey, inverse_gain, bias) in &samplers {
                    if let (Some(contrast), Some(grey)) = (contrast.at(point), grey.at(point)) {
                        sum[0] += contrast;
                        sum[1] += (grey - bias) * inverse_gain;
                        seen += 1.0;
                    }
                }
                sum.map(|sum| if seen > 0.0 { sum / seen } else { f32::NAN })
            })
            .collect();
        Ok(Self {
            lattice,
            origin,
            points,
            contrast: fused.iter().map(|f| f[0]).collect(),
            grey: fused.iter().map(|f| f[1]).collect(),
        })
    }

    /// Correlates a frame at `pose` with the wall.
    pub fn agreement(&self, portrait: &Portrait, pose: &Pose) -> Agreement {
        let sampler = portrait.contrast(pose, &self.origin);
        let (mut n, mut xx, mut yy, mut xy) = (0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for (point, wall) in self.points.iter().zip(&self.contrast) {
            if wall.is_nan() {
                continue;
            }
            if let Some(value) = sampler.at(point) {
                let (wall, value) = (f64::from(*wall), f64::from(value));
                n += 1.0;
                xx += wall * wall;
                yy += value * value;
                xy += wall * value;
            }
        }
        Agreement {
            correlation: xy / (xx * yy).sqrt().max(f64::MIN_POSITIVE),
            samples: n,
        }
    }

    /// The estimate with `pose` and the gain and bias that fit the wall best: a line through its grey values.
    pub fn exposed(&self, portrait: &Portrait, pose: &Pose) -> FrameEstimate {
        let sampler = portrait.grey(pose, &self.origin);
        let (mut n, mut x, mut y, mut xx, mut xy) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for (point, wall) in self.points.iter().zip(&self.grey) {
            if wall.is_nan() {
                continue;
            }
            if let Some(value) = sampler.at(point) {
                let (wall, value) = (f64::from(*wall), f64::from(value));
                n += 1.0;
                x += wall;
                y += value;
                xx += wall * wall;
                xy += wall * value;
            }
        }
        if n == 0.0 {
            return FrameEstimate::at(*pose);
        }
        let gain = (xy - x * y / n) / (xx - x * x / n);
        let gain = if gain.is_finite() {
            gain.clamp(0.4, 2.5)
        } else {
            1.0
        };
        FrameEstimate {
            pose: *pose,
            log_gain: gain.ln(),
            bias: (y - gain * x) / n,
        }
    }
}
