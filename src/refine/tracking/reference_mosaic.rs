//! The wall around a frame as the frames already placed show it.

use crate::camera::{Camera, Sweep};
use crate::frames::{
    GreyImage, LocalContrast, Pyramid, local_contrast, mask_outliers, noise_at_level,
};
use crate::refine::model::context::EstimationContext;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::samples::footprints::reach_m;
use crate::refine::samples::point_sampler::{ImagePoint, PointSampler};
use crate::surface::{Footprint, WallPoint, viewing_distance};
use crate::trajectory::Pose;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::sync::Arc;

/// MosaicGrid cells at the most: a frame that looks far along the tunnel sees more, but not well.
const MOST_CELLS: usize = 1 << 20;

/// Least pixels of a piece of wall, over those it has when seen squarely from the axis, with which
/// it is searched.
const LEAST_DETAIL: f32 = 0.1;
/// How far along the tunnel that is, radii, with some room: `cos³ φ` of the pixels are left at an
/// angle φ to the section.
const LONGEST_LOOK_RADII: f64 = 2.5;
/// The wall is sampled as if it were no farther than this, radii.
const COARSEST_RADII: f64 = 1.25;

/// A lattice on the unrolled wall: one sample a pixel of a pyramid level, where the frame looks.
#[derive(Clone, Copy, Debug)]
pub struct MosaicGrid {
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

impl MosaicGrid {
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

    /// A point of the lattice, numbered row by row.
    pub fn wall(&self, k: usize) -> WallPoint {
        let (column, row) = (k % self.columns, k / self.columns);
        WallPoint {
            s_m: self.s_m + column as f64 * self.spacing_m,
            h_m: self.h_m + row as f64 * self.spacing_m,
        }
    }

    /// World points of the lattice, row by row.
    pub fn points(&self, scene: &EstimationContext) -> Vec<Vector3<f64>> {
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
pub fn pixel_size_m(scene: &EstimationContext, camera: &Camera, pose: &Pose) -> f64 {
    let radius_m = scene.surface.perimeter_m() / std::f64::consts::TAU;
    let range = viewing_distance(scene.surface, pose).unwrap_or(radius_m);
    range.min(3.0 * radius_m) / camera.fy
}

/// One frame at a pyramid level: its grey values and its local contrast.
pub struct UnwrappedFrame {
    camera: Camera,
    level: usize,
    picture: Arc<Pyramid>,
    local: Arc<LocalContrast>,
}

impl UnwrappedFrame {
    /// Frame `frame`, its camera moving by `sweep`, with its contrast over a window as wide as
    /// light is smooth.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn new(
        scene: &EstimationContext,
        level: usize,
        frame: usize,
        sweep: &Sweep,
    ) -> Result<Self, ProblemError> {
        let picture = scene.frames.get(frame)?;
        Ok(Self {
            camera: scene.camera.at_level(level).with_sweep(sweep),
            local: picture.contrast(level),
            level,
            picture,
        })
    }

    /// Frame `frame`, its camera moving by `sweep`, with its contrast over no more than `window`
    /// pixels to each side: fine detail only. `all`: of all that it shows, or of the usual alone
    /// ([`mask_outliers`]).
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn fine(
        scene: &EstimationContext,
        level: usize,
        frame: usize,
        sweep: &Sweep,
        window: usize,
        all: bool,
    ) -> Result<Self, ProblemError> {
        let picture = scene.frames.get(frame)?;
        let image = picture.level(level);
        let local = if all {
            local_contrast(image, window)
        } else {
            local_contrast(&mask_outliers(image), window)
        };
        Ok(Self {
            camera: scene.camera.at_level(level).with_sweep(sweep),
            local: Arc::new(local),
            level,
            picture,
        })
    }

    /// The camera of the level, with its motion.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// The frame as `pose` would put it on the wall; points will be relative to `origin`.
    pub fn at(
        &self,
        scene: &EstimationContext,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> UnwrappedSampler<'_> {
        UnwrappedSampler {
            unwrapped: self,
            sampler: PointSampler::new(&self.camera, pose, origin),
            variance: (scene.noise * scene.noise * noise_at_level(self.level)) as f32,
        }
    }

    /// Its local contrast at wall points relative to `origin`, as `pose` would put it there.
    pub fn contrast(
        &self,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, pose, origin);
        move |point| sampler.project(point)?.sample_valid(&self.local.contrast)
    }

    /// Its grey values, likewise.
    fn grey(
        &self,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, pose, origin);
        move |point| sampler.project(point)?.sample_valid(self.picture())
    }

    fn picture(&self) -> &GreyImage {
        self.picture.level(self.level)
    }
}

/// A frame on the wall, ready to be looked at.
pub struct UnwrappedSampler<'a> {
    unwrapped: &'a UnwrappedFrame,
    sampler: PointSampler,
    /// Variance of a pixel's noise.
    variance: f32,
}

impl UnwrappedSampler<'_> {
    /// Local contrast at a wall point (relative to the origin) and the variance of its noise, where
    /// the frame has a value.
    #[inline]
    pub fn contrast_and_noise(&self, point: &[f32; 3]) -> Option<(f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        Some((contrast, self.noise(&spot)))
    }

    /// Local contrast, the variance of its noise, and the detail in grey levels, likewise.
    #[inline]
    pub fn contrast_and_detail(&self, point: &[f32; 3]) -> Option<(f32, f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        let detail = spot.sample(&self.unwrapped.local.detail);
        Some((contrast, self.noise(&spot), detail))
    }

    /// Local contrast, the variance of its noise, and the grey value, likewise.
    #[inline]
    fn contrast_and_grey(&self, point: &[f32; 3]) -> Option<(f32, f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        Some((
            contrast,
            self.noise(&spot),
            spot.sample(self.unwrapped.picture()),
        ))
    }

    #[inline]
    fn noise(&self, spot: &ImagePoint) -> f32 {
        self.variance * spot.sample(&self.unwrapped.local.sensitivity)
    }
}

/// Sums over the samples that two pictures of the wall share.
#[derive(Clone, Copy, Debug, Default)]
pub struct NccScore {
    /// Samples.
    pub samples: f64,
    xx: f64,
    yy: f64,
    xy: f64,
    noise_x: f64,
    noise_y: f64,
}

impl NccScore {
    /// Adds a sample: both contrasts and the variances of their noise.
    #[inline]
    pub fn add(&mut self, (x, noise_x): (f32, f32), (y, noise_y): (f32, f32)) {
        let (x, y) = (f64::from(x), f64::from(y));
        self.samples += 1.0;
        self.xx += x * x;
        self.yy += y * y;
        self.xy += x * y;
        self.noise_x += f64::from(noise_x);
        self.noise_y += f64::from(noise_y);
    }

    /// Correlation as it is, −1 to 1.
    pub fn correlation(&self) -> f64 {
        self.xy / (self.xx * self.yy).sqrt().max(f64::MIN_POSITIVE)
    }

    /// Share of the contrast that is texture and not noise, 0 to 1.
    pub fn texture(&self) -> f64 {
        let share = |all: f64, noise: f64| (1.0 - noise / all.max(f64::MIN_POSITIVE)).max(0.0);
        (share(self.xx, self.noise_x) * share(self.yy, self.noise_y)).sqrt()
    }

    /// Correlation of the textures behind the noise: the one as it is over the share that is
    /// texture.
    ///
    /// About 1 where both show the same wall, however noisy. None where noise drowns the texture.
    ///
    /// Source: C. Spearman, "The proof and measurement of association between two things", 1904
    /// (correction for attenuation).
    pub fn match_quality(&self) -> Option<f64> {
        let texture = self.texture();
        (texture > LEAST_TEXTURE).then(|| (self.correlation() / texture).min(1.0))
    }
}

/// Least share of texture with which pictures can be compared.
const LEAST_TEXTURE: f64 = 0.2;

/// The wall around a frame, fused from the frames already placed.
pub struct ReferenceMosaic {
    /// Where it is sampled.
    pub lattice: MosaicGrid,
    /// World point that others are relative to.
    pub origin: Vector3<f64>,
    /// Points of the lattice relative to the origin.
    pub points: Vec<[f32; 3]>,
    /// Local contrast there, the mean over the frames; NaN where none looks, or what is there is
    /// ignored.
    pub contrast: Vec<f32>,
    /// Variance of its noise.
    noise: Vec<f32>,
    /// The wall's grey value there, likewise.
    grey: Vec<f32>,
    /// Whether the frame that is looked for shows the point in any detail, from where it is
    /// expected.
    pub visible: Vec<bool>,
}

/// How much of a frame's detail is left on a wall seen from afar or obliquely.
struct ViewCone {
    /// The camera, relative to the origin, metres.
    centre: Vector3<f32>,
    radius_m: f32,
}

impl ViewCone {
    /// True if a piece of the wall with this normal has at least [`LEAST_DETAIL`] of the pixels it
    /// has when seen squarely from the axis: `cos β (r/d)²` of them, at distance d and angle β to
    /// the normal.
    #[inline]
    fn sees(&self, point: &[f32; 3], normal: &Vector3<f32>) -> bool {
        let ray = Vector3::from(*point) - self.centre;
        let square = ray.norm_squared();
        ray.dot(normal).abs() * self.radius_m * self.radius_m
            > LEAST_DETAIL * square * square.sqrt()
    }
}

impl ReferenceMosaic {
    /// Fuses the `placed` frames over where `pose` looks, `margin_m` metres more on every side.
    ///
    /// # Errors
    /// [`ProblemError::Placement`] for a `pose` outside the tunnel, named as frame `frame`.
    pub fn new(
        scene: &EstimationContext,
        placed: &[(UnwrappedFrame, FrameEstimate)],
        camera: &Camera,
        (frame, pose): (usize, &Pose),
        margin_m: f64,
    ) -> Result<Self, ProblemError> {
        let radius_m = scene.surface.perimeter_m() / std::f64::consts::TAU;
        let reach_m = reach_m(scene.surface).min(LONGEST_LOOK_RADII * radius_m);
        let footprint = Footprint::within(scene.surface, camera, pose, reach_m)
            .map_err(|source| ProblemError::Placement { frame, source })?
            .widened(margin_m);
        // A frame that looks along the tunnel has its detail where the wall is near.
        let spacing_m =
            pixel_size_m(scene, camera, pose).min(COARSEST_RADII * radius_m / camera.fy);
        let lattice = MosaicGrid::over(&footprint, spacing_m);
        let middle = WallPoint {
            s_m: 0.5 * (footprint.s_min_m + footprint.s_max_m),
            h_m: 0.5 * (footprint.h_min_m + footprint.h_max_m),
        };
        let origin = scene.surface.frame(middle).x_w;
        let normals: Vec<Vector3<f32>> = (0..lattice.columns)
            .map(|column| {
                let wall = WallPoint {
                    s_m: lattice.s_m + column as f64 * lattice.spacing_m,
                    h_m: middle.h_m,
                };
                let frame = scene.surface.frame(wall);
                frame.e_s.cross(&frame.e_h).normalize().cast()
            })
            .collect();
        let points: Vec<[f32; 3]> = lattice
            .points(scene)
            .iter()
            .map(|x_w| (x_w - origin).cast().into())
            .collect();
        let cone = |pose: &Pose| ViewCone {
            centre: (pose.t_wc - origin).cast(),
            radius_m: radius_m as f32,
        };
        let in_view =
            |cone: &ViewCone, k: usize| cone.sees(&points[k], &normals[k % lattice.columns]);
        let own = cone(pose);
        let visible: Vec<bool> = (0..points.len()).map(|k| in_view(&own, k)).collect();
        let samplers: Vec<(ViewCone, UnwrappedSampler, f32, f32)> = placed
            .iter()
            .map(|(unwrapped, estimate)| {
                (
                    cone(&estimate.pose),
                    unwrapped.at(scene, &estimate.pose, &origin),
                    (-estimate.log_gain).exp() as f32,
                    estimate.bias as f32,
                )
            })
            .collect();
        let fused: Vec<[f32; 3]> = points
            .par_iter()
            .enumerate()
            .map(|(k, point)| {
                let (mut sum, mut seen) = ([0.0f32; 3], 0.0f32);
                if scene.ignored.contains(&lattice.wall(k)) {
                    return [f32::NAN; 3];
                }
                for (cone, sampler, inverse_gain, bias) in &samplers {
                    if !in_view(cone, k) {
                        continue;
                    }
                    if let Some((contrast, noise, grey)) = sampler.contrast_and_grey(point) {
                        sum[0] += contrast;
                        sum[1] += noise;
                        sum[2] += (grey - bias) * inverse_gain;
                        seen += 1.0;
                    }
                }
                let seen = if seen > 0.0 { seen } else { f32::NAN };
                [sum[0] / seen, sum[1] / (seen * seen), sum[2] / seen]
            })
            .collect();
        Ok(Self {
            lattice,
            origin,
            points,
            contrast: fused.iter().map(|f| f[0]).collect(),
            noise: fused.iter().map(|f| f[1]).collect(),
            grey: fused.iter().map(|f| f[2]).collect(),
            visible,
        })
    }

    /// Compares a frame at `pose` with the wall.
    pub fn ncc_score(
        &self,
        scene: &EstimationContext,
        unwrapped: &UnwrappedFrame,
        pose: &Pose,
    ) -> NccScore {
        let sampler = unwrapped.at(scene, pose, &self.origin);
        let mut ncc_score = NccScore::default();
        let wall = self.contrast.iter().zip(&self.noise);
        for (point, (wall, wall_noise)) in self.points.iter().zip(wall) {
            if wall.is_nan() {
                continue;
            }
            if let Some(own) = sampler.contrast_and_noise(point) {
                ncc_score.add((*wall, *wall_noise), own);
            }
        }
        ncc_score
    }

    /// The estimate with `pose` and the gain and bias that fit the wall best: a line through its
    /// grey values.
    pub fn exposed(&self, unwrapped: &UnwrappedFrame, pose: &Pose) -> FrameEstimate {
        let grey = unwrapped.grey(pose, &self.origin);
        let (mut n, mut x, mut y, mut xx, mut xy) = (0.0f64, 0.0f64, 0.0f64, 0.0f64, 0.0f64);
        for (point, wall) in self.points.iter().zip(&self.grey) {
            if wall.is_nan() {
                continue;
            }
            if let Some(value) = grey(point) {
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
