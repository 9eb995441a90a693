//! Search for the reading of poses and pictures that the pictures agree with.
//!
//! In a round tunnel a camera on the axis looks at the wall in every convention of its poses, in
//! either order of them, and with quaternions that begin with w. The geometry cannot tell these
//! apart, but neighbouring frames can: read rightly, each is found on the wall that the one before
//! it shows, within what the prior allows
//! ([`crate::tracking::registration::register_frame`]).

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::FrameEstimate;
use crate::stages::setup::Setup;
use crate::tracking::neighbour_pairs::{first_frames, register_pairs};
use crate::tracking::prescreening::prescreen;
use crate::tracking::registration::{MAX_DEVIATION_COST, Registered};
use image::DynamicImage;
use tunnelstitch_core::frames::{FrameSet, Light, load_colour};
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::survey::{PoseReading, Survey, SurveyError};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::StampedPose;

/// Smallest number of pairs: fewer may fit by chance.
const MIN_PAIRS: usize = 4;
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
/// the one given is by how much less the frame deviates from the prior, `½ eᵀΣ⁻¹e`, and by how much
/// better it correlates, which it does with another focal length alone. A reading is taken if three quarters of the pairs fit and speak for it, and its odds
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
        let log_odds = comparison.log_odds(&registered);
        if comparison.may_take(&registered) && log_odds > least_nats {
            let fitting = registered.iter().flatten().count();
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

/// The second frames of the pairs; None where a frame does not fit.
type Registrations = Vec<Option<Registered>>;

/// The reading given, with which others are compared.
struct Comparison {
    /// The pairs in the reading given.
    of_given: Registrations,
    /// Natural logarithm of the odds that a reading must exceed.
    least_nats: f64,
}

impl Comparison {
    /// Evidence of the first pairs for a reading against the one given by their priors, nats.
    fn evidence<'a>(&'a self, reading: &'a [Option<Registered>]) -> impl Iterator<Item = f64> + 'a {
        let pairs = reading.iter().zip(&self.of_given);
        pairs.map(move |(reading, given)| deviation(given) - deviation(reading))
    }

    /// Logarithm of the odds of a reading to the one given, by priors and, where a pair fits in
    /// both, by pixels.
    fn log_odds(&self, reading: &[Option<Registered>]) -> f64 {
        let of_pixels = |(reading, given): (&Option<Registered>, &Option<Registered>)| {
            Some((*reading)?.log_likelihood - (*given)?.log_likelihood)
        };
        let of_pixels = reading.iter().zip(&self.of_given).filter_map(of_pixels);
        self.evidence(reading).sum::<f64>() + of_pixels.sum::<f64>()
    }

    /// True if a reading may be taken whose first pairs are `reading` and in which all others fit
    /// without any deviation.
    fn may_take(&self, reading: &[Option<Registered>]) -> bool {
        let left = &self.of_given[reading.len()..];
        let at_best = left.iter().map(deviation);
        let evidence: Vec<f64> = self.evidence(reading).chain(at_best).collect();
        let fitting = reading.iter().flatten().count() + left.len();
        let for_it = evidence.iter().filter(|nats| **nats > 0.0).count();
        let is_likely = evidence.iter().sum::<f64>() > self.least_nats;
        is_likely && 4 * fitting.min(for_it) >= 3 * evidence.len()
    }
}

/// Deviation of a frame from its prior; one that does not fit deviates by as much as that allows.
fn deviation(registered: &Option<Registered>) -> f64 {
    registered.map_or(MAX_DEVIATION_COST, |registered| registered.deviation)
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
        is_wanted: impl Fn(&[Option<Registered>]) -> bool,
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
            camera: reading.camera(&survey.camera),
            frames: &frames,
            initial: &initial,
            pose_gaps: &[],
            ..RefineInput::from(survey)
        };
        let setup = Setup::new(input, &options)?;
        // No light is known yet.
        setup.frames.set_light(Light::Normalised);
        let prescreened = prescreen(&setup.initial_context(0.0), setup.coarsest_level(), &Silent)?;
        let context = setup.initial_context(prescreened.noise);
        let initial = setup.prior.initial.iter();
        let states = FrameStates {
            estimates: initial.map(|pose| FrameEstimate::at(*pose)).collect(),
            rejections: prescreened.rejections,
            kappa: Kappa::zeros(),
        };
        // The pictures are those of the pairs alone.
        let firsts: Vec<usize> = (0..self.frames.len()).step_by(2).collect();
        Ok(register_pairs(
            &context, &options, &states, &firsts, is_wanted,
        )?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::Pose;

    /// A frame that deviates from its prior by so much, and correlates by so much.
    fn fits(deviation: f64, log_likelihood: f64) -> Option<Registered> {
        Some(Registered {
            estimate: FrameEstimate::at(Pose::identity()),
            is_reliable: true,
            deviation,
            log_likelihood,
        })
    }

    #[test]
    fn a_reading_is_given_up_once_the_other_pairs_cannot_save_it() {
        let comparison = Comparison {
            of_given: vec![fits(3.0, 0.0); 12],
            least_nats: 9.5,
        };
        assert!(comparison.may_take(&[]));
        assert!(comparison.may_take(&[fits(1.0, 0.0); 12]));
        // Three quarters of the pairs must fit, and speak for it.
        assert!(comparison.may_take(&[fits(4.0, 0.0); 3]));
        assert!(!comparison.may_take(&[fits(4.0, 0.0); 4]));
        assert!(!comparison.may_take(&[None; 4]));
        // A pair that does not fit costs more than the others can make up for here.
        assert!(!comparison.may_take(&[None]));
        assert!(!comparison.may_take(&[fits(2.5, 0.0); 12]));
    }

    /// Steps that are longer than planned fit a shorter focal length, but the pictures do not.
    #[test]
    fn pixels_that_correlate_worse_speak_against_a_reading() {
        let comparison = Comparison {
            of_given: vec![fits(3.0, 40.0), fits(3.0, 40.0), None],
            least_nats: 3.0,
        };
        let odds = |of_pixels: f64| comparison.log_odds(&[fits(1.0, of_pixels); 3]);
        assert_eq!(odds(40.0), 4.0 + MAX_DEVIATION_COST - 1.0);
        assert_eq!(odds(30.0), odds(40.0) - 20.0);
    }
}
