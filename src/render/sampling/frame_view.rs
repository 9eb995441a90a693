//! A frame as a tile of the canvas looks at it.

use super::exposure::Response;
use super::fixed_point::{self, Block, Part, Patch, Source};
use super::patch_light::Light;
use super::picture::Picture;
use super::point_batch::Run;
use super::sample::Samples;
use crate::camera::Camera;
use crate::numerics::kernel::{Interpolation, Kernel};
use crate::render::layout::placement::Placement;
use crate::render::warp::control_points::Lattice;
use crate::render::warp::local_polynomial::{Chart, Projected};
use crate::render::warp::patches::{PATCH, of_patch, pieces};
use crate::render::warp::projection::{Look, Points};
use std::ops::Range;

/// Kernels are made for stretches of this step from 1 upwards.
const STRETCH_STEP: f64 = 0.25;
/// The widest kernel: frames are halved before they are more than twice as fine as the canvas, save
/// where a camera stands much nearer to the wall than the others.
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

    /// The kernel for canvas pixels that are these steps apart in a frame, u and v of each: as wide
    /// as that axis asks along which there are more frame pixels.
    fn for_steps(&self, [s, h]: [[f32; 2]; 2]) -> &Kernel {
        let square = |k: usize| s[k] * s[k] + h[k] * h[k];
        self.stretched(square(0).max(square(1)).sqrt())
    }

    /// The widest kernel that is no wider than `stretch`.
    fn stretched(&self, stretch: f32) -> &Kernel {
        // The cast saturates, so that anything odd gets an end of the list.
        let step = ((f64::from(stretch) - 1.0) / STRETCH_STEP) as usize;
        &self.0[step.min(self.0.len() - 1)]
    }
}

/// A patch of the chart in a frame.
#[derive(Clone, Copy)]
struct PatchView<'a> {
    /// As wide as the frame is finer than the canvas in the middle of the patch; None where it is
    /// rough or not in the frame.
    kernel: Option<&'a Kernel>,
    /// Between which u and between which v all of the kernel lies within the picture; None if it is
    /// looked up otherwise, or masked.
    within: Option<[[f32; 2]; 2]>,
    /// True if that is so all over the patch.
    inside: bool,
    /// What undoes the light of a smooth patch, if there is any.
    light: Option<Light>,
}

/// What rounding may change of a coordinate, pixels.
const ROUNDING_PX: f32 = 0.01;

impl<'a> PatchView<'a> {
    fn new(
        chart: &Chart,
        patch: usize,
        picture: &Picture,
        kernels: &'a Kernels,
        response: &Response,
    ) -> Self {
        let (Some(lines), Some(steps)) = (chart.lines(patch), chart.steps(patch)) else {
            return Self {
                kernel: None,
                within: None,
                inside: false,
                light: None,
            };
        };
        let kernel = kernels.for_steps(steps);
        let range = Chart::range(lines, 0..PATCH, 0..PATCH);
        let first = kernel.before() as f32 + ROUNDING_PX;
        let size = [picture.width(), picture.height()];
        let within = size.map(|size| {
            let end = (size + kernel.before() + 1) as f32 - kernel.taps() as f32;
            [first, end - ROUNDING_PX]
        });
        let within = (picture.mask().is_none() && kernel.taps() > 1).then_some(within);
        Self {
            kernel: Some(kernel),
            within,
            inside: within.is_some_and(|within| lies(range, within)),
            light: response.light(|| {
                let nodes = [-1.0, 0.0, 1.0];
                nodes.map(|y| nodes.map(|x| Chart::pixel(lines, x, y)))
            }),
        }
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
    /// Of each patch.
    patches: Vec<PatchView<'a>>,
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
        let patches =
            (0..chart.len()).map(|k| PatchView::new(&chart, k, picture, kernels, &response));
        Self {
            frame,
            look,
            patches: patches.collect(),
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

    /// True if it is plain that the frame shows nothing of some rows and columns of a tile, all in
    /// one patch.
    pub fn misses(&self, rows: &Range<usize>, columns: &Range<usize>) -> bool {
        let Some(lines) = self
            .chart
            .lines(self.chart.patch(rows.start, columns.start))
        else {
            return self.chart.is_outside_at(rows.start, columns.start);
        };
        let range = Chart::range(lines, of_patch(rows).1, of_patch(columns).1);
        let mut axes = range.into_iter().zip(self.look.limit());
        axes.any(|([least, most], limit)| most < -ROUNDING_PX || least > limit + ROUNDING_PX)
    }

    /// Looks at some columns of a row of a tile `width` columns wide: where they appear, and the
    /// values there with the frame's exposure undone. `points`: all of the tile's, if the view is
    /// rough.
    pub fn look_at(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        run.locate(&self.chart, &self.look, points, place, columns.clone());
        for piece in pieces(columns) {
            if !self.sample_row(run, place.0, piece.clone()) {
                self.sample_located(run, points, place, piece);
            }
        }
    }

    /// The same without where the columns appear.
    pub fn values(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        for piece in pieces(columns) {
            let done = self.sample_row(run, place.0, piece.clone());
            if !done && self.locate(run, points, place, piece.clone()) {
                self.sample_located(run, points, place, piece);
            }
        }
    }

    /// Finds where columns of one patch appear; false if it is plain that the frame shows none of
    /// them.
    fn locate(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) -> bool {
        let misses = self.misses(&(place.0..place.0 + 1), &columns);
        if misses {
            run.see_nothing(columns)
        } else {
            run.locate(&self.chart, &self.look, points, place, columns)
        }
        !misses
    }

    /// The values in columns of one patch, if all of it lies inside an 8-bit frame.
    fn sample_row(&self, run: &mut Run, row: usize, columns: Range<usize>) -> bool {
        let Some((at, patch)) = self.patch(&(row..row + 1), &columns) else {
            return false;
        };
        let (row, (first, own)) = (row % PATCH, of_patch(&columns));
        let done = run.sample_row(self.picture, &patch, row, first, own);
        if done && let Some(light) = &self.patches[at].light {
            self.response.undo_by(light, row, run, first, columns);
        }
        done
    }

    /// The values in columns of one patch that were located.
    fn sample_located(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        let Some(kernel) = self.kernel(run, points, place, columns.clone()) else {
            return;
        };
        run.sample(self.picture, kernel, columns.clone());
        let row = place.0;
        match &self.patches[self.chart.patch(row, columns.start)].light {
            Some(light) => {
                let (first, _) = of_patch(&columns);
                self.response
                    .undo_by(light, row % PATCH, run, first, columns);
            }
            None => self.response.undo(run, columns),
        }
    }

    /// Whether [`View::copy`] can do it: 8 bits, more than the nearest pixel, no exposure to be
    /// undone.
    pub fn copies(&self) -> bool {
        let eight = matches!(self.picture.samples(), Samples::Eight(_));
        eight && self.kernels.stretched(1.0).taps() > 1 && self.response.is_none()
    }

    /// As [`View::values`], with the values straight into `pixels`, alpha last.
    pub fn copy<const C: usize>(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
        pixels: &mut [u8],
    ) {
        for piece in pieces(columns.clone()) {
            let first = (piece.start - columns.start) * (C + 1);
            let own = &mut pixels[first..first + piece.len() * (C + 1)];
            let kernel = if self.locate(run, points, place, piece.clone()) {
                self.kernel(run, points, place, piece.clone())
            } else {
                None
            };
            match (kernel, self.picture.samples()) {
                (Some(kernel), Samples::Eight(samples)) => {
                    run.copy::<C>(self.picture, samples, kernel, piece, own);
                }
                _ => own.fill(0),
            }
        }
    }

    /// Draws some rows and columns of a tile, all in one patch, into these rows' pixels: the bytes
    /// of [`View::copy`]. False without doing it where they do not lie inside an 8-bit frame, or
    /// the processor lacks the vectors for it.
    pub fn block<const C: usize>(
        &self,
        rows: Range<usize>,
        columns: Range<usize>,
        pixels: &mut [&mut [u8]],
    ) -> bool {
        let Some((_, patch)) = self.patch(&rows, &columns) else {
            return false;
        };
        let (first, columns) = of_patch(&columns);
        let block = Block {
            patch,
            row: rows.start % PATCH,
            columns,
            first,
        };
        fixed_point::block::<C>(&block, pixels)
    }

    /// What the frame has in some rows and columns of a tile, all in one patch, if they lie inside
    /// an 8-bit frame.
    pub fn part(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        corners: [f32; 4],
    ) -> Option<Part<'_>> {
        let (at, patch) = self.patch(rows, columns)?;
        Some(Part {
            patch,
            bias: self.response.bias(),
            light: self.patches[at].light,
            corners,
        })
    }

    /// The patch that these rows and columns of a tile lie in, and what is to be sampled there, if
    /// they lie inside an 8-bit frame.
    fn patch(&self, rows: &Range<usize>, columns: &Range<usize>) -> Option<(usize, Patch<'_>)> {
        let at = self.chart.patch(rows.start, columns.start);
        let PatchView {
            kernel: Some(kernel),
            within: Some(within),
            inside,
            ..
        } = &self.patches[at]
        else {
            return None;
        };
        let lines = self.chart.lines(at)?;
        if !inside {
            let ((_, rows), (_, columns)) = (of_patch(rows), of_patch(columns));
            let range = Chart::range(lines, rows, fixed_point::reach(&columns));
            if !lies(range, *within) {
                return None;
            }
        }
        let Samples::Eight(samples) = self.picture.samples() else {
            return None;
        };
        let stride = self.picture.width() * self.picture.format().channels;
        let patch = Patch {
            source: Source { samples, stride },
            kernel,
            lines,
        };
        Some((at, patch))
    }

    /// The kernel for points of a patch that were found before; None if the frame shows none of
    /// them.
    fn kernel(
        &self,
        run: &Run,
        points: &Points,
        (row, width): (usize, usize),
        columns: Range<usize>,
    ) -> Option<&'a Kernel> {
        let patch = self.chart.patch(row, columns.start);
        if let Some(kernel) = self.patches[patch].kernel {
            return Some(kernel);
        }
        // Next to the middle.
        let seen = run.seen();
        let half = columns.start + columns.len() / 2;
        let column = (half..columns.end)
            .find(|k| seen[*k])
            .or_else(|| (columns.start..half).rev().find(|k| seen[*k]))?;
        let steps = self.exact_steps(points, (row, width), column);
        Some(self.kernels.for_steps(steps))
    }

    /// How far u and v move from one point to the next, or from the one before where a row or
    /// column ends.
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

    /// `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the outermost pixel
    /// centres.
    #[inline(always)]
    pub fn feather(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}

/// Whether what lies between these, along u and along v, lies within.
fn lies(range: [[f32; 2]; 2], within: [[f32; 2]; 2]) -> bool {
    let both = range.into_iter().zip(within);
    both.into_iter()
        .all(|([least, most], [first, last])| least >= first && most <= last)
}
