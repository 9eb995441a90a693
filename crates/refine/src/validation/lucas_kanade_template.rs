//! Template of a frame on the wall, which is aligned with other frames by Gauss–Newton.

use crate::model::context::EstimationContext;
use crate::samples::point_sampler::PointSampler;
use crate::samples::viewpoint::Viewpoint;
use crate::thresholds::assessment::MIN_PIXEL_SHARE;
use crate::thresholds::pairwise_lucas_kanade::{
    MAX_DISPLACEMENT_PX, MAX_SQUARED_SLOPE_RATIO, STRIDE_PX,
};
use crate::thresholds::tracking::{MAX_SOLVE_ITERATIONS, STEP_TOLERANCE_PX};
use crate::tiles::residual_weighting::robust_correlation;
use crate::tracking::mosaic_grid::{MosaicGrid, pixel_size_m};
use crate::validation::alignment::Alignment;
use crate::validation::lucas_kanade_fit::{AffineFit, SharedSample, TemplateSample};
use nalgebra::{Vector3, Vector6};
use tunnelstitch_core::frames::{Pyramid, noise_at_level};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::median::MAD_TO_SIGMA;
use tunnelstitch_geometry::surface::Footprint;
use tunnelstitch_geometry::trajectory::Pose;

/// Samples along the side of a patch: larger than most glints.
const PATCH: usize = 4;

/// Number of samples that two frames must share: five for each of the eight unknowns.
const MIN_SAMPLES: f64 = 40.0;

/// Variance of the residuals that is assumed at least, grey levels²: that of rounding to whole grey
/// levels.
const MIN_RESIDUAL_VARIANCE: f32 = 1.0 / 12.0;

/// A frame's image at its pose.
pub struct PosedImage<'a> {
    /// The estimation context.
    pub context: &'a EstimationContext<'a>,
    /// Pyramid level.
    pub level: usize,
    /// The camera of the level, with its motion.
    pub camera: Camera,
    /// The frame's image pyramid.
    pub pyramid: &'a Pyramid,
    /// The pose.
    pub pose: &'a Pose,
}

impl PosedImage<'_> {
    /// A function from wall points relative to `origin` to the frame's grey value there.
    fn grey_at(&self, origin: &Vector3<f64>) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, self.pose, origin);
        let image = self.pyramid.level(self.level);
        move |point| sampler.project(point)?.sample_valid(image)
    }
}

/// A frame on the wall, to be aligned with others.
pub struct Template {
    origin: Vector3<f64>,
    samples: Vec<TemplateSample>,
    /// Number of patches of neighbouring samples.
    patches: usize,
    /// The samples' pixels in this frame ([`SharedSample::pixels`]).
    pixels: Vec<f32>,
    /// Width of a pixel of the level on the wall, metres.
    pixel_size_m: f64,
    /// The distance of the wall where it is, metres.
    distance_m: f64,
    /// Pixels of full size per pixel of the level.
    scale: f64,
    /// Variance of the noise of a slope.
    slope_noise: f64,
    /// Variance of the noise of a grey value.
    noise: f32,
    /// Largest gain of one frame against the other, and the inverse of the smallest.
    max_gain: f64,
}

impl Template {
    /// The template of a frame over its footprint.
    pub fn new(image: &PosedImage, footprint: &Footprint) -> Self {
        let context = image.context;
        let pixel_size_m = pixel_size_m(context, &image.camera, image.pose);
        let grid = MosaicGrid::over(footprint, STRIDE_PX * pixel_size_m);
        let middle = footprint.middle();
        let origin = context.surface.frame(middle).x_w;
        let grey = image.grey_at(&origin);
        let mut samples = Vec::new();
        let half = [
            0.5 * (footprint.s_max_m - footprint.s_min_m),
            0.5 * (footprint.h_max_m - footprint.h_min_m),
        ];
        let [width, height] = half.map(|half| half.max(pixel_size_m));
        let patch_columns = grid.columns.div_ceil(PATCH);
        for row in 0..grid.rows {
            for column in 0..grid.columns {
                let wall = grid.wall_point(row * grid.columns + column);
                if context.ignored.contains(&wall) {
                    continue;
                }
                let frame = context.surface.frame(wall);
                let point: [f32; 3] = (frame.x_w - origin).cast().into();
                let (e_s, e_h): ([f32; 3], [f32; 3]) =
                    (frame.e_s.cast().into(), frame.e_h.cast().into());
                let step = pixel_size_m as f32;
                let at = |ds: f32, dh: f32| grey(&displaced(&point, &e_s, &e_h, ds, dh));
                let (Some(value), Some(left), Some(right), Some(up), Some(down)) = (
                    grey(&point),
                    at(-step, 0.0),
                    at(step, 0.0),
                    at(0.0, -step),
                    at(0.0, step),
                ) else {
                    continue;
                };
                let x = [
                    1.0,
                    ((wall.s_m - middle.s_m) / width) as f32,
                    ((wall.h_m - middle.h_m) / height) as f32,
                ];
                samples.push(TemplateSample {
                    point,
                    e_s,
                    e_h,
                    x,
                    grey: value,
                    slope: [0.5 * (right - left), 0.5 * (down - up)],
                    influence_weight: 1.0,
                    patch: row / PATCH * patch_columns + column / PATCH,
                });
            }
        }
        bound_influence(&mut samples);
        let distance_m = pixel_size_m * image.camera.vertical_focal_px();
        let viewpoint = Viewpoint::new(image.pose, &origin, distance_m);
        let pixels = samples.iter().map(|sample| pixels(&viewpoint, sample));
        let noise = context.noise * context.noise * noise_at_level(image.level);
        Self {
            origin,
            pixels: pixels.collect(),
            samples,
            distance_m,
            patches: grid.rows.div_ceil(PATCH) * patch_columns,
            pixel_size_m,
            scale: f64::from(1u32 << image.level),
            slope_noise: 0.5 * noise,
            noise: noise as f32,
            // Three σ of the difference of two frames' log-gains.
            max_gain: (3.0 * std::f64::consts::SQRT_2 * context.prior.log_gain_sigma).exp(),
        }
    }

    /// Aligns another frame with the template; None if the two share too little.
    ///
    /// Where the iterations diverge, the result of the first one is returned: small where the poses
    /// are right.
    pub fn align(&self, other: &PosedImage) -> Option<Alignment> {
        let grey = other.grey_at(&self.origin);
        let viewpoint = Viewpoint::new(other.pose, &self.origin, self.distance_m);
        let mut p = Vector6::<f64>::zeros();
        let mut exposure: Option<(f64, f64)> = None;
        let mut correlation = None;
        let mut first = None;
        let mut result = None;
        for _ in 0..MAX_SOLVE_ITERATIONS {
            let shared = self.sample_displaced(&p, &grey, &viewpoint);
            let min_samples = (MIN_PIXEL_SHARE * self.samples.len() as f64).max(MIN_SAMPLES);
            if (shared.len() as f64) < min_samples {
                return None;
            }
            let exposure_before = *exposure.get_or_insert_with(|| self.fit_exposure(&shared));
            let correlation = *correlation.get_or_insert_with(|| compute_correlation(&shared));
            let variance = self.residual_variance(&shared, exposure_before);
            let fit = AffineFit::new(
                &shared,
                self.patches,
                self.slope_noise,
                exposure_before,
                variance,
                correlation,
            );
            let Some(step) = fit.step() else {
                return Some(fit.without_texture(self.scale));
            };
            let (gain, bias) = exposure_before;
            p += step.fixed_rows::<6>(0);
            exposure = Some((gain + step[6], bias + step[7]));
            let moved_px = fit.rms(&Vector6::from(step.fixed_rows::<6>(0)));
            let alignment = fit.alignment(&p, self.scale, f64::from(variance));
            let first = *first.get_or_insert(alignment);
            let has_diverged = fit.rms(&p) > MAX_DISPLACEMENT_PX;
            let has_converged = !has_diverged && moved_px < STEP_TOLERANCE_PX;
            result = Some(if has_converged { alignment } else { first });
            if has_diverged || has_converged {
                break;
            }
        }
        result
    }

    /// Fits the exposure `value = a grey + b` by least squares.
    fn fit_exposure(&self, shared: &[SharedSample]) -> (f64, f64) {
        let mut m = [0.0f64; 5];
        for one in shared {
            let (x, y) = (f64::from(one.sample.grey), f64::from(one.value));
            for (sum, term) in m.iter_mut().zip([1.0, x, y, x * x, x * y]) {
                *sum += term;
            }
        }
        let [n, x, y, xx, xy] = m;
        let gain = (xy - x * y / n) / (xx - x * x / n).max(1e-9);
        let gain = gain.clamp(1.0 / self.max_gain, self.max_gain);
        (gain, (y - gain * x) / n)
    }

    /// The samples with another frame's grey value at the points displaced by the field `p`, where
    /// it has one.
    fn sample_displaced(
        &self,
        p: &Vector6<f64>,
        grey: impl Fn(&[f32; 3]) -> Option<f32>,
        viewpoint: &Viewpoint,
    ) -> Vec<SharedSample<'_>> {
        let mut shared = Vec::with_capacity(self.samples.len());
        let field: [f32; 6] = (p * self.pixel_size_m).cast::<f32>().into();
        for (sample, own_pixels) in self.samples.iter().zip(&self.pixels) {
            let x = &sample.x;
            let ds = field[0] * x[0] + field[1] * x[1] + field[2] * x[2];
            let dh = field[3] * x[0] + field[4] * x[1] + field[5] * x[2];
            let point = displaced(&sample.point, &sample.e_s, &sample.e_h, ds, dh);
            if let Some(value) = grey(&point) {
                shared.push(SharedSample {
                    sample,
                    value,
                    pixels: pixels(viewpoint, sample).min(*own_pixels),
                });
            }
        }
        shared
    }

    /// Robust variance of the residuals, by their median, grey levels².
    fn residual_variance(&self, shared: &[SharedSample], (gain, bias): (f64, f64)) -> f32 {
        let mut sizes: Vec<f32> = shared
            .iter()
            .map(|one| (gain as f32 * one.sample.grey + bias as f32 - one.value).abs())
            .collect();
        let middle = sizes.len() / 2;
        let (_, median, _) = sizes.select_nth_unstable_by(middle, f32::total_cmp);
        (MAD_TO_SIGMA as f32 * *median)
            .powi(2)
            .max(2.0 * self.noise)
            .max(MIN_RESIDUAL_VARIANCE)
    }
}

/// The pixels that a sample has from a viewpoint, at most 1 ([`SharedSample::pixels`]).
fn pixels(viewpoint: &Viewpoint, sample: &TemplateSample) -> f32 {
    let normal = Vector3::from(sample.e_s).cross(&Vector3::from(sample.e_h));
    viewpoint
        .area_share(&sample.point, &normal.normalize())
        .min(1.0)
}

/// Weighs steep samples such that none has more influence than `√MAX_SQUARED_SLOPE_RATIO` times
/// that of the median slope.
fn bound_influence(samples: &mut [TemplateSample]) {
    let square = |sample: &TemplateSample| sample.slope[0].powi(2) + sample.slope[1].powi(2);
    let mut squares: Vec<f32> = samples.iter().map(square).collect();
    if squares.is_empty() {
        return;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f32::total_cmp);
    let max_square = MAX_SQUARED_SLOPE_RATIO * *median;
    for sample in samples {
        sample.influence_weight = (max_square / square(sample).max(max_square)).min(1.0);
    }
}

/// A point displaced along the wall by `ds` and `dh`, metres.
#[inline]
fn displaced(point: &[f32; 3], e_s: &[f32; 3], e_h: &[f32; 3], ds: f32, dh: f32) -> [f32; 3] {
    std::array::from_fn(|k| point[k] + ds * e_s[k] + dh * e_h[k])
}

/// Correlation of grey values, −1 to 1: of all samples or of most, whichever is greater.
///
/// Glints outweigh a faint wall in the former; where most of the wall is flat, the latter is that
/// of noise.
fn compute_correlation(shared: &[SharedSample]) -> f64 {
    let pair = |one: &SharedSample| (one.sample.grey, one.value);
    let pairs: Vec<(f32, f32)> = shared.iter().map(pair).collect();
    let mut m = [0.0f64; 6];
    for (x, y) in &pairs {
        let (x, y) = (f64::from(*x), f64::from(*y));
        for (sum, term) in m.iter_mut().zip([1.0, x, y, x * x, y * y, x * y]) {
            *sum += term;
        }
    }
    let [n, x, y, xx, yy, xy] = m;
    let spread = (xx - x * x / n) * (yy - y * y / n);
    let of_all = (xy - x * y / n) / spread.sqrt().max(f64::MIN_POSITIVE);
    of_all.max(robust_correlation(&pairs))
}
