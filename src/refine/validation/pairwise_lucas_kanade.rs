//! How well are two frames aligned where they overlap, and how sure is that?
//!
//! Gauss–Newton compares each frame with the wall fused from all. Where the trajectory is bent,
//! that wall is blurred, the robust loss turns away from what does not fit, and every residual
//! looks bearable. Two frames by themselves hide nothing: where they overlap, the displacement of
//! the one against the other is measured, an affine field
//!
//! `d(x) = P (1, s, h)ᵀ`,   P: 2 × 3,
//!
//! that minimises `Σ ω (a I_a(x) + b − I_b(x + d(x)))²` at a fine pyramid level, with the exposure
//! a, b and the biweight ω of [`Loss`] for what is not wall. With N the normal matrix, freed of the
//! noise in its slopes, and v the variance of the residuals, P has covariance `v N⁻¹` if they are
//! noise. Glints are not: steeper than a faint wall, they move with the camera. So no sample has
//! more influence than one a few times as steep as usual, and with g the parts that patches of
//! samples have in the gradient, the covariance is `C = N⁻¹ (Σ g gᵀ) N⁻¹` where that makes σ
//! larger, whatever the residuals are like. The root mean square of the displacement over the
//! overlap is `e = √(pᵀWp)`, of which errors alone make `σ = √tr(C W)`. By the triangle inequality,
//! frames that are aligned to τ show `e > τ + z σ` no more often than a Gaussian exceeds z standard
//! deviations.
//!
//! Source: B. D. Lucas and T. Kanade, "An iterative image registration technique with an
//! application to stereo vision", 1981.

use crate::camera::Camera;
use crate::frames::{MAD_TO_SIGMA, Pyramid, noise_at_level};
use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::samples::point_sampler::PointSampler;
use crate::refine::tiles::residual_weighting::{Loss, robust_correlation};
use crate::refine::tracking::reference_mosaic::{MosaicGrid, pixel_size_m};
use crate::refine::validation::overlaps::{Batch, Overlaps};
use crate::surface::{Footprint, WallPoint};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3, Vector6};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

/// Pyramid level at which displacements are measured: small against a brick's edge, and half the
/// noise of full size.
const LEVEL: usize = 1;
/// Every how many pixels of it a sample is taken, along each axis.
const STRIDE: f64 = 4.0;
/// Gauss–Newton steps.
const STEPS: usize = 8;
/// Least samples that two frames share, and as a share of the one's own.
const LEAST_SAMPLES: usize = 40;
const LEAST_OVERLAP: f64 = 0.02;
/// Gauss–Newton finds no displacement larger than this, pixels of the level: it is no measurement
/// then.
const MOST_PX: f64 = 8.0;
/// Share of the squared slopes that must be texture and not noise: with less, N is chance.
const LEAST_TEXTURE: f64 = 0.3;
/// Squared slope, over the median one, from which on a sample's influence no longer grows.
const STEEPEST: f32 = 10.0;
/// Samples along the side of a patch: larger than most glints.
const PATCH: usize = 4;
/// A step shorter than this, pixels of the level, is the last; one longer than three times this is
/// no end.
const LAST_STEP_PX: f64 = 0.03;
/// Noise of the residuals that is assumed at least, grey levels: rounding.
const LEAST_SIGMA: f32 = 0.3;

/// How two frames are aligned.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Samples they share.
    pub samples: f64,
    /// e, pixels of full size.
    pub error_px: f64,
    /// σ, likewise; infinite where the texture is too faint to tell.
    pub sigma_px: f64,
    /// Correlation of their grey values at the poses as they are, with no weight that could hide
    /// that two frames show different things: of all samples or of most, whichever is greater.
    pub correlation: f64,
}

/// Measures how those of a run of frames that are inliers and overlap are aligned; `finest` is the
/// finest level that tracking uses.
///
/// # Errors
/// [`ProblemError`].
pub fn align_pairs(
    scene: &EstimationContext,
    finest: usize,
    tracked: &FrameStates,
    frames: &Range<usize>,
) -> Result<Vec<Alignment>, ProblemError> {
    let level = LEVEL.min(finest);
    let camera = scene.camera.at_level(level);
    let overlaps = Overlaps::of(scene, &camera, tracked, frames)?;
    let mut found = Vec::new();
    for Batch { partners, needed } in overlaps.batches(|_, _| true) {
        let pictures: BTreeMap<usize, Arc<Pyramid>> = needed
            .into_par_iter()
            .map(|k| Ok((k, scene.frames.get(k)?)))
            .collect::<Result<_, ProblemError>>()?;
        let measured: Vec<Vec<Alignment>> = partners
            .par_iter()
            .map(|(a, others)| {
                let look = |k: usize| Look {
                    scene,
                    level,
                    camera: camera.with_sweep(&tracked.sweep(scene, k)),
                    picture: &pictures[&k],
                    pose: &tracked.estimates[k].pose,
                };
                let Some(footprint) = &overlaps.footprints[*a] else {
                    return Vec::new();
                };
                let template = Template::new(&look(*a), footprint);
                let aligned = |b: &usize| {
                    let mut alignment = template.align(&look(*b))?;
                    (alignment.a, alignment.b) = (*a, *b);
                    Some(alignment)
                };
                others.iter().filter_map(aligned).collect()
            })
            .collect();
        found.extend(measured.into_iter().flatten());
    }
    Ok(found)
}

/// A frame at its pose.
struct Look<'a> {
    scene: &'a EstimationContext<'a>,
    level: usize,
    camera: Camera,
    picture: &'a Pyramid,
    pose: &'a crate::trajectory::Pose,
}

impl Look<'_> {
    /// The frame's grey values at wall points relative to `origin`.
    fn greys(&self, origin: &Vector3<f64>) -> impl Fn(&[f32; 3]) -> Option<f32> + use<'_> {
        let sampler = PointSampler::new(&self.camera, self.pose, origin);
        let image = self.picture.level(self.level);
        move |point| sampler.project(point)?.sample_valid(image)
    }
}

/// A sample of the wall as a frame shows it.
struct Sample {
    /// The point, relative to the template's origin, metres.
    point: [f32; 3],
    /// `∂x/∂s`; `∂x/∂h` is the axis.
    e_s: [f32; 3],
    e_h: [f32; 3],
    /// The regressors 1, s, h, the latter about −1 to 1.
    x: [f32; 3],
    grey: f32,
    /// Slope along s and h, grey levels per pixel.
    slope: [f32; 2],
    /// Weight that bounds its influence.
    bound: f32,
    /// The patch of neighbouring samples it belongs to.
    patch: usize,
}

/// A frame on the wall, ready to be compared with others.
struct Template {
    origin: Vector3<f64>,
    samples: Vec<Sample>,
    /// WallRegions that they are counted by.
    patches: usize,
    /// A pixel of the level on the wall, metres.
    pixel_size_m: f64,
    /// Pixels of full size per pixel of the level.
    scale: f64,
    /// Variance of a slope's noise, and of a grey value's.
    slope_noise: f64,
    noise: f32,
}

impl Template {
    fn new(look: &Look, footprint: &Footprint) -> Self {
        let scene = look.scene;
        let pixel_size_m = pixel_size_m(scene, &look.camera, look.pose);
        let lattice = MosaicGrid::over(footprint, STRIDE * pixel_size_m);
        let middle = WallPoint {
            s_m: 0.5 * (footprint.s_min_m + footprint.s_max_m),
            h_m: 0.5 * (footprint.h_min_m + footprint.h_max_m),
        };
        let origin = scene.surface.frame(middle).x_w;
        let grey = look.greys(&origin);
        let mut samples = Vec::new();
        let half = [
            0.5 * (footprint.s_max_m - footprint.s_min_m),
            0.5 * (footprint.h_max_m - footprint.h_min_m),
        ];
        let [width, height] = half.map(|half| half.max(pixel_size_m));
        let patch_columns = lattice.columns.div_ceil(PATCH);
        for row in 0..lattice.rows {
            for column in 0..lattice.columns {
                let wall = lattice.wall(row * lattice.columns + column);
                if scene.ignored.contains(&wall) {
                    continue;
                }
                let frame = scene.surface.frame(wall);
                let point: [f32; 3] = (frame.x_w - origin).cast().into();
                let (e_s, e_h): ([f32; 3], [f32; 3]) =
                    (frame.e_s.cast().into(), frame.e_h.cast().into());
                let step = pixel_size_m as f32;
                let at = |ds: f32, dh: f32| grey(&moved(&point, &e_s, &e_h, ds, dh));
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
                samples.push(Sample {
                    point,
                    e_s,
                    e_h,
                    x,
                    grey: value,
                    slope: [0.5 * (right - left), 0.5 * (down - up)],
                    bound: 1.0,
                    patch: row / PATCH * patch_columns + column / PATCH,
                });
            }
        }
        bound_influence(&mut samples);
        let noise = scene.noise * scene.noise * noise_at_level(look.level);
        Self {
            origin,
            samples,
            patches: lattice.rows.div_ceil(PATCH) * patch_columns,
            pixel_size_m,
            scale: f64::from(1u32 << look.level),
            slope_noise: 0.5 * noise,
            noise: noise as f32,
        }
    }

    /// The displacement of another frame; none if the two share too little.
    fn align(&self, other: &Look) -> Option<Alignment> {
        let grey = other.greys(&self.origin);
        let mut p = Vector6::<f64>::zeros();
        let mut exposure: Option<(f64, f64)> = None;
        let mut correlated = None;
        let mut first = None;
        let mut result = None;
        for _ in 0..STEPS {
            let mut seen: Vec<(&Sample, f32)> = Vec::with_capacity(self.samples.len());
            let field: [f32; 6] = (p * self.pixel_size_m).cast::<f32>().into();
            for sample in &self.samples {
                let x = &sample.x;
                let ds = field[0] * x[0] + field[1] * x[1] + field[2] * x[2];
                let dh = field[3] * x[0] + field[4] * x[1] + field[5] * x[2];
                let point = moved(&sample.point, &sample.e_s, &sample.e_h, ds, dh);
                if let Some(value) = grey(&point) {
                    seen.push((sample, value));
                }
            }
            let least = (LEAST_OVERLAP * self.samples.len() as f64).max(LEAST_SAMPLES as f64);
            if (seen.len() as f64) < least {
                return None;
            }
            let (gain, bias) = *exposure.get_or_insert_with(|| line(&seen));
            let correlation = *correlated.get_or_insert_with(|| correlation(&seen));
            let mut sizes: Vec<f32> = seen
                .iter()
                .map(|(sample, value)| (gain as f32 * sample.grey + bias as f32 - value).abs())
                .collect();
            let middle = sizes.len() / 2;
            let (_, median, _) = sizes.select_nth_unstable_by(middle, f32::total_cmp);
            let variance = (MAD_TO_SIGMA as f32 * *median)
                .powi(2)
                .max(2.0 * self.noise)
                .max(LEAST_SIGMA * LEAST_SIGMA);
            let fit = Fit::new(self, &seen, (gain, bias), variance, correlation);
            let Some(step) = fit.step() else {
                return Some(fit.silent(self.scale));
            };
            p += step.fixed_rows::<6>(0);
            exposure = Some((gain + step[6], bias + step[7]));
            let moved = fit.rms(&Vector6::from(step.fixed_rows::<6>(0)));
            let alignment = fit.alignment(&p, self.scale, f64::from(variance));
            // Where the steps lead nowhere, the first is what is known: small where the poses are
            // right.
            let first = *first.get_or_insert(alignment);
            let lost = fit.rms(&p) > MOST_PX;
            let ended = !lost && moved < 3.0 * LAST_STEP_PX;
            result = Some(if ended { alignment } else { first });
            if lost || moved < LAST_STEP_PX {
                break;
            }
        }
        result
    }
}

/// Gives samples steeper than most a weight such that none has more influence than `√STEEPEST`
/// times the usual.
fn bound_influence(samples: &mut [Sample]) {
    let square = |sample: &Sample| sample.slope[0].powi(2) + sample.slope[1].powi(2);
    let mut squares: Vec<f32> = samples.iter().map(square).collect();
    if squares.is_empty() {
        return;
    }
    let middle = squares.len() / 2;
    let (_, median, _) = squares.select_nth_unstable_by(middle, f32::total_cmp);
    let most = STEEPEST * *median;
    for sample in samples {
        sample.bound = (most / square(sample).max(most)).min(1.0);
    }
}

/// A point moved along the wall, metres.
#[inline]
fn moved(point: &[f32; 3], e_s: &[f32; 3], e_h: &[f32; 3], ds: f32, dh: f32) -> [f32; 3] {
    std::array::from_fn(|k| point[k] + ds * e_s[k] + dh * e_h[k])
}

/// The line `value = a grey + b` of least squares.
fn line(seen: &[(&Sample, f32)]) -> (f64, f64) {
    let mut m = [0.0f64; 5];
    for (sample, value) in seen {
        let (x, y) = (f64::from(sample.grey), f64::from(*value));
        for (sum, term) in m.iter_mut().zip([1.0, x, y, x * x, x * y]) {
            *sum += term;
        }
    }
    let [n, x, y, xx, xy] = m;
    let gain = (xy - x * y / n) / (xx - x * x / n).max(1e-9);
    let gain = gain.clamp(0.4, 2.5);
    (gain, (y - gain * x) / n)
}

/// Correlation of grey values, −1 to 1: of all samples or of most, whichever is greater. Glints
/// outweigh a faint wall in the former; where most of the wall is flat, the latter is that of
/// noise.
fn correlation(seen: &[(&Sample, f32)]) -> f64 {
    let pairs: Vec<(f32, f32)> = seen.iter().map(|(s, value)| (s.grey, *value)).collect();
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

/// Normal equations of one step: displacement field, gain, bias.
struct Fit {
    n: SMatrix<f64, 8, 8>,
    right: SVector<f64, 8>,
    /// Scatter of the scores `Σ g gᵀ`, g the part of a patch in the right side.
    scatter: SMatrix<f64, 8, 8>,
    /// `Σ x xᵀ / Σ 1` of the regressors.
    w: Matrix3<f64>,
    samples: f64,
    /// At the poses as they are.
    correlation: f64,
    /// False if the slopes are mostly noise.
    textured: bool,
}

impl Fit {
    fn new(
        template: &Template,
        seen: &[(&Sample, f32)],
        (gain, bias): (f64, f64),
        variance: f32,
        correlation: f64,
    ) -> Self {
        let mut scores = vec![SVector::<f64, 8>::zeros(); template.patches];
        let mut n = SMatrix::<f64, 8, 8>::zeros();
        let mut right = SVector::<f64, 8>::zeros();
        let mut w = Matrix3::<f64>::zeros();
        let mut weighted = Matrix3::<f64>::zeros();
        let (gain32, bias32) = (gain as f32, bias as f32);
        for (sample, value) in seen {
            let e = value - (gain32 * sample.grey + bias32);
            let omega = sample.bound * Loss::weight(e * e, 1.0 / variance);
            let x = sample.x;
            let regressors = Vector3::from(x.map(f64::from));
            let outer = regressors * regressors.transpose();
            w += outer;
            let (gs, gh) = (gain32 * sample.slope[0], gain32 * sample.slope[1]);
            // I_b(x + d) ≈ a I_a(x) + b − a ∇I_a · (remaining d), so the row of the remaining d is
            // −a∇I_a.
            let row = SVector::<f64, 8>::from_column_slice(&[
                f64::from(-gs * x[0]),
                f64::from(-gs * x[1]),
                f64::from(-gs * x[2]),
                f64::from(-gh * x[0]),
                f64::from(-gh * x[1]),
                f64::from(-gh * x[2]),
                f64::from(sample.grey),
                1.0,
            ]);
            let omega = f64::from(omega);
            n += omega * row * row.transpose();
            scores[sample.patch] += omega * f64::from(e) * row;
            weighted += omega * outer;
        }
        let mut scatter = SMatrix::<f64, 8, 8>::zeros();
        for score in &scores {
            right += score;
            scatter += score * score.transpose();
        }
        let slope_noise = template.slope_noise;
        let noise = gain * gain * slope_noise * weighted[(0, 0)];
        let textured = [0, 3].iter().all(|k| {
            let all: f64 = n[(*k, *k)];
            all - noise > LEAST_TEXTURE * all
        });
        for k in 0..3 {
            for l in 0..3 {
                let noise = gain * gain * slope_noise * weighted[(k, l)];
                n[(k, l)] -= noise;
                n[(3 + k, 3 + l)] -= noise;
            }
        }
        Self {
            n,
            right,
            scatter,
            w: w / seen.len() as f64,
            samples: seen.len() as f64,
            correlation,
            textured,
        }
    }

    /// None where the texture tells nothing.
    fn step(&self) -> Option<SVector<f64, 8>> {
        if self.textured {
            Some(self.n.cholesky()?.solve(&self.right))
        } else {
            None
        }
    }

    /// What a texture too faint to tell says: nothing.
    fn silent(&self, scale: f64) -> Alignment {
        Alignment {
            error_px: 0.0,
            sigma_px: f64::INFINITY,
            ..self.alignment(&Vector6::zeros(), scale, 1.0)
        }
    }

    /// `√(pᵀWp)`, pixels of the level.
    fn rms(&self, p: &Vector6<f64>) -> f64 {
        let (s, h) = (p.fixed_rows::<3>(0), p.fixed_rows::<3>(3));
        (s.dot(&(self.w * s)) + h.dot(&(self.w * h)))
            .max(0.0)
            .sqrt()
    }

    fn alignment(&self, p: &Vector6<f64>, scale: f64, variance: f64) -> Alignment {
        let square = |covariance: &SMatrix<f64, 8, 8>| {
            let of = |k| covariance.fixed_view::<3, 3>(k, k).component_mul(&self.w);
            of(0).sum() + of(3).sum()
        };
        let square = self.n.cholesky().map_or(f64::INFINITY, |n| {
            let inverse = n.inverse();
            let sandwich = inverse * self.scatter * inverse;
            square(&(variance * inverse)).max(square(&sandwich))
        });
        Alignment {
            a: 0,
            b: 0,
            samples: self.samples,
            error_px: scale * self.rms(p),
            sigma_px: scale * square.sqrt(),
            correlation: self.correlation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::FrameCache;
    use crate::refine::test_scene::{frame_states, independent_prior, test_context};
    use crate::test_wall::{TestWall, waves};
    use crate::trajectory::Pose;

    /// Alignments of a ring of frames at the given poses.
    fn measured(wall: &TestWall, poses: &[Pose]) -> Vec<Alignment> {
        let pictures = wall
            .frames()
            .into_iter()
            .map(|frame| Pyramid::new(frame, 1));
        let frames = FrameCache::of_pyramids(pictures.collect());
        let prior = independent_prior(poses);
        let scene = test_context(wall, &frames, &prior);
        let tracked = frame_states(poses);
        align_pairs(&scene, 0, &tracked, &(0..tracked.estimates.len())).unwrap()
    }

    #[test]
    fn true_poses_are_aligned() {
        let wall = TestWall::ring(waves);
        let found = measured(&wall, &wall.poses);
        assert!(found.len() >= 14);
        for pair in found {
            assert!(pair.error_px < 0.05, "{pair:?}");
        }
    }

    /// A frame shifted along the tunnel by 10 mm is 1 cm · f / 1 m ≈ 1 px off all it overlaps.
    #[test]
    fn a_displaced_frame_is_off_by_its_displacement() {
        let wall = TestWall::ring(waves);
        let mut poses = wall.poses.clone();
        poses[5].t_wc.y += 0.01;
        let expected = 0.01 * wall.camera.fy;
        let mut seen = 0;
        for pair in measured(&wall, &poses) {
            if pair.a == 5 || pair.b == 5 {
                seen += 1;
                let ratio = pair.error_px / expected;
                assert!((0.7..1.4).contains(&ratio), "{pair:?} {expected}");
            } else {
                assert!(pair.error_px < 0.05, "{pair:?}");
            }
        }
        assert!(seen >= 2);
    }
}
