//! Which frame shows which part of the panorama, and how one passes into the next.
//!
//! A grid of nodes, some eight pixels apart (sixteen and more where there would be too many), lies
//! over the canvas. Each node is given to one frame ([`super::labels`]); between nodes the frames
//! pass into each other with the bilinear weights of their nodes. What they still differ by in
//! light over longer distances is levelled out by a correction given at the nodes
//! ([`super::levelling`]).

use super::chart::PATCH;
use super::draw::NO_FRAME;
use super::labels;
use super::levelling::{self, COARSEST};
use super::run::RUN;
use super::thumbnails::Thumbnails;
use super::{Canvas, Exposure, Placement, Tile};
use crate::surface::Surface;
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Distance of the grid's nodes, canvas pixels, unless there would be too many.
const STEP_PX: f64 = 8.0;
/// The most nodes of a grid; beyond, they are farther apart.
const NODES: usize = 4 << 20;

/// Distance of the nodes on a canvas, pixels: by the canvas alone, so that the panorama does not
/// depend on the memory.
pub(super) fn step_px(canvas: &Canvas) -> f64 {
    let mut step = STEP_PX;
    loop {
        let grid = canvas.grid(step, COARSEST);
        if grid.pixels() <= NODES || grid.columns <= COARSEST {
            return step;
        }
        step *= 2.0;
    }
}

/// The grid over a canvas.
pub(super) fn grid(canvas: &Canvas) -> Canvas {
    canvas.grid(step_px(canvas), COARSEST)
}

/// Which frame shows what.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seams {
    grid: Canvas,
    /// The frame of each node, row-major; [`NO_FRAME`] where none sees the wall.
    labels: Vec<u32>,
    /// What is added to the frames' values at each node, `channels` numbers; nothing at all where
    /// frames stay as they are.
    corrections: Vec<f32>,
    channels: usize,
}

/// Where the columns of a tile lie between the nodes.
pub struct Across {
    cells: Vec<Cell>,
    /// How far each column lies from the node before to the one after, 0 to 1; 0 beyond the last.
    t: [f32; RUN],
    columns: usize,
}

impl Across {
    /// Number of columns.
    pub fn len(&self) -> usize {
        self.columns
    }

    /// How far each column lies from the node before to the one after, 0 to 1; anything beyond the
    /// last.
    pub fn between(&self) -> &[f32; RUN] {
        &self.t
    }
}

/// Columns of a tile between the same two nodes.
struct Cell {
    columns: Range<usize>,
    before: usize,
    after: usize,
}

/// A row between two rows of nodes.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    before: usize,
    after: usize,
    /// How far from the one to the other, 0 to 1.
    t: f32,
}

impl Between {
    /// How far from the one row to the other, 0 to 1.
    pub fn t(&self) -> f32 {
        self.t
    }
}

/// The rows of a tile, cut where they pass a row of nodes and where one row of patches ends and the
/// next begins.
pub fn strips(down: &[Between]) -> impl Iterator<Item = Range<usize>> {
    let key = |row: usize| (down[row].before, row / PATCH);
    let mut from = 0;
    std::iter::from_fn(move || {
        let own = (from < down.len()).then(|| key(from))?;
        let to = (from + 1..down.len())
            .find(|row| key(*row) != own)
            .unwrap_or(down.len());
        let strip = from..to;
        from = to;
        Some(strip)
    })
}

impl Seams {
    /// Finds the best frame for each node of the grid over `canvas`, by thumbnails whose exposure
    /// is undone; with `blend`, also the correction. `white`: full scale of the frames.
    pub(super) fn find(
        surface: &dyn Surface,
        thumbnails: &Thumbnails,
        exposure: &Exposure,
        placements: &[Placement],
        canvas: &Canvas,
        blend: Option<f32>,
    ) -> Self {
        let grid = grid(canvas);
        let labels = labels::best(surface, thumbnails, exposure, placements, &grid);
        let channels = thumbnails.channels();
        let corrections = match blend {
            Some(white) => levelling::corrections(
                surface, thumbnails, exposure, placements, &grid, &labels, white,
            ),
            None => Vec::new(),
        };
        Self {
            grid,
            labels,
            corrections,
            channels,
        }
    }

    /// The frame of each node, row-major.
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// Memory of the grid while it is made, bytes a node.
    pub(super) fn bytes_per_node(channels: usize) -> u64 {
        // Labels; composite, corrections and those of the coarser grids.
        (4 + 4 * (channels + 3 * (channels + 1))) as u64
    }

    /// True if frames stay as they are: every pixel is one frame's.
    pub fn are_hard(&self) -> bool {
        self.corrections.is_empty()
    }

    fn frame(&self, row: usize, column: usize) -> u32 {
        self.labels[row * self.grid.columns as usize + column]
    }

    /// The frames that a tile may be drawn from, in their order.
    pub(super) fn frames_of(&self, canvas: &Canvas, tile: &Tile) -> Vec<usize> {
        let first = self.row_of(canvas, tile.row).before;
        let last = self.row_of(canvas, tile.row + tile.rows - 1).after;
        // Nodes follow each other; around the tunnel the first comes after the last.
        let count = self.grid.columns as usize;
        let node = |column: u32| self.column_of(canvas, column).0;
        let across = (node(tile.column)..=node(tile.column + tile.columns - 1) + 1)
            .map(|node| node.rem_euclid(count as i64) as usize);
        let across: Vec<usize> = across.take(count).collect();
        let mut frames = Vec::new();
        let mut previous = NO_FRAME;
        let mut open = false;
        for row in self.labels[first * count..(last + 1) * count].chunks_exact(count) {
            for column in &across {
                let frame = row[*column];
                open |= frame == NO_FRAME;
                if frame != previous && frame != NO_FRAME {
                    frames.push(frame as usize);
                    previous = frame;
                }
            }
        }
        // Where some node is seen by none, its surroundings may be, by any frame around.
        if open {
            frames.extend(&tile.frames);
        }
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// The node before a column of the canvas, from −1 on, and how far from it to the next one the
    /// column lies.
    fn column_of(&self, canvas: &Canvas, column: u32) -> (i64, f32) {
        let scale = f64::from(self.grid.columns) / f64::from(canvas.columns);
        let at = (f64::from(column) + 0.5) * scale - 0.5;
        let before = at.floor();
        (before as i64, (at - before) as f32)
    }

    /// Where the columns of a tile lie between the nodes.
    pub(super) fn across(&self, canvas: &Canvas, tile: &Tile) -> Across {
        let count = i64::from(self.grid.columns);
        let mut cells: Vec<Cell> = Vec::new();
        let mut t = [0.0; RUN];
        let mut cell = i64::MIN;
        for (column, t) in t.iter_mut().enumerate().take(tile.columns as usize) {
            let before;
            (before, *t) = self.column_of(canvas, tile.column + column as u32);
            if before != cell {
                cell = before;
                cells.push(Cell {
                    columns: column..column,
                    before: cell.rem_euclid(count) as usize,
                    after: (cell + 1).rem_euclid(count) as usize,
                });
            }
            if let Some(cell) = cells.last_mut() {
                cell.columns.end = column + 1;
            }
        }
        Across {
            cells,
            t,
            columns: tile.columns as usize,
        }
    }

    /// Where a row of the canvas lies between the nodes.
    pub(super) fn row_of(&self, canvas: &Canvas, row: u32) -> Between {
        let last = self.grid.rows as usize - 1;
        let scale = self.grid.px_per_metre / canvas.px_per_metre;
        let at = ((f64::from(row) + 0.5) * scale - 0.5).max(0.0);
        let before = (at as usize).min(last);
        Between {
            before,
            after: (before + 1).min(last),
            t: (at - before as f64).min(1.0) as f32,
        }
    }

    /// Where the rows of a tile lie between the rows of nodes.
    pub(super) fn down(&self, canvas: &Canvas, tile: &Tile) -> Vec<Between> {
        let rows = tile.row..tile.row + tile.rows;
        rows.map(|row| self.row_of(canvas, row)).collect()
    }

    /// The frame that some columns from a row to another are of; None if there are several, or
    /// none.
    pub(super) fn only(
        &self,
        across: &Across,
        columns: &Range<usize>,
        [first, last]: [&Between; 2],
    ) -> Option<usize> {
        let cells = across.cells.iter();
        let cells = cells.skip_while(|cell| cell.columns.end <= columns.start);
        let cells = cells.take_while(|cell| cell.columns.start < columns.end);
        let mut only = None;
        for cell in cells {
            for row in first.before..=last.after {
                for column in [cell.before, cell.after] {
                    let frame = self.frame(row, column);
                    if frame == NO_FRAME || only.is_some_and(|only| only != frame) {
                        return None;
                    }
                    only = Some(frame);
                }
            }
        }
        Some(only? as usize)
    }

    /// What some columns of a row are made of. Between the same nodes nothing changes from row to
    /// row where no frames meet.
    ///
    /// Without blending each pixel is one frame's, the one with the largest weight.
    pub(super) fn shares(
        &self,
        across: &Across,
        columns: Range<usize>,
        row: &Between,
        shares: &mut Shares,
    ) {
        shares.clear();
        let outside = |cell: &&Cell| cell.columns.end <= columns.start;
        for cell in across.cells.iter().skip_while(outside) {
            let (from, to) = (
                cell.columns.start.max(columns.start),
                cell.columns.end.min(columns.end),
            );
            if from >= to {
                break;
            }
            let corners = [
                self.frame(row.before, cell.before),
                self.frame(row.before, cell.after),
                self.frame(row.after, cell.before),
                self.frame(row.after, cell.after),
            ];
            if corners.iter().any(|frame| *frame != corners[0]) {
                self.mixed(&corners, &across.t[from..to], row, from, shares);
            } else if corners[0] != NO_FRAME {
                shares.whole(corners[0] as usize, from, to);
            }
        }
    }

    /// A cell with different frames at its corners: its columns from `from` on, at `along`.
    fn mixed(
        &self,
        corners: &[u32; 4],
        along: &[f32],
        row: &Between,
        from: usize,
        shares: &mut Shares,
    ) {
        let mut frames = *corners;
        frames.sort_unstable();
        let weight = |s: f32, frame: u32| {
            let t = row.t;
            let weights = [(1.0 - s) * (1.0 - t), s * (1.0 - t), (1.0 - s) * t, s * t];
            let own = corners
                .iter()
                .zip(weights)
                .filter(|(corner, _)| **corner == frame);
            own.map(|(_, w)| w).sum::<f32>()
        };
        if self.are_hard() {
            for (column, s) in along.iter().enumerate() {
                let mut best = (NO_FRAME, f32::NEG_INFINITY);
                // Of equals the earlier frame.
                for frame in frames.iter().filter(|frame| **frame != NO_FRAME) {
                    let own = weight(*s, *frame);
                    if own > best.1 {
                        best = (*frame, own);
                    }
                }
                shares.whole(best.0 as usize, from + column, from + column + 1);
            }
            return;
        }
        for (n, frame) in frames.iter().enumerate() {
            // Each frame once.
            if *frame == NO_FRAME || n > 0 && frames[n - 1] == *frame {
                continue;
            }
            let start = shares.weights.len();
            shares
                .weights
                .extend(along.iter().map(|s| weight(*s, *frame)));
            shares.list.push(Share {
                frame: *frame as usize,
                from,
                to: from + along.len(),
                corners: corners.map(|corner| f32::from(corner == *frame)),
                weights: Some(start),
            });
        }
    }

    /// What is added to the values along a row, at each of its columns: nothing in lanes beyond the
    /// channels.
    pub(super) fn corrections<const L: usize>(
        &self,
        across: &Across,
        row: &Between,
        found: &mut [[f32; L]],
    ) {
        if self.are_hard() {
            found.fill([0.0; L]);
            return;
        }
        let node = |row: usize, column: usize| {
            let first = (row * self.grid.columns as usize + column) * self.channels;
            &self.corrections[first..][..self.channels]
        };
        let between = |column: usize| {
            let mut value = [0.0; L];
            let ends = node(row.before, column).iter().zip(node(row.after, column));
            for (value, (upper, lower)) in value.iter_mut().zip(ends) {
                *value = upper + row.t * (lower - upper);
            }
            value
        };
        for cell in &across.cells {
            let (left, right) = (between(cell.before), between(cell.after));
            let columns = cell.columns.clone();
            for (t, found) in across.t[columns.clone()].iter().zip(&mut found[columns]) {
                for c in 0..L {
                    found[c] = left[c] + t * (right[c] - left[c]);
                }
            }
        }
    }
}

/// What a row of a tile is made of.
#[derive(Debug, Default)]
pub struct Shares {
    list: Vec<Share>,
    weights: Vec<f32>,
}

/// A frame's part in the columns `from..to`.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// The frame.
    pub frame: usize,
    /// First column.
    pub from: usize,
    /// The column after the last.
    pub to: usize,
    /// 1 at those corners of its cell that are its own, else 0: the upper two, then the lower two.
    pub corners: [f32; 4],
    /// Where its weights begin; none where it is alone.
    weights: Option<usize>,
}

impl Shares {
    fn clear(&mut self) {
        self.list.clear();
        self.weights.clear();
    }

    /// Makes them the one of a frame that is alone in its columns, if there is one; else none.
    pub fn only(&mut self, frame: Option<usize>, columns: Range<usize>) {
        self.clear();
        if let Some(frame) = frame {
            self.whole(frame, columns.start, columns.end);
        }
    }

    /// Columns that are one frame's.
    fn whole(&mut self, frame: usize, from: usize, to: usize) {
        match self.list.last_mut() {
            Some(last) if last.weights.is_none() && last.frame == frame && last.to == from => {
                last.to = to;
            }
            _ => self.list.push(Share {
                frame,
                from,
                to,
                corners: [1.0; 4],
                weights: None,
            }),
        }
    }

    /// The frame that some columns are given to alone, if there is one.
    pub fn alone(&self, columns: &Range<usize>) -> Option<usize> {
        let all = |share: &&Share| {
            share.weights.is_none() && share.from <= columns.start && share.to >= columns.end
        };
        Some(self.list.iter().find(all)?.frame)
    }

    /// All of them, those of one cell together.
    pub fn by_cells(&self) -> impl Iterator<Item = &[Share]> {
        let same = |a: &Share, b: &Share| a.weights.is_some() && a.from == b.from;
        self.list.chunk_by(same)
    }

    /// All of them, each with its weights or none if it is alone.
    pub fn iter(&self) -> impl Iterator<Item = (&Share, Option<&[f32]>)> {
        self.list.iter().map(|share| {
            let weights = share
                .weights
                .map(|start| &self.weights[start..][..share.to - share.from]);
            (share, weights)
        })
    }
}
