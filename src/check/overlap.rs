//! Overlap of the frames on the wall according to their initial poses.

use super::statistics::median_or_zero;
use crate::surface::{Footprint, shortest_arc};
use crate::survey::Survey;
use crate::trajectory::Pose;
use nalgebra::{Vector2, Vector3};
use serde::Serialize;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Largest number of frames whose overlap with other turns is measured.
const MAX_MEASURED_FRAMES: usize = 200;
/// Columns and rows of pixels of a frame that are projected into others.
const GRID_PIXELS: [usize; 2] = [20, 15];
/// Largest distance in the sequence between frames of one camera in one turn; others belong to
/// another turn.
const MAX_NEIGHBOUR_DISTANCE: usize = 3;

/// Overlap of frames, medians over the frames. Pixels that the mask hides and ignored parts of the
/// wall do not count.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
pub struct OverlapCheck {
    /// Share of a frame that the next one of its camera also shows, 0–1.
    pub neighbours: f64,
    /// Smallest overlap of neighbours, 0–1.
    pub least_neighbours: f64,
    /// First frame of the neighbours with the smallest overlap.
    pub least_after: usize,
    /// Share of a frame that the best frame of another turn also shows, 0–1; 0 without loop
    /// closure.
    pub turns: f64,
    /// Shorter side of the rectangle on the unrolled wall that neighbours share, masked parts
    /// included, metres.
    pub neighbours_width_m: f64,
    /// Number of frames that show no wall within range and are not measured.
    pub without_wall: usize,
}

/// Sides of the rectangle that two footprints share, metres.
fn shared_sides(a: &Footprint, b: &Footprint, perimeter_m: f64) -> [f64; 2] {
    let middle = |f: &Footprint| 0.5 * (f.s_min_m + f.s_max_m);
    let apart = shortest_arc(middle(b) - middle(a), perimeter_m);
    let width = |f: &Footprint| f.s_max_m - f.s_min_m;
    let half = 0.5 * (width(a) + width(b));
    let s = (half - apart.abs()).min(width(a)).min(width(b));
    let h = a.h_max_m.min(b.h_max_m) - a.h_min_m.max(b.h_min_m);
    [s.max(0.0), h.max(0.0)]
}

/// Measures overlaps by a regular grid of pixels that are projected from frame to frame.
struct OverlapMeter<'a> {
    survey: &'a Survey,
    poses: &'a [Pose],
    /// The pixels of each camera that may show the wall.
    pixels: Vec<Vec<[f64; 2]>>,
}

impl<'a> OverlapMeter<'a> {
    fn new(survey: &'a Survey, poses: &'a [Pose]) -> Self {
        let [columns, rows] = GRID_PIXELS;
        let [width, height] = survey.cameras.size();
        let middle =
            |k: usize, of: usize, px: u32| (k as f64 + 0.5) / of as f64 * f64::from(px) - 0.5;
        let pixel = |k: usize| {
            let u = middle(k % columns, columns, width);
            [u, middle(k / columns, rows, height)]
        };
        let of_camera = |camera: usize| {
            let pixels = (0..columns * rows).map(pixel);
            pixels
                .filter(|pixel| shows_wall(survey, camera, &Vector2::from(*pixel)))
                .collect()
        };
        Self {
            survey,
            poses,
            pixels: (0..survey.cameras.count()).map(of_camera).collect(),
        }
    }

    /// Wall points of a frame's pixels that are not ignored, world coordinates, metres.
    fn wall_points(&self, frame: usize) -> Vec<Vector3<f64>> {
        let (survey, pose) = (self.survey, &self.poses[frame]);
        let camera = survey.cameras.of(frame);
        let pixels = self.pixels[frame % self.pixels.len()].iter();
        let hits = pixels.filter_map(|[u, v]| {
            let ray = pose.r_wc * camera.ray(*u, *v)?;
            let hit = survey.surface.hit(&pose.t_wc, &ray).ok()?;
            (!survey.ignored.contains(&hit.wall)).then_some(hit.x_w)
        });
        hits.collect()
    }

    /// Share of a frame's pixels whose wall points the frame `other` also shows.
    fn shared_share(&self, points: &[Vector3<f64>], other: usize) -> f64 {
        let is_shown = |x_w: &&Vector3<f64>| {
            let x_c = self.poses[other].to_camera(x_w);
            let pixel = self.survey.cameras.of(other).project(&x_c);
            pixel.is_some_and(|pixel| shows_wall(self.survey, other, &pixel))
        };
        points.iter().filter(is_shown).count() as f64 / (GRID_PIXELS[0] * GRID_PIXELS[1]) as f64
    }
}

/// True if the lens covers a pixel of a frame and the mask does not hide it.
fn shows_wall(survey: &Survey, frame: usize, pixel: &Vector2<f64>) -> bool {
    let mask = survey.frames.masks().of(frame);
    (survey.cameras.of(frame)).is_in_image(pixel, 0.0)
        && mask.is_none_or(|mask| mask.is_clear(pixel.x as f32, pixel.y as f32, 0.0))
}

impl OverlapCheck {
    /// Measures the overlap of all neighbours, and of up to [`MAX_MEASURED_FRAMES`] frames with
    /// other turns.
    pub(super) fn of(survey: &Survey, poses: &[Pose]) -> Self {
        let surface = survey.surface.as_ref();
        let perimeter_m = surface.perimeter_m();
        let footprints: Vec<Option<Footprint>> = poses
            .iter()
            .enumerate()
            .map(|(k, pose)| Footprint::trace(surface, survey.cameras.of(k), pose).ok())
            .collect();
        let meter = OverlapMeter::new(survey, poses);
        let sides = |a: usize, b: usize| {
            let (a, b) = (footprints[a].as_ref()?, footprints[b].as_ref()?);
            Some(shared_sides(a, b, perimeter_m))
        };
        let meet = |a: usize, b: usize| sides(a, b).is_some_and(|[s, h]| s > 0.0 && h > 0.0);
        let cameras = survey.cameras.count();
        let shares: Vec<f64> = (cameras..poses.len())
            .par_map(|k| meter.shared_share(&meter.wall_points(k - cameras), k));
        let least = shares.iter().enumerate().min_by(|a, b| a.1.total_cmp(b.1));
        let step = poses.len().div_ceil(MAX_MEASURED_FRAMES).max(1);
        let others = |k: usize| {
            let others = (0..poses.len())
                .filter(|other| other.abs_diff(k) > MAX_NEIGHBOUR_DISTANCE * cameras);
            let points = meter.wall_points(k);
            let shares = others
                .filter(|other| meet(k, *other))
                .map(|other| meter.shared_share(&points, other));
            shares.fold(0.0, f64::max)
        };
        let widths = (cameras..poses.len()).filter_map(|k| sides(k - cameras, k));
        Self {
            neighbours: median_or_zero(shares.iter().copied()),
            least_neighbours: least.map_or(0.0, |(_, share)| *share),
            least_after: least.map_or(0, |(k, _)| k),
            turns: median_or_zero((0..poses.len()).step_by(step).map(others)),
            neighbours_width_m: median_or_zero(widths.map(|[s, h]| s.min(h))),
            without_wall: footprints.iter().filter(|f| f.is_none()).count(),
        }
    }
}
