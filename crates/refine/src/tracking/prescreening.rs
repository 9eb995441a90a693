//! Prescreening: rejects frames that show nothing or repeat an earlier picture, and finds the mean
//! of the others and the noise of the pictures.

use crate::model::context::EstimationContext;
use crate::model::problem_error::ProblemError;
use crate::model::rejection::RejectionReason;
use crate::thresholds::correlation_search::MIN_OVERLAP_SHARE;
use crate::thresholds::prescreening::{MAX_REPEAT_DIFFERENCE_GREY, MIN_CONTRAST_GREY};
use tunnelstitch_core::frames::{GreyImage, NoiseMeasurement, PictureNoise};
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::viewing_distance;

/// Frames decoded at once: bounds the memory.
const BATCH: usize = 64;
/// Number of frames whose mean shows the shading: of the wall's texture it keeps less than a third.
const MIN_SHADING_FRAMES: usize = 10;

/// The result of prescreening.
pub struct Prescreened {
    /// The rejection reason of every frame that is of no use.
    pub rejections: Vec<Option<RejectionReason>>,
    /// The mean of all frames at the coarsest level, each over its own mean, in hundredths; None
    /// if they are too few to show the light.
    pub mean: Option<GreyImage>,
    /// The noise of the pictures: the median over the frames.
    pub noise: PictureNoise,
}

/// Prescreens every frame at the coarsest pyramid level.
///
/// # Errors
/// [`ProblemError::Frame`].
pub fn prescreen(
    context: &EstimationContext,
    coarsest: usize,
    progress: &dyn Progress,
) -> Result<Prescreened, ProblemError> {
    let count = context.frames.frames();
    progress.start("decoding", count);
    let mut rejections = Vec::with_capacity(count);
    let mut sums: Vec<[f64; 2]> = Vec::new();
    let cameras = context.cameras.count();
    // The last frame of each camera that shows something.
    let mut last: Vec<Option<(usize, GreyImage)>> = vec![None; cameras];
    let mut size = (0, 0);
    let mut noises = Vec::new();
    for start in (0..count).step_by(BATCH) {
        let pictures = (start..(start + BATCH).min(count))
            .par_map(|k| {
                let frame = context.frames.get(k)?;
                progress.advance(1);
                Ok((frame.level(coarsest).clone(), NoiseMeasurement::of(&frame)))
            })
            .into_iter()
            .collect::<Result<Vec<(GreyImage, Option<NoiseMeasurement>)>, ProblemError>>()?;
        for (k, (picture, noise)) in (start..).zip(pictures) {
            size = (picture.width(), picture.height());
            sums.resize(size.0 * size.1, [0.0; 2]);
            let (mean, ..) = compute_moments(&picture);
            let repeated = last[k % cameras].as_ref().filter(|(earlier, other)| {
                rms_difference(other, &picture) < MAX_REPEAT_DIFFERENCE_GREY
                    && has_moved(context, *earlier, k, coarsest)
            });
            rejections.push(if is_featureless(&picture) {
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
                last[k % cameras] = Some((k, picture));
            }
        }
    }
    progress.finish();
    // Hundredths: grey levels of an ordinary picture.
    let mean = sums.iter().map(|[sum, n]| (100.0 * sum / n) as f32);
    let mean = GreyImage::new(size.0, size.1, mean.collect());
    let has_enough =
        rejections.iter().filter(|reason| reason.is_none()).count() >= MIN_SHADING_FRAMES;
    Ok(Prescreened {
        noise: PictureNoise::median(&noises),
        rejections,
        mean: has_enough.then_some(mean),
    })
}

/// True for a frame, at the coarsest pyramid level, that shows nothing to be compared.
pub fn is_featureless(picture: &GreyImage) -> bool {
    let (_, spread, known) = compute_moments(picture);
    // With fewer known pixels no pose has the overlap that registration asks for.
    known < MIN_OVERLAP_SHARE || spread < MIN_CONTRAST_GREY
}

/// Mean and standard deviation of a picture, grey levels, and its share of pixels with a value.
fn compute_moments(picture: &GreyImage) -> (f64, f64, f64) {
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

/// Root mean square difference of two pictures where both have values, grey levels.
fn rms_difference(a: &GreyImage, b: &GreyImage) -> f64 {
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

/// True if two frames cannot show the same picture by their initial poses: if these move the
/// picture by more than a pixel of the coarsest level, where pictures are compared.
fn has_moved(context: &EstimationContext, a: usize, b: usize, coarsest: usize) -> bool {
    let (from, to) = (&context.prior.initial[a], &context.prior.initial[b]);
    let Ok(distance_m) = viewing_distance(context.surface.as_ref(), context.cameras.of(a), from)
    else {
        return true;
    };
    let rotation = from.r_wc.angle_to(&to.r_wc);
    let translation = (to.t_wc - from.t_wc).norm() / distance_m;
    (rotation + translation) * context.cameras.of(a).vertical_focal_px()
        > 2f64.powi(coarsest as i32)
}
