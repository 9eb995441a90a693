//! Tiles of the panorama, row by row.

use super::exposure::Exposure;
use super::sample::{Sample, Samples};
use super::seams::{Seams, Shares};
use super::view::{Kernels, View};
use super::warp::{Points, RUN, Run};
use super::{Canvas, FrameStack, Placement, Tile};
use crate::surface::Surface;
use nalgebra::Vector3;
use serde::Serialize;

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
    exact: Vec<Vector3<f64>>,
    points: Points,
    run: Run,
    shares: Shares,
    corrections: Vec<[f32; 4]>,
}

/// A drawn tile.
pub struct Drawn {
    /// Its pixels, row-major, alpha last: full where some frame sees the wall, 0 in holes.
    pub samples: Samples,
    /// The frame that each pixel shows most of, [`NO_FRAME`] in holes and where frames are mixed all over.
    pub sources: Vec<u32>,
}

impl Scene<'_> {
    /// Draws a tile. The frames that it needs must be held ([`Scene::needed`]).
    pub fn draw(&self, tile: &Tile, scratch: &mut Scratch) -> Drawn {
        let format = self.frames.format();
        match (format.channels, format.deep) {
            (1, false) => self.draw_as::<u8, 1>(tile, scratch),
            (_, false) => self.draw_as::<u8, 3>(tile, scratch),
            (1, true) => self.draw_as::<u16, 1>(tile, scratch),
            (_, true) => self.draw_as::<u16, 3>(tile, scratch),
        }
    }

    /// The frames that a tile is drawn from, in their order.
    pub fn needed(&self, tile: &Tile) -> Vec<usize> {
        match self.composition {
            Composition::Seams(seams) => seams.frames_of(self.canvas, tile),
            Composition::Average | Composition::Median => tile.frames.clone(),
        }
    }

    fn draw_as<T: Sample, const C: usize>(&self, tile: &Tile, scratch: &mut Scratch) -> Drawn
    where
        Samples: From<Vec<T>>,
    {
        if tile.frames.is_empty() {
            return Drawn {
                samples: vec![T::default(); tile.pixels() * (C + 1)].into(),
                sources: vec![NO_FRAME; tile.pixels()],
            };
        }
        let Scratch {
            exact,
            points,
            run,
            shares,
            corrections,
        } = scratch;
        tile.points_into(self.surface, self.canvas, exact);
        points.set(exact);
        let camera = self.frames.camera();
        let views = self.needed(tile).into_iter().filter_map(|frame| {
            let picture = self.frames.picture(frame)?;
            Some(View::new(
                (frame, &self.placements[frame], picture),
                camera,
                self.kernels,
                self.exposure.of(frame),
                points,
                tile.columns as usize,
            ))
        });
        let views: Vec<View> = views.collect();
        let mut brush = Brush::<'_, T, C> {
            pixels: vec![T::default(); tile.pixels() * (C + 1)],
            next: 0,
            sources: Vec::with_capacity(tile.pixels()),
            run,
        };
        match self.composition {
            Composition::Seams(seams) => {
                let row = (shares, corrections);
                brush.best_view(tile, points, &views, seams, self.canvas, row);
            }
            Composition::Average => brush.average(tile, points, &views),
            Composition::Median => brush.median(tile, points, &views),
        }
        Drawn {
            samples: brush.pixels.into(),
            sources: brush.sources,
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

    /// Columns from `from` that show nothing but a frame.
    fn set(&mut self, run: &Run, frame: usize, from: usize, count: usize) {
        self.sums[from..from + count].copy_from_slice(&run.values()[..count]);
        let seen = run.seen()[..count].iter();
        let columns = self.weights[from..]
            .iter_mut()
            .zip(&mut self.sources[from..]);
        for (seen, (weight, source)) in seen.zip(columns) {
            *weight = if *seen { 1.0 } else { 0.0 };
            *source = if *seen { frame as u32 } else { NO_FRAME };
        }
    }

    /// Columns from `from` that show a frame with some weight.
    fn mix(&mut self, run: &Run, frame: usize, from: usize, weights: &[f32]) {
        for (k, w) in weights.iter().enumerate() {
            if run.seen()[k] && *w > 0.0 {
                self.add(from + k, &run.values()[k], *w);
                if *w > self.largest[from + k] {
                    self.largest[from + k] = *w;
                    self.sources[from + k] = frame as u32;
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

/// Draws rows of a tile with `C` channels of `T`.
struct Brush<'a, T, const C: usize> {
    /// All that the tile has, in holes to begin with.
    pixels: Vec<T>,
    /// The pixel to be drawn next.
    next: usize,
    sources: Vec<u32>,
    run: &'a mut Run,
}

impl<T: Sample, const C: usize> Brush<'_, T, C> {
    #[inline(always)]
    fn put(&mut self, value: Option<[f32; 4]>) {
        let at = self.next * (C + 1);
        self.next += 1;
        let (Some(value), Some(pixel)) = (value, self.pixels.get_mut(at..=at + C)) else {
            return;
        };
        for (sample, value) in pixel.iter_mut().zip(&value[..C]) {
            *sample = T::nearest(*value);
        }
        pixel[C] = T::nearest(T::WHITE);
    }

    fn average(&mut self, tile: &Tile, points: &Points, views: &[View]) {
        let columns = tile.columns as usize;
        let mut sums = Row::new();
        for row in 0..tile.rows as usize {
            sums.clear(columns);
            for view in views {
                view.look_at(self.run, points, row * columns, columns);
                let (u, v) = self.run.pixels();
                for k in 0..columns {
                    if self.run.seen()[k] {
                        let w = view.feather(u[k], v[k]);
                        sums.add(k, &self.run.values()[k], w);
                    }
                }
            }
            for k in 0..columns {
                let w = sums.weights[k];
                self.put((w > 0.0).then(|| sums.sums[k].map(|sum| sum / w)));
                self.sources.push(NO_FRAME);
            }
        }
    }

    fn median(&mut self, tile: &Tile, points: &Points, views: &[View]) {
        let columns = tile.columns as usize;
        let mut stacks: Vec<Vec<[f32; 4]>> = vec![Vec::with_capacity(views.len()); columns];
        let mut values = Vec::with_capacity(views.len());
        for row in 0..tile.rows as usize {
            for view in views {
                view.look_at(self.run, points, row * columns, columns);
                for (k, stack) in stacks.iter_mut().enumerate() {
                    if self.run.seen()[k] {
                        stack.push(self.run.values()[k]);
                    }
                }
            }
            for stack in &mut stacks {
                let middle = (!stack.is_empty()).then(|| {
                    let mut middle = [0.0; 4];
                    for (c, middle) in middle.iter_mut().enumerate().take(C) {
                        values.clear();
                        values.extend(stack.iter().map(|value| value[c]));
                        *middle = median(&mut values);
                    }
                    middle
                });
                self.put(middle);
                self.sources.push(NO_FRAME);
                stack.clear();
            }
        }
    }

    fn best_view(
        &mut self,
        tile: &Tile,
        points: &Points,
        views: &[View],
        seams: &Seams,
        canvas: &Canvas,
        (shares, corrections): (&mut Shares, &mut Vec<[f32; 4]>),
    ) {
        let columns = tile.columns as usize;
        let places = seams.columns_of(canvas, tile);
        let mut sums = Row::new();
        for row in 0..tile.rows as usize {
            let start = row * columns;
            let between = seams.row_of(canvas, tile.row + row as u32);
            seams.shares(&places, &between, shares);
            seams.corrections(&places, &between, corrections);
            sums.clear(columns);
            for (share, weights) in shares.iter() {
                let Ok(view) = views.binary_search_by_key(&share.frame, |view| view.frame) else {
                    continue;
                };
                let (from, count) = (share.from, share.to - share.from);
                views[view].look_at(self.run, points, start + from, count);
                match weights {
                    Some(weights) => sums.mix(self.run, share.frame, from, weights),
                    None => sums.set(self.run, share.frame, from, count),
                }
            }
            // At the edge of what is seen: frames that no node of the grid shows.
            if sums.weights[..columns].contains(&0.0) {
                for view in views {
                    view.look_at(self.run, points, start, columns);
                    sums.fill(self.run, view.frame, columns);
                }
            }
            for (k, correction) in corrections.iter().enumerate() {
                let w = sums.weights[k];
                let inverse = 1.0 / w;
                let sum = &sums.sums[k];
                let value = std::array::from_fn(|c| sum[c] * inverse + correction[c]);
                self.put((w > 0.0).then_some(value));
            }
            self.sources.extend_from_slice(&sums.sources[..columns]);
        }
    }
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
