//! Correlation search: hypotheses of a frame's pose beyond the basin of Gauss–Newton.
//!
//! A brick wall correlates with itself over a fraction of a brick only, and the prior is wider than
//! that. So before a frame is refined, it is compared with the reference mosaic over the whole
//! width of the prior. The frame is unwrapped under a few turns of the camera ([`SearchGrid`]);
//! each picture is correlated with the mosaic over all shifts at once, by Fourier transform
//! ([`Correlator`]). The best maxima are the hypotheses.
//!
//! The score of a hypothesis is its log-posterior with exposure and noise profiled out:
//! `ℓ = −(n/2ν) ln(1 − c²) − ½ ωᵀΣ⁻¹ω`, n the samples that both show, ν those that share one
//! independent piece of texture.

use crate::comparison::unwrapped_frame::UnwrappedFrame;
use crate::model::context::EstimationContext;
use crate::thresholds::correlation_search::{MIN_OVERLAP_SHARE, SAMPLES_PER_INDEPENDENT_PIECE};
use crate::tracking::correlator::{CorrelationMaximum, Correlator};
use crate::tracking::reference_mosaic::ReferenceMosaic;
use crate::tracking::search_across::{SearchAcross, tunnel_axis_in_camera};
use crate::tracking::search_along::SearchAlong;
use crate::tracking::search_grid::{MIN_SEPARATION_STEPS, SearchGrid, Turns};
use nalgebra::Vector2;
use rayon::prelude::*;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::surface::{looks_along, viewing_distance};
use tunnelstitch_geometry::trajectory::Pose;

/// Distance on the wall from which on two poses are different, samples: two correlation lengths.
///
/// With the autocorrelation `exp(−d²/2L²)` of the texture, an independent piece has
/// [`SAMPLES_PER_INDEPENDENT_PIECE`] `= π L²` samples, so `2L = 2 √(4/π)`; e⁻² of the correlation
/// is left there.
pub const MIN_SEPARATION_SAMPLES: f64 = 2.26;

/// Smallest share of its squared correlation that a right hypothesis keeps at half a step of the
/// search from the right pose.
///
/// With the autocorrelation `exp(−d²/2L²)` of the texture, `π L²` = 4 samples (an independent
/// piece), half a sample off along both axes (d² = 1/2) and half a step of roll off (one sample at
/// the corners, d² = 1/3 in the mean) leave `exp(−d²/L²)` = 0.52 of it.
pub const MIN_SQUARED_CORRELATION_LEFT: f64 = 0.5;

/// A hypothesis of a frame's pose.
#[derive(Clone, Copy, Debug)]
pub struct Hypothesis {
    /// The pose.
    pub pose: Pose,
    /// Log-posterior ℓ, as the search finds it.
    pub score: f64,
    /// Upper bound of the log-posterior after refinement ([`attainable_log_likelihood`]).
    pub attainable_score: f64,
}

/// Log-likelihood `−(n/2ν) ln(1 − c²)` of a correlation over a number of samples, exposure and
/// noise profiled out.
pub fn log_likelihood(correlation: f64, samples: f64) -> f64 {
    let c = correlation.clamp(0.0, 1.0 - 1e-6);
    -0.5 * samples / SAMPLES_PER_INDEPENDENT_PIECE * (1.0 - c * c).ln()
}

/// Upper bound of the log-likelihood that refinement reaches from a hypothesis of the search.
///
/// The search's steps leave a right hypothesis at least [`MIN_SQUARED_CORRELATION_LEFT`] of its
/// squared correlation, so refinement finds no more than `c²/MIN_SQUARED_CORRELATION_LEFT`.
pub fn attainable_log_likelihood(correlation: f64, samples: f64) -> f64 {
    log_likelihood(correlation / MIN_SQUARED_CORRELATION_LEFT.sqrt(), samples)
}

/// The number of samples that a frame must share with the mosaic to be compared.
pub fn min_samples(unwrapped: &UnwrappedFrame) -> f64 {
    let camera = unwrapped.camera();
    MIN_OVERLAP_SHARE * f64::from(camera.width) * f64::from(camera.height)
}

/// Log-likelihood that the greatest of so many correlations of noise exceeds with the probability
/// `alpha` at the most: `ℓ ≈ ½ z²` of a normal deviate, that exceeds z with a probability below
/// `exp(−½ z²)`.
pub fn log_likelihood_by_chance(correlations: usize, alpha: f64) -> f64 {
    (correlations as f64 / alpha).ln()
}

/// The result of a search.
pub struct Found {
    /// Hypotheses, best first.
    pub hypotheses: Vec<Hypothesis>,
    /// Number of maxima of the correlation that they are the best of.
    pub maxima: usize,
}

/// Searches around `predicted`, with the prior's σ of pitch, yaw and roll as they appear in the
/// picture, `sigma_rad`, for at most `count` hypotheses.
pub fn search_poses(
    context: &EstimationContext,
    mosaic: &ReferenceMosaic,
    unwrapped: &UnwrappedFrame,
    predicted: &Pose,
    sigma_rad: [f64; 3],
    count: usize,
) -> Found {
    let spacing_m = mosaic.grid.spacing_m;
    let Some(grid) = search_grid(context, unwrapped.camera(), predicted, sigma_rad, spacing_m)
    else {
        return Found {
            hypotheses: Vec::new(),
            maxima: 0,
        };
    };
    let cells = |length_m: f64| (length_m / spacing_m).ceil() as usize;
    let correlator = Correlator::new(mosaic, grid.reach_m().map(cells).into());
    let min_samples = min_samples(unwrapped);
    let mut maxima: Vec<ScoredMaximum> = grid
        .turns()
        .par_iter()
        .flat_map_iter(|&turns| {
            let pose = grid.turned_pose(turns);
            let maxima = correlator.find_maxima(mosaic, unwrapped, &pose).into_iter();
            let compared = maxima.filter(|found| found.samples >= min_samples);
            let scored =
                compared.map(|found| score(grid.as_ref(), turns, found.shift * spacing_m, &found));
            scored.collect::<Vec<ScoredMaximum>>()
        })
        .collect();
    maxima.sort_by(|a, b| b.score.total_cmp(&a.score));
    let best = select_distinct(grid.as_ref(), &maxima, spacing_m, count).into_iter();
    let hypotheses = best.filter_map(|maximum| {
        Some(Hypothesis {
            pose: grid.shifted_pose(maximum.turns, &maximum.shift_m)?,
            score: maximum.score,
            attainable_score: maximum.attainable_score,
        })
    });
    Found {
        hypotheses: hypotheses.collect(),
        maxima: maxima.len(),
    }
}

/// The grid around a pose for samples `spacing_m` apart; None if the camera sees no wall.
fn search_grid<'p>(
    context: &'p EstimationContext,
    camera: &Camera,
    predicted: &Pose,
    sigma_rad: [f64; 3],
    spacing_m: f64,
) -> Option<Box<dyn SearchGrid + 'p>> {
    let surface = context.surface.as_ref();
    if !looks_along(surface, predicted) {
        let across = SearchAcross::new(context, camera, predicted, sigma_rad, spacing_m)?;
        return Some(Box::new(across));
    }
    let distance_m = viewing_distance(surface, camera, predicted).ok()?;
    let tunnel_axis = tunnel_axis_in_camera(context, predicted);
    let lengths_m = (distance_m, spacing_m);
    let along = SearchAlong::new(context, predicted, tunnel_axis, sigma_rad, lengths_m);
    Some(Box::new(along))
}

/// A maximum of the correlation under two turns, with its log-posterior.
struct ScoredMaximum {
    turns: Turns,
    /// Shift along s and h, metres.
    shift_m: Vector2<f64>,
    score: f64,
    attainable_score: f64,
}

/// Scores a maximum of the correlation by its log-posterior.
fn score(
    grid: &dyn SearchGrid,
    turns: Turns,
    shift_m: Vector2<f64>,
    found: &CorrelationMaximum,
) -> ScoredMaximum {
    let prior = grid.deviation(turns, &shift_m);
    let (correlation, samples) = (found.correlation, found.samples);
    ScoredMaximum {
        turns,
        shift_m,
        score: log_likelihood(correlation, samples) - prior,
        attainable_score: attainable_log_likelihood(correlation, samples) - prior,
    }
}

/// Selects the best of the maxima, which are sorted best first, without those that are nearly the
/// pose of a better one; `count` at most.
fn select_distinct<'m>(
    grid: &dyn SearchGrid,
    maxima: &'m [ScoredMaximum],
    spacing_m: f64,
    count: usize,
) -> Vec<&'m ScoredMaximum> {
    let mut distinct: Vec<&ScoredMaximum> = Vec::new();
    for maximum in maxima {
        let is_same = |other: &&ScoredMaximum| {
            let (a, b) = (maximum, other);
            let (moved_m, steps) = grid.distance((a.turns, a.shift_m), (b.turns, b.shift_m));
            moved_m < MIN_SEPARATION_SAMPLES * spacing_m && steps < MIN_SEPARATION_STEPS
        };
        if !distinct.iter().any(is_same) {
            distinct.push(maximum);
        }
        if distinct.len() == count {
            break;
        }
    }
    distinct
}

/// Finds shifts along s and h, metres, up to `reach_m`, at which a frame at `pose` matches the
/// mosaic: maxima of the squared correlation of at least `min_squared_correlation`.
///
/// Zero shift is one of them where the pose is right.
pub fn find_matching_shifts(
    mosaic: &ReferenceMosaic,
    unwrapped: &UnwrappedFrame,
    pose: &Pose,
    reach_m: [f64; 2],
    min_squared_correlation: f64,
) -> Vec<[f64; 2]> {
    let spacing_m = mosaic.grid.spacing_m;
    let cells = |length_m: f64| (length_m / spacing_m).ceil() as usize;
    let correlator = Correlator::new(mosaic, (cells(reach_m[0]), cells(reach_m[1])));
    let min_samples = min_samples(unwrapped);
    correlator
        .find_maxima(mosaic, unwrapped, pose)
        .into_iter()
        .filter(|found| {
            found.samples >= min_samples && found.correlation.powi(2) >= min_squared_correlation
        })
        .map(|found| (found.shift * spacing_m).into())
        .collect()
}
