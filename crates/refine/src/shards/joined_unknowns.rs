//! The shared parameters of all stretches.

use crate::parameters::calibration::{BEND_INDEX, Kappa, SHARED_PARAMETERS};
use crate::shards::alignment::ShardAlignment;
use crate::shards::state::ShardEnd;
use tunnelstitch_geometry::surface::Bend;

/// The shared parameters where the solve of all stretches begins, and which of them it estimates.
pub struct JoinedUnknowns {
    /// Their values: the mean of those of the stretches.
    pub kappa: Kappa,
    /// True for those that any stretch estimates.
    pub free: [bool; SHARED_PARAMETERS],
    /// True for those that any stretch has equations of, and none estimates.
    pub tested: [bool; SHARED_PARAMETERS],
}

/// Joins the shared parameters of stretches; `ends`: with their alignments, by which a bend turns.
pub fn join_unknowns(ends: &[(&ShardEnd, &ShardAlignment)]) -> JoinedUnknowns {
    let states = || ends.iter().map(|(end, _)| &end.snapshot.state);
    let any = |is: &dyn Fn(&[bool; SHARED_PARAMETERS]) -> bool| states().any(|s| is(&s.free));
    let free = std::array::from_fn(|k| any(&|free| free[k]));
    let tested = std::array::from_fn(|k| !free[k] && states().any(|state| state.tested[k]));
    let mut sum = Kappa::zeros();
    for (end, alignment) in ends {
        sum += end.snapshot.state.kappa;
        let bend = Bend {
            curvature_per_m: end.bend_per_m,
            at_h_m: 0.0,
        };
        let [x, z] = bend.moved(&alignment.motion).curvature_per_m;
        sum[BEND_INDEX] += x;
        sum[BEND_INDEX + 1] += z;
    }
    let mean = sum / ends.len().max(1) as f64;
    JoinedUnknowns {
        kappa: Kappa::from_fn(|k, _| if free[k] { mean[k] } else { 0.0 }),
        free,
        tested,
    }
}
