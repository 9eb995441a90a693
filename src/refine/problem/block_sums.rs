//! What a block of the wall adds to the normal equations.

use super::{FrameShare, Problem};
use crate::camera::Camera;
use crate::numerics::simd_dispatch::dispatch_simd;
use crate::refine::estimate::{FrameStep, UNKNOWNS};
use crate::refine::grid::TilePoints;
use crate::refine::lens::LensSums;
use crate::refine::normal::{Block, NormalEquations, Pattern};
use crate::refine::tile::{ObserverMoments, SAMPLES, TileMoments, TileWork, Weighing};
use crate::refine::view::View;
use crate::refine::visibility::{Tile, Visibility};
use nalgebra::{Matrix2x6, Matrix4, SMatrix};
use std::ops::Range;

impl Problem<'_> {
    /// Sums over the tiles of one block, for the few active frames that see it.
    pub fn sum_block(
        &self,
        stretch: usize,
        visibility: &Visibility,
        block: &Range<usize>,
        views: &[View],
        lens: &Camera,
    ) -> BlockSums {
        let tiles = &visibility.tiles[block.clone()];
        let stretch_slots: Vec<Option<usize>> = self
            .coverage
            .frames(stretch)
            .iter()
            .map(|k| self.slot(*k))
            .collect();
        let frames = visibility.frames(block).into_iter();
        let slots = frames.filter_map(|k| stretch_slots[k]).collect();
        let mut sums = BlockSums::new(slots, self.calibrates);
        let mut work = TileWork::default();
        let mut scratch = Vec::new();
        let spacing = (self.grid.spacing_s_m, self.grid.spacing_h_m);
        let weighing = Weighing {
            noise: &self.noise,
            by_variance: self.sampling.by_variance,
            fused: self.scene.fused_gradient,
            denoiser: self.denoiser.as_ref(),
        };
        let mut summed: Vec<TileSums> = Vec::with_capacity(tiles.len());
        let mut add = |tile: &Tile, points: &TilePoints, found: &TileMoments| {
            let observers = visibility.observers(tile);
            let mut columns = Vec::with_capacity(observers.len());
            for (k, (observer, moments)) in observers.iter().zip(&found.observers).enumerate() {
                sums.cost += moments.cost;
                let view = &views[observer.frame as usize];
                if let Some(slot) = stretch_slots[observer.frame as usize] {
                    let a = view.wall_jacobian(points);
                    let mut c = Matrix2x6::zeros();
                    if self.calibrates {
                        let frame = self.coverage.frames(stretch)[observer.frame as usize];
                        let seen = view.shared_jacobian(points, &a, lens, &self.rates[frame]);
                        c.copy_from(&seen);
                    }
                    columns.push(Column {
                        place: sums.place(slot),
                        moments: *moments,
                        own_features: found.own_features.get(k).copied(),
                        a,
                        c,
                        inverse_gain: 1.0 / f64::from(view.gain() * observer.shade),
                    });
                }
            }
            let mut features = found.features;
            if let Some(texture) = &self.unknown_texture {
                texture.weaken(&mut features, observers.len());
            }
            summed.push(TileSums {
                columns,
                features,
                total: found.observers.iter().map(|observer| observer.weight).sum(),
            });
        };
        let points_of = |tile: &Tile, scratch: &mut Vec<_>| {
            TilePoints::new(&self.grid, self.scene.surface, tile.id, scratch)
        };
        if let Some(wall) = &self.wall {
            let found = self.joint(visibility, block, views).moments(wall);
            for (tile, found) in tiles.iter().zip(&found) {
                add(tile, &points_of(tile, &mut scratch), found);
            }
        } else {
            for tile in tiles {
                let points = points_of(tile, &mut scratch);
                dispatch_simd(
                    #[inline(always)]
                    || {
                        let seen = visibility.observers(tile).iter().map(|o| o.seen(views));
                        work.moments(&points, seen, spacing, &weighing);
                    },
                );
                add(tile, &points, &work.found);
            }
        }
        dispatch_simd(
            #[inline(always)]
            || {
                for tile in &summed {
                    sums.add_tile(&tile.columns, &tile.features, tile.total);
                    if let Some(lens) = &mut sums.lens {
                        lens.add_tile(&tile.columns, &tile.features, tile.total);
                    }
                }
            },
        );
        sums
    }
}

/// What a tile adds to the normal equations.
struct TileSums {
    columns: Vec<Column>,
    /// M.
    features: Matrix4<f64>,
    /// Weight of all observers, held ones too.
    total: f64,
}

/// An active observer of a tile.
pub struct Column {
    /// Which of the block's frames.
    pub place: usize,
    pub moments: ObserverMoments,
    /// M of the frame's own gradient, where that is what the derivative takes.
    own_features: Option<Matrix4<f64>>,
    /// A.
    pub a: Matrix2x6<f64>,
    /// C; zero unless shared unknowns are estimated.
    pub c: Matrix2x6<f64>,
    /// `1/a`, shading included.
    pub inverse_gain: f64,
}

impl Column {
    /// `M B` (4 × 8) for this observer's `B = diag(A, 1, 1/a)`.
    #[inline(always)]
    fn features_times_b(&self, m: &Matrix4<f64>) -> SMatrix<f64, 4, UNKNOWNS> {
        let mut product = SMatrix::<f64, 4, UNKNOWNS>::zeros();
        for c in 0..6 {
            for r in 0..4 {
                product[(r, c)] = m[(r, 0)] * self.a[(0, c)] + m[(r, 1)] * self.a[(1, c)];
            }
        }
        for r in 0..4 {
            product[(r, 6)] = m[(r, 2)];
            product[(r, 7)] = m[(r, 3)] * self.inverse_gain;
        }
        product
    }

    /// Adds `scale · Bᵀ F` to a block.
    #[inline(always)]
    fn add_b_transposed_times(&self, f: &SMatrix<f64, 4, UNKNOWNS>, scale: f64, block: &mut Block) {
        for c in 0..UNKNOWNS {
            let (f0, f1) = (scale * f[(0, c)], scale * f[(1, c)]);
            for r in 0..6 {
                block[(r, c)] += self.a[(0, r)] * f0 + self.a[(1, r)] * f1;
            }
            block[(6, c)] += scale * f[(2, c)];
            block[(7, c)] += scale * f[(3, c)] * self.inverse_gain;
        }
    }
}

/// Sums over the tiles of one block, for the few active frames that see it.
pub struct BlockSums {
    /// The frames, counted among the active ones.
    pub slots: Vec<usize>,
    /// Robust cost.
    pub cost: f64,
    /// Gradient, a frame after another.
    pub gradient: Vec<FrameStep>,
    shares: Vec<FrameShare>,
    /// Upper triangle, row by row.
    blocks: Vec<Block>,
    /// The lens's part, if it is estimated.
    pub lens: Option<LensSums>,
}

impl BlockSums {
    fn new(slots: Vec<usize>, calibrates: bool) -> Self {
        let n = slots.len();
        Self {
            slots,
            cost: 0.0,
            gradient: vec![FrameStep::zeros(); n],
            shares: vec![FrameShare::default(); n],
            blocks: vec![Block::zeros(); n * (n + 1) / 2],
            lens: calibrates.then(|| LensSums::new(n)),
        }
    }

    /// Place of a slot among this block's; it must be one of them.
    fn place(&self, slot: usize) -> usize {
        self.slots.partition_point(|s| *s < slot)
    }

    #[inline(always)]
    fn block_index(&self, row: usize, column: usize) -> usize {
        let n = self.slots.len();
        row * n - row * (row + 1) / 2 + column
    }

    /// `features`: M of the tile; `total`: weight of all its observers, held ones too.
    #[inline(always)]
    fn add_tile(&mut self, columns: &[Column], features: &Matrix4<f64>, total: f64) {
        for (n, b) in columns.iter().enumerate() {
            let moments = &b.moments;
            let share = &mut self.shares[b.place];
            share.samples += SAMPLES;
            share.pixels += moments.pixels;
            share.inliers += moments.inliers;
            share.square += moments.square;
            let gradient = &mut self.gradient[b.place];
            for k in 0..6 {
                gradient[k] -=
                    b.a[(0, k)] * moments.gradient[0] + b.a[(1, k)] * moments.gradient[1];
            }
            gradient[6] -= moments.gradient[2];
            gradient[7] -= moments.gradient[3] * b.inverse_gain;
            let f = b.features_times_b(features);
            if let Some(own) = &b.own_features {
                // Its noise is in the diagonal blocks only: `w̄ Bᵀ (M_i − M) B` more.
                let index = self.block_index(b.place, b.place);
                let more = b.features_times_b(&(own - features));
                b.add_b_transposed_times(&more, moments.weight, &mut self.blocks[index]);
            }
            for a in &columns[..=n] {
                let own = if a.place == b.place {
                    a.moments.weight
                } else {
                    0.0
                };
                let scale = own - a.moments.weight * moments.weight / total.max(1e-12);
                let index = self.block_index(a.place, b.place);
                a.add_b_transposed_times(&f, scale, &mut self.blocks[index]);
            }
        }
    }

    /// Adds the block to the normal equations, their scatter and the frames' shares.
    pub fn add_to(
        &self,
        pattern: &Pattern,
        normal: &mut NormalEquations,
        scatter: &mut [Block],
        frames: &mut [FrameShare],
    ) {
        for (column, slot) in self.slots.iter().enumerate() {
            normal.gradient[*slot] += self.gradient[column];
            let (share, sum) = (&mut frames[*slot], &self.shares[column]);
            share.samples += sum.samples;
            share.pixels += sum.pixels;
            share.inliers += sum.inliers;
            share.square += sum.square;
            for row in 0..=column {
                let block = &self.blocks[self.block_index(row, column)];
                normal.add_block(pattern, self.slots[row], *slot, block);
                if let Some(place) = pattern.place(self.slots[row], *slot) {
                    scatter[place] += self.gradient[row] * self.gradient[column].transpose();
                }
            }
        }
    }
}
