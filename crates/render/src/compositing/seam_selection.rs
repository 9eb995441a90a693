//! Selection of the frame that shows each place of the wall, with seams where frames agree.
//!
//! Each node p of the grid is given to one frame `l_p`, so that
//!
//! `E = Σ_p D_p(l_p) + Σ_{p,q neighbours} V_pq(l_p, l_q)`
//!
//! is small. D prefers frames that show the wall finely and squarely, away from their edges, and
//! that agree with the others; V is zero between nodes of the same frame, else the cost of a seam's
//! length and of the two frames' difference on both sides of it.
//!
//! Rows and columns of nodes are solved one at a time with their neighbours fixed, by dynamic
//! programming (Viterbi). A row is cut open at θ = 0, where its ends are fixed to their previous
//! values. Every other row is solved at once, which does not depend on the number of threads.
//!
//! Sources: J. Davis, "Mosaics of scenes with moving objects", CVPR 1998 (seams where pictures
//! agree); A. Agarwala et al., "Interactive digital photomontage", SIGGRAPH 2004 (the energy).

use crate::layout::canvas::Canvas;
use crate::layout::placement::{NO_FRAME, Placement};
use crate::layout::tiles::{Tile, tiles};
use crate::sampling::exposure::Exposure;
use crate::sampling::point_batch::{MAX_BATCH_POINTS, PointBatch};
use crate::sampling::thumbnails::Thumbnails;
use crate::warp::projection::LocalPoints;
use tunnelstitch_geometry::numerics::median::median;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Surface, WallFrame};

/// Edge of a tile of nodes: the parts of frames that show them stay in the second-level cache.
const TILE_EDGE: u32 = 32;
/// Frames that a node chooses among. A higher value finds better seams and is slower.
const MAX_CANDIDATES: usize = 3;
/// 1-σ of the difference of frames that agree, grey levels of 255. A higher value tolerates larger
/// differences.
const DIFFERENCE_SIGMA: f32 = 2.0;
/// Cost of half the resolution. A higher value prefers sharp frames over short seams.
const HALF_RESOLUTION_COST: f32 = 2.0;
/// Cost at a frame's very edge. A higher value keeps seams away from frames' edges.
const EDGE_COST: f32 = 2.0;
/// Distance from the edge at which that cost begins, as a share of half the width or height.
const EDGE_WIDTH: f32 = 0.15;
/// Nodes to each side that belong to a node's neighbourhood.
const NEIGHBOURHOOD_NODES: usize = 4;
/// Cost of one σ, beyond the first two, that a frame is farther from the median of all frames than
/// the nearest one. A higher value leaves out more of what moves.
const OUTLIER_COST: f32 = 1.0;
/// Largest cost of such an outlier.
const MAX_OUTLIER_COST: f32 = 12.0;
/// Cost of being clipped white.
const CLIPPING_COST: f32 = 4.0;
/// Grey level of 255 above which a frame counts as clipped.
const CLIPPING_GREY: f32 = 250.0;
/// Cost of one step of a seam. A higher value makes shorter seams.
const SEAM_STEP_COST: f32 = 0.5;
/// Cost of one σ that the frames differ by along a seam. A higher value moves seams to where frames
/// agree.
const DIFFERENCE_COST: f32 = 0.5;
/// Largest cost of such a difference, or where frames cannot be compared.
const MAX_DIFFERENCE_COST: f32 = 6.0;

/// A frame that a node may be given to.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Candidate {
    frame: u32,
    /// D.
    cost: f32,
    /// Grey value there, of 255.
    grey: f32,
}

const NO_CANDIDATE: Candidate = Candidate {
    frame: NO_FRAME,
    cost: 0.0,
    grey: 0.0,
};

/// Candidates of a node, the best first; [`NO_CANDIDATE`] where there are no more.
type Candidates = [Candidate; MAX_CANDIDATES];

/// Inputs from which frames are observed at nodes.
struct FrameObserver<'a> {
    surface: &'a dyn Surface,
    thumbnails: &'a Thumbnails,
    exposure: &'a Exposure,
    placements: &'a [Placement],
}

/// Selects the frame of each node of `grid`, row-major; [`NO_FRAME`] where no thumbnail shows the
/// wall.
pub fn select_frames(
    surface: &dyn Surface,
    thumbnails: &Thumbnails,
    exposure: &Exposure,
    placements: &[Placement],
    grid: &Canvas,
) -> Vec<u32> {
    let columns = grid.columns as usize;
    let observer = FrameObserver {
        surface,
        thumbnails,
        exposure,
        placements,
    };
    let mut labels: Vec<u32> = Vec::with_capacity(grid.pixels());
    // Band by band, each with the one before fixed.
    for band in tiles(surface, grid, placements, TILE_EDGE) {
        let parts: Vec<Vec<Candidates>> =
            band.par_map(|tile| node_candidates(&observer, grid, tile));
        let rows = band.first().map_or(0, |tile| tile.rows as usize);
        let mut candidates = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            for (tile, part) in band.iter().zip(&parts) {
                let width = tile.columns as usize;
                candidates.extend_from_slice(&part[row * width..][..width]);
            }
        }
        let above = labels.len().checked_sub(columns);
        let above = above.map(|start| labels[start..].to_vec());
        let mut labelling = NodeLabelling {
            columns,
            candidates,
            chosen: vec![0; rows * columns],
        };
        labelling.optimise(above.as_deref());
        let chosen = labelling.candidates.iter().zip(&labelling.chosen);
        labels.extend(chosen.map(|(candidates, chosen)| candidates[*chosen as usize].frame));
    }
    labels
}

/// Finds the best candidates of a tile's nodes.
fn node_candidates(observer: &FrameObserver, grid: &Canvas, tile: &Tile) -> Vec<Candidates> {
    let frame_of = |wall| observer.surface.frame(wall);
    let walls: Vec<WallFrame> = tile.walls(grid).map(frame_of).collect();
    let points: Vec<_> = walls.iter().map(|wall| wall.x_w).collect();
    let points = LocalPoints::new(&points);
    let frames = tile.frames.iter();
    let observations: Vec<Vec<NodeObservation>> = frames
        .map(|frame| observer.observe_nodes(*frame, tile, &points, &walls))
        .collect();
    // Node by node, in the order of the frames.
    let seen = |node: usize| {
        let own = tile.frames.iter().zip(&observations);
        own.map(move |(frame, observations)| (*frame, observations[node]))
            .filter(|(_, observation)| observation.fineness > 0.0)
    };
    let mut greys = Vec::new();
    let middles: Vec<f32> = (0..walls.len())
        .map(|node| {
            greys.clear();
            greys.extend(seen(node).map(|(_, observation)| observation.grey));
            median(&mut greys)
        })
        .collect();
    let mut found: Vec<Candidate> = Vec::new();
    (0..walls.len())
        .map(|node| {
            let (mut finest, mut count) = (0.0f32, 0);
            for (_, observation) in seen(node) {
                finest = finest.max(observation.fineness);
                count += 1;
            }
            // Of two that differ, neither is nearer to their median: the neighbourhood decides.
            let usual = match count {
                2 => neighbourhood_mean(&middles, tile.columns as usize, node),
                _ => middles[node],
            };
            let least = seen(node).map(|(_, observation)| (observation.grey - usual).abs());
            let least = least.fold(f32::INFINITY, f32::min);
            found.clear();
            found.extend(seen(node).map(|(frame, observation)| {
                let mut cost = HALF_RESOLUTION_COST * (finest / observation.fineness).log2();
                cost += EDGE_COST * (1.0 - observation.inset / EDGE_WIDTH).max(0.0);
                let off = ((observation.grey - usual).abs() - least) / DIFFERENCE_SIGMA - 2.0;
                cost += (OUTLIER_COST * off.max(0.0)).min(MAX_OUTLIER_COST);
                if observation.raw > CLIPPING_GREY {
                    cost += CLIPPING_COST;
                }
                Candidate {
                    frame: frame as u32,
                    cost,
                    grey: observation.grey,
                }
            }));
            // Stable: of equals the earlier frame.
            found.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            std::array::from_fn(|k| found.get(k).copied().unwrap_or(NO_CANDIDATE))
        })
        .collect()
}

/// Mean of the values (those there are) in a square of [`NEIGHBOURHOOD_NODES`] nodes to each side
/// of a node.
fn neighbourhood_mean(values: &[f32], columns: usize, node: usize) -> f32 {
    let rows = values.len() / columns.max(1);
    let near = |at: usize, size: usize| {
        at.saturating_sub(NEIGHBOURHOOD_NODES)..(at + NEIGHBOURHOOD_NODES + 1).min(size)
    };
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

/// Observation of a node by a frame.
#[derive(Clone, Copy, Debug, Default)]
struct NodeObservation {
    /// Resolution, pixels per length of wall along the direction in which it is lowest, in units of
    /// the focal length; 0: does not show it.
    fineness: f32,
    /// Distance from the nearest edge, of half the width or height.
    inset: f32,
    /// Grey value of 255, exposure undone.
    grey: f32,
    /// Grey value of 255 of the frame itself.
    raw: f32,
}

impl FrameObserver<'_> {
    /// Observes a tile's nodes in a frame.
    fn observe_nodes(
        &self,
        frame: usize,
        tile: &Tile,
        points: &LocalPoints,
        walls: &[WallFrame],
    ) -> Vec<NodeObservation> {
        let (thumbnails, placements) = (self.thumbnails, self.placements);
        let camera = thumbnails.cameras().of(frame);
        let pose = &placements[frame].pose;
        let view = thumbnails.view(frame, &placements[frame], points);
        let response = self.exposure.of(frame);
        let format = thumbnails.format();
        let forwards = pose.r_wc * nalgebra::Vector3::z();
        let columns = tile.columns as usize;
        let mut batch = PointBatch::default();
        let mut raw = [[0.0; 4]; MAX_BATCH_POINTS];
        let mut found = vec![NodeObservation::default(); walls.len()];
        for row in 0..tile.rows as usize {
            let start = row * columns;
            view.look_at(&mut batch, start, columns);
            raw[..columns].copy_from_slice(&batch.values()[..columns]);
            response.undo(&mut batch, 0..columns);
            let (u, v) = batch.pixels();
            for k in 0..columns {
                if !batch.seen()[k] {
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
                found[start + k] = NodeObservation {
                    fineness: fineness as f32,
                    inset: inset(u[k], camera.width).min(inset(v[k], camera.height)),
                    grey: format.grey(batch.values()[k]),
                    raw: format.grey(raw[k]),
                };
            }
        }
        found
    }
}

/// Nodes of a band and their chosen candidates.
struct NodeLabelling {
    columns: usize,
    candidates: Vec<Candidates>,
    /// Index of each node's chosen candidate.
    chosen: Vec<u8>,
}

impl NodeLabelling {
    /// Solves columns, then rows; `above`: the frames of the row above, which stay.
    fn optimise(&mut self, above: Option<&[u32]>) {
        let (columns, rows) = (self.columns, self.candidates.len() / self.columns.max(1));
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
        let solved: Vec<Vec<u8>> = lines.par_map(|line| self.viterbi(line, above));
        for (line, solved) in lines.iter().zip(solved) {
            for (node, chosen) in line.iter().zip(solved) {
                self.chosen[*node] = chosen;
            }
        }
    }

    /// Finds the best candidates along a line, all other nodes fixed.
    fn viterbi(&self, line: &[usize], above: Option<&[u32]>) -> Vec<u8> {
        let mut costs = [0.0f32; MAX_CANDIDATES];
        let mut back: Vec<[u8; MAX_CANDIDATES]> = Vec::with_capacity(line.len());
        for (n, node) in line.iter().enumerate() {
            let before = n.checked_sub(1).map(|n| line[n]);
            let after = line.get(n + 1).copied();
            let own = &self.candidates[*node];
            let mut next = self.fixed_neighbour_costs(*node, before, after, above);
            let mut from = [0u8; MAX_CANDIDATES];
            for (next, candidate) in next.iter_mut().zip(own) {
                *next += candidate.cost;
            }
            if let Some(before) = before {
                let seams = seam_costs(&self.candidates[before], own);
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
            // A missing candidate is not chosen, unless there is none at all.
            for (next, candidate) in next.iter_mut().zip(own).skip(1) {
                if candidate.frame == NO_FRAME {
                    *next = f32::INFINITY;
                }
            }
            costs = next;
            back.push(from);
        }
        let mut k = (0..MAX_CANDIDATES)
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

    /// Cost of seams between each candidate of a node and those neighbours that are fixed.
    fn fixed_neighbour_costs(
        &self,
        node: usize,
        before: Option<usize>,
        after: Option<usize>,
        above: Option<&[u32]>,
    ) -> [f32; MAX_CANDIDATES] {
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
            Some(node + columns).filter(|below| *below < self.candidates.len()),
        ];
        let mut costs = [0.0; MAX_CANDIDATES];
        for other in neighbours.into_iter().flatten() {
            if Some(other) != before && Some(other) != after && other != node {
                let seams = seam_costs(&self.candidates[node], &self.candidates[other]);
                let chosen = usize::from(self.chosen[other]);
                for (cost, seams) in costs.iter_mut().zip(&seams) {
                    *cost += seams[chosen];
                }
            }
        }
        if let (0, Some(above)) = (row, above) {
            for (cost, candidate) in costs.iter_mut().zip(&self.candidates[node]) {
                if above[column] != candidate.frame {
                    *cost += SEAM_STEP_COST;
                }
            }
        }
        costs
    }
}

/// Cost V of two neighbours for each candidate of the first and each of the second.
#[inline]
fn seam_costs(first: &Candidates, second: &Candidates) -> [[f32; MAX_CANDIDATES]; MAX_CANDIDATES] {
    // Grey values of each frame of the second at the first, and vice versa; NaN where they are not
    // known.
    let (mut at_first, mut at_second) = ([f32::NAN; MAX_CANDIDATES], [f32::NAN; MAX_CANDIDATES]);
    for (a, there) in first.iter().zip(&mut at_second) {
        for (b, here) in second.iter().zip(&mut at_first) {
            if a.frame == b.frame {
                (*here, *there) = (a.grey, b.grey);
            }
        }
    }
    let difference = |shown: f32, grey: f32| {
        // The least of NaN and a number is the number.
        (DIFFERENCE_COST / DIFFERENCE_SIGMA * (shown - grey).abs()).min(MAX_DIFFERENCE_COST)
    };
    let mut seams = [[0.0; MAX_CANDIDATES]; MAX_CANDIDATES];
    for (k, a) in first.iter().enumerate() {
        for (j, b) in second.iter().enumerate() {
            let same = a.frame == b.frame || a.frame == NO_FRAME || b.frame == NO_FRAME;
            let cost =
                SEAM_STEP_COST + difference(at_first[j], a.grey) + difference(at_second[k], b.grey);
            seams[k][j] = if same { 0.0 } else { cost };
        }
    }
    seams
}
