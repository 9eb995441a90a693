//! Search for the reading of poses and pictures that the pictures agree with.
//!
//! In a round tunnel a camera on the axis looks at the wall in every convention of its poses, in
//! either order of them, and with quaternions that begin with w. The geometry cannot tell these
//! apart, but neighbouring frames can: read rightly, each is found on the wall that the one before
//! it shows, within what the prior allows ([`register_frame`]).

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::samples::footprints::footprints;
use crate::stages::setup::Setup;
use crate::tracking::neighbours::Neighbours;
use crate::tracking::pose_prediction::PosePrediction;
use crate::tracking::prescreening::prescreen;
use crate::tracking::registration::{Effort, MAX_DEVIATION_COST, register_frame};
use image::DynamicImage;
use tunnelstitch_core::frames::{FrameSet, Light, load_colour};
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::survey::{PoseReading, Survey, SurveyError};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::StampedPose;

/// Largest number of pairs of neighbouring frames that are looked at: bounds the time.
const MAX_PAIRS: usize = 12;
/// Smallest number of pairs: fewer may fit by chance.
const MIN_PAIRS: usize = 4;
/// Pairs that are registered at once; after each batch a reading that cannot be taken any more is
/// given up.
const PAIRS_AT_ONCE: usize = 4;
/// Hypotheses of a frame's pose that are refined: neighbours at the right reading overlap by much,
/// so that the right one is among the best.
const MAX_PAIR_HYPOTHESES: usize = 2;
/// Evidence below that of the best reading with which another is named beside it, nats: odds of one
/// to twenty.
const MAX_DEFICIT_NATS: f64 = 3.0;

/// Largest power of ten of odds that is printed: no prior is right so far out.
const MAX_ODDS_POWER: f64 = 20.0;

/// A survey whose readings cannot be searched.
#[derive(Debug, thiserror::Error)]
pub enum ReadingSearchError {
    /// The poses cannot be read in all readings.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A frame cannot be read, or the input is none to refine.
    #[error(transparent)]
    Refine(#[from] RefineError),
}

/// Readings that neighbouring frames agree with rather than with the one given.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct FittingReadings {
    /// The readings, each as it is asked for.
    pub readings: Vec<String>,
    /// Pairs of neighbouring frames that fit in the first of them.
    pub fitting: usize,
    /// Pairs that fit as given.
    pub given: usize,
    /// Pairs that were looked at.
    pub pairs: usize,
    /// Natural logarithm of the posterior odds of the first to the one given.
    pub log_odds: f64,
}

impl FittingReadings {
    /// The finding in one sentence.
    pub fn sentence(&self) -> String {
        let Self {
            readings,
            fitting,
            given,
            pairs,
            log_odds,
        } = self;
        let power = log_odds / std::f64::consts::LN_10;
        let odds = if power < MAX_ODDS_POWER {
            format!("odds of 10^{power:.0} to 1")
        } else {
            format!("odds of more than 10^{MAX_ODDS_POWER:.0} to 1")
        };
        format!(
            "the frames do not agree with poses and pictures as they are read ({given} of {pairs} \
             neighbours fit each other); they agree ({fitting} of {pairs}, {odds}) with {}",
            readings.join(", or with ")
        )
    }
}

/// Looks for readings that neighbouring frames agree with; None if they do with the one given, or
/// with no other.
///
/// A frame is registered on the wall that the one before it shows, as tracking does, from the
/// reading's pose and within its prior. Where it is found in both readings, the evidence against
/// the one given is by how much less the frame deviates from the prior, `½ eᵀΣ⁻¹e`; the pixels are
/// the same. A reading is taken if three quarters of the pairs fit and speak for it, and its odds
/// exceed the number of readings over the survey's rate of false alarms. There may be several:
/// poses exactly as planned, seen from the tunnel's other end, are those of another convention.
///
/// # Errors
/// [`ReadingSearchError`].
pub fn search_readings(survey: &Survey) -> Result<Option<FittingReadings>, ReadingSearchError> {
    let firsts = first_frames(survey.frames.len());
    if firsts.len() < MIN_PAIRS {
        return Ok(None);
    }
    let pictures = Pictures::load(survey, &firsts)?;
    let readings = survey.pose_readings()?;
    let least_nats = (readings.len() as f64 / RefineOptions::default().false_alarm_rate).ln();
    let mut readings = readings.into_iter();
    let Some(given) = readings.next() else {
        return Ok(None);
    };
    let comparison = Comparison {
        of_given: pictures.register(survey, &given, |_| true)?,
        least_nats,
    };
    let mut found = Vec::new();
    for reading in readings {
        let registered = pictures.register(survey, &reading, |some| comparison.may_take(some))?;
        if comparison.may_take(&registered) {
            let fitting = registered.iter().flatten().count();
            let log_odds: f64 = comparison.evidence(&registered).iter().sum();
            found.push((log_odds, fitting, reading));
        }
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.2.changes.cmp(&b.2.changes)));
    let Some(&(log_odds, fitting, _)) = found.first() else {
        return Ok(None);
    };
    let named = found
        .into_iter()
        .filter(|(nats, _, _)| log_odds - nats <= MAX_DEFICIT_NATS);
    Ok(Some(FittingReadings {
        readings: named.map(|(_, _, reading)| reading.remedy).collect(),
        fitting,
        given: comparison.of_given.iter().flatten().count(),
        pairs: firsts.len(),
        log_odds,
    }))
}

/// Deviations of the second frames from their prior, `½ eᵀΣ⁻¹e`; None where a frame does not fit.
type Registrations = Vec<Option<f64>>;

/// The reading given, with which others are compared.
struct Comparison {
    /// The pairs in the reading given.
    of_given: Registrations,
    /// Natural logarithm of the odds that a reading must exceed.
    least_nats: f64,
}

impl Comparison {
    /// Evidence of the first pairs for a reading against the one given, nats. A frame that does not
    /// fit deviates by as much as the prior allows.
    fn evidence(&self, reading: &[Option<f64>]) -> Vec<f64> {
        let deviation = |registered: &Option<f64>| registered.unwrap_or(MAX_DEVIATION_COST);
        let pairs = reading.iter().zip(&self.of_given);
        pairs
            .map(|(reading, given)| deviation(given) - deviation(reading))
            .collect()
    }

    /// True if a reading is taken whose first pairs are `reading` and in which all others fit
    /// without any deviation.
    fn may_take(&self, reading: &[Option<f64>]) -> bool {
        let at_best = vec![Some(0.0); self.of_given.len() - reading.len()];
        let pairs = [reading, &at_best].concat();
        let evidence = self.evidence(&pairs);
        let fitting = pairs.iter().flatten().count();
        let for_it = evidence.iter().filter(|nats| **nats > 0.0).count();
        evidence.iter().sum::<f64>() > self.least_nats && 4 * fitting.min(for_it) >= 3 * pairs.len()
    }
}

/// The first frames of the pairs: evenly distributed, no frame in two pairs.
fn first_frames(frames: usize) -> Vec<usize> {
    let pairs = (frames / 2).min(MAX_PAIRS);
    (0..pairs).map(|k| k * frames / pairs.max(1)).collect()
}

/// The pictures of pairs of neighbouring frames, as read.
struct Pictures {
    /// Indices of the frames, pair by pair.
    frames: Vec<usize>,
    pictures: Vec<DynamicImage>,
}

impl Pictures {
    fn load(survey: &Survey, firsts: &[usize]) -> Result<Self, RefineError> {
        let frames: Vec<usize> = firsts.iter().flat_map(|k| [*k, *k + 1]).collect();
        let chosen = survey.frames.only(&frames);
        let (width, height) = (survey.camera.width, survey.camera.height);
        let files: Vec<_> = chosen.iter().collect();
        let pictures = files.par_map(|file| load_colour(file, width, height));
        let pictures = pictures.into_iter().collect::<Result<_, _>>();
        Ok(Self {
            frames,
            pictures: pictures.map_err(ProblemError::from)?,
        })
    }

    /// Registers the second frame of each pair on the wall that the first one shows, as long as
    /// `is_wanted` of those before.
    fn register(
        &self,
        survey: &Survey,
        reading: &PoseReading,
        is_wanted: impl Fn(&[Option<f64>]) -> bool,
    ) -> Result<Registrations, RefineError> {
        let turned = |picture| reading.orientation.turned(picture);
        let mut frames = FrameSet::in_memory(self.pictures.iter().map(turned));
        if let Some(mask) = survey.frames.mask() {
            frames.hide(mask);
        }
        let poses = self.frames.iter().map(|k| reading.initial[*k]);
        let initial: Vec<StampedPose> = poses.collect();
        let options = RefineOptions {
            // Only the poses.
            calibrate: Some(Vec::new()),
            ..RefineOptions::fast()
        };
        let input = RefineInput {
            frames: &frames,
            initial: &initial,
            pose_gaps: &[],
            ..RefineInput::from(survey)
        };
        let setup = Setup::new(input, &options)?;
        // No light is known yet.
        setup.frames.set_light(Light::Normalised);
        register_pairs(&setup, is_wanted)
    }
}

/// Registers frames 1, 3, 5 … on the wall that frames 0, 2, 4 … show, as long as `is_wanted` of
/// those before.
fn register_pairs(
    setup: &Setup,
    is_wanted: impl Fn(&[Option<f64>]) -> bool,
) -> Result<Registrations, RefineError> {
    let coarsest = setup.coarsest_level();
    let prescreened = prescreen(&setup.initial_context(0.0), coarsest, &Silent)?;
    let context = setup.initial_context(prescreened.noise);
    let initial = setup.prior.initial.iter();
    let states = FrameStates {
        estimates: initial.map(|pose| FrameEstimate::at(*pose)).collect(),
        rejections: prescreened.rejections,
        kappa: Kappa::zeros(),
    };
    let footprints = footprints(&context, &states)?;
    let register = |pair: &usize| -> Result<Option<f64>, RefineError> {
        let frame_range = 2 * pair..2 * pair + 2;
        if states.inliers(&frame_range).contains(&false) {
            return Ok(None);
        }
        let neighbours = Neighbours {
            estimates: &states.estimates[frame_range.clone()],
            registered: &[true, false],
            footprints: &footprints[frame_range.clone()],
            frame_range,
        };
        let frame = 2 * pair + 1;
        let predicted = PosePrediction {
            pose: states.estimates[frame].pose,
            sigma_scale: 1.0,
        };
        let registered = register_frame(
            &context,
            setup.options,
            frame,
            &predicted,
            &neighbours,
            &mut Effort::of(MAX_PAIR_HYPOTHESES),
        )?;
        Ok(registered.ok().map(|registered| registered.deviation))
    };
    let pairs: Vec<usize> = (0..setup.count() / 2).collect();
    let mut registered = Vec::new();
    for batch in pairs.chunks(PAIRS_AT_ONCE) {
        if !is_wanted(&registered) {
            break;
        }
        for one in batch.par_map(register) {
            registered.push(one?);
        }
    }
    Ok(registered)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_spread_and_share_no_frame() {
        assert_eq!(first_frames(1).len(), 0);
        assert_eq!(first_frames(5), [0, 2]);
        let firsts = first_frames(1001);
        assert_eq!(firsts.len(), MAX_PAIRS);
        assert!(firsts.windows(2).all(|pair| pair[1] >= pair[0] + 2));
        assert!(firsts.iter().all(|first| first + 1 < 1001));
        assert!(first_frames(24).iter().all(|first| first % 2 == 0));
    }

    #[test]
    fn a_reading_is_given_up_once_the_other_pairs_cannot_save_it() {
        let comparison = Comparison {
            of_given: vec![Some(3.0); 12],
            least_nats: 9.5,
        };
        assert!(comparison.may_take(&[]));
        assert!(comparison.may_take(&[Some(1.0); 12]));
        // Three quarters of the pairs must fit, and speak for it.
        assert!(comparison.may_take(&[Some(4.0); 3]));
        assert!(!comparison.may_take(&[Some(4.0); 4]));
        assert!(!comparison.may_take(&[None; 4]));
        // A pair that does not fit costs more than the others can make up for here.
        assert!(!comparison.may_take(&[None]));
        assert!(!comparison.may_take(&[Some(2.5); 12]));
    }
}
