//! Which frame shows which part of the panorama, and how one passes into the next.
//!
//! A grid of nodes, some eight pixels apart, lies over the canvas. Each node is given to one frame
//! ([`super::labels`]); between nodes the frames pass into each other with the bilinear weights of their nodes. What they still differ by in light
//! over longer distances is levelled out by a correction given at the nodes ([`super::levelling`]).

use super::draw::NO_FRAME;
use super::labels;
use super::levelling;
use super::thumbnails::Thumbnails;
use super::warp::RUN;
use super::{Canvas, Exposure, Placement, Tile};
use crate::surface::Surface;

/// Distance of the grid's nodes, canvas pixels, unless the panorama is so large that the grid would need more memory
/// than it may have.
pub const STEP_PX: f64 = 8.0;

/// Which frame shows what.
#[derive(Clone, Debug)]
pub struct Seams {
    grid: Canvas,
    /// The frame of each node, row-major; [`NO_FRAME`] where none sees the wall.
    labels: Vec<u32>,
    /// What is added to the frames' values at each node, `channels` numbers; nothing at all where frames stay as they are.
    corrections: Vec<f32>,
    channels: usize,
}

/// A place between two nodes along one axis.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    before: usize,
    after: usize,
    /// How far from the one to the other, 0 to 1.
    t: f32,
}

impl Seams {
    /// Finds the best frame for each node of `grid`, by thumbnails whose exposure is undone; with `blend`, also the
    /// correction. `white`: full scale of the frames.
    pub fn find(
        surface: &dyn Surface,
        thumbnails: &Thumbnails,
        exposure: &Exposure,
        placements: &[Placement],
        grid: Canvas,
        blend: Option<f32>,
    ) -> Self {
        let labels = labels::best(surface, thumbnails, exposure, placements, &grid);
        let channels = thumbnails.channels();
        let corrections = match blend {
            Some(white) => {
                levelling::corrections(surface, thumbnails, exposure, placements, &grid, &labels, white)
            }
            None => Vec::new(),
        };
        Self {
            grid,
            labels,
            corrections,
            channels,
        }
    }

    /// The grid.
    pub fn grid(&self) -> &Canvas {
        &self.grid
    }

    /// The frame of each node, row-major.
    pub fn labels(&self) -> &[u32] {
        &self.labels
    }

    /// Memory of the grid while it is made, bytes a node.
    pub fn bytes_per_node(channels: usize) -> u64 {
        // Labels; composite, corrections and those of the coarser grids.
        (4 + 4 * (channels + 3 * (channels + 1))) as u64
    }

    fn frame(&self, row: usize, column: usize) -> u32 {
        self.labels[row * self.grid.columns as usize + column]
    }

    /// The frames that a tile may be drawn from, in their order.
    pub fn frames_of(&self, canvas: &Canvas, tile: &Tile) -> Vec<usize> {
        let columns = self.columns_of(canvas, tile);
        let mut frames = Vec::new();
        let mut rows: Vec<usize> = (tile.row..tile.row + tile.rows)
            .flat_map(|row| {
                let between = self.row_of(canvas, row);
                [between.before, between.after]
            })
            .collect();
        rows.dedup();
        let mut open = false;
        for row in rows {
            for between in &columns {
                for column in [between.before, between.after] {
                    match self.frame(row, column) {
                        NO_FRAME => open = true,
                        frame => {
                            if frames.last() != Some(&(frame as usize)) {
                                frames.push(frame as usize);
                            }
                        }
                    }
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

    /// Where the columns of a tile lie between the nodes.
    pub fn columns_of(&self, canvas: &Canvas, tile: &Tile) -> Vec<Between> {
        let count = self.grid.columns as usize;
        let scale = f64::from(self.grid.columns) / f64::from(canvas.columns);
        let between = |column: u32| {
            let at = (f64::from(column) + 0.5) * scale - 0.5;
            let before = at.floor();
            Between {
                before: (before as i64).rem_euclid(count as i64) as usize,
                after: (before as i64 + 1).rem_euclid(count as i64) as usize,
                t: (at - before) as f32,
            }
        };
        (tile.column..tile.column + tile.columns)
            .map(between)
            .collect()
    }

    /// Where a row of the canvas lies between the nodes.
    pub fn row_of(&self, canvas: &Canvas, row: u32) -> Between {
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

    /// Calls `draw(frame, from, to, weights)` for all frames that the columns `from..to` of a row are made of.
    ///
    /// Without blending each pixel is one frame's, the one with the largest weight.
    #[inline(always)]
    pub fn shares(
        &self,
        columns: &[Between],
        row: &Between,
        mut draw: impl FnMut(usize, usize, usize, &[f32]),
    ) {
        let ones = [1.0f32; RUN];
        let mut run: Option<(u32, usize)> = None;
        let mut from = 0;
        while from < columns.len() {
            let cell = &columns[from];
            let mut to = from + 1;
            while to < columns.len() && columns[to].before == cell.before {
                to += 1;
            }
            let corners = [
                self.frame(row.before, cell.before),
                self.frame(row.before, cell.after),
                self.frame(row.after, cell.before),
                self.frame(row.after, cell.after),
            ];
            let uniform = corners.iter().all(|frame| *frame == corners[0]);
            if let Some((frame, start)) = run
                && !(uniform && corners[0] == frame)
            {
                draw(frame as usize, start, from, &ones);
                run = None;
            }
            if uniform {
                if run.is_none() && corners[0] != NO_FRAME {
                    run = Some((corners[0], from));
                }
            } else {
                self.mixed(&corners, &columns[from..to], row, from, &mut draw);
            }
            from = to;
        }
        if let Some((frame, start)) = run {
            draw(frame as usize, start, columns.len(), &ones);
        }
    }

    /// A cell with different frames at its corners.
    #[inline(always)]
    fn mixed(
        &self,
        corners: &[u32; 4],
        columns: &[Between],
        row: &Between,
        from: usize,
        draw: &mut impl FnMut(usize, usize, usize, &[f32]),
    ) {
        let hard = self.corrections.is_empty();
        let mut frames = *corners;
        frames.sort_unstable();
        let mut shares = [[0.0f32; RUN]; 4];
        for (k, between) in columns.iter().enumerate() {
            let (s, t) = (between.t, row.t);
            let weights = [
                (1.0 - s) * (1.0 - t),
                s * (1.0 - t),
                (1.0 - s) * t,
                s * t,
            ];
            let mut best = 0;
            for (n, frame) in frames.iter().enumerate() {
                // Each frame once.
                if *frame == NO_FRAME || n > 0 && frames[n - 1] == *frame {
                    continue;
                }
                for (corner, w) in corners.iter().zip(weights) {
                    if corner == frame {
                        shares[n][k] += w;
                    }
                }
                if shares[n][k] > shares[best][k] {
                    best = n;
                }
            }
            if hard {
                for (n, share) in shares.iter_mut().enumerate() {
                    share[k] = if n == best { 1.0 } else { 0.0 };
                }
            }
        }
        for (n, frame) in frames.iter().enumerate() {
            if *frame != NO_FRAME && (n == 0 || frames[n - 1] != *frame) {
                draw(*frame as usize, from, from + columns.len(), &shares[n]);
            }
        }
    }

    /// What is added to the values at a place.
    #[inline(always)]
    pub fn correction(&self, column: &Between, row: &Between) -> [f32; 4] {
        let mut sum = [0.0; 4];
        if self.corrections.is_empty() {
            return sum;
        }
        let (s, t) = (column.t, row.t);
        let corners = [
            (row.before, column.before, (1.0 - s) * (1.0 - t)),
            (row.before, column.after, s * (1.0 - t)),
            (row.after, column.before, (1.0 - s) * t),
            (row.after, column.after, s * t),
        ];
        for (i, j, w) in corners {
            let node = (i * self.grid.columns as usize + j) * self.channels;
            for (sum, value) in sum.iter_mut().zip(&self.corrections[node..][..self.channels]) {
                *sum += w * value;
            }
        }
        sum
    }
}
