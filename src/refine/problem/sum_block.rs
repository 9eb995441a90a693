//! Sums over the tiles of one block of the wall.

use crate::camera::Camera;
use crate::numerics::simd_dispatch::wide;
use crate::refine::problem::block_sums::{BlockSums, TileSums};
use crate::refine::problem::observer_column::Column;
use crate::refine::problem::photometric_problem::PhotometricProblem;
use crate::refine::samples::visibility::{Tile, Visibility};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::TilePoints;
use crate::refine::tiles::tile::{ResidualWeighting, TileMoments, TileWorkspace};
use nalgebra::Matrix2x6;
use std::ops::Range;

impl PhotometricProblem<'_> {
    /// Sums over the tiles of one block, for the few active frames that see it.
    pub fn sum_block(
        &self,
        stretch: usize,
        visibility: &Visibility,
        block: &Range<usize>,
        views: &[SampledFrame],
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
        let mut work = TileWorkspace::default();
        let mut scratch = Vec::new();
        let spacing = (self.grid.spacing_s_m, self.grid.spacing_h_m);
        let weighting = ResidualWeighting {
            noise: &self.noise,
            variance_weighting: self.sampling.variance_weighting,
            denoiser: self.denoiser.as_ref(),
        };
        let mut summed: Vec<TileSums> = Vec::with_capacity(tiles.len());
        let mut add = |tile: &Tile, points: &TilePoints, found: &TileMoments| {
            let observers = visibility.observers(tile);
            let mut columns = Vec::with_capacity(observers.len());
            for (observer, moments) in observers.iter().zip(&found.observers) {
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
                wide(
                    #[inline(always)]
                    || {
                        let seen = visibility.observers(tile).iter().map(|o| o.seen(views));
                        work.moments(&points, seen, spacing, &weighting);
                    },
                );
                add(tile, &points, &work.found);
            }
        }
        wide(
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
