//! Motion and exposure of one stretch against the one before, by the frames that both have placed.

use crate::model::frame_states::FrameStates;
use crate::parameters::frame_estimate::FrameEstimate;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::surface::{Gauge, GaugeMotion};
use tunnelstitch_geometry::trajectory::Pose;

/// Difference of a stretch from the one before where both are right: the motion along the gauge,
/// and the grey values of the wall.
///
/// With `I = a W + b` in either of them, the wall of this one has `W = α W' + β` for the grey value
/// W' of the one before: `a' = a α`, `b' = b + a β`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShardAlignment {
    /// The motion.
    pub motion: GaugeMotion,
    /// ln α.
    pub log_gain: f64,
    /// β, grey levels.
    pub bias: f64,
}

impl ShardAlignment {
    /// The alignment of estimates `own` to those of the same frames `before`.
    pub fn of_common(gauge: &Gauge, own: &[FrameEstimate], before: &[FrameEstimate]) -> Self {
        let poses = |of: &[FrameEstimate]| -> Vec<Pose> { of.iter().map(|e| e.pose).collect() };
        let pairs = || own.iter().zip(before);
        let log_gains = pairs().map(|(own, before)| before.log_gain - own.log_gain);
        let biases = pairs().map(|(own, before)| (before.bias - own.bias) / own.log_gain.exp());
        Self {
            motion: gauge.align(&poses(own), &poses(before)),
            log_gain: upper_median(log_gains.collect()).unwrap_or(0.0),
            bias: upper_median(biases.collect()).unwrap_or(0.0),
        }
    }

    /// An estimate as the stretch before would have it.
    pub fn apply(&self, estimate: &FrameEstimate) -> FrameEstimate {
        FrameEstimate {
            pose: self.motion.apply(&estimate.pose),
            log_gain: estimate.log_gain + self.log_gain,
            bias: estimate.bias + estimate.log_gain.exp() * self.bias,
        }
    }
}

/// The frames of `range`, counted in the survey, that are inliers of both of two states, which
/// begin with the frames `firsts`.
pub fn common_inliers(
    range: std::ops::Range<usize>,
    states: [&FrameStates; 2],
    firsts: [usize; 2],
) -> Vec<usize> {
    let is_inlier = |frame: &usize| {
        let of = states.iter().zip(firsts);
        of.into_iter()
            .all(|(state, first)| state.rejections[frame - first].is_none())
    };
    range.filter(is_inlier).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::trajectory::spiral;

    /// A stretch with a motion and grey values of its own.
    #[test]
    fn motion_and_exposure_are_those_that_a_stretch_was_given() {
        let before: Vec<FrameEstimate> = (spiral(20, 0.1, 0.5).into_iter().enumerate())
            .map(|(k, pose)| FrameEstimate {
                pose,
                log_gain: 0.02 * (k as f64).sin(),
                bias: (k as f64).cos(),
            })
            .collect();
        let motion = GaugeMotion::about_y(2.1, -17.0);
        let (alpha, beta) = (1.1f64, -6.0);
        let own: Vec<FrameEstimate> = (before.iter())
            .map(|estimate| FrameEstimate {
                pose: motion.apply(&estimate.pose),
                log_gain: estimate.log_gain - alpha.ln(),
                bias: estimate.bias - estimate.log_gain.exp() / alpha * beta,
            })
            .collect();
        let found = ShardAlignment::of_common(&Gauge::round(), &own, &before);
        for (own, before) in own.iter().zip(&before) {
            let aligned = found.apply(own);
            assert!(aligned.pose.local(&before.pose).norm() < 1e-12);
            assert!((aligned.log_gain - before.log_gain).abs() < 1e-12);
            assert!((aligned.bias - before.bias).abs() < 1e-12);
        }
        // Without a gauge there is no motion.
        let held = ShardAlignment::of_common(&Gauge::default(), &own, &before);
        assert!(held.motion.is_none());
    }
}
