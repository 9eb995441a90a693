//! A frame as a tile of the canvas looks at it.

use super::chart::{Chart, Lattice, Projected};
use super::exposure::Response;
use super::kernel::{Interpolation, Kernel};
use super::run::Run;
use super::sample::Samples;
use super::warp::{Look, Points};
use super::{Picture, Placement};
use crate::camera::Camera;
use std::ops::Range;

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
    chart: Chart,
    picture: &'a Picture,
    kernels: &'a Kernels,
    response: Response<'a>,
    /// `2/width`, `2/height` of the picture, and the last pixel centres.
    feather: [f32; 4],
}

impl<'a> View<'a> {
    /// A frame (its index, place and picture) as it is seen from a tile with the given `lattice`.
    pub fn new(
        (frame, placement, picture): (usize, &Placement, &'a Picture),
        camera: &Camera,
        kernels: &'a Kernels,
        response: Response<'a>,
        lattice: &Lattice,
        projected: &mut Projected,
    ) -> Self {
        let (width, height) = (camera.width as f32, camera.height as f32);
        let origin = &lattice.points().origin;
        let look = Look::new(&placement.camera(camera), &placement.pose, origin);
        let chart = Chart::new(&look, lattice, projected);
        Self {
            frame,
            look,
            chart,
            kernels,
            picture,
            response,
            feather: [2.0 / width, 2.0 / height, width - 0.5, height - 0.5],
        }
    }

    /// True if the frame shows some of the tile.
    pub fn shows(&self) -> bool {
        !self.chart.is_outside()
    }

    /// True if some of the tile's points are to be projected one by one.
    pub fn is_rough(&self) -> bool {
        self.chart.is_rough()
    }

    /// Looks at some columns of a row of a tile `width` columns wide: where they appear, and the values there with the frame's exposure
    /// undone. `points`: all of the tile's, if the view is rough.
    pub fn look_at(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        self.locate(run, points, place, columns.clone());
        self.values(run, points, place, columns);
    }

    /// The first half of [`View::look_at`]: where they appear.
    pub fn locate(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        run.locate(&self.chart, &self.look, points, place, columns);
    }

    /// The second half, for columns that were located: one kernel for all of them.
    pub fn values(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        if let Some(kernel) = self.kernel(run, points, place, columns.clone()) {
            run.sample(self.picture, kernel, columns.clone());
            self.response.undo(run, columns);
        }
    }

    /// Whether [`View::copy`] can do it: 8 bits, more than the nearest pixel, no exposure to be undone.
    pub fn copies(&self) -> bool {
        let eight = matches!(self.picture.samples(), Samples::Eight(_));
        eight && self.kernels.stretched(1.0).taps() > 1 && self.response.is_none()
    }

    /// As [`View::look_at`], with the values straight into `pixels`, alpha last.
    pub fn copy<const C: usize>(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
        pixels: &mut [u8],
    ) {
        run.locate(&self.chart, &self.look, points, place, columns.clone());
        let kernel = self.kernel(run, points, place, columns.clone());
        match (kernel, self.picture.samples()) {
            (Some(kernel), Samples::Eight(samples)) => {
                run.copy::<C>(self.picture, samples, kernel, columns, pixels);
            }
            _ => pixels.fill(0),
        }
    }

    /// The kernel for points that were found before: as wide as the frame is finer than the canvas where it shows one of them, next to
    /// the middle. None if it shows none.
    fn kernel(
        &self,
        run: &Run,
        points: &Points,
        (row, width): (usize, usize),
        columns: Range<usize>,
    ) -> Option<&'a Kernel> {
        let seen = run.seen();
        let half = columns.start + columns.len() / 2;
        let column = (half..columns.end)
            .find(|k| seen[*k])
            .or_else(|| (columns.start..half).rev().find(|k| seen[*k]))?;
        let steps = self.chart.steps(row, column);
        let [s, h] = steps.unwrap_or_else(|| self.exact_steps(points, (row, width), column));
        // Frame pixels to a step of one canvas pixel, along that axis of the frame along which there are more.
        let square = |k: usize| s[k] * s[k] + h[k] * h[k];
        Some(self.kernels.stretched(square(0).max(square(1)).sqrt()))
    }

    /// [`Chart::steps`] from one point to the next, or from the one before where a row or column ends.
    fn exact_steps(
        &self,
        points: &Points,
        (row, width): (usize, usize),
        column: usize,
    ) -> [[f32; 2]; 2] {
        let at = row * width + column;
        let own = self.look.pixel(points, at);
        let step = |after: Option<usize>, before: Option<usize>| {
            let other = after.or(before).unwrap_or(at);
            let other = self.look.pixel(points, other);
            [other[0] - own[0], other[1] - own[1]]
        };
        let right = (column + 1 < width).then_some(at + 1);
        let below = Some(at + width).filter(|below| *below < points.len());
        let left = (column > 0).then(|| at - 1);
        [step(right, left), step(below, at.checked_sub(width))]
    }

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel centres.
    #[inline(always)]
    pub fn feather(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}
