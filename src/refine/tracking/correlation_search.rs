//! Looking for a frame beyond the basin of Gauss–Newton.
//!
//! A wall of bricks correlates with itself over a fraction of a brick only; the prior is wider than
//! that. So before a frame is refined, it is compared with the wall fused from the frames already
//! placed, over the whole width of the prior: the frame, unrolled under a few hypotheses of pitch
//! and roll, is correlated with the wall over all shifts at once, by Fourier transform (a shift of
//! the camera looks nearly like a turn, and refinement tells them apart). The best maxima are
//! handed on as hypotheses.
//!
//! Both are compared by their local contrast ([`crate::frames::local_contrast`]), normalised over
//! what both show: with masks m,
//!
//! `c(d) = Σ A(x) W(x+d) / √(Σ A²(x) m_W(x+d) · Σ m_A(x) W²(x+d))`.
//!
//! The score of a hypothesis is its log-posterior with exposure and noise profiled out:
//! `ℓ = −(n/2ν) ln(1 − c²) − ½ ωᵀΣ⁻¹ω`, n the samples both show, ν those that share one independent
//! piece of texture.
//!
//! Source: J. P. Lewis, "Fast normalized cross-correlation", 1995 (correlation by transform); D.
//! Padfield, "Masked object registration in the Fourier domain", IEEE Trans. Image Processing
//! 21(5), 2012 (masks).

use crate::numerics::spectrum::{Spectrum, Transform};
use crate::refine::model::context::EstimationContext;
use crate::refine::thresholds::correlation_search::MIN_SQUARED_CORRELATION_LEFT;
use crate::refine::tracking::reference_mosaic::{ReferenceMosaic, UnwrappedFrame};
use crate::surface::{WallPoint, shortest_arc, wall_jacobian};
use crate::trajectory::{Pose, so3};
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use rayon::prelude::*;

/// Half width of the search, in standard deviations of the prior.
pub const REACH: f64 = 3.5;
/// ν: samples per independent piece of texture.
const SAMPLES_PER_PIECE: f64 = 4.0;
/// Least share of the frame that must lie on known wall.
const LEAST_OVERLAP: f64 = 0.08;
/// Step between roll hypotheses: movement of the frame's corners, samples.
const ROLL_STEP: f64 = 2.0;
/// Step between pitch hypotheses, radians: by as much less, the shift does instead.
const PITCH_STEP: f64 = 0.12;
/// ... and no finer than this share of it, however steep the view.
const LEAST_PITCH_STEP: f64 = 0.4;
/// Local maxima kept per pitch and roll.
const MAXIMA: usize = 4;
/// Maxima closer than this are one, samples.
const APART: f64 = 2.5;

/// A pose worth refining.
#[derive(Clone, Copy, Debug)]
pub struct Hypothesis {
    /// The pose.
    pub pose: Pose,
    /// Log-posterior ℓ, as the search finds it.
    pub score: f64,
    /// Upper bound of the log-posterior after refinement ([`attainable_log_likelihood`]).
    pub attainable_score: f64,
}

/// ℓ without the prior.
pub fn log_likelihood(correlation: f64, samples: f64) -> f64 {
    let c = correlation.clamp(0.0, 1.0 - 1e-6);
    -0.5 * samples / SAMPLES_PER_PIECE * (1.0 - c * c).ln()
}

/// Upper bound of the log-likelihood that refinement reaches from a hypothesis of the search.
///
/// The search's steps leave a right hypothesis at least [`MIN_SQUARED_CORRELATION_LEFT`] of its
/// squared correlation, so refinement finds no more than `c²/MIN_SQUARED_CORRELATION_LEFT`.
pub fn attainable_log_likelihood(correlation: f64, samples: f64) -> f64 {
    log_likelihood(correlation / MIN_SQUARED_CORRELATION_LEFT.sqrt(), samples)
}

/// Least number of samples a frame must share with the wall to be compared.
pub fn least_samples(unwrapped: &UnwrappedFrame) -> f64 {
    let camera = unwrapped.camera();
    LEAST_OVERLAP * f64::from(camera.width) * f64::from(camera.height)
}

/// A maximum of the correlation over shifts.
struct Peak {
    pitch: f64,
    roll: f64,
    /// Shift along s and h, metres.
    shift_m: Vector2<f64>,
    score: f64,
    attainable_score: f64,
}

/// Searches around `predicted` over `sigma_rad`, the prior's σ of pitch, yaw and roll as seen in
/// the picture; returns at most `count` local maxima, best first.
pub fn search(
    scene: &EstimationContext,
    wall: &ReferenceMosaic,
    unwrapped: &UnwrappedFrame,
    predicted: &Pose,
    sigma_rad: [f64; 3],
    count: usize,
) -> Vec<Hypothesis> {
    let Ok(hit) = scene
        .surface
        .hit(&predicted.t_wc, &(predicted.r_wc * Vector3::z()))
    else {
        return Vec::new();
    };
    let spacing = wall.lattice.spacing_m;
    // How far a radian moves the middle of the view: of pitch along the tunnel, about the tunnel's
    // axis around it.
    let a = wall_jacobian(predicted, &scene.surface.frame(hit.wall));
    let axis = axis_seen(scene, predicted);
    let Some(tilt) = tilt_axis(&axis) else {
        return Vec::new();
    };
    let along = (a.fixed_columns::<3>(0) * tilt).norm();
    let across = (a.fixed_columns::<3>(0) * axis).norm();
    let cells = |length: f64| (length / spacing).ceil() as usize;
    let camera = unwrapped.camera();
    let half_diagonal = 0.5 * f64::from(camera.width).hypot(f64::from(camera.height));
    // The more steeply a frame looks along the tunnel, the faster its picture on the wall stretches
    // with the pitch.
    let steep = (hit.range / along).clamp(LEAST_PITCH_STEP, 1.0);
    let pitches = steps(REACH * sigma_rad[0], PITCH_STEP * steep);
    let rolls = steps(REACH * sigma_rad[2], ROLL_STEP / half_diagonal);
    // Shifts along h make up for half a step of pitch; those along s for all of the yaw.
    let half_pitch = if pitches.len() > 1 {
        0.6 * (pitches[1] - pitches[0])
    } else {
        REACH * sigma_rad[0]
    };
    let widest = 0.5 * scene.surface.perimeter_m();
    let reach = (
        cells((REACH * sigma_rad[1] * across).min(widest)),
        cells((half_pitch * along).min(widest)),
    );
    let correlator = Correlator::new(wall, reach);
    let least = least_samples(unwrapped);
    let hypotheses: Vec<(f64, f64)> = pitches
        .iter()
        .flat_map(|pitch| rolls.iter().map(|roll| (*pitch, *roll)))
        .collect();
    let mut peaks: Vec<Peak> = hypotheses
        .par_iter()
        .flat_map_iter(|&(pitch, roll)| {
            let turn = so3::exp(&(tilt * pitch)) * so3::exp(&(Vector3::z() * roll));
            let pose = Pose::new(predicted.r_wc * turn, predicted.t_wc);
            let mut own: Vec<Peak> = correlator
                .correlate(wall, unwrapped, &pose)
                .into_iter()
                .filter(|found| found.samples >= least)
                .map(|found| {
                    let shift_m = found.shift * spacing;
                    // A camera that pitches up looks towards −h.
                    let omega = tilt * (pitch - shift_m.y / along)
                        + axis * (shift_m.x / across)
                        + Vector3::z() * roll;
                    let prior: f64 = [tilt, Vector3::z().cross(&tilt), Vector3::z()]
                        .iter()
                        .zip(sigma_rad)
                        .map(|(axis, sigma)| 0.5 * (omega.dot(axis) / sigma).powi(2))
                        .sum();
                    let Maximum {
                        correlation,
                        samples,
                        ..
                    } = found;
                    Peak {
                        pitch,
                        roll,
                        shift_m,
                        score: log_likelihood(correlation, samples) - prior,
                        attainable_score: attainable_log_likelihood(correlation, samples) - prior,
                    }
                })
                .collect();
            own.sort_by(|a, b| b.score.total_cmp(&a.score));
            own.truncate(MAXIMA);
            own
        })
        .collect();
    peaks.sort_by(|a, b| b.score.total_cmp(&a.score));
    let mut best: Vec<&Peak> = Vec::new();
    for peak in &peaks {
        let same = |other: &&Peak| {
            let along = peak.shift_m.y - other.shift_m.y - (peak.pitch - other.pitch) * along;
            let across = peak.shift_m.x - other.shift_m.x;
            along.hypot(across) < APART * spacing
                && (peak.roll - other.roll).abs() * half_diagonal < 1.5 * ROLL_STEP
        };
        if !best.iter().any(same) {
            best.push(peak);
        }
        if best.len() == count {
            break;
        }
    }
    best.into_iter()
        .filter_map(|peak| {
            let turn = so3::exp(&(tilt * peak.pitch)) * so3::exp(&(Vector3::z() * peak.roll));
            let pose = Pose::new(predicted.r_wc * turn, predicted.t_wc);
            Some(Hypothesis {
                pose: shifted(scene, &pose, &peak.shift_m)?,
                score: peak.score,
                attainable_score: peak.attainable_score,
            })
        })
        .collect()
}

/// The direction of the tunnel where a camera stands, in the camera's frame.
fn axis_seen(scene: &EstimationContext, pose: &Pose) -> Vector3<f64> {
    scene.surface.straightened(pose).r_wc.inverse() * Vector3::y()
}

/// The axis, in the camera's frame, about which a turn moves the middle of the view along the
/// tunnel and nowhere else: its own x for a camera that is not rolled. None for one that looks
/// along the tunnel's axis.
fn tilt_axis(axis: &Vector3<f64>) -> Option<Vector3<f64>> {
    axis.cross(&Vector3::z()).try_normalize(1e-6)
}

/// Where else on the wall a frame at `pose` fits: shifts along s and h, metres, up to `reach_m`, at
/// which the squared correlation has a maximum of at least `least`; the shift of none is one of
/// them, where the pose is right.
pub fn matches(
    wall: &ReferenceMosaic,
    unwrapped: &UnwrappedFrame,
    pose: &Pose,
    reach_m: [f64; 2],
    least: f64,
) -> Vec<[f64; 2]> {
    let spacing = wall.lattice.spacing_m;
    let cells = |length: f64| (length / spacing).ceil() as usize;
    let correlator = Correlator::new(wall, (cells(reach_m[0]), cells(reach_m[1])));
    let samples = least_samples(unwrapped);
    correlator
        .correlate(wall, unwrapped, pose)
        .into_iter()
        .filter(|found| found.samples >= samples && found.correlation.powi(2) >= least)
        .map(|found| (found.shift * spacing).into())
        .collect()
}

/// Angles from `−half` to `half`, no more than `step` apart.
fn steps(half: f64, step: f64) -> Vec<f64> {
    let n = (half / step).floor() as i32;
    (-n..=n).map(|k| f64::from(k) * step).collect()
}

/// The pose turned so that its middle looks at a wall point `shift_m` away from where it does:
/// about the tunnel's axis, which moves the picture along s and leaves it as it is, however steeply
/// it looks along the tunnel, and in pitch.
fn shifted(scene: &EstimationContext, pose: &Pose, shift_m: &Vector2<f64>) -> Option<Pose> {
    let look = |pose: &Pose| scene.surface.hit(&pose.t_wc, &(pose.r_wc * Vector3::z()));
    let from = look(pose).ok()?.wall;
    let target = WallPoint {
        s_m: from.s_m + shift_m.x,
        h_m: from.h_m + shift_m.y,
    };
    let mut pose = *pose;
    for _ in 0..8 {
        let hit = look(&pose).ok()?.wall;
        let left = Vector2::new(
            shortest_arc(target.s_m - hit.s_m, scene.surface.perimeter_m()),
            target.h_m - hit.h_m,
        );
        let a = wall_jacobian(&pose, &scene.surface.frame(hit));
        let a: Matrix2x3<f64> = a.fixed_columns::<3>(0).into_owned();
        let axis = axis_seen(scene, &pose);
        let tilt = tilt_axis(&axis)?;
        let turn = Matrix2::from_columns(&[a * tilt, a * axis]);
        let step = turn.try_inverse()? * left;
        let step = step * (0.3 / step.norm()).min(1.0);
        pose.r_wc *= so3::exp(&(tilt * step.x + axis * step.y));
    }
    Some(pose)
}

/// A local maximum over shifts.
struct Maximum {
    /// Shift, samples.
    shift: Vector2<f64>,
    correlation: f64,
    /// Samples that both show.
    samples: f64,
}

/// The wall's spectra, ready to be correlated with frames over shifts up to a reach.
struct Correlator {
    transform: Transform,
    reach: (usize, usize),
    contrast: Spectrum,
    square: Spectrum,
    mask: Spectrum,
}

impl Correlator {
    fn new(wall: &ReferenceMosaic, reach: (usize, usize)) -> Self {
        let lattice = &wall.lattice;
        // Room for shifts beyond the wall's end, so that nothing comes around from the other.
        let transform = Transform::at_least(lattice.columns + reach.0, lattice.rows + reach.1);
        let spread = |value: fn(f32) -> f32| {
            let raster = pad_raster(&transform, lattice.columns, &wall.contrast, value);
            transform.forward(raster)
        };
        Self {
            contrast: spread(|v| v),
            square: spread(|v| v * v),
            mask: spread(|_| 1.0),
            transform,
            reach,
        }
    }

    /// Local maxima of the correlation of the frame at `pose` over shifts, in samples.
    fn correlate(
        &self,
        wall: &ReferenceMosaic,
        unwrapped: &UnwrappedFrame,
        pose: &Pose,
    ) -> Vec<Maximum> {
        let contrast = unwrapped.contrast(pose, &wall.origin);
        let unrolled: Vec<f32> = wall
            .points
            .iter()
            .zip(&wall.visible)
            .map(|(point, visible)| match visible {
                true => contrast(point).unwrap_or(f32::NAN),
                false => f32::NAN,
            })
            .collect();
        let transform = &self.transform;
        let columns = wall.lattice.columns;
        let spread = |value: fn(f32) -> f32| {
            transform.forward(pad_raster(transform, columns, &unrolled, value))
        };
        let (contrast, square, mask) = (spread(|v| v), spread(|v| v * v), spread(|_| 1.0));
        let product = transform.correlate(&contrast, &self.contrast);
        let own = transform.correlate(&square, &self.mask);
        let walls = transform.correlate(&mask, &self.square);
        let samples = transform.correlate(&mask, &self.mask);
        let (reach_s, reach_h) = (self.reach.0 as i64, self.reach.1 as i64);
        let (width, height) = (transform.columns as i64, transform.rows as i64);
        let index =
            |ds: i64, dh: i64| (dh.rem_euclid(height) * width + ds.rem_euclid(width)) as usize;
        let at = |ds: i64, dh: i64| -> f32 {
            let k = index(ds, dh);
            let energy = (own[k] * walls[k]).max(0.0).sqrt();
            if samples[k] < 1.0 || energy <= 0.0 {
                -1.0
            } else {
                product[k] / energy
            }
        };
        let mut maxima = Vec::new();
        for dh in -reach_h..=reach_h {
            for ds in -reach_s..=reach_s {
                let c = at(ds, dh);
                let peak = c > 0.0
                    && (-1..=1)
                        .all(|y| (-1..=1).all(|x| (x, y) == (0, 0) || at(ds + x, dh + y) <= c));
                if peak {
                    maxima.push(Maximum {
                        shift: Vector2::new(ds as f64, dh as f64),
                        correlation: f64::from(c),
                        samples: f64::from(samples[index(ds, dh)]),
                    });
                }
            }
        }
        maxima
    }
}

/// A lattice's values in a raster of the transform's size; 0 where there is none.
fn pad_raster(
    transform: &Transform,
    columns: usize,
    values: &[f32],
    value: fn(f32) -> f32,
) -> Vec<f32> {
    let mut raster = vec![0.0; transform.columns * transform.rows];
    let rows = raster.chunks_exact_mut(transform.columns);
    for (row, values) in rows.zip(values.chunks_exact(columns)) {
        for (cell, v) in row.iter_mut().zip(values) {
            if !v.is_nan() {
                *cell = value(*v);
            }
        }
    }
    raster
}
