//! A frame as a tile of the canvas looks at it.

use super::exposure::Response;
use super::kernel::{Interpolation, Kernel};
use super::warp::{Look, Points, Run};
use super::{Picture, Placement};
use crate::camera::Camera;

/// Kernels are made for stretches of this step from 1 upwards.
const STRETCH_STEP: f64 = 0.25;
/// The widest kernel: frames are halved before they are more than twice as fine as the canvas, save where a camera stands
/// much nearer to the wall than the others.
const MOST_STRETCH: f64 = 4.0;

/// The kernels of an interpolation for all stretches.
#[derive(Clone, Debug)]
pub struct Kernels(Vec<Kernel>);

impl Kernels {
    /// The kernels of an interpolation.
    pub fn new(interpolation: Interpolation) -> Self {
        let steps = ((MOST_STRETCH - 1.0) / STRETCH_STEP) as usize;
        let kernel = |k| Kernel::new(interpolation, 1.0 + STRETCH_STEP * k as f64);
        Self((0..=steps).map(kernel).collect())
    }

    /// The widest kernel that is no wider than `stretch`.
    fn stretched(&self, stretch: f32) -> &Kernel {
        // The cast saturates, so that anything odd gets an end of the list.
        let step = ((f64::from(stretch) - 1.0) / STRETCH_STEP) as usize;
        &self.0[step.min(self.0.len() - 1)]
    }
}

/// A frame, ready to be sampled at the points of one tile.
pub struct View<'a> {
    /// Index of the frame.
    pub frame: usize,
    look: Look,
    picture: &'a Picture,
    kernels: &'a Kernels,
    response: Response<'a>,
    /// Points in a row of the tile.
    columns: usize,
    /// `2/width`, `2/height` of the picture, and the last pixel centres.
    feather: [f32; 4],
}

impl<'a> View<'a> {
    /// A frame (its index, place and picture) as it is seen from a tile with the given `points`, `columns` in a row.
    pub fn new(
        (frame, placement, picture): (usize, &Placement, &'a Picture),
        camera: &Camera,
        kernels: &'a Kernels,
        response: Response<'a>,
        points: &Points,
        columns: usize,
    ) -> Self {
        let (width, height) = (camera.width as f32, camera.height as f32);
        Self {
            frame,
            look: Look::new(&placement.camera(camera), &placement.pose, &points.origin),
            picture,
            kernels,
            response,
            columns,
            feather: [2.0 / width, 2.0 / height, width - 0.5, height - 0.5],
        }
    }

    /// Looks at `count` points of a row from index `start`: where they appear, and the values there with the frame's exposure
    /// undone.
    pub fn look_at(&self, run: &mut Run, points: &Points, start: usize, count: usize) {
        run.project(&self.look, points, start, count);
        let half = count / 2;
        let seen = &run.seen()[..count];
        let found = seen[half..].iter().position(|seen| *seen).map(|k| half + k);
        let Some(k) = found.or_else(|| seen[..half].iter().rposition(|seen| *seen)) else {
            return;
        };
        let stretch = self.stretch(points, start + k);
        run.sample(self.picture, self.kernels.stretched(stretch), count);
        self.response.undo(run, count);
    }

    /// How many pixels of the frame a step of one canvas pixel covers at a point, along that axis of the frame along which
    /// it covers more.
    fn stretch(&self, points: &Points, at: usize) -> f32 {
        let (u, v) = self.look.pixel(points, at);
        // The neighbours after it, or before it at the end of a row or column.
        let step = |after: usize, before: Option<usize>, ends: bool| {
            let other = match (ends || after >= points.len(), before) {
                (false, _) => after,
                (true, Some(before)) => before,
                (true, None) => at,
            };
            let (s, t) = self.look.pixel(points, other);
            (s - u, t - v)
        };
        let ends = (at + 1).is_multiple_of(self.columns);
        let before = at.checked_sub(1).filter(|_| self.columns > 1);
        let (u_s, v_s) = step(at + 1, before, ends);
        let (u_h, v_h) = step(at + self.columns, at.checked_sub(self.columns), false);
        (u_s * u_s + u_h * u_h).max(v_s * v_s + v_h * v_h).sqrt()
    }

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel centres.
    #[inline(always)]
    pub fn feather(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}
