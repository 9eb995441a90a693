//! Refined hypotheses of a frame's pose, and the choice between them.

use crate::comparison::ncc_score::NccScore;
use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::rejection::RejectionReason;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::thresholds::registration::{MAX_UNEXPLAINED_RATIO, MIN_CORRELATION, MIN_UNEXPLAINED};
use crate::tracking::correlation_search::{MIN_SEPARATION_SAMPLES, min_samples};
use crate::tracking::pose_separation::separation_m;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::Surface;

/// Difference of the prior's log-densities from which on the prior tells two poses apart: `½ 3²`,
/// three σ.
const MIN_PRIOR_MARGIN_NATS: f64 = 4.5;

/// A hypothesis after its refinement.
#[derive(Clone, Copy, Debug)]
pub struct Candidate {
    /// The estimate at which the refinement ended.
    pub estimate: FrameEstimate,
    /// Unexplained share `1 − c²` of the texture's variance, no less than
    /// [`crate::thresholds::registration::MIN_UNEXPLAINED`].
    pub unexplained: f64,
    /// Correlation c with the reference mosaic, corrected for noise.
    pub correlation: f64,
    /// Log-likelihood of the correlation.
    pub log_likelihood: f64,
    /// Deviation `½ eᵀΣ⁻¹e` from the prior's prediction.
    pub deviation: f64,
}

impl Candidate {
    /// True if the frame matches the mosaic as well as two right poses may differ, once for the
    /// frame's own pose and once for those that the mosaic is fused from.
    pub fn is_reliable(&self) -> bool {
        self.unexplained <= MAX_UNEXPLAINED_RATIO * MAX_UNEXPLAINED_RATIO * MIN_UNEXPLAINED
    }

    /// The log-posterior, up to a constant.
    pub fn log_posterior(&self) -> f64 {
        self.log_likelihood - self.deviation
    }
}

/// Sorts candidates by their log-posteriors, best first.
pub fn sort_candidates(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| b.log_posterior().total_cmp(&a.log_posterior()));
}

/// Chooses one of the candidates, which are sorted best first.
///
/// Among those whose unexplained shares are too similar for the pixels to decide, the prior
/// chooses. If its margin is too small for a candidate elsewhere on the wall, the frame is
/// ambiguous.
/// `pixel_size_m` tells how large a pixel of the search level is on the wall where a candidate
/// looks.
///
/// # Errors
/// The reason to reject the frame.
pub fn choose_candidate<'c>(
    candidates: &'c [Candidate],
    surface: &dyn Surface,
    camera: &Camera,
    pixel_size_m: impl Fn(&Candidate) -> f64,
) -> Result<&'c Candidate, RejectionReason> {
    let no_match = |correlation| RejectionReason::NoMatch { correlation };
    let first = candidates.first().ok_or(no_match(0.0))?;
    if first.correlation < MIN_CORRELATION {
        return Err(no_match(first.correlation));
    }
    let pixel_size_m = pixel_size_m(first);
    let similar: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| c.unexplained < MAX_UNEXPLAINED_RATIO * first.unexplained)
        .collect();
    let best = similar
        .iter()
        .min_by(|a, b| a.deviation.total_cmp(&b.deviation))
        .unwrap_or(&first);
    for other in &similar {
        let (a, b) = (&best.estimate.pose, &other.estimate.pose);
        let separation_m = separation_m(surface, camera, a, b);
        if separation_m > MIN_SEPARATION_SAMPLES * pixel_size_m
            && other.deviation - best.deviation < MIN_PRIOR_MARGIN_NATS
        {
            return Err(RejectionReason::Ambiguous {
                other: other.estimate.pose,
                separation_m,
            });
        }
    }
    Ok(best)
}

/// Unexplained share `1 − c²` of the texture's variance, c the correlation corrected for noise;
/// None if too few samples are shared or the two do not correlate.
///
/// It is 0 where noise drowns the texture: nothing speaks against the pose, and the covariance
/// states how uncertain it is.
pub fn unexplained_share(ncc_score: &NccScore, unwrapped: &UnwrappedFrame) -> Option<f64> {
    let compared = ncc_score.samples >= min_samples(unwrapped) && ncc_score.correlation() > 0.0;
    let correlation = ncc_score.corrected_correlation().unwrap_or(1.0);
    compared.then_some(1.0 - correlation * correlation)
}
