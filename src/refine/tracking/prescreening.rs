//! A first look at every frame: is it there, does it show anything, how is it lit.

use crate::frames::{GreyImage, Shading, noise_sigma};
use crate::progress::Progress;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::model::rejection::RejectionReason;
use crate::surface::viewing_distance;
use rayon::prelude::*;

/// Frames looked at together.
const RUN: usize = 64;
/// Spread of grey values below which a frame shows nothing, grey levels at the coarsest level.
const LEAST_CONTRAST: f64 = 0.75;
/// Root mean square difference below which two frames are the same picture, grey levels at the
/// coarsest level.
const SAME_PICTURE: f64 = 0.1;
/// Movement between the initial poses beyond which two equal pictures cannot both be right, pixels
/// of full size.
const MOVED_PX: f64 = 20.0;

/// What the first look finds.
pub struct Prescreened {
    /// Frames that are useless, with the reason.
    pub rejections: Vec<Option<RejectionReason>>,
    /// Shading that all frames have in common, if there is one.
    pub shading: Option<Shading>,
    /// 1-σ of the sensor's noise, grey levels: the median over the frames.
    pub noise: f64,
}

/// Looks at every frame at the coarsest pyramid level.
///
/// # Errors
/// [`ProblemError::Frame`].
pub fn prescreen(
    scene: &EstimationContext,
    coarsest: usize,
    progress: &dyn Progress,
) -> Result<Prescreened, ProblemError> {
    let count = scene.frames.frames();
    progress.start("decoding", count);
    let mut rejections = Vec::with_capacity(count);
    let mut sums: Vec<[f64; 2]> = Vec::new();
    let mut last: Option<(usize, GreyImage)> = None;
    let mut size = (0, 0);
    let mut noises = Vec::new();
    for start in (0..count).step_by(RUN) {
        let small = (start..(start + RUN).min(count))
            .into_par_iter()
            .map(|k| {
                let frame = scene.frames.get(k)?;
                progress.advance(1);
                Ok((frame.level(coarsest).clone(), noise_sigma(frame.level(0))))
            })
            .collect::<Result<Vec<(GreyImage, Option<f64>)>, ProblemError>>()?;
        for (k, (picture, noise)) in (start..).zip(small) {
            size = (picture.width(), picture.height());
            sums.resize(size.0 * size.1, [0.0; 2]);
            let (mean, spread, known) = moments(&picture);
            let repeated = last.as_ref().filter(|(earlier, other)| {
                difference(other, &picture) < SAME_PICTURE && moved(scene, *earlier, k)
            });
            rejections.push(if known < 0.1 || spread < LEAST_CONTRAST {
                Some(RejectionReason::Featureless)
            } else {
                repeated.map(|(earlier, _)| RejectionReason::Repeated(*earlier))
            });
            if rejections[k].is_none() {
                noises.extend(noise);
                for (sum, value) in sums.iter_mut().zip(picture.data()) {
                    if !value.is_nan() {
                        sum[0] += f64::from(*value) / mean;
                        sum[1] += 1.0;
                    }
                }
                last = Some((k, picture));
            }
        }
    }
    progress.finish();
    // A hundred times the relative brightness: grey levels of an ordinary picture.
    let mean = sums.iter().map(|[sum, n]| (100.0 * sum / n) as f32);
    let mean = GreyImage::new(size.0, size.1, mean.collect());
    let full = (scene.camera.width as usize, scene.camera.height as usize);
    let enough = rejections.iter().filter(|d| d.is_none()).count() >= LEAST_FRAMES;
    noises.sort_unstable_by(f64::total_cmp);
    Ok(Prescreened {
        noise: noises.get(noises.len() / 2).copied().unwrap_or(0.0),
        rejections,
        shading: enough.then(|| Shading::of_mean(&mean, full)).flatten(),
    })
}

/// Frames whose mean tells light from wall, at least.
const LEAST_FRAMES: usize = 10;

/// Mean, standard deviation, and share of pixels that have a value.
fn moments(picture: &GreyImage) -> (f64, f64, f64) {
    let (mut n, mut sum, mut square) = (0.0f64, 0.0f64, 0.0f64);
    for value in picture.data().iter().filter(|v| !v.is_nan()) {
        let value = f64::from(*value);
        n += 1.0;
        sum += value;
        square += value * value;
    }
    let mean = sum / n.max(1.0);
    let variance = (square / n.max(1.0) - mean * mean).max(0.0);
    (mean, variance.sqrt(), n / picture.data().len() as f64)
}

/// Root mean square difference where both have values.
fn difference(a: &GreyImage, b: &GreyImage) -> f64 {
    let (mut n, mut sum) = (0.0f64, 0.0f64);
    for (a, b) in a.data().iter().zip(b.data()) {
        let d = f64::from(a - b);
        if !d.is_nan() {
            n += 1.0;
            sum += d * d;
        }
    }
    (sum / n.max(1.0)).sqrt()
}

/// True if the initial poses put two frames well apart.
fn moved(scene: &EstimationContext, a: usize, b: usize) -> bool {
    let (from, to) = (&scene.prior.initial[a], &scene.prior.initial[b]);
    let Ok(range) = viewing_distance(scene.surface, from) else {
        return true;
    };
    let turned = from.r_wc.angle_to(&to.r_wc);
    let shifted = (to.t_wc - from.t_wc).norm() / range;
    (turned + shifted) * scene.camera.fy > MOVED_PX
}
