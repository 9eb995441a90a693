//! The search: all readings against the one given.

use super::comparison::{Comparison, exceeds_scatter};
use super::picture_pairs::PicturePairs;
use super::telling_pairs::{TellingPair, telling_pairs};
use crate::error::RefineError;
use crate::options::RefineOptions;
use crate::tracking::neighbour_pairs::first_frames;
use crate::tracking::registration::{MAX_DEVIATION_COST, Registered};
use crate::verdict::other_readings::FittingReadings;
use tunnelstitch_core::survey::{PoseReading, Survey};

/// Smallest number of pairs: fewer may fit by chance.
const MIN_PAIRS: usize = 4;
/// Evidence below that of the best reading with which another is named beside it, nats: odds of one
/// to twenty.
const MAX_DEFICIT_NATS: f64 = 3.0;
/// Evidence of a pair that speaks for poses of other frames, nats: half of that by which its steps
/// differ at least.
const MIN_SHIFT_NATS: f64 = 0.5 * MAX_DEVIATION_COST;

/// A reading that neighbouring frames agree with.
struct Found<'r> {
    reading: &'r PoseReading,
    /// Pairs that fit in it, pairs that fit as given, and all pairs.
    fitting: usize,
    given: usize,
    pairs: usize,
    /// Natural logarithm of its odds to the reading given.
    log_odds: f64,
    /// The evidence of each pair, nats; empty if these are not evenly distributed.
    pair_nats: Vec<f64>,
}

impl Found<'_> {
    /// True if a reading that has more evidence is distinguished from this one: by its odds, and by
    /// the evidence of pairs, which differs by more than it scatters.
    fn is_distinguished_from(&self, best: &Self) -> bool {
        if best.log_odds - self.log_odds <= MAX_DEFICIT_NATS {
            return false;
        }
        let pairs = best.pair_nats.iter().zip(&self.pair_nats);
        let differences: Vec<f64> = pairs.map(|(best, own)| best - own).collect();
        let is_usual = self.reading.prior_nats >= 0.0;
        differences.is_empty() || !is_usual || exceeds_scatter(&differences)
    }
}

/// Looks for readings that neighbouring frames agree with; None if they do with the one given, or
/// with no other, or if they are of a rig.
///
/// A frame is registered on the wall that the one before it shows, as tracking does, from the
/// reading's pose and within its prior. Where it is found in both readings, the evidence against
/// the one given is by how much less the frame deviates from the prior, `½ eᵀΣ⁻¹e`, and, with
/// another camera, by how much better it correlates. The σ of the prior are the same in all
/// readings, also of tunnels of another radius: pictures do not measure all of a pose, and a
/// narrower prior holds the rest closer to its prediction, right or wrong. A reading is taken if
/// three quarters of the pairs fit, if as many speak for it or their evidence exceeds its scatter,
/// and if its odds exceed the number of readings over the survey's rate of false alarms. There may
/// be several: poses exactly as planned, seen from the tunnel's other end, are those of another
/// convention.
///
/// Poses of other frames are compared by the pairs that tell them ([`telling_pairs`]), all other
/// readings by pairs that are evenly distributed.
///
/// # Errors
/// [`RefineError`]: poses that cannot be read in all readings, a frame that cannot be read, or
/// input that is none to refine.
pub fn search_readings(survey: &Survey) -> Result<Option<FittingReadings>, RefineError> {
    if !can_search_readings(survey) {
        return Ok(None);
    }
    let readings = survey.pose_readings().map_err(Box::new)?;
    let least_nats = (readings.len() as f64 / RefineOptions::default().false_alarm_rate).ln();
    let Some((given, others)) = readings.split_first() else {
        return Ok(None);
    };
    let is_shifted = |reading: &&PoseReading| reading.shift_frames != 0;
    let (shifted, others): (Vec<_>, Vec<_>) = others.iter().partition(is_shifted);
    let mut found = among_all_pairs(survey, given, &others, least_nats)?;
    found.extend(among_telling_pairs(survey, given, &shifted, least_nats)?);
    Ok(name(found))
}

/// True if a survey has pairs of neighbouring frames by which readings can be compared: it has
/// frames enough, and they are not those of a rig.
fn can_search_readings(survey: &Survey) -> bool {
    !survey.cameras.is_rig() && first_frames(survey.frames.len()).len() >= MIN_PAIRS
}

/// Readings that evenly distributed pairs agree with. Those that are improbable from the beginning
/// compete with the others, and are tried only where one of these fits.
fn among_all_pairs<'r>(
    survey: &Survey,
    given: &PoseReading,
    others: &[&'r PoseReading],
    least_nats: f64,
) -> Result<Vec<Found<'r>>, RefineError> {
    let firsts = first_frames(survey.frames.len());
    let mut pictures = PicturePairs::load(survey, &firsts)?;
    let mut comparison = Comparison {
        of_given: pictures.register(given, |_| true)?,
        telling: vec![true; firsts.len()],
        least_nats,
        min_pair_nats: 0.0,
    };
    let is_usual = |reading: &&&PoseReading| reading.prior_nats >= 0.0;
    let (usual, rivals): (Vec<_>, Vec<_>) = others.iter().partition(is_usual);
    let mut found = Vec::new();
    for readings in [usual, rivals] {
        for reading in readings {
            found.extend(compare(&mut pictures, &comparison, reading)?);
        }
        let Some(best_nats) = found.iter().map(|one| one.log_odds).reduce(f64::max) else {
            break;
        };
        // Less than that is not named beside it.
        comparison.least_nats = least_nats.max(best_nats - MAX_DEFICIT_NATS);
    }
    Ok(found)
}

/// Readings with poses of other frames that the pairs which tell them agree with.
fn among_telling_pairs<'r>(
    survey: &Survey,
    given: &PoseReading,
    shifted: &[&'r PoseReading],
    least_nats: f64,
) -> Result<Vec<Found<'r>>, RefineError> {
    let telling = telling_pairs(&survey.prior, given, shifted);
    if telling.len() < MIN_PAIRS {
        return Ok(Vec::new());
    }
    let firsts: Vec<usize> = telling.iter().map(|pair| pair.first).collect();
    let mut pictures = PicturePairs::load(survey, &firsts)?;
    let compared =
        |k: usize, of_given: &[Option<Registered>]| compared(&telling, k, of_given, least_nats);
    // Pairs that are still to be registered may not fit as given.
    let may_take_any = |some: &[Option<Registered>]| {
        let mut all = (0..shifted.len()).filter_map(|k| compared(k, some));
        all.any(|comparison| comparison.may_take(&[]))
    };
    let of_given = pictures.register(given, may_take_any)?;
    if !may_take_any(&of_given) {
        return Ok(Vec::new());
    }
    let mut found = Vec::new();
    for (k, reading) in shifted.iter().enumerate() {
        if let Some(comparison) = compared(k, &of_given) {
            found.extend(compare(&mut pictures, &comparison, reading)?);
        }
    }
    Ok(found)
}

/// The comparison with reading `k`, in which pairs beyond the end of `of_given` do not fit as
/// given; None if too few pairs tell it from that.
fn compared(
    telling: &[TellingPair],
    k: usize,
    of_given: &[Option<Registered>],
    least_nats: f64,
) -> Option<Comparison> {
    let mut of_given = of_given.to_vec();
    of_given.resize(telling.len(), None);
    let tells: Vec<bool> = telling
        .iter()
        .map(|pair| pair.readings.contains(&k))
        .collect();
    let is_enough = tells.iter().filter(|tells| **tells).count() >= MIN_PAIRS;
    is_enough.then_some(Comparison {
        of_given,
        telling: tells,
        least_nats,
        min_pair_nats: MIN_SHIFT_NATS,
    })
}

/// Compares a reading with the one given; None if it is not taken.
fn compare<'r>(
    pictures: &mut PicturePairs,
    comparison: &Comparison,
    reading: &'r PoseReading,
) -> Result<Option<Found<'r>>, RefineError> {
    if !comparison.may_take(&[]) {
        return Ok(None);
    }
    let registered = pictures.register(reading, |some| comparison.may_take(some))?;
    let pair_nats = comparison.pair_nats(&registered, reading.changes_camera());
    let log_odds = reading.prior_nats + comparison.total_nats(&pair_nats);
    let is_taken = comparison.may_take(&registered) && log_odds > comparison.least_nats;
    Ok(is_taken.then(|| Found {
        reading,
        fitting: registered.iter().flatten().count(),
        given: comparison.of_given.iter().flatten().count(),
        pairs: comparison.of_given.len(),
        log_odds,
        pair_nats: match reading.shift_frames {
            0 => pair_nats,
            _ => Vec::new(),
        },
    }))
}

/// The readings found, the most probable first, without those that it is distinguished from; those
/// that the pictures' files ask for before the others.
fn name(mut found: Vec<Found>) -> Option<FittingReadings> {
    found.sort_by(|a, b| {
        let by_odds = b.log_odds.total_cmp(&a.log_odds);
        by_odds.then(a.reading.changes.cmp(&b.reading.changes))
    });
    let best = found.first()?;
    let named = found.iter().filter(|one| !one.is_distinguished_from(best));
    let mut named: Vec<&Found> = named.collect();
    named.sort_by_key(|one| !one.reading.is_stated);
    let first = named.first()?;
    Some(FittingReadings {
        readings: named.iter().map(|one| one.reading.remedy.clone()).collect(),
        is_of_camera: named.iter().any(|one| one.reading.changes_camera()),
        fitting: first.fitting,
        given: first.given,
        pairs: first.pairs,
        log_odds: first.log_odds,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::frames::PictureOrientation;
    use tunnelstitch_core::survey::CameraReading;

    /// A usual reading, or one that is improbable from the beginning.
    fn reading(prior_nats: f64) -> PoseReading {
        PoseReading {
            remedy: format!("{prior_nats}"),
            changes: 1,
            is_stated: false,
            prior_nats,
            initial: Vec::new(),
            orientation: PictureOrientation::Stored,
            camera: CameraReading::AsGiven,
            shift_frames: 0,
        }
    }

    fn found<'r>(reading: &'r PoseReading, pair_nats: &[f64]) -> Found<'r> {
        Found {
            reading,
            fitting: pair_nats.len(),
            given: 0,
            pairs: pair_nats.len(),
            log_odds: reading.prior_nats + pair_nats.iter().sum::<f64>(),
            pair_nats: pair_nats.to_vec(),
        }
    }

    /// Of equal sums, those whose pairs disagree do not tell readings apart.
    #[test]
    fn readings_are_told_apart_where_pairs_agree() {
        let (usual, rare) = (reading(0.0), reading(-3.0));
        let best = found(&usual, &[30.0; 8]);
        let steady = found(&usual, &[29.0; 8]);
        let mixed = found(&usual, &[24.0, 34.0, 25.0, 33.0, 26.0, 34.0, 24.0, 32.0]);
        assert!(steady.is_distinguished_from(&best) && !mixed.is_distinguished_from(&best));
        assert_eq!(steady.log_odds, mixed.log_odds);
        // A reading that is improbable from the beginning needs more.
        assert!(found(&rare, &mixed.pair_nats).is_distinguished_from(&best));
        // Within odds of one to twenty, nothing is distinguished.
        assert!(!found(&usual, &[29.8; 8]).is_distinguished_from(&best));
    }
}
