//! Tiles of the panorama, row by row.

use super::band::{Place, Rows};
use super::chart::{Lattice, Projected};
use super::exposure::Exposure;
use super::run::{RUN, Run};
use super::sample::Sample;
use super::seams::{Seams, Shares};
use super::view::{Kernels, View};
use super::warp::Points;
use super::{Canvas, FrameStack, Placement, Tile};
use crate::surface::Surface;
use crate::vectors::wide;
use nalgebra::Vector3;
use serde::Serialize;
use std::ops::Range;

/// Which frames a pixel of the panorama shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Mode {
    /// The frame that shows the wall best there; frames change along seams where they agree.
    #[default]
    BestView,
    /// The mean of all frames, weighted by `tent(u) tent(v)`: 1 in the middle of a frame, 0 at its edge.
    Average,
    /// The median of all frames: what most of them show.
    Median,
}

/// What tiles are drawn from.
pub struct Scene<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The frames.
    pub frames: &'a FrameStack,
    /// Where they lie, in their order.
    pub placements: &'a [Placement],
    /// What is drawn.
    pub canvas: &'a Canvas,
    /// How frames are sampled.
    pub kernels: &'a Kernels,
    /// What is undone of the frames' exposure.
    pub exposure: &'a Exposure,
    /// Which frames are shown where.
    pub composition: Composition<'a>,
}

/// Which frames are shown where.
#[derive(Clone, Copy)]
pub enum Composition<'a> {
    /// One frame at each place, with seams between.
    Seams(&'a Seams),
    /// See [`Mode::Average`].
    Average,
    /// See [`Mode::Median`].
    Median,
}

/// No frame, in a map of frames.
pub const NO_FRAME: u32 = u32::MAX;

/// What drawing a tile needs for a while: made once a thread, since fresh memory costs as much as the work in it.
#[derive(Default)]
pub struct Scratch {
    lattice: Lattice,
    projected: Projected,
    exact: Vec<Vector3<f64>>,
    points: Points,
    run: Run,
    shares: Shares,
    corrections: Vec<[f32; 4]>,
}

impl Scene<'_> {
    /// Draws a tile in its place. The frames that it needs must be held ([`Scene::needed`]).
    pub fn draw(&self, tile: &Tile, place: Place, scratch: &mut Scratch) {
        let Place { pixels, sources } = place;
        match (self.frames.format().channels, pixels) {
            (1, Rows::Eight(pixels)) => self.draw_as::<u8, 1>(tile, pixels, sources, scratch),
            (_, Rows::Eight(pixels)) => self.draw_as::<u8, 3>(tile, pixels, sources, scratch),
            (1, Rows::Sixteen(pixels)) => self.draw_as::<u16, 1>(tile, pixels, sources, scratch),
            (_, Rows::Sixteen(pixels)) => self.draw_as::<u16, 3>(tile, pixels, sources, scratch),
        }
    }

    /// The frames that a tile is drawn from, in their order.
    pub fn needed(&self, tile: &Tile) -> Vec<usize> {
        match self.composition {
            Composition::Seams(seams) => seams.frames_of(self.canvas, tile),
            Composition::Average | Composition::Median => tile.frames.clone(),
        }
    }

    fn draw_as<T: Sample, const C: usize>(
        &self,
        tile: &Tile,
        pixels: Vec<&mut [T]>,
        sources: Vec<&mut [u32]>,
        scratch: &mut Scratch,
    ) {
        let Scratch {
            lattice,
            projected,
            exact,
            points,
            run,
            shares,
            corrections,
        } = scratch;
        let camera = self.frames.camera();
        lattice.set(self.surface, self.canvas, tile);
        let views = self.needed(tile).into_iter().filter_map(|frame| {
            let picture = self.frames.picture(frame)?;
            Some(View::new(
                (frame, &self.placements[frame], picture),
                camera,
                self.kernels,
                self.exposure.of(frame),
                lattice,
                projected,
            ))
        });
        let views: Vec<View> = views.filter(View::shows).collect();
        if views.is_empty() {
            for (pixels, sources) in pixels.into_iter().zip(sources) {
                pixels.fill(T::default());
                sources.fill(NO_FRAME);
            }
            return;
        }
        if views.iter().any(View::is_rough) {
            tile.points_into(self.surface, self.canvas, exact);
            points.set(exact);
        }
        let mut brush = Brush::<'_, C> {
            width: tile.columns as usize,
            points,
            views: &views,
            run,
            sums: Row::new(),
        };
        let rows = pixels.into_iter().zip(sources).enumerate();
        match self.composition {
            Composition::Seams(seams) => {
                let places = seams.columns_of(self.canvas, tile);
                let copies = seams.are_hard() && views.iter().all(View::copies);
                let mut above = None;
                for (row, (pixels, sources)) in rows {
                    let between = seams.row_of(self.canvas, tile.row + row as u32);
                    // Between the same nodes nothing changes where no frames meet.
                    if above != Some(between.before()) || !shares.are_whole() {
                        seams.shares(&places, &between, shares);
                        above = Some(between.before());
                    }
                    match T::bytes(pixels) {
                        Some(pixels) if copies => {
                            brush.copy(row, shares, pixels, sources);
                        }
                        _ => {
                            seams.corrections(&places, &between, corrections);
                            brush.best_view(row, shares, corrections, pixels, sources);
                        }
                    }
                }
            }
            Composition::Average => {
                for (row, (pixels, sources)) in rows {
                    sources.fill(NO_FRAME);
                    brush.average(row, pixels);
                }
            }
            Composition::Median => {
                let mut stacks = vec![Vec::with_capacity(views.len()); tile.columns as usize];
                for (row, (pixels, sources)) in rows {
                    sources.fill(NO_FRAME);
                    brush.median(row, &mut stacks, pixels);
                }
            }
        }
    }
}

/// Values of a row of a tile, added up.
struct Row {
    sums: [[f32; 4]; RUN],
    weights: [f32; RUN],
    /// The largest weight so far, and whose it is.
    largest: [f32; RUN],
    sources: [u32; RUN],
}

impl Row {
    fn new() -> Self {
        Self {
            sums: [[0.0; 4]; RUN],
            weights: [0.0; RUN],
            largest: [0.0; RUN],
            sources: [NO_FRAME; RUN],
        }
    }

    fn clear(&mut self, count: usize) {
        self.sums[..count].fill([0.0; 4]);
        self.weights[..count].fill(0.0);
        self.largest[..count].fill(0.0);
        self.sources[..count].fill(NO_FRAME);
    }

    #[inline(always)]
    fn add(&mut self, k: usize, value: &[f32; 4], w: f32) {
        let sum = &mut self.sums[k];
        *sum = std::array::from_fn(|c| sum[c] + w * value[c]);
        self.weights[k] += w;
    }

    /// Columns that show nothing but a frame.
    fn set(&mut self, run: &Run, frame: usize, columns: Range<usize>) {
        self.sums[columns.clone()].copy_from_slice(&run.values()[columns.clone()]);
        let seen = run.seen()[columns.clone()].iter();
        let columns = self.weights[columns.clone()]
            .iter_mut()
            .zip(&mut self.sources[columns]);
        for (seen, (weight, source)) in seen.zip(columns) {
            *weight = if *seen { 1.0 } else { 0.0 };
            *source = if *seen { frame as u32 } else { NO_FRAME };
        }
    }

    /// Columns from `from` that show a frame with some weight.
    fn mix(&mut self, run: &Run, frame: usize, from: usize, weights: &[f32]) {
        for (k, w) in weights.iter().enumerate() {
            let k = from + k;
            if run.seen()[k] && *w > 0.0 {
                self.add(k, &run.values()[k], *w);
                if *w > self.largest[k] {
                    self.largest[k] = *w;
                    self.sources[k] = frame as u32;
                }
            }
        }
    }

    /// Columns that show nothing yet.
    fn fill(&mut self, run: &Run, frame: usize, count: usize) {
        for k in 0..count {
            if self.weights[k] == 0.0 && run.seen()[k] {
                self.sums[k] = run.values()[k];
                self.weights[k] = 1.0;
                self.sources[k] = frame as u32;
            }
        }
    }
}

/// Draws rows of a tile with `C` channels.
struct Brush<'a, const C: usize> {
    /// Columns of the tile.
    width: usize,
    /// The tile's points, if some view is rough.
    points: &'a Points,
    views: &'a [View<'a>],
    run: &'a mut Run,
    sums: Row,
}

impl<const C: usize> Brush<'_, C> {
    /// The pixels of a row: `value(k)` where it has some weight.
    #[inline(always)]
    fn put<T: Sample>(&self, pixels: &mut [T], value: impl Fn(usize, f32) -> [f32; 4]) {
        let weights = &self.sums.weights[..self.width];
        wide(
            #[inline(always)]
            || {
                for (k, (pixel, w)) in pixels.chunks_exact_mut(C + 1).zip(weights).enumerate() {
                    let w = *w;
                    let value = value(k, 1.0 / w);
                    for (sample, value) in pixel.iter_mut().zip(&value[..C]) {
                        *sample = T::nearest(if w > 0.0 { *value } else { 0.0 });
                    }
                    pixel[C] = T::nearest(if w > 0.0 { T::WHITE } else { 0.0 });
                }
            },
        );
    }

    fn average<T: Sample>(&mut self, row: usize, pixels: &mut [T]) {
        self.sums.clear(self.width);
        for view in self.views {
            view.look_at(self.run, self.points, (row, self.width), 0..self.width);
            let (u, v) = self.run.pixels();
            for k in 0..self.width {
                if self.run.seen()[k] {
                    let w = view.feather(u[k], v[k]);
                    self.sums.add(k, &self.run.values()[k], w);
                }
            }
        }
        let sums = &self.sums.sums;
        self.put(
            pixels,
            #[inline(always)]
            |k, inverse| {
                let [a, b, c, d] = sums[k];
                [a * inverse, b * inverse, c * inverse, d * inverse]
            },
        );
    }

    /// `stacks`: empty, one a column.
    fn median<T: Sample>(&mut self, row: usize, stacks: &mut [Vec<[f32; 4]>], pixels: &mut [T]) {
        for view in self.views {
            view.look_at(self.run, self.points, (row, self.width), 0..self.width);
            for (k, stack) in stacks.iter_mut().enumerate() {
                if self.run.seen()[k] {
                    stack.push(self.run.values()[k]);
                }
            }
        }
        let mut values = Vec::with_capacity(self.views.len());
        self.sums.clear(self.width);
        for (k, stack) in stacks.iter_mut().enumerate().filter(|(_, s)| !s.is_empty()) {
            self.sums.weights[k] = 1.0;
            for c in 0..C {
                values.clear();
                values.extend(stack.iter().map(|value| value[c]));
                self.sums.sums[k][c] = median(&mut values);
            }
            stack.clear();
        }
        let sums = &self.sums.sums;
        self.put(pixels, |k, _| sums[k]);
    }

    fn best_view<T: Sample>(
        &mut self,
        row: usize,
        shares: &Shares,
        corrections: &[[f32; 4]],
        pixels: &mut [T],
        sources: &mut [u32],
    ) {
        let (points, place) = (self.points, (row, self.width));
        self.sums.clear(self.width);
        for view in self.views {
            let own = || shares.iter().filter(|(share, _)| share.frame == view.frame);
            let Some(from) = own().map(|(share, _)| share.from).min() else {
                continue;
            };
            let to = own().map(|(share, _)| share.to).max().unwrap_or(from);
            view.locate(self.run, points, place, from..to);
            for (share, weights) in own() {
                view.values(self.run, points, place, share.from..share.to);
                match weights {
                    Some(weights) => self.sums.mix(self.run, share.frame, share.from, weights),
                    None => self.sums.set(self.run, share.frame, share.from..share.to),
                }
            }
        }
        // At the edge of what is seen: frames that no node of the grid shows.
        if self.sums.weights[..self.width].contains(&0.0) {
            for view in self.views {
                view.look_at(self.run, points, place, 0..self.width);
                self.sums.fill(self.run, view.frame, self.width);
            }
        }
        let sums = &self.sums.sums;
        self.put(
            pixels,
            #[inline(always)]
            |k, inverse| {
                let ([a, b, c, d], [e, f, g, h]) = (sums[k], corrections[k]);
                [
                    a * inverse + e,
                    b * inverse + f,
                    c * inverse + g,
                    d * inverse + h,
                ]
            },
        );
        sources.copy_from_slice(&self.sums.sources[..self.width]);
    }

    /// The same where every pixel is one frame's as it is.
    fn copy(&mut self, row: usize, shares: &Shares, pixels: &mut [u8], sources: &mut [u32]) {
        let (points, place, step) = (self.points, (row, self.width), C + 1);
        let mut covered = 0;
        for (share, _) in shares.iter() {
            let Some(view) = view_of(self.views, share.frame) else {
                continue;
            };
            // Nothing between one share and the next.
            pixels[covered * step..share.from * step].fill(0);
            sources[covered..share.from].fill(NO_FRAME);
            covered = share.to;
            let columns = share.from..share.to;
            let own = &mut pixels[columns.start * step..columns.end * step];
            let there = &mut sources[columns.clone()];
            view.copy::<C>(self.run, points, place, columns.clone(), own);
            there.fill(share.frame as u32);
            let seen = &self.run.seen()[columns];
            if seen.contains(&false) {
                for (source, _) in there.iter_mut().zip(seen).filter(|(_, seen)| !**seen) {
                    *source = NO_FRAME;
                }
            }
        }
        pixels[covered * step..].fill(0);
        sources[covered..].fill(NO_FRAME);
        if !sources.contains(&NO_FRAME) {
            return;
        }
        let mut other = [0; 4 * RUN];
        for view in self.views {
            let own = &mut other[..self.width * step];
            view.copy::<C>(self.run, points, place, 0..self.width, own);
            let there = pixels.chunks_exact_mut(step).zip(sources.iter_mut());
            let found = own.chunks_exact(step).zip(self.run.seen());
            for ((pixel, source), (own, seen)) in there.zip(found) {
                if *source == NO_FRAME && *seen {
                    pixel.copy_from_slice(own);
                    *source = view.frame as u32;
                }
            }
        }
    }
}

fn view_of<'a>(views: &'a [View<'a>], frame: usize) -> Option<&'a View<'a>> {
    let at = views.binary_search_by_key(&frame, |view| view.frame).ok()?;
    Some(&views[at])
}

/// The median; the mean of the middle two of an even number. NaN of none.
pub(super) fn median(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return f32::NAN;
    }
    values.sort_unstable_by(f32::total_cmp);
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}
