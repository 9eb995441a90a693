//! The frame that shows a place of the wall best, with seams where frames agree.
//!
//! Each node p of the grid is given to one frame `l_p`, so that
//!
//! `E = Σ_p D_p(l_p) + Σ_{p,q neighbours} V_pq(l_p, l_q)`
//!
//! is small. D prefers frames that show the wall finely and squarely, away from their edges, and
//! that show what the others show, too; V is zero between nodes of the same frame, else a seam's
//! length and what the two frames differ by on both sides of it.
//!
//! Rows and columns of nodes are solved one at a time with their neighbours held, by dynamic
//! programming (Viterbi). A row is cut open at θ = 0, where its ends are held to what they were.
//! Every other row at once, which does not depend on the number of threads.
//!
//! Sources: J. Davis, "Mosaics of scenes with moving objects", CVPR 1998 (seams where pictures
//! agree); A. Agarwala et al., "Interactive digital photomontage", SIGGRAPH 2004 (the energy).

use crate::numerics::median::median;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::{NO_FRAME, Placement};
use crate::render::layout::tiles::{Tile, tiles};
use crate::render::sampling::exposure::Exposure;
use crate::render::sampling::point_batch::{RUN, Run};
use crate::render::sampling::thumbnails::Thumbnails;
use crate::render::warp::projection::Points;
use crate::surface::{Surface, WallFrame};
use rayon::prelude::*;

/// Edge of a tile of nodes: what its frames show of them stays in the second-level cache.
const TILE: u32 = 32;
/// Frames that a node chooses among.
const CHOICES: usize = 3;
/// Grey levels (of 255) that frames differ by without reason.
const SIGMA: f32 = 2.0;
/// Cost of half the resolution.
const RESOLUTION: f32 = 2.0;
/// Cost at a frame's very edge, ...
const EDGE: f32 = 2.0;
/// ... which begins at this share of half its width or height from it.
const EDGE_SHARE: f32 = 0.15;
/// Nodes to each side that are a node's surroundings.
const AROUND: usize = 4;
/// Cost of one σ beyond the first two that a frame is farther from the median of all frames than
/// the nearest, ...
const OUTLIER: f32 = 1.0;
/// ... and of the most.
const MOST_OUTLYING: f32 = 12.0;
/// Cost of being clipped white.
const CLIPPED: f32 = 4.0;
/// Grey level (of 255) from which a frame is taken for clipped.
const WHITE: f32 = 250.0;
/// Cost of one step of a seam, ...
const SEAM: f32 = 0.5;
/// ... of one σ that the frames differ by along it, ...
const DIFFERENCE: f32 = 0.5;
/// ... and of the most, or where they cannot be compared.
const MOST_DIFFERENT: f32 = 6.0;

/// A frame that a node may be given to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Choice {
    frame: u32,
    /// D.
    cost: f32,
    /// Grey value there, of 255.
    grey: f32,
}

const NONE: Choice = Choice {
    frame: NO_FRAME,
    cost: 0.0,
    grey: 0.0,
};

/// The choices of a node, the best first; [`NONE`] where there are no more.
type Choices = [Choice; CHOICES];

/// What nodes are looked at with.
struct Eyes<'a> {
    surface: &'a dyn Surface,
    thumbnails: &'a Thumbnails,
    exposure: &'a Exposure,
    placements: &'a [Placement],
}

/// The frame of each node of `grid`, row-major; [`NO_FRAME`] where no thumbnail shows the wall.
pub fn best(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    exposure: &Exposure,
    placements: &[Placement],
    grid: &Canvas,
) -> Vec<u32> {
    let columns = grid.columns as usize;
    let eyes = Eyes {
        surface,
        thumbnails,
        exposure,
        placements,
    };
    let mut labels: Vec<u32> = Vec::with_capacity(grid.pixels());
    // Band by band, each held to the one before.
    for band in tiles(surface, grid, placements, TILE) {
        let parts: Vec<Vec<Choices>> = band
            .par_iter()
            .map(|tile| choices(&eyes, grid, tile))
            .collect();
        let rows = band.first().map_or(0, |tile| tile.rows as usize);
        let mut choices = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            for (tile, part) in band.iter().zip(&parts) {
                let width = tile.columns as usize;
                choices.extend_from_slice(&part[row * width..][..width]);
            }
        }
        let above = labels.len().checked_sub(columns);
        let above = above.map(|start| labels[start..].to_vec());
        let mut lattice = Lattice {
            columns,
            choices,
            chosen: vec![0; rows * columns],
        };
        lattice.settle(above.as_deref());
        let chosen = lattice.choices.iter().zip(&lattice.chosen);
        labels.extend(chosen.map(|(choices, chosen)| choices[*chosen as usize].frame));
    }
    labels
}

/// The best choices of a tile's nodes.
fn choices(eyes: &Eyes, grid: &Canvas, tile: &Tile) -> Vec<Choices> {
    let frame_of = |wall| eyes.surface.frame(wall);
    let walls: Vec<WallFrame> = tile.walls(grid).map(frame_of).collect();
    let points: Vec<_> = walls.iter().map(|wall| wall.x_w).collect();
    let points = Points::new(&points);
    let frames = tile.frames.iter();
    let sights: Vec<Vec<Sight>> = frames
        .map(|frame| eyes.sights(*frame, tile, &points, &walls))
        .collect();
    // Node by node, in the order of the frames.
    let seen = |node: usize| {
        let own = tile.frames.iter().zip(&sights);
        own.map(move |(frame, sights)| (*frame, sights[node]))
            .filter(|(_, sight)| sight.fineness > 0.0)
    };
    let mut greys = Vec::new();
    let middles: Vec<f32> = (0..walls.len())
        .map(|node| {
            greys.clear();
            greys.extend(seen(node).map(|(_, sight)| sight.grey));
            median(&mut greys)
        })
        .collect();
    let mut found: Vec<Choice> = Vec::new();
    (0..walls.len())
        .map(|node| {
            let (mut finest, mut count) = (0.0f32, 0);
            for (_, sight) in seen(node) {
                finest = finest.max(sight.fineness);
                count += 1;
            }
            // Of two that differ, neither is nearer to their median: what is around decides.
            let usual = match count {
                2 => surroundings(&middles, tile.columns as usize, node),
                _ => middles[node],
            };
            let least = seen(node).map(|(_, sight)| (sight.grey - usual).abs());
            let least = least.fold(f32::INFINITY, f32::min);
            found.clear();
            found.extend(seen(node).map(|(frame, sight)| {
                let mut cost = RESOLUTION * (finest / sight.fineness).log2();
                cost += EDGE * (1.0 - sight.inset / EDGE_SHARE).max(0.0);
                let off = ((sight.grey - usual).abs() - least) / SIGMA - 2.0;
                cost += (OUTLIER * off.max(0.0)).min(MOST_OUTLYING);
                if sight.raw > WHITE {
                    cost += CLIPPED;
                }
                Choice {
                    frame: frame as u32,
                    cost,
                    grey: sight.grey,
                }
            }));
            // Stable: of equals the earlier frame.
            found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            std::array::from_fn(|k| found.get(k).copied().unwrap_or(NONE))
        })
        .collect()
}

/// Mean of the values (those there are) in a square of [`AROUND`] nodes to each side of a node.
fn surroundings(values: &[f32], columns: usize, node: usize) -> f32 {
    let rows = values.len() / columns.max(1);
    let near = |at: usize, size: usize| at.saturating_sub(AROUND)..(at + AROUND + 1).min(size);
    let (mut sum, mut count) = (0.0, 0.0);
    for row in near(node / columns, rows) {
        for value in &values[row * columns..][near(node % columns, columns)] {
            if !value.is_nan() {
                sum += value;
                count += 1.0;
            }
        }
    }
    sum / count
}

/// What a frame shows of a node.
#[derive(Clone, Copy, Debug, Default)]
struct Sight {
    /// Pixels per length of wall along the direction in which they are fewest, in units of the
    /// focal length; 0: does not show it.
    fineness: f32,
    /// Distance from the nearest edge, of half the width or height.
    inset: f32,
    /// Grey value of 255, exposure undone, ...
    grey: f32,
    /// ... and as it is.
    raw: f32,
}

impl Eyes<'_> {
    /// What a frame shows of a tile's nodes.
    fn sights(
        &self,
        frame: usize,
        tile: &Tile,
        points: &Points,
        walls: &[WallFrame],
    ) -> Vec<Sight> {
        let (thumbnails, placements) = (self.thumbnails, self.placements);
        let camera = thumbnails.camera();
        let pose = &placements[frame].pose;
        let view = thumbnails.view(frame, &placements[frame], points);
        let response = self.exposure.of(frame);
        let format = thumbnails.format();
        let forwards = pose.r_wc * nalgebra::Vector3::z();
        let columns = tile.columns as usize;
        let mut run = Run::default();
        let mut raw = [[0.0; 4]; RUN];
        let mut found = vec![Sight::default(); walls.len()];
        for row in 0..tile.rows as usize {
            let start = row * columns;
            view.look_at(&mut run, start, columns);
            raw[..columns].copy_from_slice(&run.values()[..columns]);
            response.undo(&mut run, 0..columns);
            let (u, v) = run.pixels();
            for k in 0..columns {
                if !run.seen()[k] {
                    continue;
                }
                // On a plane at distance d from the camera, at the point x: f cos α/|x| with cos α
                // = d/|x| across, f/z along: the least is d f/(z |x|) up to the angle between the
                // view and the optical axis.
                let wall = &walls[start + k];
                let ray = wall.x_w - pose.t_wc;
                let normal = wall.e_s.cross(&wall.e_h);
                let fineness = ray.dot(&normal).abs() / (ray.dot(&forwards) * ray.norm());
                let inset = |at: f32, last: u32| {
                    let last = (last - 1) as f32;
                    at.min(last - at) * 2.0 / last
                };
                found[start + k] = Sight {
                    fineness: fineness as f32,
                    inset: inset(u[k], camera.width).min(inset(v[k], camera.height)),
                    grey: format.grey(run.values()[k]),
                    raw: format.grey(raw[k]),
                };
            }
        }
        found
    }
}

/// Nodes of a band and what they chose.
struct Lattice {
    columns: usize,
    choices: Vec<Choices>,
    /// Which of its choices each node has taken.
    chosen: Vec<u8>,
}

impl Lattice {
    /// Solves columns, then rows; `above`: the frames of the row above, which stay.
    fn settle(&mut self, above: Option<&[u32]>) {
        let (columns, rows) = (self.columns, self.choices.len() / self.columns.max(1));
        for parity in 0..2 {
            let lines: Vec<Vec<usize>> = (parity..columns)
                .step_by(2)
                .map(|column| (0..rows).map(|row| row * columns + column).collect())
                .collect();
            self.solve(&lines, above);
        }
        for parity in 0..2 {
            let lines: Vec<Vec<usize>> = (parity..rows)
                .step_by(2)
                .map(|row| (row * columns..(row + 1) * columns).collect())
                .collect();
            self.solve(&lines, above);
        }
    }

    /// Solves lines of nodes that are no neighbours of one another.
    fn solve(&mut self, lines: &[Vec<usize>], above: Option<&[u32]>) {
        let solved: Vec<Vec<u8>> = lines
            .par_iter()
            .map(|line| self.viterbi(line, above))
            .collect();
        for (line, solved) in lines.iter().zip(solved) {
            for (node, chosen) in line.iter().zip(solved) {
                self.chosen[*node] = chosen;
            }
        }
    }

    /// The best choices along a line, all other nodes held.
    fn viterbi(&self, line: &[usize], above: Option<&[u32]>) -> Vec<u8> {
        let mut costs = [0.0f32; CHOICES];
        let mut back: Vec<[u8; CHOICES]> = Vec::with_capacity(line.len());
        for (n, node) in line.iter().enumerate() {
            let before = n.checked_sub(1).map(|n| line[n]);
            let after = line.get(n + 1).copied();
            let own = &self.choices[*node];
            let mut next = self.held(*node, before, after, above);
            let mut from = [0u8; CHOICES];
            for (next, choice) in next.iter_mut().zip(own) {
                *next += choice.cost;
            }
            if let Some(before) = before {
                let seams = seams(&self.choices[before], own);
                for (k, next) in next.iter_mut().enumerate() {
                    let mut best = (f32::INFINITY, 0);
                    for (j, cost) in costs.iter().enumerate() {
                        let cost = cost + seams[j][k];
                        if cost < best.0 {
                            best = (cost, j as u8);
                        }
                    }
                    *next += best.0;
                    from[k] = best.1;
                }
            }
            // What is no choice is not taken, unless there is none.
            for (next, choice) in next.iter_mut().zip(own).skip(1) {
                if choice.frame == NO_FRAME {
                    *next = f32::INFINITY;
                }
            }
            costs = next;
            back.push(from);
        }
        let mut k = (0..CHOICES)
            .min_by(|a, b| costs[*a].total_cmp(&costs[*b]))
            .unwrap_or(0) as u8;
        let mut chosen: Vec<u8> = back
            .iter()
            .rev()
            .map(|from| {
                let own = k;
                k = from[usize::from(own)];
                own
            })
            .collect();
        chosen.reverse();
        chosen
    }

    /// Seams between each choice of a node and those neighbours that are held.
    fn held(
        &self,
        node: usize,
        before: Option<usize>,
        after: Option<usize>,
        above: Option<&[u32]>,
    ) -> [f32; CHOICES] {
        let columns = self.columns;
        let (row, column) = (node / columns, node % columns);
        let start = row * columns;
        let right = if column + 1 < columns {
            node + 1
        } else {
            start
        };
        let left = if column > 0 {
            node - 1
        } else {
            start + columns - 1
        };
        let neighbours = [
            Some(right),
            Some(left),
            node.checked_sub(columns),
            Some(node + columns).filter(|below| *below < self.choices.len()),
        ];
        let mut costs = [0.0; CHOICES];
        for other in neighbours.into_iter().flatten() {
            if Some(other) != before && Some(other) != after && other != node {
                let seams = seams(&self.choices[node], &self.choices[other]);
                let chosen = usize::from(self.chosen[other]);
                for (cost, seams) in costs.iter_mut().zip(&seams) {
                    *cost += seams[chosen];
                }
            }
        }
        if let (0, Some(above)) = (row, above) {
            for (cost, choice) in costs.iter_mut().zip(&self.choices[node]) {
                if above[column] != choice.frame {
                    *cost += SEAM;
                }
            }
        }
        costs
    }
}

/// V of two neighbours for each choice of the first and each of the second.
#[inline]
fn seams(first: &Choices, second: &Choices) -> [[f32; CHOICES]; CHOICES] {
    // What each frame of the second shows at the first, and the other way round; NaN where that is
    // not known.
    let (mut at_first, mut at_second) = ([f32::NAN; CHOICES], [f32::NAN; CHOICES]);
    for (a, there) in first.iter().zip(&mut at_second) {
        for (b, here) in second.iter().zip(&mut at_first) {
            if a.frame == b.frame {
                (*here, *there) = (a.grey, b.grey);
            }
        }
    }
    let difference = |shown: f32, grey: f32| {
        // The least of NaN and a number is the number.
        (DIFFERENCE / SIGMA * (shown - grey).abs()).min(MOST_DIFFERENT)
    };
    let mut seams = [[0.0; CHOICES]; CHOICES];
    for (k, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            let same = a.frame == b.frame || a.frame == NO_FRAME || b.frame == NO_FRAME;
            let cost = SEAM + difference(at_first[j], a.grey) + difference(at_second[k], b.grey);
            seams[k][j] = if same { 0.0 } else { cost };
        }
    }
    seams
}
