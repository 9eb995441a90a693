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
    kernel: &'a Kernel,
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
            kernel: kernels.stretched(chart.stretch()),
            chart,
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
        run.locate(&self.chart, &self.look, points, place, columns.clone());
        if run.seen()[columns.clone()].contains(&true) {
            run.sample(self.picture, self.kernel, columns.clone());
            self.response.undo(run, columns);
        }
    }

    /// Whether [`View::copy`] can do it: 8 bits, more than the nearest pixel, no exposure to be undone.
    pub fn copies(&self) -> bool {
        let eight = matches!(self.picture.samples(), Samples::Eight(_));
        eight && self.kernel.taps() > 1 && self.response.is_none()
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
        if !run.seen()[columns.clone()].contains(&true) {
            pixels.fill(0);
        } else if let Samples::Eight(samples) = self.picture.samples() {
            run.copy::<C>(self.picture, samples, self.kernel, columns, pixels);
        }
    }

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel centres.
    #[inline(always)]
    pub fn feather(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}
