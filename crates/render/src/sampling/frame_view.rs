//! A frame over one tile of the canvas, sampled with its exposure undone.

use super::exposure::Response;
use super::fixed_point::{self, BlendPart, PatchBlock, PictureSamples, SampledPatch};
use super::patch_light::PatchLight;
use super::picture::Picture;
use super::point_batch::PointBatch;
use super::sample::Samples;
use crate::layout::placement::Placement;
use crate::warp::control_points::ControlPoints;
use crate::warp::local_polynomial::{LocalPolynomialWarp, ProjectedControlPoints};
use crate::warp::patches::{PATCH_EDGE, split_at_patches, within_patch};
use crate::warp::projection::{LocalPoints, LocalProjection};
use std::ops::Range;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::kernel::{Interpolation, Kernel};

/// Step between the stretches for which kernels are tabulated, from 1 upwards. A smaller value
/// suppresses aliasing more evenly and takes more memory.
const STRETCH_STEP: f64 = 0.25;
/// Largest stretch of a kernel: frames are halved before they are more than twice as fine as the
/// canvas, except where a camera stands much nearer to the wall than the others. A higher value
/// suppresses aliasing there and is slower.
const MAX_STRETCH: f64 = 4.0;

/// Kernels of an interpolation for all stretches.
#[derive(Clone, Debug)]
pub struct StretchedKernels(Vec<Kernel>);

impl StretchedKernels {
    /// Tabulates the kernels of an interpolation.
    pub fn new(interpolation: Interpolation) -> Self {
        let steps = ((MAX_STRETCH - 1.0) / STRETCH_STEP) as usize;
        let kernel = |k| Kernel::new(interpolation, 1.0 + STRETCH_STEP * k as f64);
        Self((0..=steps).map(kernel).collect())
    }

    /// Kernel for canvas pixels that are these steps apart in a frame, u and v of each: as wide as
    /// needed along the axis with more frame pixels.
    fn for_steps(&self, [s, h]: [[f32; 2]; 2]) -> &Kernel {
        let square = |k: usize| s[k] * s[k] + h[k] * h[k];
        self.stretched(square(0).max(square(1)).sqrt())
    }

    /// Widest kernel that is no wider than `stretch`.
    fn stretched(&self, stretch: f32) -> &Kernel {
        // The cast saturates: invalid numbers get an end of the list.
        let step = ((f64::from(stretch) - 1.0) / STRETCH_STEP) as usize;
        &self.0[step.min(self.0.len() - 1)]
    }
}

/// A patch of the warp in a frame.
#[derive(Clone, Copy)]
struct PatchView<'a> {
    /// Kernel for the resolution of the frame in the middle of the patch; None where the patch has
    /// no polynomials or is not in the frame.
    kernel: Option<&'a Kernel>,
    /// Bounds of u and of v within which all of the kernel lies within the picture; None if the
    /// picture is masked or the kernel is the nearest pixel.
    within: Option<[[f32; 2]; 2]>,
    /// True if all of the patch lies within these bounds.
    inside: bool,
    /// Exposure and shading to undo in a patch with polynomials, if there are any.
    light: Option<PatchLight>,
}

/// Margin for rounding of a coordinate, pixels.
const ROUNDING_PX: f32 = 0.01;

impl<'a> PatchView<'a> {
    fn new(
        warp: &LocalPolynomialWarp,
        patch: usize,
        picture: &Picture,
        kernels: &'a StretchedKernels,
        response: &Response,
    ) -> Self {
        let (Some(lines), Some(steps)) = (warp.coefficients(patch), warp.pixel_steps(patch)) else {
            return Self {
                kernel: None,
                within: None,
                inside: false,
                light: None,
            };
        };
        let kernel = kernels.for_steps(steps);
        let range = LocalPolynomialWarp::pixel_bounds(lines, 0..PATCH_EDGE, 0..PATCH_EDGE);
        let first = kernel.taps_before() as f32 + ROUNDING_PX;
        let size = [picture.width(), picture.height()];
        let within = size.map(|size| {
            let end = (size + kernel.taps_before() + 1) as f32 - kernel.taps() as f32;
            [first, end - ROUNDING_PX]
        });
        let within = (picture.mask().is_none() && kernel.taps() > 1).then_some(within);
        Self {
            kernel: Some(kernel),
            within,
            inside: within.is_some_and(|within| lies(range, within)),
            light: response.light(|| {
                let nodes = [-1.0, 0.0, 1.0];
                nodes.map(|y| nodes.map(|x| LocalPolynomialWarp::pixel(lines, x, y)))
            }),
        }
    }
}

/// A frame, prepared for sampling at the points of one tile.
pub struct FrameView<'a> {
    /// Index of the frame.
    pub frame: usize,
    projection: LocalProjection,
    warp: LocalPolynomialWarp,
    picture: &'a Picture,
    kernels: &'a StretchedKernels,
    /// One for each patch.
    patches: Vec<PatchView<'a>>,
    response: Response<'a>,
    /// `2/width`, `2/height` of the picture, and the last pixel centres.
    feather: [f32; 4],
}

impl<'a> FrameView<'a> {
    /// Prepares a frame (its index, place and picture) for the tile with these control points.
    pub fn new(
        (frame, placement, picture): (usize, &Placement, &'a Picture),
        camera: &Camera,
        kernels: &'a StretchedKernels,
        response: Response<'a>,
        control_points: &ControlPoints,
        projected: &mut ProjectedControlPoints,
    ) -> Self {
        let (width, height) = (camera.width as f32, camera.height as f32);
        let origin = &control_points.points().origin;
        let projection = LocalProjection::new(&placement.camera(camera), &placement.pose, origin);
        let warp = LocalPolynomialWarp::new(&projection, control_points, projected);
        let patches =
            (0..warp.len()).map(|k| PatchView::new(&warp, k, picture, kernels, &response));
        Self {
            frame,
            projection,
            patches: patches.collect(),
            warp,
            kernels,
            picture,
            response,
            feather: [2.0 / width, 2.0 / height, width - 0.5, height - 0.5],
        }
    }

    /// True if the frame shows some of the tile.
    pub fn is_visible(&self) -> bool {
        !self.warp.is_outside()
    }

    /// True if some of the tile's points are to be projected one by one.
    pub fn needs_exact_projection(&self) -> bool {
        self.warp.needs_exact_projection()
    }

    /// True if the frame certainly shows nothing of some rows and columns of a tile, all in one
    /// patch.
    pub fn is_outside(&self, rows: &Range<usize>, columns: &Range<usize>) -> bool {
        let Some(lines) = self
            .warp
            .coefficients(self.warp.patch_index(rows.start, columns.start))
        else {
            return self.warp.is_outside_at(rows.start, columns.start);
        };
        let range =
            LocalPolynomialWarp::pixel_bounds(lines, within_patch(rows).1, within_patch(columns).1);
        let mut axes = range.into_iter().zip(self.projection.limit());
        axes.any(|([least, most], limit)| most < -ROUNDING_PX || least > limit + ROUNDING_PX)
    }

    /// Samples some columns of a row of a tile `width` columns wide: their pixels, and the values
    /// there with the frame's exposure undone. `points`: all of the tile's, if the view needs exact
    /// projection.
    pub fn sample(
        &self,
        batch: &mut PointBatch,
        points: &LocalPoints,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        batch.locate(&self.warp, &self.projection, points, place, columns.clone());
        for piece in split_at_patches(columns) {
            if !self.sample_row(batch, place.0, piece.clone()) {
                self.sample_located(batch, points, place, piece);
            }
        }
    }

    /// Samples some columns of a row of a tile, as [`FrameView::sample`], without finding their
    /// pixels where that is not needed.
    pub fn sample_values(
        &self,
        batch: &mut PointBatch,
        points: &LocalPoints,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        for piece in split_at_patches(columns) {
            let done = self.sample_row(batch, place.0, piece.clone());
            if !done && self.locate(batch, points, place, piece.clone()) {
                self.sample_located(batch, points, place, piece);
            }
        }
    }

    /// Projects columns of one patch; false if the frame certainly shows none of them.
    fn locate(
        &self,
        batch: &mut PointBatch,
        points: &LocalPoints,
        place: (usize, usize),
        columns: Range<usize>,
    ) -> bool {
        let is_outside = self.is_outside(&(place.0..place.0 + 1), &columns);
        if is_outside {
            batch.mark_unseen(columns)
        } else {
            batch.locate(&self.warp, &self.projection, points, place, columns)
        }
        !is_outside
    }

    /// Samples columns of one patch, if all of it lies inside an 8-bit frame.
    fn sample_row(&self, batch: &mut PointBatch, row: usize, columns: Range<usize>) -> bool {
        let Some((at, patch)) = self.patch(&(row..row + 1), &columns) else {
            return false;
        };
        let (row, (first, own)) = (row % PATCH_EDGE, within_patch(&columns));
        let done = batch.sample_row(self.picture, &patch, row, first, own);
        if done && let Some(light) = &self.patches[at].light {
            self.response.undo_by(light, row, batch, first, columns);
        }
        done
    }

    /// Samples columns of one patch that are projected already.
    fn sample_located(
        &self,
        batch: &mut PointBatch,
        points: &LocalPoints,
        place: (usize, usize),
        columns: Range<usize>,
    ) {
        let Some(kernel) = self.kernel(batch, points, place, columns.clone()) else {
            return;
        };
        batch.sample(self.picture, kernel, columns.clone());
        let row = place.0;
        match &self.patches[self.warp.patch_index(row, columns.start)].light {
            Some(light) => {
                let (first, _) = within_patch(&columns);
                self.response
                    .undo_by(light, row % PATCH_EDGE, batch, first, columns);
            }
            None => self.response.undo(batch, columns),
        }
    }

    /// True if [`FrameView::copy`] applies: 8 bits, more than the nearest pixel, no exposure to be
    /// undone.
    pub fn can_copy(&self) -> bool {
        let eight = matches!(self.picture.samples(), Samples::Eight(_));
        eight && self.kernels.stretched(1.0).taps() > 1 && self.response.is_none()
    }

    /// Samples some columns of a row straight into `pixels`, alpha last.
    pub fn copy<const C: usize>(
        &self,
        batch: &mut PointBatch,
        points: &LocalPoints,
        place: (usize, usize),
        columns: Range<usize>,
        pixels: &mut [u8],
    ) {
        for piece in split_at_patches(columns.clone()) {
            let first = (piece.start - columns.start) * (C + 1);
            let own = &mut pixels[first..first + piece.len() * (C + 1)];
            let kernel = if self.locate(batch, points, place, piece.clone()) {
                self.kernel(batch, points, place, piece.clone())
            } else {
                None
            };
            match (kernel, self.picture.samples()) {
                (Some(kernel), Samples::Eight(samples)) => {
                    batch.copy::<C>(self.picture, samples, kernel, piece, own);
                }
                _ => own.fill(0),
            }
        }
    }

    /// Draws some rows and columns of a tile, all in one patch, into these rows' pixels, with the
    /// bytes of [`FrameView::copy`]. False without doing it where they do not lie inside an 8-bit
    /// frame, or the processor lacks the vectors for it.
    pub fn block<const C: usize>(
        &self,
        rows: Range<usize>,
        columns: Range<usize>,
        pixels: &mut [&mut [u8]],
    ) -> bool {
        let Some((_, patch)) = self.patch(&rows, &columns) else {
            return false;
        };
        let (first, columns) = within_patch(&columns);
        let block = PatchBlock {
            patch,
            row: rows.start % PATCH_EDGE,
            columns,
            first,
        };
        fixed_point::draw_block::<C>(&block, pixels)
    }

    /// Part of a blend that the frame has in some rows and columns of a tile, all in one patch, if
    /// they lie inside an 8-bit frame.
    pub fn part(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        corners: [f32; 4],
    ) -> Option<BlendPart<'_>> {
        let (at, patch) = self.patch(rows, columns)?;
        Some(BlendPart {
            patch,
            bias: self.response.bias(),
            light: self.patches[at].light,
            corners,
        })
    }

    /// Finds the patch that these rows and columns of a tile lie in, and its inputs for sampling,
    /// if they lie inside an 8-bit frame.
    fn patch(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
    ) -> Option<(usize, SampledPatch<'_>)> {
        let at = self.warp.patch_index(rows.start, columns.start);
        let PatchView {
            kernel: Some(kernel),
            within: Some(within),
            inside,
            ..
        } = &self.patches[at]
        else {
            return None;
        };
        let lines = self.warp.coefficients(at)?;
        if !inside {
            let ((_, rows), (_, columns)) = (within_patch(rows), within_patch(columns));
            let range =
                LocalPolynomialWarp::pixel_bounds(lines, rows, fixed_point::reach(&columns));
            if !lies(range, *within) {
                return None;
            }
        }
        let Samples::Eight(samples) = self.picture.samples() else {
            return None;
        };
        let stride = self.picture.width() * self.picture.format().channels;
        let patch = SampledPatch {
            source: PictureSamples { samples, stride },
            kernel,
            lines,
        };
        Some((at, patch))
    }

    /// Kernel for points of a patch that were projected; None if the frame shows none of them.
    fn kernel(
        &self,
        batch: &PointBatch,
        points: &LocalPoints,
        (row, width): (usize, usize),
        columns: Range<usize>,
    ) -> Option<&'a Kernel> {
        let patch = self.warp.patch_index(row, columns.start);
        if let Some(kernel) = self.patches[patch].kernel {
            return Some(kernel);
        }
        // Next to the middle.
        let seen = batch.seen();
        let half = columns.start + columns.len() / 2;
        let column = (half..columns.end)
            .find(|k| seen[*k])
            .or_else(|| (columns.start..half).rev().find(|k| seen[*k]))?;
        let steps = self.exact_steps(points, (row, width), column);
        Some(self.kernels.for_steps(steps))
    }

    /// Change of u and v from one point to the next, or from the one before where a row or column
    /// ends.
    fn exact_steps(
        &self,
        points: &LocalPoints,
        (row, width): (usize, usize),
        column: usize,
    ) -> [[f32; 2]; 2] {
        let at = row * width + column;
        let own = self.projection.pixel(points, at);
        let step = |after: Option<usize>, before: Option<usize>| {
            let other = after.or(before).unwrap_or(at);
            let other = self.projection.pixel(points, other);
            [other[0] - own[0], other[1] - own[1]]
        };
        let right = (column + 1 < width).then_some(at + 1);
        let below = Some(at + width).filter(|below| *below < points.len());
        let left = (column > 0).then(|| at - 1);
        [step(right, left), step(below, at.checked_sub(width))]
    }

    /// Feathering weight `tent(u) tent(v)`: 1 in the middle, falling to 0 half a pixel beyond the
    /// outermost pixel centres.
    #[inline(always)]
    pub fn feather_weight(&self, u: f32, v: f32) -> f32 {
        let [across, down, right, bottom] = self.feather;
        (u + 0.5).min(right - u) * across * ((v + 0.5).min(bottom - v) * down)
    }
}

/// True if bounds of u and of v lie within others.
fn lies(range: [[f32; 2]; 2], within: [[f32; 2]; 2]) -> bool {
    let both = range.into_iter().zip(within);
    both.into_iter()
        .all(|([least, most], [first, last])| least >= first && most <= last)
}
