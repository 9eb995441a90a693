//! A frame projected onto the unrolled wall by a pose.

use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::samples::point_sampler::{ImagePoint, PointSampler};
use nalgebra::Vector3;
use std::sync::Arc;
use tunnelstitch_core::frames::{GreyImage, LocalContrast, Pyramid, local_contrast, mask_outliers};
use tunnelstitch_geometry::camera::{Camera, Sweep};
use tunnelstitch_geometry::trajectory::Pose;

/// A frame at a pyramid level, with its local contrast, ready to be projected onto the wall.
pub struct UnwrappedFrame {
    camera: Camera,
    level: usize,
    pyramid: Arc<Pyramid>,
    local: Arc<LocalContrast>,
}

impl UnwrappedFrame {
    /// Frame `frame`, read while its camera moves by `sweep`; its local contrast is taken over a
    /// window as wide as light is smooth.
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn new(
        context: &EstimationContext,
        level: usize,
        frame: usize,
        sweep: &Sweep,
    ) -> Result<Self, ProblemError> {
        let pyramid = context.frames.get(frame)?;
        Ok(Self {
            camera: context.cameras.of(frame).at_level(level).with_sweep(sweep),
            local: pyramid.contrast(level),
            level,
            pyramid,
        })
    }

    /// Frame `frame`, read while its camera moves by `sweep`; its local contrast is taken over no
    /// more than `window_px` pixels to each side, so that only fine detail is left.
    ///
    /// `with_outliers`: of all that the frame shows, or without what stands out of the wall
    /// ([`mask_outliers`]).
    ///
    /// # Errors
    /// [`ProblemError::Frame`].
    pub fn with_window(
        context: &EstimationContext,
        level: usize,
        frame: usize,
        sweep: &Sweep,
        window_px: usize,
        with_outliers: bool,
    ) -> Result<Self, ProblemError> {
        let pyramid = context.frames.get(frame)?;
        let image = pyramid.level(level);
        let local = if with_outliers {
            local_contrast(image, window_px)
        } else {
            local_contrast(&mask_outliers(image), window_px)
        };
        Ok(Self {
            camera: context.cameras.of(frame).at_level(level).with_sweep(sweep),
            local: Arc::new(local),
            level,
            pyramid,
        })
    }

    /// The camera of the level, with its motion.
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Projects the frame onto the wall by `pose`; wall points will be given relative to `origin`.
    pub fn sampler_at(
        &self,
        context: &EstimationContext,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> UnwrappedSampler<'_> {
        UnwrappedSampler {
            unwrapped: self,
            sampler: PointSampler::new(&self.camera, pose, origin),
            variance: context.noise.variance_at(self.level) as f32,
        }
    }

    /// A function from wall points relative to `origin` to the frame's local contrast there.
    pub fn contrast_at(
        &self,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, pose, origin);
        move |point| sampler.project(point)?.sample_valid(&self.local.contrast)
    }

    /// A function from wall points relative to `origin` to the frame's grey value there.
    pub fn grey_at(
        &self,
        pose: &Pose,
        origin: &Vector3<f64>,
    ) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, pose, origin);
        move |point| sampler.project(point)?.sample_valid(self.image())
    }

    fn image(&self) -> &GreyImage {
        self.pyramid.level(self.level)
    }
}

/// A frame at a pose, sampled at wall points.
pub struct UnwrappedSampler<'a> {
    unwrapped: &'a UnwrappedFrame,
    sampler: PointSampler,
    /// Variance of a pixel's noise, grey levels².
    variance: f32,
}

impl UnwrappedSampler<'_> {
    /// Local contrast at a wall point relative to the origin, and the variance of its noise; None
    /// where the frame has no value.
    #[inline]
    pub fn contrast_and_noise(&self, point: &[f32; 3]) -> Option<(f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        Some((contrast, self.noise_at(&spot)))
    }

    /// Local contrast, the variance of its noise, and the fine detail in grey levels; None where
    /// the frame has no value.
    #[inline]
    pub fn contrast_and_detail(&self, point: &[f32; 3]) -> Option<(f32, f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        let detail = spot.sample(&self.unwrapped.local.detail);
        Some((contrast, self.noise_at(&spot), detail))
    }

    /// Local contrast, the variance of its noise, and the grey value; None where the frame has no
    /// value.
    #[inline]
    pub fn contrast_and_grey(&self, point: &[f32; 3]) -> Option<(f32, f32, f32)> {
        let spot = self.sampler.project(point)?;
        let contrast = spot.sample_valid(&self.unwrapped.local.contrast)?;
        Some((
            contrast,
            self.noise_at(&spot),
            spot.sample(self.unwrapped.image()),
        ))
    }

    #[inline]
    fn noise_at(&self, spot: &ImagePoint) -> f32 {
        self.variance * spot.sample(&self.unwrapped.local.sensitivity)
    }
}
