//! Values of a frame at a batch of points: projection and interpolation in one pass.

use super::fixed_point::{self, KernelPositions, PictureSamples, SampledPatch};
use super::floating_point::{colour, grey};
use super::picture::Picture;
use super::sample::{Sample, Samples};
use crate::layout::tiles::TILE_COLUMNS;
use crate::warp::local_polynomial::LocalPolynomialWarp;
use crate::warp::patches::{LANES, PATCH_EDGE};
use crate::warp::projection::{LocalPoints, LocalProjection};
use std::ops::Range;
use tunnelstitch_geometry::numerics::kernel::Kernel;
use tunnelstitch_geometry::numerics::rounding::floor_and_fraction;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Most points of a batch: all its arrays stay in the first-level cache.
pub const MAX_BATCH_POINTS: usize = TILE_COLUMNS;

/// A batch of points: pixels of a frame at which they appear, and the values there: colour in the
/// first three of four lanes, grey in the first.
pub struct PointBatch {
    u: [f32; MAX_BATCH_POINTS],
    v: [f32; MAX_BATCH_POINTS],
    seen: [bool; MAX_BATCH_POINTS],
    /// Index of the first sample under the kernel.
    first: [u32; MAX_BATCH_POINTS],
    /// Phases of the kernel along u and v.
    phases: [[i32; MAX_BATCH_POINTS]; 2],
    /// True where the kernel lies within the picture.
    inside: [bool; MAX_BATCH_POINTS],
    /// Whole-numbered sums under the kernel.
    sums: [[i32; 4]; MAX_BATCH_POINTS],
    values: [[f32; 4]; MAX_BATCH_POINTS],
}

impl Default for PointBatch {
    fn default() -> Self {
        Self {
            u: [0.0; MAX_BATCH_POINTS],
            v: [0.0; MAX_BATCH_POINTS],
            seen: [false; MAX_BATCH_POINTS],
            first: [0; MAX_BATCH_POINTS],
            phases: [[0; MAX_BATCH_POINTS]; 2],
            inside: [false; MAX_BATCH_POINTS],
            sums: [[0; 4]; MAX_BATCH_POINTS],
            values: [[0.0; 4]; MAX_BATCH_POINTS],
        }
    }
}

impl PointBatch {
    /// Points that the frame shows; after [`PointBatch::sample`] and [`PointBatch::copy`], without
    /// those whose kernel meets a masked pixel.
    #[inline(always)]
    pub fn seen(&self) -> &[bool; MAX_BATCH_POINTS] {
        &self.seen
    }

    /// Pixel coordinates of the points, u and v.
    #[inline(always)]
    pub fn pixels(&self) -> (&[f32; MAX_BATCH_POINTS], &[f32; MAX_BATCH_POINTS]) {
        (&self.u, &self.v)
    }

    /// Values at the points that the frame shows.
    #[inline(always)]
    pub fn values(&self) -> &[[f32; 4]; MAX_BATCH_POINTS] {
        &self.values
    }

    /// Values at the points, to be changed.
    pub fn values_mut(&mut self) -> &mut [[f32; 4]; MAX_BATCH_POINTS] {
        &mut self.values
    }

    /// Pixel coordinates u and v, whether each point is seen, and the values, to be changed.
    #[inline(always)]
    #[expect(clippy::type_complexity, reason = "parts of the batch, side by side")]
    pub fn parts(
        &mut self,
    ) -> (
        &[f32; MAX_BATCH_POINTS],
        &[f32; MAX_BATCH_POINTS],
        &[bool; MAX_BATCH_POINTS],
        &mut [[f32; 4]; MAX_BATCH_POINTS],
    ) {
        (&self.u, &self.v, &self.seen, &mut self.values)
    }

    /// Projects `count` points from index `start`, one by one.
    pub fn project(
        &mut self,
        projection: &LocalProjection,
        points: &LocalPoints,
        start: usize,
        count: usize,
    ) {
        let (u, v) = (&mut self.u[..count], &mut self.v[..count]);
        let seen = &mut self.seen[..count];
        projection.project_all(points, start, (u, v, seen));
        let limit = projection.limit();
        dispatch_simd(
            #[inline(always)]
            || {
                for k in 0..count {
                    seen[k] &= within(u[k], v[k], limit);
                }
            },
        );
    }

    /// Projects the points in some columns of a row of a tile by its polynomials; `points`: all of
    /// the tile's, `width` in a row, if some patch must be projected point by point.
    pub fn locate(
        &mut self,
        warp: &LocalPolynomialWarp,
        projection: &LocalProjection,
        points: &LocalPoints,
        (row, width): (usize, usize),
        columns: Range<usize>,
    ) {
        let eights = eights(&columns);
        let mut exact = [false; MAX_BATCH_POINTS / LANES];
        let (u, v) = (
            self.u.as_chunks_mut::<LANES>().0,
            self.v.as_chunks_mut::<LANES>().0,
        );
        let seen = self.seen.as_chunks_mut::<LANES>().0;
        dispatch_simd(
            #[inline(always)]
            || {
                // These are locals of the closure, here and in [`PointBatch::find_kernels`]: loops
                // over borrowed values are not vectorised.
                let limit = projection.limit();
                for eight in eights.clone() {
                    let (mut own_u, mut own_v) = ([0.0; LANES], [0.0; LANES]);
                    exact[eight] = !warp.locate_eight(row, eight, &mut own_u, &mut own_v);
                    seen[eight] = std::array::from_fn(
                        #[inline(always)]
                        |k| within(own_u[k], own_v[k], limit),
                    );
                    (u[eight], v[eight]) = (own_u, own_v);
                }
            },
        );
        for eight in eights.filter(|eight| exact[*eight]) {
            let count = LANES.min(width - eight * LANES);
            let (u, v) = (&mut u[eight][..count], &mut v[eight][..count]);
            let seen = &mut seen[eight][..count];
            projection.project_all(points, row * width + eight * LANES, (u, v, seen));
            for (k, seen) in seen.iter_mut().enumerate() {
                *seen &= within(u[k], v[k], projection.limit());
            }
        }
    }

    /// Marks some columns as not shown by the frame.
    pub fn mark_unseen(&mut self, columns: Range<usize>) {
        self.seen[columns].fill(false);
    }

    /// Marks points whose kernel meets a masked pixel as not seen.
    fn hide_masked(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        if picture.mask().is_some() {
            for k in columns {
                self.seen[k] = self.seen[k] && picture.shows(self.u[k], self.v[k], kernel);
            }
        }
    }

    /// Samples some columns that were projected before.
    pub fn sample(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        self.hide_masked(picture, kernel, columns.clone());
        match (picture.samples(), picture.format().channels) {
            (Samples::Eight(samples), 1) if kernel.taps() > 1 => {
                self.fixed_point_values::<1>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), _) if kernel.taps() > 1 => {
                self.fixed_point_values::<3>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), 1) => {
                self.floating_point_values::<u8, 1>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), _) => {
                self.floating_point_values::<u8, 3>(picture, samples, kernel, columns);
            }
            (Samples::Sixteen(samples), 1) => {
                self.floating_point_values::<u16, 1>(picture, samples, kernel, columns);
            }
            (Samples::Sixteen(samples), _) => {
                self.floating_point_values::<u16, 3>(picture, samples, kernel, columns);
            }
        }
    }

    /// Samples some columns (`own`) of a row of the patch that begins with the tile's column
    /// `first`, all of them inside the picture. False without doing it where the processor lacks
    /// the vectors for it.
    pub fn sample_row(
        &mut self,
        picture: &Picture,
        patch: &SampledPatch,
        row: usize,
        first: usize,
        own: Range<usize>,
    ) -> bool {
        let values = &mut self.values[first..first + PATCH_EDGE];
        let done = match picture.format().channels {
            1 => fixed_point::sample_values::<1>(patch, row, own.clone(), values),
            _ => fixed_point::sample_values::<3>(patch, row, own.clone(), values),
        };
        if done {
            self.seen[first..][own].fill(true);
        }
        done
    }

    /// Samples some columns that were projected before straight into `pixels`, alpha last; zeros
    /// where the frame does not show the wall.
    pub fn copy<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
        pixels: &mut [u8],
    ) {
        self.hide_masked(picture, kernel, columns.clone());
        let all_inside = self.fixed_point_sums::<C>(picture, samples, kernel, columns.clone());
        let sums = &self.sums[columns.clone()];
        fixed_point::write_pixels::<C>(kernel, sums, pixels);
        if all_inside {
            return;
        }
        for (k, pixel) in columns.zip(pixels.chunks_exact_mut(C + 1)) {
            if !self.seen[k] {
                pixel.fill(0);
            } else if !self.inside[k] {
                let value = picture.at(self.u[k], self.v[k], kernel);
                for (sample, value) in pixel.iter_mut().zip(&value[..C]) {
                    *sample = u8::nearest(*value);
                }
            }
        }
    }

    fn fixed_point_values<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
    ) {
        let all_inside = self.fixed_point_sums::<C>(picture, samples, kernel, columns.clone());
        let (sums, values) = (
            &self.sums[columns.clone()],
            &mut self.values[columns.clone()],
        );
        let missing = fixed_point::missing(kernel.taps());
        let scale = fixed_point::scale(kernel.taps());
        dispatch_simd(
            #[inline(always)]
            || {
                for (value, sum) in values.iter_mut().zip(sums) {
                    for (value, sum) in value.iter_mut().zip(sum) {
                        *value = (sum + missing) as f32 * scale;
                    }
                }
            },
        );
        if !all_inside {
            self.sample_border(picture, kernel, columns);
        }
    }

    /// Sums under the kernel where all of it lies in the picture; sums elsewhere have no meaning.
    /// True if that is everywhere.
    fn fixed_point_sums<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
    ) -> bool {
        let all_inside =
            self.find_kernels(picture, kernel, kernel.integer_phases(), columns.clone());
        if !fits(picture, kernel) {
            return false;
        }
        let source = PictureSamples {
            samples,
            stride: picture.width() * C,
        };
        let places = KernelPositions {
            first: &self.first[columns.clone()],
            phases: [
                &self.phases[0][columns.clone()],
                &self.phases[1][columns.clone()],
            ],
        };
        fixed_point::sum_samples::<C>(source, kernel, places, &mut self.sums[columns]);
        all_inside
    }

    fn floating_point_values<T: Sample, const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[T],
        kernel: &Kernel,
        columns: Range<usize>,
    ) {
        let all_inside = self.find_kernels(picture, kernel, Kernel::PHASES, columns.clone());
        let stride = picture.width() * C;
        dispatch_simd(
            #[inline(always)]
            || {
                let columns = columns.clone();
                match kernel.taps() {
                    1 => self.sum_kernels::<T, C, 1>(samples, stride, kernel, columns),
                    2 => self.sum_kernels::<T, C, 2>(samples, stride, kernel, columns),
                    4 => self.sum_kernels::<T, C, 4>(samples, stride, kernel, columns),
                    6 => self.sum_kernels::<T, C, 6>(samples, stride, kernel, columns),
                    8 => self.sum_kernels::<T, C, 8>(samples, stride, kernel, columns),
                    10 => self.sum_kernels::<T, C, 10>(samples, stride, kernel, columns),
                    12 => self.sum_kernels::<T, C, 12>(samples, stride, kernel, columns),
                    _ => self.inside[columns].fill(false),
                }
            },
        );
        if !all_inside || kernel.taps() > 12 {
            self.sample_border(picture, kernel, columns);
        }
    }

    /// Samples the points whose kernel reaches beyond the picture; pixels there repeat the
    /// outermost one.
    fn sample_border(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        for k in columns {
            if self.seen[k] && !self.inside[k] {
                let [red, green, blue] = picture.at(self.u[k], self.v[k], kernel);
                self.values[k] = [red, green, blue, 0.0];
            }
        }
    }

    /// Finds the first sample and the phases of each point's kernel; those of the first pixel where
    /// the kernel does not lie within the picture. True if it does everywhere.
    fn find_kernels(
        &mut self,
        picture: &Picture,
        kernel: &Kernel,
        phases: f32,
        columns: Range<usize>,
    ) -> bool {
        let (taps, before) = (kernel.taps() as i32, kernel.taps_before() as i32);
        let (width, height) = (picture.width() as i32, picture.height() as i32);
        let (right, bottom) = (width - taps, height - taps);
        let channels = picture.format().channels as i32;
        let rounding = kernel.rounding();
        let (u, v) = (self.u.as_chunks::<LANES>().0, self.v.as_chunks::<LANES>().0);
        let seen = self.seen.as_chunks::<LANES>().0;
        let first = self.first.as_chunks_mut::<LANES>().0;
        let inside = self.inside.as_chunks_mut::<LANES>().0;
        let [across, down] = &mut self.phases;
        let across = across.as_chunks_mut::<LANES>().0;
        let down = down.as_chunks_mut::<LANES>().0;
        dispatch_simd(
            #[inline(always)]
            || {
                let (width, right, bottom) = (width, right, bottom);
                let (before, channels, rounding, phases) = (before, channels, rounding, phases);
                for eight in eights(&columns) {
                    let (u, v, seen) = (u[eight], v[eight], seen[eight]);
                    let (mut own_across, mut own_down) = ([0; LANES], [0; LANES]);
                    let (mut own_first, mut own_inside) = ([0; LANES], [false; LANES]);
                    for k in 0..LANES {
                        let (x, s) = floor_and_fraction(u[k] + rounding);
                        let (y, t) = floor_and_fraction(v[k] + rounding);
                        own_across[k] = Kernel::phase_of(s, phases);
                        own_down[k] = Kernel::phase_of(t, phases);
                        let (left, top) = (x - before, y - before);
                        let within =
                            seen[k] & (left >= 0) & (top >= 0) & (left <= right) & (top <= bottom);
                        own_inside[k] = within;
                        let at = top.wrapping_mul(width).wrapping_add(left);
                        own_first[k] = if within {
                            at.wrapping_mul(channels) as u32
                        } else {
                            0
                        };
                    }
                    (across[eight], down[eight]) = (own_across, own_down);
                    (first[eight], inside[eight]) = (own_first, own_inside);
                }
            },
        );
        !self.inside[columns].contains(&false)
    }

    /// Sums `Σ_y w_y Σ_x w_x I(x, y)` over `N × N` pixels, where all of them lie in the picture.
    #[inline(always)]
    fn sum_kernels<T: Sample, const C: usize, const N: usize>(
        &mut self,
        samples: &[T],
        stride: usize,
        kernel: &Kernel,
        columns: Range<usize>,
    ) {
        for k in columns {
            if !self.inside[k] {
                continue;
            }
            let w_x = kernel.at(self.phases[0][k] as usize).first_chunk();
            let w_y = kernel.at(self.phases[1][k] as usize).first_chunk();
            // A kernel of N taps has N weights.
            let (Some(w_x), Some(w_y)) = (w_x, w_y) else {
                continue;
            };
            let own = &samples[self.first[k] as usize..];
            self.values[k] = if C == 1 {
                [grey::<T, N>(own, stride, w_x, w_y), 0.0, 0.0, 0.0]
            } else {
                colour::<T, N>(own, stride, w_x, w_y)
            };
        }
    }
}

/// Groups of eight that some columns lie in.
fn eights(columns: &Range<usize>) -> Range<usize> {
    columns.start / LANES..columns.end.div_ceil(LANES)
}

/// True within the outermost pixel centres.
#[inline(always)]
fn within(u: f32, v: f32, limit: [f32; 2]) -> bool {
    (u >= 0.0) & (v >= 0.0) & (u <= limit[0]) & (v <= limit[1])
}

/// True if a picture is at least as large as the kernel.
fn fits(picture: &Picture, kernel: &Kernel) -> bool {
    picture.width().min(picture.height()) >= kernel.taps()
}
