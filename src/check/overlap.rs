//! How much wall frames share, by their initial poses.

use super::median;
use crate::surface::{Footprint, shortest_arc};
use crate::survey::Survey;
use crate::trajectory::Pose;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use serde::Serialize;

/// Frames whose overlap with all others is looked at.
const ASKED: usize = 200;
/// Columns and rows of pixels of a frame that are looked for in others.
const PIXELS: [usize; 2] = [20, 15];
/// Frames nearer than this in the sequence are neighbours, not another turn.
const SAME_TURN: usize = 3;

/// What frames share and are compared by; medians over the frames. What the mask hides or the
/// survey ignores is shared with none.
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
    /// The shorter side of the box on the unrolled wall that neighbours share, masked or not,
    /// metres.
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

/// Pixels of a frame, spread evenly, by which it is compared with others.
struct Asked<'a> {
    survey: &'a Survey,
    poses: &'a [Pose],
    pixels: Vec<[f64; 2]>,
}

impl<'a> Asked<'a> {
    fn of(survey: &'a Survey, poses: &'a [Pose]) -> Self {
        let camera = &survey.camera;
        let [columns, rows] = PIXELS;
        let middle =
            |k: usize, of: usize, px: u32| (k as f64 + 0.5) / of as f64 * f64::from(px) - 0.5;
        let pixel = |k: usize| {
            let u = middle(k % columns, columns, camera.width);
            [u, middle(k / columns, rows, camera.height)]
        };
        let pixels = (0..columns * rows).map(pixel);
        Self {
            survey,
            poses,
            pixels: pixels
                .filter(|pixel| shows(survey, &Vector2::from(*pixel)))
                .collect(),
        }
    }

    /// Where they meet wall that is not ignored, world coordinates, metres.
    fn points(&self, frame: usize) -> Vec<Vector3<f64>> {
        let (survey, pose) = (self.survey, &self.poses[frame]);
        let hits = self.pixels.iter().filter_map(|[u, v]| {
            let ray = pose.r_wc * survey.camera.ray(*u, *v)?;
            let hit = survey.surface.hit(&pose.t_wc, &ray).ok()?;
            (!survey.ignored.contains(&hit.wall)).then_some(hit.x_w)
        });
        hits.collect()
    }

    /// Share of a frame that these points are, which it shows, and which another shows, too.
    fn share(&self, points: &[Vector3<f64>], other: usize) -> f64 {
        let sees = |x_w: &&Vector3<f64>| {
            let x_c = self.poses[other].to_camera(x_w);
            let pixel = self.survey.camera.project(&x_c);
            pixel.is_some_and(|pixel| shows(self.survey, &pixel))
        };
        points.iter().filter(sees).count() as f64 / (PIXELS[0] * PIXELS[1]) as f64
    }
}

/// Whether a pixel of a frame shows wall.
fn shows(survey: &Survey, pixel: &Vector2<f64>) -> bool {
    let mask = survey.frames.mask();
    survey.camera.is_in_image(pixel, 0.0)
        && mask.is_none_or(|mask| mask.is_clear(pixel.x as f32, pixel.y as f32, 0.0))
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
        let asked = Asked::of(survey, poses);
        let sides = |a: usize, b: usize| {
            let (a, b) = (footprints[a].as_ref()?, footprints[b].as_ref()?);
            Some(shared(a, b, perimeter_m))
        };
        let meet = |a: usize, b: usize| sides(a, b).is_some_and(|[s, h]| s > 0.0 && h > 0.0);
        let shares: Vec<f64> = (1..poses.len())
            .into_par_iter()
            .map(|k| asked.share(&asked.points(k - 1), k))
            .collect();
        let least = shares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        let step = poses.len().div_ceil(ASKED).max(1);
        let others = |k: usize| {
            let others = (0..poses.len()).filter(|other| other.abs_diff(k) > SAME_TURN);
            let points = asked.points(k);
            let shares = others
                .filter(|other| meet(k, *other))
                .map(|other| asked.share(&points, other));
            shares.fold(0.0, f64::max)
        };
        let widths = (1..poses.len()).filter_map(|k| sides(k - 1, k));
        Self {
            neighbours: median(shares.iter().copied()),
            least_neighbours: least.map_or(0.0, |(_, share)| *share),
            least_after: least.map_or(0, |(k, _)| k),
            turns: median((0..poses.len()).step_by(step).map(others)),
            neighbours_width_m: median(widths.map(|[s, h]| s.min(h))),
            along_the_axis: footprints.iter().filter(|f| f.is_none()).count(),
        }
    }
}
