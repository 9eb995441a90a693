//! Correlation search: hypotheses of a frame's pose beyond the basin of Gauss–Newton.
//!
//! A brick wall correlates with itself over a fraction of a brick only, and the prior is wider than
//! that. So before a frame is refined, it is compared with the reference mosaic over the whole
//! width of the prior. The frame is unwrapped under a few hypotheses of pitch and roll; each
//! picture is correlated with the mosaic over all shifts at once, by Fourier transform
//! ([`Correlator`]). (A translation of the camera looks nearly like a rotation; refinement tells
//! them apart.) The best maxima are the hypotheses.
//!
//! The score of a hypothesis is its log-posterior with exposure and noise profiled out:
//! `ℓ = −(n/2ν) ln(1 − c²) − ½ ωᵀΣ⁻¹ω`, n the samples that both show, ν those that share one
//! independent piece of texture.

use crate::model::context::EstimationContext;
use crate::samples::footprints::MAX_VIEWING_DISTANCE_RADII;
use crate::thresholds::correlation_search::{
    MAX_DEVIATION_SIGMA, MIN_OVERLAP_SHARE, PITCH_STEP_RAD, SAMPLES_PER_INDEPENDENT_PIECE,
};
use crate::tracking::correlator::{CorrelationMaximum, Correlator};
use crate::tracking::reference_mosaic::ReferenceMosaic;
use crate::tracking::unwrapped_frame::UnwrappedFrame;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use rayon::prelude::*;
use tunnelstitch_geometry::surface::{WallPoint, shortest_arc, wall_jacobian};
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Distance on the wall from which on two poses are different, samples: two correlation lengths.
///
/// With the autocorrelation `exp(−d²/2L²)` of the texture, an independent piece has
/// [`SAMPLES_PER_INDEPENDENT_PIECE`] `= π L²` samples, so `2L = 2 √(4/π)`; e⁻² of the correlation
/// is left there.
pub const MIN_SEPARATION_SAMPLES: f64 = 2.26;

/// Step between roll hypotheses: motion of the picture's corners, samples. The right roll is within
/// a sample, all over the picture.
const ROLL_STEP_SAMPLES: f64 = 2.0;

/// Difference of roll from which on two maxima are different hypotheses, steps of roll:
/// neighbouring steps show the same pose, the next but one does not.
const MIN_SEPARATION_ROLL_STEPS: f64 = 1.5;

/// Share of the pitch step to which it shrinks as the frame looks more steeply along the tunnel:
/// the cosine of the angle to the section at which the farthest resolved wall is seen.
const MIN_PITCH_STEP_SHARE: f64 = 1.0 / MAX_VIEWING_DISTANCE_RADII;

/// Length of a step of the Newton iterations that rotate a pose to look at a wall point, radians:
/// along it the tangent of a view at 45° changes by less than a factor of two.
const MAX_VIEW_STEP_RAD: f64 = 0.3;

/// Number of these iterations: five of full length turn the view by a right angle, three more
/// square the error three times, from a tenth of a radian to 1e-8.
const VIEW_ITERATIONS: usize = 8;

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

/// Searches around `predicted`, with the prior's σ of pitch, yaw and roll as they appear in the
/// picture, `sigma_rad`; returns at most `count` hypotheses, best first.
pub fn search_poses(
    context: &EstimationContext,
    mosaic: &ReferenceMosaic,
    unwrapped: &UnwrappedFrame,
    predicted: &Pose,
    sigma_rad: [f64; 3],
    count: usize,
) -> Vec<Hypothesis> {
    let spacing_m = mosaic.grid.spacing_m;
    let Some(grid) = SearchGrid::new(context, unwrapped, predicted, sigma_rad, spacing_m) else {
        return Vec::new();
    };
    let cells = |length_m: f64| (length_m / spacing_m).ceil() as usize;
    let correlator = Correlator::new(mosaic, (cells(grid.reach_m[0]), cells(grid.reach_m[1])));
    let min_samples = min_samples(unwrapped);
    let turns: Vec<(f64, f64)> = grid
        .pitches
        .iter()
        .flat_map(|pitch| grid.rolls.iter().map(|roll| (*pitch, *roll)))
        .collect();
    let mut maxima: Vec<ScoredMaximum> = turns
        .par_iter()
        .flat_map_iter(|&(pitch, roll)| {
            let pose = grid.turned_pose(pitch, roll);
            let maxima = correlator.find_maxima(mosaic, unwrapped, &pose).into_iter();
            let compared = maxima.filter(|found| found.samples >= min_samples);
            let scored = compared.map(|found| grid.score(pitch, roll, spacing_m, &found));
            scored.collect::<Vec<ScoredMaximum>>()
        })
        .collect();
    maxima.sort_by(|a, b| b.score.total_cmp(&a.score));
    grid.select_distinct(&maxima, spacing_m, count)
        .into_iter()
        .filter_map(|maximum| {
            let pose = grid.turned_pose(maximum.pitch, maximum.roll);
            Some(Hypothesis {
                pose: shift_view(context, &pose, &maximum.shift_m)?,
                score: maximum.score,
                attainable_score: maximum.attainable_score,
            })
        })
        .collect()
}

/// A maximum of the correlation under one pitch and roll, with its log-posterior.
struct ScoredMaximum {
    pitch: f64,
    roll: f64,
    /// Shift along s and h, metres.
    shift_m: Vector2<f64>,
    score: f64,
    attainable_score: f64,
}

/// The pitches, rolls and shifts that are searched around a predicted pose.
struct SearchGrid<'p> {
    predicted: &'p Pose,
    /// σ of pitch, yaw and roll, radians.
    sigma_rad: [f64; 3],
    /// The tunnel's axis in the camera's frame.
    tunnel_axis: Vector3<f64>,
    /// The axis of pitch in the camera's frame.
    pitch_axis: Vector3<f64>,
    /// Motion of the middle of the view along the tunnel by a radian of pitch, metres.
    along_m: f64,
    /// Motion of the middle of the view around the tunnel by a radian about its axis, metres.
    across_m: f64,
    /// Half the diagonal of the picture, pixels.
    half_diagonal: f64,
    /// Pitches, radians.
    pitches: Vec<f64>,
    /// Rolls, radians.
    rolls: Vec<f64>,
    /// Largest shifts along s and h, metres.
    reach_m: [f64; 2],
}

impl<'p> SearchGrid<'p> {
    /// The grid around a pose, for samples `spacing_m` apart; None if that does not look at the
    /// wall, or looks along the tunnel.
    fn new(
        context: &EstimationContext,
        unwrapped: &UnwrappedFrame,
        predicted: &'p Pose,
        sigma_rad: [f64; 3],
        spacing_m: f64,
    ) -> Option<Self> {
        let ray = predicted.r_wc * Vector3::z();
        let hit = context.surface.hit(&predicted.t_wc, &ray).ok()?;
        let a = wall_jacobian(predicted, &context.surface.frame(hit.wall));
        let tunnel_axis = tunnel_axis_in_camera(context, predicted);
        let pitch_axis = pitch_axis(&tunnel_axis)?;
        let along_m = (a.fixed_columns::<3>(0) * pitch_axis).norm();
        let across_m = (a.fixed_columns::<3>(0) * tunnel_axis).norm();
        let camera = unwrapped.camera();
        let half_diagonal = 0.5 * f64::from(camera.width).hypot(f64::from(camera.height));
        // The more steeply a frame looks along the tunnel, the faster its picture on the wall
        // stretches with the pitch.
        let steepness = (hit.range / along_m).clamp(MIN_PITCH_STEP_SHARE, 1.0);
        let pitch_reach = MAX_DEVIATION_SIGMA * sigma_rad[0];
        let pitches = symmetric_steps(pitch_reach, PITCH_STEP_RAD * steepness);
        let roll_reach = MAX_DEVIATION_SIGMA * sigma_rad[2];
        let rolls = symmetric_steps(roll_reach, ROLL_STEP_SAMPLES / half_diagonal);
        // Shifts along h make up for half a step of pitch, and a sample more, as a maximum may lie
        // between those of two pitches; shifts along s make up for all of the yaw.
        let along_reach_m = if pitches.len() > 1 {
            0.5 * (pitches[1] - pitches[0]) * along_m + spacing_m
        } else {
            pitch_reach * along_m
        };
        let widest_m = 0.5 * context.surface.perimeter_m();
        Some(Self {
            predicted,
            sigma_rad,
            tunnel_axis,
            pitch_axis,
            along_m,
            across_m,
            half_diagonal,
            pitches,
            rolls,
            reach_m: [
                (MAX_DEVIATION_SIGMA * sigma_rad[1] * across_m).min(widest_m),
                along_reach_m.min(widest_m),
            ],
        })
    }

    /// The predicted pose, pitched and rolled.
    fn turned_pose(&self, pitch: f64, roll: f64) -> Pose {
        let turn = so3::exp(&(self.pitch_axis * pitch)) * so3::exp(&(Vector3::z() * roll));
        Pose::new(self.predicted.r_wc * turn, self.predicted.t_wc)
    }

    /// Scores a maximum of the correlation by its log-posterior.
    fn score(
        &self,
        pitch: f64,
        roll: f64,
        spacing_m: f64,
        found: &CorrelationMaximum,
    ) -> ScoredMaximum {
        let shift_m = found.shift * spacing_m;
        // A camera that pitches up looks towards −h.
        let omega = self.pitch_axis * (pitch - shift_m.y / self.along_m)
            + self.tunnel_axis * (shift_m.x / self.across_m)
            + Vector3::z() * roll;
        let yaw_axis = Vector3::z().cross(&self.pitch_axis);
        let prior: f64 = [self.pitch_axis, yaw_axis, Vector3::z()]
            .iter()
            .zip(self.sigma_rad)
            .map(|(axis, sigma)| 0.5 * (omega.dot(axis) / sigma).powi(2))
            .sum();
        let (correlation, samples) = (found.correlation, found.samples);
        ScoredMaximum {
            pitch,
            roll,
            shift_m,
            score: log_likelihood(correlation, samples) - prior,
            attainable_score: attainable_log_likelihood(correlation, samples) - prior,
        }
    }

    /// Selects the best of the maxima, which are sorted best first, without those that are nearly
    /// the pose of a better one; `count` at most.
    fn select_distinct<'m>(
        &self,
        maxima: &'m [ScoredMaximum],
        spacing_m: f64,
        count: usize,
    ) -> Vec<&'m ScoredMaximum> {
        let mut distinct: Vec<&ScoredMaximum> = Vec::new();
        for maximum in maxima {
            let is_same = |other: &&ScoredMaximum| {
                let pitch_m = (maximum.pitch - other.pitch) * self.along_m;
                let along_m = maximum.shift_m.y - other.shift_m.y - pitch_m;
                let across_m = maximum.shift_m.x - other.shift_m.x;
                let roll = (maximum.roll - other.roll).abs() * self.half_diagonal;
                along_m.hypot(across_m) < MIN_SEPARATION_SAMPLES * spacing_m
                    && roll < MIN_SEPARATION_ROLL_STEPS * ROLL_STEP_SAMPLES
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
}

/// The direction of the tunnel's axis at a camera, in the camera's frame.
fn tunnel_axis_in_camera(context: &EstimationContext, pose: &Pose) -> Vector3<f64> {
    context.surface.straightened(pose).r_wc.inverse() * Vector3::y()
}

/// The axis of pitch in the camera's frame: a rotation about it moves the middle of the view along
/// the tunnel and nowhere else. None for a camera that looks along the tunnel.
///
/// It is the camera's own x for a camera that is not rolled.
fn pitch_axis(tunnel_axis: &Vector3<f64>) -> Option<Vector3<f64>> {
    tunnel_axis.cross(&Vector3::z()).try_normalize(1e-6)
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

/// Angles from `−reach` to `reach` in steps of `step`, 0 among them.
fn symmetric_steps(reach: f64, step: f64) -> Vec<f64> {
    let n = (reach / step).floor() as i32;
    (-n..=n).map(|k| f64::from(k) * step).collect()
}

/// Rotates a pose so that its middle looks at a wall point `shift_m` away from where it does; None
/// if it leaves the wall.
///
/// It rotates about the tunnel's axis, which moves the picture along s and does not distort it
/// however steeply the camera looks along the tunnel, and in pitch. Newton's method finds the two
/// angles.
fn shift_view(context: &EstimationContext, pose: &Pose, shift_m: &Vector2<f64>) -> Option<Pose> {
    let hit = |pose: &Pose| {
        let ray = pose.r_wc * Vector3::z();
        context.surface.hit(&pose.t_wc, &ray)
    };
    let from = hit(pose).ok()?.wall;
    let target = WallPoint {
        s_m: from.s_m + shift_m.x,
        h_m: from.h_m + shift_m.y,
    };
    let mut pose = *pose;
    for _ in 0..VIEW_ITERATIONS {
        let wall = hit(&pose).ok()?.wall;
        let remaining_m = Vector2::new(
            shortest_arc(target.s_m - wall.s_m, context.surface.perimeter_m()),
            target.h_m - wall.h_m,
        );
        let a = wall_jacobian(&pose, &context.surface.frame(wall));
        let a: Matrix2x3<f64> = a.fixed_columns::<3>(0).into_owned();
        let axis = tunnel_axis_in_camera(context, &pose);
        let tilt = pitch_axis(&axis)?;
        let jacobian = Matrix2::from_columns(&[a * tilt, a * axis]);
        let step = jacobian.try_inverse()? * remaining_m;
        let step = step * (MAX_VIEW_STEP_RAD / step.norm()).min(1.0);
        pose.r_wc *= so3::exp(&(tilt * step.x + axis * step.y));
    }
    Some(pose)
}
