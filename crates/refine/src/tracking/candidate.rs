//! Refined hypotheses of a frame's pose, and the choice between them.

use crate::comparison::unexplained::Unexplained;
use crate::model::rejection::RejectionReason;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::thresholds::registration::MIN_CORRELATION;
use crate::tracking::correlation_search::MIN_SEPARATION_SAMPLES;
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
    /// Shares of the variance that the reference mosaic leaves unexplained.
    pub unexplained: Unexplained,
    /// Log-likelihood of the correlation.
    pub log_likelihood: f64,
    /// Deviation `½ eᵀΣ⁻¹e` from the prior's prediction.
    pub deviation: f64,
}

impl Candidate {
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
/// ambiguous. `by_chance`: log-likelihood that candidates hardly exceed where there is nothing but
/// noise; `pixel_size_m` tells how large a pixel of the search level is on the wall where a
/// candidate looks.
///
/// # Errors
/// The reason to reject the frame.
pub fn choose_candidate<'c>(
    candidates: &'c [Candidate],
    by_chance: f64,
    surface: &dyn Surface,
    camera: &Camera,
    pixel_size_m: impl Fn(&Candidate) -> f64,
) -> Result<&'c Candidate, RejectionReason> {
    let no_match = |correlation| RejectionReason::NoMatch { correlation };
    let first = candidates.first().ok_or(no_match(0.0))?;
    let correlation = first.unexplained.correlation();
    let may_be_chance = first.unexplained.is_drowned && first.log_likelihood < by_chance;
    if correlation < MIN_CORRELATION || may_be_chance {
        return Err(no_match(correlation));
    }
    let pixel_size_m = pixel_size_m(first);
    let similar: Vec<&Candidate> = candidates
        .iter()
        .filter(|c| first.unexplained.is_matched_by(&c.unexplained))
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
