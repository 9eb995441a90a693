//! Reference mosaic: the wall around a frame, fused from the registered frames.

use crate::comparison::mosaic_grid::{MosaicGrid, pixel_size_m};
use crate::comparison::ncc_score::NccScore;
use crate::comparison::unwrapped_frame::{UnwrappedFrame, UnwrappedSampler};
use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::samples::footprints::RESOLVED_RANGE_RADII;
use crate::samples::viewpoint::Viewpoint;
use nalgebra::Vector3;
use rayon::prelude::*;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{Footprint, mean_radius_m};
use tunnelstitch_geometry::trajectory::Pose;

/// The wall around a frame, fused from the registered frames.
pub struct ReferenceMosaic {
    /// The grid on which the wall is sampled.
    pub grid: MosaicGrid,
    /// The world point that others are relative to.
    pub origin: Vector3<f64>,
    /// The grid points relative to the origin.
    pub points: Vec<[f32; 3]>,
    /// Local contrast, the mean over the frames; NaN where no frame has a value and on ignored
    /// parts of the wall.
    pub contrast: Vec<f32>,
    /// Variance of the noise of the local contrast.
    noise: Vec<f32>,
    /// Grey values of the wall, NaN where there is no contrast.
    grey: Vec<f32>,
    /// True for points that the frame to be registered resolves from its predicted pose.
    pub is_resolved: Vec<bool>,
}

/// A registered frame that the mosaic is fused from.
struct Source<'a> {
    viewpoint: Viewpoint,
    sampler: UnwrappedSampler<'a>,
    inverse_gain: f32,
    bias: f32,
}

impl ReferenceMosaic {
    /// Fuses the `registered` frames over the wall where frame `frame` looks from `pose`, widened
    /// by `margin_m` metres on every side.
    ///
    /// # Errors
    /// [`ProblemError::Placement`] for a `pose` outside the tunnel.
    pub fn new(
        context: &EstimationContext,
        registered: &[(UnwrappedFrame, FrameEstimate)],
        camera: &Camera,
        (frame, pose): (usize, &Pose),
        margin_m: f64,
    ) -> Result<Self, ProblemError> {
        let radius_m = mean_radius_m(context.surface.as_ref());
        let resolving = Camera {
            max_range_m: camera.max_range_m.min(RESOLVED_RANGE_RADII * radius_m),
            ..*camera
        };
        let footprint = Footprint::trace(context.surface.as_ref(), &resolving, pose)
            .map_err(|source| ProblemError::Placement { frame, source })?
            .widened(margin_m);
        let spacing_m = pixel_size_m(context, camera, pose);
        let grid = MosaicGrid::over(&footprint, spacing_m);
        let middle = footprint.middle();
        let origin = context.surface.frame(middle).x_w;
        let normals = grid.column_normals(context);
        let points: Vec<[f32; 3]> = grid
            .world_points(context)
            .iter()
            .map(|x_w| (x_w - origin).cast().into())
            .collect();
        let viewpoint = |pose: &Pose| Viewpoint::new(pose, &origin, radius_m);
        let resolves = |viewpoint: &Viewpoint, k: usize| {
            viewpoint.resolves(&points[k], &normals[k % grid.columns])
        };
        let own = viewpoint(pose);
        let is_resolved: Vec<bool> = (0..points.len()).map(|k| resolves(&own, k)).collect();
        let sources: Vec<Source> = registered
            .iter()
            .map(|(unwrapped, estimate)| Source {
                viewpoint: viewpoint(&estimate.pose),
                sampler: unwrapped.sampler_at(context, &estimate.pose, &origin),
                inverse_gain: (-estimate.log_gain).exp() as f32,
                bias: estimate.bias as f32,
            })
            .collect();
        let fused: Vec<[f32; 3]> = points
            .par_iter()
            .enumerate()
            .map(|(k, point)| {
                if context.ignored.contains(&grid.wall_point(k)) {
                    return [f32::NAN; 3];
                }
                fuse_point(&sources, point, |viewpoint| resolves(viewpoint, k))
            })
            .collect();
        Ok(Self {
            grid,
            origin,
            points,
            contrast: fused.iter().map(|f| f[0]).collect(),
            noise: fused.iter().map(|f| f[1]).collect(),
            grey: fused.iter().map(|f| f[2]).collect(),
            is_resolved,
        })
    }

    /// Compares a frame at `pose` with the mosaic.
    pub fn compute_ncc(
        &self,
        context: &EstimationContext,
        unwrapped: &UnwrappedFrame,
        pose: &Pose,
    ) -> NccScore {
        let sampler = unwrapped.sampler_at(context, pose, &self.origin);
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

    /// The frame's estimate at `pose`, with the gain and bias that fit its grey values to those of
    /// the mosaic: a regression line. The gain is within three σ of its prior, whose logarithm has
    /// the 1-σ `log_gain_sigma`.
    pub fn fit_exposure(
        &self,
        unwrapped: &UnwrappedFrame,
        pose: &Pose,
        log_gain_sigma: f64,
    ) -> FrameEstimate {
        let grey = unwrapped.grey_at(pose, &self.origin);
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
        let max_gain = (3.0 * log_gain_sigma).exp();
        let gain = if gain.is_finite() {
            gain.clamp(1.0 / max_gain, max_gain)
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

/// Fuses one wall point from the frames that resolve it: mean contrast, variance of its noise, and
/// mean grey value; NaN if there is none.
#[inline]
fn fuse_point(
    sources: &[Source],
    point: &[f32; 3],
    resolves: impl Fn(&Viewpoint) -> bool,
) -> [f32; 3] {
    let (mut sum, mut count) = ([0.0f32; 3], 0.0f32);
    for source in sources {
        if !resolves(&source.viewpoint) {
            continue;
        }
        if let Some((contrast, noise, grey)) = source.sampler.contrast_and_grey(point) {
            sum[0] += contrast;
            sum[1] += noise;
            sum[2] += (grey - source.bias) * source.inverse_gain;
            count += 1.0;
        }
    }
    let count = if count > 0.0 { count } else { f32::NAN };
    [sum[0] / count, sum[1] / (count * count), sum[2] / count]
}
