//! Multi-band blending of differences of light between frames that exposure has left.
//!
//! Let L be the composite of the frames along their seams and `D_i = I_i − L` the difference of
//! frame i to it, at the nodes of the grid (zero where the frame sees nothing). With `M_i` the mask
//! of the nodes given to frame i, Gaussian pyramids `G_k M_i` and Laplacian pyramids `Λ_k D_i`, the
//! correction is the collapsed pyramid of
//!
//! `Σ_i G_k M_i Λ_k D_i / Σ_i G_k M_i`.
//!
//! Added to L this is the multi-band blend of all `I_i`: fine differences change over a short way
//! across a seam, broad ones over a long way. The finest band, between the nodes, is the frames'
//! own.
//!
//! Source: P. J. Burt, E. H. Adelson, "A multiresolution spline with application to image mosaics",
//! ACM Transactions on Graphics 2(4), 1983.

use crate::layout::canvas::Canvas;
use crate::layout::placement::{NO_FRAME, Placement};
use crate::sampling::exposure::Exposure;
use crate::sampling::point_batch::{MAX_BATCH_POINTS, PointBatch};
use crate::sampling::thumbnails::Thumbnails;
use crate::warp::projection::LocalPoints;
use rayon::prelude::*;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;

/// Bands of the pyramid; the coarsest grid's nodes are `2^(PYRAMID_BANDS − 1)` as far apart. The
/// grid has a multiple of that many columns. More bands blend light over longer distances.
pub const PYRAMID_BANDS: usize = 4;
/// Distance of the coarsest grid's nodes, in nodes of the finest.
pub const COARSEST_SPACING: u32 = 1 << (PYRAMID_BANDS - 1);
/// Largest difference that is blended, grey levels of 255: beyond it something has moved or glints.
/// A higher value blends stronger differences of light and lets moved things bleed over seams.
const MAX_DIFFERENCE: f32 = 20.0;
/// Smallest weight that is not rounding noise.
const MIN_WEIGHT: f32 = 1e-4;
/// Frames that are processed at once. A higher value uses more threads and more memory.
const FRAMES_AT_ONCE: usize = 64;

/// A window of the grid around the nodes of one frame, its edges multiples of [`COARSEST_SPACING`].
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

/// Computes the corrections that are added to the composite at each node, `channels` numbers, in
/// units of the frames' samples (`white`: their full scale).
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
    let sampled = |frame: usize, window: &Window| {
        sample_frame(
            surface, thumbnails, exposure, placements, grid, frame, window,
        )
    };
    // The composite.
    let mut composite = vec![0.0f32; labels.len() * channels];
    for chunk in windows.chunks(FRAMES_AT_ONCE) {
        let layers: Vec<Layer> = chunk.par_map(|(frame, window)| sampled(*frame, window));
        let columns = grid.columns as usize;
        let rows = composite.par_chunks_exact_mut(columns * channels);
        let labels = labels.par_chunks_exact(columns);
        rows.zip(labels)
            .enumerate()
            .for_each(|(row, (own, labels))| {
                for ((frame, window), layer) in chunk.iter().zip(&layers) {
                    let Some(values) = window.row(0, row, layer) else {
                        continue;
                    };
                    for (column, value) in
                        window.around(0, columns).zip(values.chunks_exact(channels))
                    {
                        if labels[column] == *frame as u32 {
                            own[column * channels..][..channels].copy_from_slice(value);
                        }
                    }
                }
            });
    }
    let mut bands: Vec<Layer> = (0..PYRAMID_BANDS)
        .map(|band| {
            let (columns, rows) = (
                grid.columns as usize >> band,
                (grid.rows as usize).next_multiple_of(COARSEST_SPACING as usize) >> band,
            );
            Layer::zeros(columns, rows, channels + 1)
        })
        .collect();
    for chunk in windows.chunks(FRAMES_AT_ONCE) {
        let parts: Vec<Vec<Layer>> = chunk.par_map(|(frame, window)| {
            let mut different = sampled(*frame, window);
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
                    *value = if given && off.abs() <= MAX_DIFFERENCE / 255.0 * f32::from(u16::MAX) {
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
        });
        for (band, sum) in bands.iter_mut().enumerate() {
            let (columns, channels) = (sum.columns, sum.channels);
            let rows = sum.values.par_chunks_exact_mut(columns * channels);
            rows.enumerate().for_each(|(row, own)| {
                for ((_, window), part) in chunk.iter().zip(&parts) {
                    let values = window.row(band, row, &part[band]).unwrap_or_default();
                    for (column, value) in window
                        .around(band, columns)
                        .zip(values.chunks_exact(channels))
                    {
                        for (own, value) in
                            own[column * channels..][..channels].iter_mut().zip(value)
                        {
                            *own += value;
                        }
                    }
                }
            });
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

/// Bands of `different`, weighted by the mask's pyramid, and the weights as a last channel;
/// `around`: the window closes around the tunnel.
fn weighted_bands(different: Layer, mask: Layer, around: bool) -> Vec<Layer> {
    let mut bands = Vec::with_capacity(PYRAMID_BANDS);
    let (mut fine, mut mask) = (different, mask);
    for band in 0..PYRAMID_BANDS {
        let coarse =
            (band + 1 < PYRAMID_BANDS).then(|| (fine.reduced(around), mask.reduced(around)));
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

/// Windows of all frames that have nodes: around these, and as far beyond as the coarsest band
/// reaches.
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
    let (edge, reach) = (i64::from(COARSEST_SPACING), 2 * i64::from(COARSEST_SPACING));
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
    /// Calls `visit(node of the grid, place in the window)` for all nodes of the window that the
    /// grid has.
    fn each(&self, grid: &Canvas, mut visit: impl FnMut(usize, usize)) {
        let columns = grid.columns as usize;
        for row in 0..self.rows {
            let of_grid = self.row + row as i64;
            if !(0..i64::from(grid.rows)).contains(&of_grid) {
                continue;
            }
            for (k, column) in self.around(0, columns).enumerate() {
                visit(of_grid as usize * columns + column, row * self.columns + k);
            }
        }
    }

    /// The columns of the window among the `columns` of a grid that is `band` halvings coarser.
    fn around(&self, band: usize, columns: usize) -> impl Iterator<Item = usize> {
        let first = (self.column >> band).rem_euclid(columns as i64) as usize;
        (first..columns)
            .chain(0..columns)
            .take(self.columns >> band)
    }

    /// A row of such a grid in the window's layer, if it has it.
    fn row<'a>(&self, band: usize, row: usize, layer: &'a Layer) -> Option<&'a [f32]> {
        let row = usize::try_from(row as i64 - (self.row >> band)).ok()?;
        (row < layer.rows).then(|| layer.row(row))
    }
}

/// Samples a frame in a window, exposure undone; NaN where it shows nothing.
fn sample_frame(
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
    let points = LocalPoints::new(&points);
    let view = thumbnails.view(frame, &placements[frame], &points);
    let response = exposure.of(frame);
    let count = window.columns * window.rows;
    let mut values = Vec::with_capacity(count * channels);
    let mut batch = PointBatch::default();
    // Row by row: along a run the light changes little by little.
    for row in 0..window.rows {
        for column in (0..window.columns).step_by(MAX_BATCH_POINTS) {
            let length = MAX_BATCH_POINTS.min(window.columns - column);
            let start = row * window.columns + column;
            view.look_at(&mut batch, start, length);
            response.undo(&mut batch, 0..length);
            for (value, seen) in batch.values()[..length].iter().zip(batch.seen()) {
                match seen {
                    true => values.extend_from_slice(&value[..channels]),
                    false => values.extend_from_slice(&[f32::NAN; 4][..channels]),
                }
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

/// Pads a row of that many nodes before the first and after the last: with the other end around the
/// tunnel, or by repetition.
fn pad(row: &mut [f32], columns: usize, channels: usize, around: bool) {
    let (first, last) = if around { (columns, 1) } else { (1, columns) };
    row.copy_within(first * channels..(first + 1) * channels, 0);
    row.copy_within(
        last * channels..(last + 1) * channels,
        (columns + 1) * channels,
    );
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

    /// Multiplies each node by its weight, and appends the weight as a channel.
    fn weighted(&self, weights: &Self) -> Self {
        let mut all = Self::zeros(self.columns, self.rows, self.channels + 1);
        let nodes = self.values.chunks_exact(self.channels).zip(&weights.values);
        for (own, (node, w)) in all.values.chunks_exact_mut(self.channels + 1).zip(nodes) {
            for (own, value) in own.iter_mut().zip(node) {
                *own = value * w;
            }
            own[self.channels] = *w;
        }
        all
    }

    /// Divides each node by its last channel, which is its weight.
    fn normalised(&self) -> Self {
        let channels = self.channels - 1;
        let mut all = Self::zeros(self.columns, self.rows, channels);
        let nodes = self.values.chunks_exact(self.channels);
        for (own, node) in all.values.chunks_exact_mut(channels).zip(nodes) {
            let w = node[channels];
            let scale = if w > MIN_WEIGHT { 1.0 / w } else { 0.0 };
            for (own, value) in own.iter_mut().zip(node) {
                *own = value * scale;
            }
        }
        all
    }

    /// Halves the nodes each way, to the middles of 2 × 2: weights (1, 3, 3, 1)/8 along each axis;
    /// `around`: the last column is followed by the first, else the border is repeated.
    fn reduced(&self, around: bool) -> Self {
        const WEIGHTS: [f32; 4] = [0.125, 0.375, 0.375, 0.125];
        let (columns, rows, c) = (self.columns / 2, self.rows / 2, self.channels);
        let mut half = Self::zeros(columns, rows, c);
        // A row with the columns beyond either end of it.
        let mut row_of = vec![0.0; (self.columns + 2) * c];
        for row in 0..rows {
            let near = |k: usize| (2 * row + k).saturating_sub(1).min(self.rows - 1);
            let [p, q, r, s] = [0, 1, 2, 3].map(|k| self.row(near(k)));
            let inner = &mut row_of[c..(self.columns + 1) * c];
            for (n, value) in inner.iter_mut().enumerate() {
                *value = WEIGHTS[0] * (p[n] + s[n]) + WEIGHTS[1] * (q[n] + r[n]);
            }
            pad(&mut row_of, self.columns, c, around);
            let target = &mut half.values[row * columns * c..][..columns * c];
            for (column, node) in target.chunks_exact_mut(c).enumerate() {
                let own = &row_of[2 * column * c..][..4 * c];
                for (channel, value) in node.iter_mut().enumerate() {
                    let at = |k: usize| own[k * c + channel];
                    *value = WEIGHTS[0] * (at(0) + at(3)) + WEIGHTS[1] * (at(1) + at(2));
                }
            }
        }
        half
    }

    /// Doubles the nodes each way, bilinear; `around`: the last column is followed by the first,
    /// else the border is repeated.
    fn expanded(&self, around: bool) -> Self {
        /// Weights of the node's own parent, and of the other one next to it.
        const WEIGHTS: [f32; 2] = [0.75, 0.25];
        let (columns, rows, c) = (2 * self.columns, 2 * self.rows, self.channels);
        let mut double = Self::zeros(columns, rows, c);
        let mut row_of = vec![0.0; (self.columns + 2) * c];
        for row in 0..rows {
            let own = row / 2;
            let other = match row % 2 {
                0 => own.saturating_sub(1),
                _ => (own + 1).min(self.rows - 1),
            };
            let inner = &mut row_of[c..(self.columns + 1) * c];
            let both = self.row(own).iter().zip(self.row(other));
            for (value, (own, other)) in inner.iter_mut().zip(both) {
                *value = WEIGHTS[0] * own + WEIGHTS[1] * other;
            }
            pad(&mut row_of, self.columns, c, around);
            let target = &mut double.values[row * columns * c..][..columns * c];
            for (column, two) in target.chunks_exact_mut(2 * c).enumerate() {
                let near = &row_of[column * c..][..3 * c];
                for channel in 0..c {
                    let at = |k: usize| near[k * c + channel];
                    two[channel] = WEIGHTS[0] * at(1) + WEIGHTS[1] * at(0);
                    two[c + channel] = WEIGHTS[0] * at(1) + WEIGHTS[1] * at(2);
                }
            }
        }
        double
    }

    fn row(&self, row: usize) -> &[f32] {
        let length = self.columns * self.channels;
        &self.values[row * length..][..length]
    }
}
