//! Light levelled out over seams: multi-band blending of what exposure has left.
//!
//! Let L be the composite of the frames along their seams and `D_i = I_i − L` what frame i shows otherwise, at the nodes of the
//! grid (zero where the frame sees nothing). With `M_i` the mask of the nodes given to frame i, Gaussian pyramids `G_k M_i` and
//! Laplacian pyramids `Λ_k D_i`, the correction is the collapsed pyramid of
//!
//! `Σ_i G_k M_i Λ_k D_i / Σ_i G_k M_i`.
//!
//! Added to L this is the multi-band blend of all `I_i`: fine differences change over a short
//! way across a seam, broad ones over a long way. The finest band, between the nodes, is the frames' own.
//!
//! Source: P. J. Burt, E. H. Adelson, "A multiresolution spline with application to image mosaics", ACM Transactions
//! on Graphics 2(4), 1983.

use super::draw::NO_FRAME;
use super::run::{RUN, Run};
use super::thumbnails::Thumbnails;
use super::warp::Points;
use super::{Canvas, Exposure, Placement};
use crate::surface::Surface;
use rayon::prelude::*;

/// Bands; the coarsest grid's nodes are `2^(BANDS − 1)` as far apart. The grid has a multiple of as many columns.
pub const BANDS: usize = 4;
/// Distance of the coarsest grid's nodes, in nodes of the finest.
pub const COARSEST: u32 = 1 << (BANDS - 1);
/// What is more different than this (grey levels of 255) is no light: something has moved, or glints.
const MOST: f32 = 20.0;
/// A weight that is nothing but rounding.
const LEAST_WEIGHT: f32 = 1e-4;
/// Frames worked on at once.
const RUN_OF_FRAMES: usize = 64;

/// A window of the grid around the nodes of one frame, its edges multiples of [`COARSEST`].
#[derive(Clone, Copy, Debug)]
struct Window {
    /// First column, below zero across θ = 0.
    column: i64,
    /// First row, below zero above the first.
    row: i64,
    columns: usize,
    rows: usize,
}

/// Numbers on a lattice, `channels` a node.
#[derive(Clone, Debug)]
struct Layer {
    columns: usize,
    rows: usize,
    channels: usize,
    values: Vec<f32>,
}

/// What is to be added to the composite at each node, `channels` numbers, in units of the frames' samples (`white`: their
/// full scale).
pub fn corrections(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    exposure: &Exposure,
    placements: &[Placement],
    grid: &Canvas,
    labels: &[u32],
    white: f32,
) -> Vec<f32> {
    let channels = thumbnails.channels();
    let windows = windows(grid, labels, placements.len());
    let sight = |frame: usize, window: &Window| {
        shown(
            surface, thumbnails, exposure, placements, grid, frame, window,
        )
    };
    // The composite.
    let mut composite = vec![0.0f32; labels.len() * channels];
    for run in windows.chunks(RUN_OF_FRAMES) {
        let layers: Vec<Layer> = run
            .par_iter()
            .map(|(frame, window)| sight(*frame, window))
            .collect();
        for ((frame, window), layer) in run.iter().zip(&layers) {
            window.each(grid, |node, at| {
                if labels[node] == *frame as u32 {
                    composite[node * channels..][..channels]
                        .copy_from_slice(&layer.values[at * channels..][..channels]);
                }
            });
        }
    }
    let mut bands: Vec<Layer> = (0..BANDS)
        .map(|band| {
            let (columns, rows) = (
                grid.columns as usize >> band,
                (grid.rows as usize).next_multiple_of(COARSEST as usize) >> band,
            );
            Layer::zeros(columns, rows, channels + 1)
        })
        .collect();
    for run in windows.chunks(RUN_OF_FRAMES) {
        let parts: Vec<Vec<Layer>> = run
            .par_iter()
            .map(|(frame, window)| {
                let mut different = sight(*frame, window);
                let mut mask = Layer::zeros(window.columns, window.rows, 1);
                // Outside the grid nothing differs.
                let mut within = vec![false; mask.values.len()];
                window.each(grid, |node, at| {
                    within[at] = true;
                    mask.values[at] = f32::from(labels[node] == *frame as u32);
                    let given = labels[node] != NO_FRAME;
                    for c in 0..channels {
                        let value = &mut different.values[at * channels + c];
                        let off = *value - composite[node * channels + c];
                        // NaN where the frame sees nothing.
                        *value = if given && off.abs() <= MOST / 255.0 * f32::from(u16::MAX) {
                            off
                        } else {
                            0.0
                        };
                    }
                });
                for (at, within) in within.iter().enumerate() {
                    if !within {
                        different.values[at * channels..][..channels].fill(0.0);
                    }
                }
                weighted_bands(different, mask, window.columns == grid.columns as usize)
            })
            .collect();
        for ((_, window), part) in run.iter().zip(&parts) {
            for (band, (sum, layer)) in bands.iter_mut().zip(part).enumerate() {
                sum.add(layer, window, band);
            }
        }
    }
    let bands = bands.iter().map(Layer::normalised);
    let mut bands: Vec<Layer> = bands.collect();
    let mut blend = bands.pop().unwrap_or_else(|| Layer::zeros(0, 0, channels));
    for mut band in bands.into_iter().rev() {
        let coarse = blend.expanded(true);
        for (value, coarse) in band.values.iter_mut().zip(&coarse.values) {
            *value += coarse;
        }
        blend = band;
    }
    blend.values.truncate(labels.len() * channels);
    let scale = white / f32::from(u16::MAX);
    for value in &mut blend.values {
        *value *= scale;
    }
    blend.values
}

/// The bands of `different`, weighted by the mask's pyramid, and as a last channel the weights; `around`: the window
/// closes around the tunnel.
fn weighted_bands(different: Layer, mask: Layer, around: bool) -> Vec<Layer> {
    let mut bands = Vec::with_capacity(BANDS);
    let (mut fine, mut mask) = (different, mask);
    for band in 0..BANDS {
        let coarse = (band + 1 < BANDS).then(|| (fine.reduced(around), mask.reduced(around)));
        let mut detail = fine;
        if let Some((coarse, _)) = &coarse {
            let smooth = coarse.expanded(around);
            for (value, smooth) in detail.values.iter_mut().zip(&smooth.values) {
                *value -= smooth;
            }
        }
        bands.push(detail.weighted(&mask));
        match coarse {
            Some(next) => (fine, mask) = next,
            None => break,
        }
    }
    bands
}

/// The windows of all frames that have nodes: around these, and as far beyond as the coarsest band reaches.
fn windows(grid: &Canvas, labels: &[u32], frames: usize) -> Vec<(usize, Window)> {
    let columns = grid.columns as usize;
    // Columns are followed the shortest way from the first node of the frame.
    let mut boxes: Vec<Option<[i64; 5]>> = vec![None; frames];
    for (node, frame) in labels.iter().enumerate() {
        if *frame == NO_FRAME {
            continue;
        }
        let (row, column) = ((node / columns) as i64, (node % columns) as i64);
        let bounds = boxes[*frame as usize].get_or_insert([column, column, column, row, row]);
        let around = columns as i64;
        let near = bounds[0] + (column - bounds[0] + around / 2).rem_euclid(around) - around / 2;
        bounds[1] = bounds[1].min(near);
        bounds[2] = bounds[2].max(near);
        bounds[4] = bounds[4].max(row);
    }
    let (edge, reach) = (i64::from(COARSEST), 2 * i64::from(COARSEST));
    let window = |[_, left, right, top, bottom]: [i64; 5]| {
        let down = |at: i64| at.div_euclid(edge) * edge;
        let up = |at: i64| (at.div_euclid(edge) + 1) * edge;
        let (mut first, mut last) = (down(left - reach), up(right + reach));
        if last - first >= i64::from(grid.columns) {
            (first, last) = (0, i64::from(grid.columns));
        }
        let row = down(top - reach);
        Window {
            column: first,
            row,
            columns: (last - first) as usize,
            rows: (up(bottom + reach) - row) as usize,
        }
    };
    let found = boxes.into_iter().enumerate();
    found
        .filter_map(|(frame, bounds)| Some((frame, window(bounds?))))
        .collect()
}

impl Window {
    /// Calls `visit(node of the grid, place in the window)` for all nodes of the window that the grid has.
    fn each(&self, grid: &Canvas, mut visit: impl FnMut(usize, usize)) {
        let columns = i64::from(grid.columns);
        for row in 0..self.rows {
            let of_grid = self.row + row as i64;
            if !(0..i64::from(grid.rows)).contains(&of_grid) {
                continue;
            }
            for column in 0..self.columns {
                let around = (self.column + column as i64).rem_euclid(columns);
                visit(
                    (of_grid * columns + around) as usize,
                    row * self.columns + column,
                );
            }
        }
    }
}

/// What a frame shows in a window, exposure undone; NaN where it shows nothing.
fn shown(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    exposure: &Exposure,
    placements: &[Placement],
    grid: &Canvas,
    frame: usize,
    window: &Window,
) -> Layer {
    let channels = thumbnails.channels();
    let wall = |column: i64, row: i64| grid.wall_at([column as f64, row as f64]);
    let s_m: Vec<f64> = (0..window.columns)
        .map(|column| wall(window.column + column as i64, 0).s_m)
        .collect();
    let h_m: Vec<f64> = (0..window.rows)
        .map(|row| wall(0, window.row + row as i64).h_m)
        .collect();
    let mut points = Vec::new();
    surface.lattice(&s_m, &h_m, &mut points);
    let points = Points::new(&points);
    let view = thumbnails.view(frame, &placements[frame], &points);
    let response = exposure.of(frame);
    let count = window.columns * window.rows;
    let mut values = Vec::with_capacity(count * channels);
    let mut run = Run::default();
    // Row by row: along a run the light changes little by little.
    for row in 0..window.rows {
        for column in (0..window.columns).step_by(RUN) {
            let length = RUN.min(window.columns - column);
            let start = row * window.columns + column;
            view.look_at(&mut run, start, length);
            response.undo(&mut run, 0..length);
            for k in 0..length {
                let (value, seen) = (run.values()[k], run.seen()[k]);
                values.extend((0..channels).map(|c| if seen { value[c] } else { f32::NAN }));
            }
        }
    }
    Layer {
        columns: window.columns,
        rows: window.rows,
        channels,
        values,
    }
}

impl Layer {
    fn zeros(columns: usize, rows: usize, channels: usize) -> Self {
        Self {
            columns,
            rows,
            channels,
            values: vec![0.0; columns * rows * channels],
        }
    }

    /// Each node times its weight, and the weight as one channel more.
    fn weighted(&self, weights: &Self) -> Self {
        let nodes = self.values.chunks_exact(self.channels).zip(&weights.values);
        Self {
            channels: self.channels + 1,
            values: nodes
                .flat_map(|(node, w)| node.iter().map(move |v| v * w).chain([*w]))
                .collect(),
            ..*self
        }
    }

    /// Each node by its last channel, which is its weight.
    fn normalised(&self) -> Self {
        let channels = self.channels - 1;
        let nodes = self.values.chunks_exact(self.channels);
        Self {
            channels,
            values: nodes
                .flat_map(|node| {
                    let w = node[channels];
                    let scale = if w > LEAST_WEIGHT { 1.0 / w } else { 0.0 };
                    node[..channels].iter().map(move |v| v * scale)
                })
                .collect(),
            ..*self
        }
    }

    /// Half as many nodes each way, at the middles of 2 × 2: weights (1, 3, 3, 1)/8 along each axis; `around`: the last
    /// column is followed by the first, else the border is repeated.
    fn reduced(&self, around: bool) -> Self {
        let (columns, rows, c) = (self.columns / 2, self.rows / 2, self.channels);
        let weights = [0.125, 0.375, 0.375, 0.125];
        let near = |at: usize, k: usize, size: usize| (2 * at + k).saturating_sub(1).min(size - 1);
        let mut across = Self::zeros(columns, self.rows, c);
        for row in 0..self.rows {
            for column in 0..columns {
                for (k, w) in weights.iter().enumerate() {
                    let near = match around {
                        true => (2 * column + k + self.columns - 1) % self.columns,
                        false => near(column, k, self.columns),
                    };
                    let from = (row * self.columns + near) * c;
                    for channel in 0..c {
                        across.values[(row * columns + column) * c + channel] +=
                            w * self.values[from + channel];
                    }
                }
            }
        }
        let mut half = Self::zeros(columns, rows, c);
        for row in 0..rows {
            for (k, w) in weights.iter().enumerate() {
                let from = near(row, k, self.rows) * columns * c;
                let source = &across.values[from..][..columns * c];
                let target = &mut half.values[row * columns * c..][..columns * c];
                for (target, source) in target.iter_mut().zip(source) {
                    *target += w * source;
                }
            }
        }
        half
    }

    /// Twice as many nodes each way, bilinear; `around`: the last column is followed by the first, else the border is repeated.
    fn expanded(&self, around: bool) -> Self {
        let (columns, rows, c) = (2 * self.columns, 2 * self.rows, self.channels);
        let mut double = Self::zeros(columns, rows, c);
        // The node's own parent, and the other one next to it.
        let parents = |at: usize, size: usize, around: bool| {
            let own = at / 2;
            let other = match (at % 2, around) {
                (0, true) => (own + size - 1) % size,
                (0, false) => own.saturating_sub(1),
                (_, true) => (own + 1) % size,
                (_, false) => (own + 1).min(size - 1),
            };
            [(own, 0.75f32), (other, 0.25)]
        };
        for row in 0..rows {
            for column in 0..columns {
                let at = (row * columns + column) * c;
                for (i, w_i) in parents(row, self.rows, false) {
                    for (j, w_j) in parents(column, self.columns, around) {
                        let from = (i * self.columns + j) * c;
                        for channel in 0..c {
                            double.values[at + channel] += w_i * w_j * self.values[from + channel];
                        }
                    }
                }
            }
        }
        double
    }

    /// Adds the layer of a window, `band` halvings from the grid's.
    fn add(&mut self, layer: &Self, window: &Window, band: usize) {
        let c = self.channels;
        let (first, top) = (window.column >> band, window.row >> band);
        for row in 0..layer.rows {
            let to = top + row as i64;
            if !(0..self.rows as i64).contains(&to) {
                continue;
            }
            for column in 0..layer.columns {
                let around = (first + column as i64).rem_euclid(self.columns as i64);
                let node = (to * self.columns as i64 + around) as usize * c;
                let from = (row * layer.columns + column) * c;
                for channel in 0..c {
                    self.values[node + channel] += layer.values[from + channel];
                }
            }
        }
    }
}
