//! What a frame shows of a run of points: geometry and sampling in one pass.

use super::fixed_point::{self, Patch, Places, Source};
use super::floating_point::{colour, grey};
use super::picture::Picture;
use super::sample::{Sample, Samples};
use crate::numerics::kernel::Kernel;
use crate::numerics::rounding::whole;
use crate::numerics::simd_dispatch::wide;
use crate::render::layout::tiles::TILE_COLUMNS;
use crate::render::warp::local_polynomial::Chart;
use crate::render::warp::patches::{EIGHT, PATCH};
use crate::render::warp::projection::{Look, Points};
use std::ops::Range;

/// Most points of a run: all that is known of a run stays in the first-level cache.
pub const RUN: usize = TILE_COLUMNS;

/// Where a run of points appears in a frame, and the values there: colour in the first three of
/// four lanes, grey in the first.
pub struct Run {
    u: [f32; RUN],
    v: [f32; RUN],
    seen: [bool; RUN],
    /// Index of the first sample under the kernel.
    first: [u32; RUN],
    /// Tabulated phases along u and v.
    phases: [[i32; RUN]; 2],
    /// True where the kernel lies within the picture.
    inside: [bool; RUN],
    /// Whole-numbered sums under the kernel.
    sums: [[i32; 4]; RUN],
    values: [[f32; 4]; RUN],
}

impl Default for Run {
    fn default() -> Self {
        Self {
            u: [0.0; RUN],
            v: [0.0; RUN],
            seen: [false; RUN],
            first: [0; RUN],
            phases: [[0; RUN]; 2],
            inside: [false; RUN],
            sums: [[0; 4]; RUN],
            values: [[0.0; 4]; RUN],
        }
    }
}

impl Run {
    /// Which of the points the frame shows; after [`Run::sample`] and [`Run::copy`], without those
    /// whose kernel meets a masked pixel.
    #[inline(always)]
    pub fn seen(&self) -> &[bool; RUN] {
        &self.seen
    }

    /// The pixel coordinates of the points, u and v.
    #[inline(always)]
    pub fn pixels(&self) -> (&[f32; RUN], &[f32; RUN]) {
        (&self.u, &self.v)
    }

    /// The values at the points that the frame shows.
    #[inline(always)]
    pub fn values(&self) -> &[[f32; 4]; RUN] {
        &self.values
    }

    /// The values, to be changed.
    pub fn values_mut(&mut self) -> &mut [[f32; 4]; RUN] {
        &mut self.values
    }

    /// The pixel coordinates, which of them are seen, and the values to be changed.
    #[inline(always)]
    #[expect(clippy::type_complexity, reason = "parts of the run, side by side")]
    pub fn parts(&mut self) -> (&[f32; RUN], &[f32; RUN], &[bool; RUN], &mut [[f32; 4]; RUN]) {
        (&self.u, &self.v, &self.seen, &mut self.values)
    }

    /// Finds the pixels of `count` points from index `start`, one by one.
    pub fn project(&mut self, look: &Look, points: &Points, start: usize, count: usize) {
        let (u, v) = (&mut self.u[..count], &mut self.v[..count]);
        let seen = &mut self.seen[..count];
        look.project_all(points, start, (u, v, seen));
        let limit = look.limit();
        wide(
            #[inline(always)]
            || {
                for k in 0..count {
                    seen[k] &= within(u[k], v[k], limit);
                }
            },
        );
    }

    /// Finds the pixels of the points in some columns of a row of a tile by its chart; `points`:
    /// all of the tile's, one by one, if the chart is rough somewhere, `width` in a row.
    pub fn locate(
        &mut self,
        chart: &Chart,
        look: &Look,
        points: &Points,
        (row, width): (usize, usize),
        columns: Range<usize>,
    ) {
        let eights = eights(&columns);
        let mut rough = [false; RUN / EIGHT];
        let (u, v) = (
            self.u.as_chunks_mut::<EIGHT>().0,
            self.v.as_chunks_mut::<EIGHT>().0,
        );
        let seen = self.seen.as_chunks_mut::<EIGHT>().0;
        wide(
            #[inline(always)]
            || {
                // The closure's own, here and in [`Run::address`]: of what it borrows, loops are
                // not made vectors.
                let limit = look.limit();
                for eight in eights.clone() {
                    let (mut own_u, mut own_v) = ([0.0; EIGHT], [0.0; EIGHT]);
                    rough[eight] = !chart.eight(row, eight, &mut own_u, &mut own_v);
                    seen[eight] = std::array::from_fn(
                        #[inline(always)]
                        |k| within(own_u[k], own_v[k], limit),
                    );
                    (u[eight], v[eight]) = (own_u, own_v);
                }
            },
        );
        for eight in eights.filter(|eight| rough[*eight]) {
            let count = EIGHT.min(width - eight * EIGHT);
            let (u, v) = (&mut u[eight][..count], &mut v[eight][..count]);
            let seen = &mut seen[eight][..count];
            look.project_all(points, row * width + eight * EIGHT, (u, v, seen));
            for (k, seen) in seen.iter_mut().enumerate() {
                *seen &= within(u[k], v[k], look.limit());
            }
        }
    }

    /// Makes some columns ones that the frame does not show.
    pub fn see_nothing(&mut self, columns: Range<usize>) {
        self.seen[columns].fill(false);
    }

    /// Points whose kernel meets a masked pixel are not seen.
    fn hide(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        if picture.mask().is_some() {
            for k in columns {
                self.seen[k] = self.seen[k] && picture.shows(self.u[k], self.v[k], kernel);
            }
        }
    }

    /// Looks up the values in some columns whose pixels were found before.
    pub fn sample(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        self.hide(picture, kernel, columns.clone());
        match (picture.samples(), picture.format().channels) {
            (Samples::Eight(samples), 1) if kernel.taps() > 1 => {
                self.integer_values::<1>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), _) if kernel.taps() > 1 => {
                self.integer_values::<3>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), 1) => {
                self.float_values::<u8, 1>(picture, samples, kernel, columns);
            }
            (Samples::Eight(samples), _) => {
                self.float_values::<u8, 3>(picture, samples, kernel, columns);
            }
            (Samples::Sixteen(samples), 1) => {
                self.float_values::<u16, 1>(picture, samples, kernel, columns);
            }
            (Samples::Sixteen(samples), _) => {
                self.float_values::<u16, 3>(picture, samples, kernel, columns);
            }
        }
    }

    /// Looks up the values in some columns (`own`) of a row of the patch that begins with the
    /// tile's column `first`, all of them inside the picture. False without doing it where the
    /// processor lacks the vectors for it.
    pub fn sample_row(
        &mut self,
        picture: &Picture,
        patch: &Patch,
        row: usize,
        first: usize,
        own: Range<usize>,
    ) -> bool {
        let values = &mut self.values[first..first + PATCH];
        let done = match picture.format().channels {
            1 => fixed_point::values::<1>(patch, row, own.clone(), values),
            _ => fixed_point::values::<3>(patch, row, own.clone(), values),
        };
        if done {
            self.seen[first..][own].fill(true);
        }
        done
    }

    /// Puts the values in some columns whose pixels were found before straight into `pixels`, alpha
    /// last; nothing where the frame does not show the wall.
    pub fn copy<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
        pixels: &mut [u8],
    ) {
        self.hide(picture, kernel, columns.clone());
        let all_inside = self.integer_sums::<C>(picture, samples, kernel, columns.clone());
        let sums = &self.sums[columns.clone()];
        fixed_point::pixels::<C>(kernel, sums, pixels);
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

    fn integer_values<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
    ) {
        let all_inside = self.integer_sums::<C>(picture, samples, kernel, columns.clone());
        let (sums, values) = (
            &self.sums[columns.clone()],
            &mut self.values[columns.clone()],
        );
        let missing = fixed_point::missing(kernel.taps());
        let scale = fixed_point::scale(kernel.taps());
        wide(
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
            self.values_at_the_border(picture, kernel, columns);
        }
    }

    /// Sums under the kernel where all of it lies in the picture, anything elsewhere; true if that
    /// is everywhere.
    fn integer_sums<const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[u8],
        kernel: &Kernel,
        columns: Range<usize>,
    ) -> bool {
        let all_inside = self.address(picture, kernel, kernel.integer_phases(), columns.clone());
        if !fits(picture, kernel) {
            return false;
        }
        let source = Source {
            samples,
            stride: picture.width() * C,
        };
        let places = Places {
            first: &self.first[columns.clone()],
            phases: [
                &self.phases[0][columns.clone()],
                &self.phases[1][columns.clone()],
            ],
        };
        fixed_point::sums::<C>(source, kernel, places, &mut self.sums[columns]);
        all_inside
    }

    fn float_values<T: Sample, const C: usize>(
        &mut self,
        picture: &Picture,
        samples: &[T],
        kernel: &Kernel,
        columns: Range<usize>,
    ) {
        let all_inside = self.address(picture, kernel, Kernel::PHASES, columns.clone());
        let stride = picture.width() * C;
        wide(
            #[inline(always)]
            || {
                let columns = columns.clone();
                match kernel.taps() {
                    1 => self.gather::<T, C, 1>(samples, stride, kernel, columns),
                    2 => self.gather::<T, C, 2>(samples, stride, kernel, columns),
                    4 => self.gather::<T, C, 4>(samples, stride, kernel, columns),
                    6 => self.gather::<T, C, 6>(samples, stride, kernel, columns),
                    8 => self.gather::<T, C, 8>(samples, stride, kernel, columns),
                    10 => self.gather::<T, C, 10>(samples, stride, kernel, columns),
                    12 => self.gather::<T, C, 12>(samples, stride, kernel, columns),
                    _ => self.inside[columns].fill(false),
                }
            },
        );
        if !all_inside || kernel.taps() > 12 {
            self.values_at_the_border(picture, kernel, columns);
        }
    }

    /// Pixels beyond the border repeat the outermost one.
    fn values_at_the_border(&mut self, picture: &Picture, kernel: &Kernel, columns: Range<usize>) {
        for k in columns {
            if self.seen[k] && !self.inside[k] {
                let [red, green, blue] = picture.at(self.u[k], self.v[k], kernel);
                self.values[k] = [red, green, blue, 0.0];
            }
        }
    }

    /// The samples and phases that each point needs; those of the first pixel where the kernel does
    /// not lie within the picture. True if it does everywhere.
    fn address(
        &mut self,
        picture: &Picture,
        kernel: &Kernel,
        phases: f32,
        columns: Range<usize>,
    ) -> bool {
        let (taps, before) = (kernel.taps() as i32, kernel.before() as i32);
        let (width, height) = (picture.width() as i32, picture.height() as i32);
        let (right, bottom) = (width - taps, height - taps);
        let channels = picture.format().channels as i32;
        let rounding = kernel.rounding();
        let (u, v) = (self.u.as_chunks::<EIGHT>().0, self.v.as_chunks::<EIGHT>().0);
        let seen = self.seen.as_chunks::<EIGHT>().0;
        let first = self.first.as_chunks_mut::<EIGHT>().0;
        let inside = self.inside.as_chunks_mut::<EIGHT>().0;
        let [across, down] = &mut self.phases;
        let across = across.as_chunks_mut::<EIGHT>().0;
        let down = down.as_chunks_mut::<EIGHT>().0;
        wide(
            #[inline(always)]
            || {
                let (width, right, bottom) = (width, right, bottom);
                let (before, channels, rounding, phases) = (before, channels, rounding, phases);
                for eight in eights(&columns) {
                    let (u, v, seen) = (u[eight], v[eight], seen[eight]);
                    let (mut own_across, mut own_down) = ([0; EIGHT], [0; EIGHT]);
                    let (mut own_first, mut own_inside) = ([0; EIGHT], [false; EIGHT]);
                    for k in 0..EIGHT {
                        let (x, s) = whole(u[k] + rounding);
                        let (y, t) = whole(v[k] + rounding);
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

    /// `Σ_y w_y Σ_x w_x I(x, y)` over `N × N` pixels, where all of them lie in the picture.
    #[inline(always)]
    fn gather<T: Sample, const C: usize, const N: usize>(
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

/// The eights that some columns lie in.
fn eights(columns: &Range<usize>) -> Range<usize> {
    columns.start / EIGHT..columns.end.div_ceil(EIGHT)
}

/// True within the outermost pixel centres.
#[inline(always)]
fn within(u: f32, v: f32, limit: [f32; 2]) -> bool {
    (u >= 0.0) & (v >= 0.0) & (u <= limit[0]) & (v <= limit[1])
}

/// Whether a picture is as large as the kernel.
fn fits(picture: &Picture, kernel: &Kernel) -> bool {
    picture.width().min(picture.height()) >= kernel.taps()
}
