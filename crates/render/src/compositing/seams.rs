//! Frames that show each part of the panorama, and transitions between them.
//!
//! A grid of nodes, eight pixels apart (sixteen and more where there would be too many), lies over
//! the canvas. Each node is given to one frame ([`super::seam_selection`]); between nodes the
//! frames are mixed with the bilinear weights of their nodes. Remaining differences of light over
//! longer distances are removed by a correction at the nodes ([`super::multi_band_blending`]).

use super::frame_shares::{FrameShare, FrameShares};
use super::seam_grid::{
    ColumnCell, ColumnCells, RowPosition, column_cells, column_position, grid, row_position,
};
use super::{multi_band_blending, seam_selection};
use crate::layout::canvas::Canvas;
use crate::layout::placement::{NO_FRAME, Placement};
use crate::layout::tiles::Tile;
use crate::sampling::exposure::Exposure;
use crate::sampling::thumbnails::Thumbnails;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use tunnelstitch_geometry::surface::Surface;

/// Frame and correction of each node of the grid.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Seams {
    grid: Canvas,
    /// Frame of each node, row-major; [`NO_FRAME`] where none sees the wall.
    labels: Vec<u32>,
    /// Corrections that are added to the frames' values at each node, `channels` numbers; empty
    /// where frames keep their values.
    corrections: Vec<f32>,
    channels: usize,
}

impl Seams {
    /// Selects the frame of each node of the grid over `canvas`, by thumbnails whose exposure is
    /// undone; with `blend`, also the correction. `white`: full scale of the frames.
    pub(crate) fn find(
        surface: &dyn Surface,
        thumbnails: &Thumbnails,
        exposure: &Exposure,
        placements: &[Placement],
        canvas: &Canvas,
        blend: Option<f32>,
    ) -> Self {
        let grid = grid(canvas);
        let labels =
            seam_selection::select_frames(surface, thumbnails, exposure, placements, &grid);
        let channels = thumbnails.channels();
        let corrections = match blend {
            Some(white) => multi_band_blending::corrections(
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

    /// Frame of each node, row-major.
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// Memory of the grid while it is computed, bytes a node.
    pub(crate) fn bytes_per_node(channels: usize) -> u64 {
        // Labels; composite, corrections and those of the coarser grids.
        (4 + 4 * (channels + 3 * (channels + 1))) as u64
    }

    /// True if frames keep their values: every pixel is one frame's.
    pub fn are_hard(&self) -> bool {
        self.corrections.is_empty()
    }

    fn frame(&self, row: usize, column: usize) -> u32 {
        self.labels[row * self.grid.columns as usize + column]
    }

    /// Frames that a tile may be drawn from, in their order.
    pub(crate) fn frames_of(&self, canvas: &Canvas, tile: &Tile) -> Vec<usize> {
        let first = row_position(&self.grid, canvas, tile.row).before;
        let last = row_position(&self.grid, canvas, tile.row + tile.rows - 1).after;
        // Nodes follow each other; around the tunnel the first comes after the last.
        let count = self.grid.columns as usize;
        let node = |column: u32| column_position(&self.grid, canvas, column).0;
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
        // Around a node that no frame sees, any frame may see some pixels.
        if open {
            frames.extend(&tile.frames);
        }
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// Finds the columns of a tile between the nodes.
    pub(crate) fn column_cells(&self, canvas: &Canvas, tile: &Tile) -> ColumnCells {
        column_cells(&self.grid, canvas, tile)
    }

    /// Finds the nodes around each row of a tile.
    pub(crate) fn row_positions(&self, canvas: &Canvas, tile: &Tile) -> Vec<RowPosition> {
        let rows = tile.row..tile.row + tile.rows;
        rows.map(|row| row_position(&self.grid, canvas, row))
            .collect()
    }

    /// Frame of some columns from a row to another; None if there are several, or none.
    pub(crate) fn sole_frame(
        &self,
        across: &ColumnCells,
        columns: &Range<usize>,
        [first, last]: [&RowPosition; 2],
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

    /// Finds the shares of frames in some columns of a row. Between the same nodes they do not
    /// change from row to row where no frames meet.
    ///
    /// Without blending each pixel is one frame's, the one with the largest weight.
    pub(crate) fn frame_shares(
        &self,
        across: &ColumnCells,
        columns: Range<usize>,
        row: &RowPosition,
        shares: &mut FrameShares,
    ) {
        shares.clear();
        let outside = |cell: &&ColumnCell| cell.columns.end <= columns.start;
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
                self.mix_cell(&corners, &across.t[from..to], row, from, shares);
            } else if corners[0] != NO_FRAME {
                shares.add_whole(corners[0] as usize, from, to);
            }
        }
    }

    /// Adds the shares of a cell with different frames at its corners: its columns from `from` on,
    /// at positions `along`.
    fn mix_cell(
        &self,
        corners: &[u32; 4],
        along: &[f32],
        row: &RowPosition,
        from: usize,
        shares: &mut FrameShares,
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
                shares.add_whole(best.0 as usize, from + column, from + column + 1);
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
            shares.list.push(FrameShare {
                frame: *frame as usize,
                from,
                to: from + along.len(),
                corners: corners.map(|corner| f32::from(corner == *frame)),
                weights: Some(start),
            });
        }
    }

    /// Interpolates the corrections along a row, at each of its columns; zero in lanes beyond the
    /// channels.
    pub(crate) fn corrections<const L: usize>(
        &self,
        across: &ColumnCells,
        row: &RowPosition,
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
