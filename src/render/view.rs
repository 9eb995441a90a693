//! A frame as a tile of the canvas looks at it.

use super::chart::{Chart, Lattice, PATCH, Projected};
use super::exposure::Response;
use super::integer::{self, Source, Span};
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

    /// The kernel for canvas pixels that are these steps apart in a frame, u and v of each: as wide as that axis asks along which
    /// there are more frame pixels.
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
    /// As wide as the frame is finer than the canvas in the middle of the patch; None where it is rough or not in the frame.
    kernel: Option<&'a Kernel>,
    /// True if the kernel lies within the picture all over the patch, and nothing is masked.
    inside: bool,
}

/// What rounding may change of a coordinate, pixels.
const ROUNDING_PX: f32 = 0.01;

impl<'a> PatchView<'a> {
    fn new(chart: &Chart, patch: usize, picture: &Picture, kernels: &'a Kernels) -> Self {
        let (Some(steps), Some(range)) = (chart.steps(patch), chart.range(patch)) else {
            return Self {
                kernel: None,
                inside: false,
            };
        };
        let kernel = kernels.for_steps(steps);
        let first = kernel.before() as f32 + ROUNDING_PX;
        let size = [picture.width(), picture.height()];
        let within = range.into_iter().zip(size).all(|([least, most], size)| {
            let end = (size + kernel.before() + 1) as f32 - kernel.taps() as f32;
            least >= first && most <= end - ROUNDING_PX
        });
        Self {
            kernel: Some(kernel),
            inside: within && picture.mask().is_none() && kernel.taps() > 1,
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
        let patches = (0..chart.len()).map(|k| PatchView::new(&chart, k, picture, kernels));
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

    /// The second half, for columns that were located.
    pub fn values(
        &self,
        run: &mut Run,
        points: &Points,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        for piece in pieces(columns.clone()) {
            let done = self.span(place.0, &piece).is_some_and(|(span, first)| {
                run.sample_span(self.picture, &span, first, piece.clone())
            });
            if !done && let Some(kernel) = self.kernel(run, points, place, piece.clone()) {
                run.sample(self.picture, kernel, piece);
            }
        }
        self.response.undo(run, columns);
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
        for piece in pieces(columns.clone()) {
            let first = (piece.start - columns.start) * (C + 1);
            let own = &mut pixels[first..first + piece.len() * (C + 1)];
            let done = self.span(place.0, &piece).is_some_and(|(span, first)| {
                run.show(piece.clone());
                integer::span_bytes::<C>(&span, piece.start - first..piece.end - first, own)
            });
            if done {
                continue;
            }
            self.locate(run, points, place, piece.clone());
            let kernel = self.kernel(run, points, place, piece.clone());
            match (kernel, self.picture.samples()) {
                (Some(kernel), Samples::Eight(samples)) => {
                    run.copy::<C>(self.picture, samples, kernel, piece, own);
                }
                _ => own.fill(0),
            }
        }
    }

    // Handed back through memory it would be waited for until all that was drawn before is stored.
    /// What is to be sampled for columns of one patch, and the patch's first column, if all of it lies inside an 8-bit frame.
    #[inline(always)]
    fn span(&self, row: usize, columns: &Range<usize>) -> Option<(Span<'_>, usize)> {
        let patch = self.chart.patch(row, columns.start);
        let PatchView {
            kernel: Some(kernel),
            inside: true,
        } = self.patches[patch]
        else {
            return None;
        };
        let Samples::Eight(samples) = self.picture.samples() else {
            return None;
        };
        let stride = self.picture.width() * self.picture.format().channels;
        let span = Span {
            source: Source { samples, stride },
            kernel,
            line: self.chart.line(row, patch)?,
        };
        Some((span, columns.start - columns.start % PATCH))
    }

    /// The kernel for points of a patch that were found before; None if the frame shows none of them.
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

    /// How far u and v move from one point to the next, or from the one before where a row or column ends.
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

/// Columns of a row, patch by patch.
fn pieces(columns: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let mut from = columns.start;
    std::iter::from_fn(move || {
        let to = columns.end.min((from / PATCH + 1) * PATCH);
        let piece = from..to;
        from = to;
        (!piece.is_empty()).then_some(piece)
    })
}
