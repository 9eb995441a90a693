//! Errors by deformation that no stretch sees ([`crate::parameters::unseen_errors`]), of all
//! stretches.
//!
//! Draws of different stretches are independent: each deforms its own wall. Along the gauge the
//! errors of a stretch are counted from its first frame. In the tunnel of all they go on where
//! those of the stretch before have come to. The strengths that the pixels of all frames admit are
//! those of a stretch with the share x of them times `x^(1/4)`, as the evidence falls with the
//! number of frames and with the fourth power of the strength.

use crate::parameters::calibration::Kappa;
use crate::parameters::frame_estimate::{FrameEstimate, FrameStep};
use crate::parameters::unseen_errors::{UNSEEN_DRAWS, UnseenError, UnseenErrors};
use crate::shards::division::Shard;
use crate::shards::joined_shape::nearest;
use nalgebra::{DMatrix, DVector, Matrix3, Vector6};
use std::ops::Range;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Gauge, GaugeMotion, RadialField, SplineLattice, WallPoint};

/// A stretch with the errors that it does not see.
pub struct UnseenStretch<'s> {
    /// The stretch.
    pub shard: &'s Shard,
    /// Its errors, in its own gauge.
    pub errors: &'s UnseenErrors,
    /// Motion to the gauge of all.
    pub motion: GaugeMotion,
    /// That motion on the unrolled wall.
    pub by: WallPoint,
    /// Chainage between which the wall is its own, in the gauge of all, metres.
    pub own_h_m: [f64; 2],
}

impl UnseenStretch<'_> {
    /// Strength that the pixels of all of so many frames admit over that of the stretch.
    fn scale(&self, frames: usize) -> f64 {
        (self.shard.frames.len() as f64 / frames as f64).powf(0.25)
    }
}

/// Joins the errors of stretches. `estimates`: of all frames, in the gauge of all; `lattice`: its
/// origin and perimeter are those of the wall; `extent_h_m`: of the wall, metres.
pub fn join_unseen(
    stretches: &[UnseenStretch],
    estimates: &[FrameEstimate],
    gauge: &Gauge,
    lattice: SplineLattice,
    extent_h_m: [f64; 2],
) -> UnseenErrors {
    let draws = || stretches.iter().flat_map(|stretch| &stretch.errors.draws);
    let columns = draws()
        .map(|draw| draw.displacement.lattice().columns)
        .max();
    let Some(columns) = columns else {
        return UnseenErrors::default();
    };
    let lattice = SplineLattice { columns, ..lattice };
    let rows = lattice.rows_between(extent_h_m[0], extent_h_m[1]);
    let joined = (0..UNSEEN_DRAWS).par_map(|draw| UnseenError {
        frames: frames_of(stretches, draw, estimates, gauge),
        shared: shared_of(stretches, draw, estimates.len()),
        displacement: displacement_of(stretches, draw, (lattice, rows.clone()), estimates.len()),
    });
    UnseenErrors { draws: joined }
}

/// The mean error of the shared parameters of a draw.
fn shared_of(stretches: &[UnseenStretch], draw: usize, frames: usize) -> Kappa {
    let errors = stretches.iter().filter_map(|stretch| {
        let error = stretch.errors.draws.get(draw)?;
        Some(error.shared * stretch.scale(frames))
    });
    errors.sum::<Kappa>() / stretches.len() as f64
}

/// The errors of all frames of a draw.
fn frames_of(
    stretches: &[UnseenStretch],
    draw: usize,
    estimates: &[FrameEstimate],
    gauge: &Gauge,
) -> Vec<FrameStep> {
    let mut errors: Vec<FrameStep> = Vec::with_capacity(estimates.len());
    // The amounts of the gauge's directions that errors have come to, and the error there of the
    // next stretch's first frame.
    let mut amounts = DVector::zeros(gauge.degrees_of_freedom());
    let mut before: Option<FrameStep> = None;
    for stretch in stretches {
        let (shard, scale) = (stretch.shard, stretch.scale(estimates.len()));
        let error = |frame: usize| {
            let draw = stretch.errors.draws.get(draw);
            let step = draw.and_then(|draw| draw.frames.get(shard.place(frame)));
            step.map_or_else(FrameStep::zeros, |step| {
                turned(step, &stretch.motion) * scale
            })
        };
        let first = shard.own.start;
        if let Some(before) = before {
            amounts += along(gauge, &estimates[first], &(before - error(first)));
        }
        for frame in shard.own.clone() {
            errors.push(error(frame) + moved(gauge, &estimates[frame], &amounts));
        }
        let next = shard.own.end;
        before = shard.frames.contains(&next).then(|| error(next));
    }
    errors
}

/// A step of a frame after a motion of everything: positions turn with it.
fn turned(step: &FrameStep, motion: &GaugeMotion) -> FrameStep {
    let turn: Matrix3<f64> = *motion.rotation().to_rotation_matrix().matrix();
    let mut turned = *step;
    let position = turn * step.fixed_rows::<3>(3);
    turned.fixed_rows_mut::<3>(3).copy_from(&position);
    turned
}

/// Amounts of the gauge's directions that are nearest to a step of a frame.
fn along(gauge: &Gauge, estimate: &FrameEstimate, step: &FrameStep) -> DVector<f64> {
    let directions: Vec<Vector6<f64>> = gauge.directions(&estimate.pose);
    let matrix = DMatrix::from_fn(6, directions.len(), |row, k| directions[k][row]);
    let right = matrix.transpose() * DVector::from_fn(6, |row, _| step[row]);
    let normal = matrix.transpose() * &matrix;
    let solved = normal.cholesky().map(|factor| factor.solve(&right));
    solved.unwrap_or_else(|| DVector::zeros(directions.len()))
}

/// The step of a frame by amounts of the gauge's directions.
fn moved(gauge: &Gauge, estimate: &FrameEstimate, amounts: &DVector<f64>) -> FrameStep {
    let mut step = FrameStep::zeros();
    for (direction, amount) in gauge.directions(&estimate.pose).iter().zip(amounts.iter()) {
        let mut pose = step.fixed_rows_mut::<6>(0);
        pose += direction * *amount;
    }
    step
}

/// The displacement of a draw, at every node that of the nearest stretch.
fn displacement_of(
    stretches: &[UnseenStretch],
    draw: usize,
    (lattice, rows): (SplineLattice, Range<i64>),
    frames: usize,
) -> RadialField {
    let fields = stretches.iter().map(|stretch| {
        let error = stretch.errors.draws.get(draw)?;
        let field = error.displacement.clone().moved(stretch.by);
        Some((field, stretch.scale(frames)))
    });
    let fields: Vec<Option<(RadialField, f64)>> = fields.collect();
    RadialField::through(lattice, rows, |wall| {
        let own_h_m = stretches.iter().map(|stretch| stretch.own_h_m);
        let field = fields[nearest(own_h_m, wall.h_m)].as_ref();
        field.map_or(0.0, |(field, scale)| scale * field.at(wall).delta_m)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    /// Every stretch errs by the same turn from frame to frame, counted from its first one.
    #[test]
    fn errors_along_the_gauge_go_on_from_stretch_to_stretch() {
        let poses = spiral(400, 0.1, 0.5);
        let estimates: Vec<FrameEstimate> = poses.into_iter().map(FrameEstimate::at).collect();
        let gauge = Gauge::round();
        let shards = [1, 2].map(|number| Shard::new(number, 2, 400, 1).unwrap());
        let lattice = SplineLattice {
            perimeter_m: 18.0,
            columns: 8,
            origin: WallPoint::default(),
        };
        let errors = shards.each_ref().map(|shard| {
            let of_frame = |frame: usize| {
                let amounts = DVector::from_vec(vec![1e-4 * shard.place(frame) as f64, 0.0]);
                moved(&gauge, &estimates[frame], &amounts)
            };
            let draw = UnseenError {
                frames: shard.frames.clone().map(of_frame).collect(),
                shared: Kappa::zeros(),
                displacement: RadialField::new(lattice, -10, vec![0.001; 8 * 40]),
            };
            UnseenErrors {
                draws: vec![draw; UNSEEN_DRAWS],
            }
        });
        let stretch = |k: usize| UnseenStretch {
            shard: &shards[k],
            errors: &errors[k],
            motion: GaugeMotion::default(),
            by: WallPoint::default(),
            own_h_m: [20.0 * k as f64, 20.0 * (k + 1) as f64],
        };
        let stretches = [stretch(0), stretch(1)];
        let joined = join_unseen(&stretches, &estimates, &gauge, lattice, [-1.0, 41.0]);
        assert_eq!(joined.draws.len(), UNSEEN_DRAWS);
        // With 80 frames of the other one.
        let scale = (280.0f64 / 400.0).powf(0.25);
        for frame in [0, 199, 200, 399] {
            let found = along(&gauge, &estimates[frame], &joined.draws[3].frames[frame]);
            assert!(
                (found[0] - scale * 1e-4 * frame as f64).abs() < 1e-9,
                "{frame}"
            );
        }
        let middle = WallPoint { s_m: 1.0, h_m: 5.0 };
        let delta_m = joined.draws[0].displacement.at(middle).delta_m;
        assert!((delta_m - 0.001 * scale).abs() < 1e-9, "{delta_m}");
    }
}
