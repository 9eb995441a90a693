//! How much wall frames share, by their initial poses.

use super::median;
use crate::surface::{Footprint, shortest_arc};
use crate::survey::Survey;
use crate::trajectory::Pose;
use serde::Serialize;

/// Frames whose overlap with all others is looked at.
const ASKED: usize = 200;
/// Frames nearer than this in the sequence are neighbours, not another turn.
const SAME_TURN: usize = 3;

/// What frames share, as boxes on the unrolled wall; medians over the frames.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct OverlapCheck {
    /// Share of a frame that the next one shows, too.
    pub neighbours: f64,
    /// The least of these.
    pub least_neighbours: f64,
    /// The frame after which it is.
    pub least_after: usize,
    /// Share of a frame that the best frame of another turn shows, too; 0 if no turn is closed.
    pub turns: f64,
    /// The shorter side of what neighbours share, metres.
    pub neighbours_width_m: f64,
    /// Frames that look along the tunnel's axis and could not be asked.
    pub along_the_axis: usize,
}

/// Sides of the box that two footprints share, metres.
fn shared(a: &Footprint, b: &Footprint, perimeter_m: f64) -> [f64; 2] {
    let middle = |f: &Footprint| 0.5 * (f.s_min_m + f.s_max_m);
    let apart = shortest_arc(middle(b) - middle(a), perimeter_m);
    let width = |f: &Footprint| f.s_max_m - f.s_min_m;
    let half = 0.5 * (width(a) + width(b));
    let s = (half - apart.abs()).min(width(a)).min(width(b));
    let h = a.h_max_m.min(b.h_max_m) - a.h_min_m.max(b.h_min_m);
    [s.max(0.0), h.max(0.0)]
}

fn area(f: &Footprint) -> f64 {
    (f.s_max_m - f.s_min_m) * (f.h_max_m - f.h_min_m)
}

impl OverlapCheck {
    /// Asks neighbours, and up to [`ASKED`] frames for others that see the same wall.
    pub(super) fn of(survey: &Survey, poses: &[Pose]) -> Self {
        let surface = survey.surface.as_ref();
        let perimeter_m = surface.perimeter_m();
        let footprints: Vec<Option<Footprint>> = poses
            .iter()
            .map(|pose| Footprint::trace(surface, &survey.camera, pose).ok())
            .collect();
        let share = |a: &Footprint, b: &Footprint| {
            let [s, h] = shared(a, b, perimeter_m);
            s * h / area(a).max(1e-12)
        };
        let pairs = || {
            let pairs = footprints.windows(2).enumerate();
            pairs.filter_map(|(k, pair)| Some((k, pair[0].as_ref()?, pair[1].as_ref()?)))
        };
        let least = pairs()
            .map(|(k, a, b)| (share(a, b), k))
            .min_by(|a, b| a.0.total_cmp(&b.0));
        let step = poses.len().div_ceil(ASKED).max(1);
        let others = |k: usize| {
            let own = footprints[k].as_ref()?;
            let best = footprints
                .iter()
                .enumerate()
                .filter(|(other, _)| other.abs_diff(k) > SAME_TURN)
                .filter_map(|(_, other)| Some(share(own, other.as_ref()?)))
                .fold(0.0, f64::max);
            Some(best)
        };
        Self {
            neighbours: median(pairs().map(|(_, a, b)| share(a, b))),
            least_neighbours: least.map_or(0.0, |(share, _)| share),
            least_after: least.map_or(0, |(_, k)| k),
            turns: median((0..poses.len()).step_by(step).filter_map(others)),
            neighbours_width_m: median(pairs().map(|(_, a, b)| {
                let [s, h] = shared(a, b, perimeter_m);
                s.min(h)
            })),
            along_the_axis: footprints.iter().filter(|f| f.is_none()).count(),
        }
    }
}
