//! The poses that a correlation search tries: turns of the camera one by one, and for each of them
//! all shifts of its picture on the unrolled wall at once.
//!
//! Whatever turns the camera, a rotation about the tunnel's axis shifts the picture around, and a
//! translation along the axis shifts it along, without distortion. Of what is left, two turns are
//! tried one by one: pitch and roll of a camera that looks at the wall ([`super::search_across`]),
//! the two tilts of one that looks along the tunnel ([`super::search_along`]).

use nalgebra::Vector2;
use tunnelstitch_geometry::trajectory::Pose;

/// Deviation from the prior's prediction that the search covers in each direction, σ: one of three
/// normal deviates exceeds it about once in a thousand frames.
pub const MAX_DEVIATION_SIGMA: f64 = 3.5;

/// Step between turns: motion of the picture that its shift does not make up for, samples. The
/// right turn is within a sample.
pub const TURN_STEP_SAMPLES: f64 = 2.0;

/// Difference from which on two turns are different hypotheses, steps: neighbouring steps show the
/// same pose, the next but one does not.
pub const MIN_SEPARATION_STEPS: f64 = 1.5;

/// Two turns of a camera, radians.
pub type Turns = [f64; 2];

/// Turns and shifts of a frame around its predicted pose.
pub trait SearchGrid: Sync {
    /// The turns that are tried.
    fn turns(&self) -> Vec<Turns>;

    /// The largest shifts along s and h, metres.
    fn reach_m(&self) -> [f64; 2];

    /// The predicted pose, turned.
    fn turned_pose(&self, turns: Turns) -> Pose;

    /// The predicted pose, turned, with its picture shifted on the wall; None if it leaves the
    /// wall.
    fn shifted_pose(&self, turns: Turns, shift_m: &Vector2<f64>) -> Option<Pose>;

    /// `½ ωᵀΣ⁻¹ω` of the motion that turns and shift stand for, by the prior.
    fn deviation(&self, turns: Turns, shift_m: &Vector2<f64>) -> f64;

    /// Motion on the wall, metres, and of the turns, steps, between two hypotheses.
    fn distance(&self, a: (Turns, Vector2<f64>), b: (Turns, Vector2<f64>)) -> (f64, f64);
}

/// Angles from `−reach` to `reach` in steps of `step`, 0 among them.
pub fn symmetric_steps(reach: f64, step: f64) -> Vec<f64> {
    let n = (reach / step).floor() as i32;
    (-n..=n).map(|k| f64::from(k) * step).collect()
}

/// All pairs of two lists of angles.
pub fn all_turns(first: &[f64], second: &[f64]) -> Vec<Turns> {
    first
        .iter()
        .flat_map(|a| second.iter().map(move |b| [*a, *b]))
        .collect()
}
