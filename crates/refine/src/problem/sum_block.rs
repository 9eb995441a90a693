//! Sums over the tiles of one block of the wall.

use crate::parameters::shape::Shape;
use crate::problem::block_sums::{BlockSums, TileSums};
use crate::problem::observer_column::ObserverColumn;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::set_up::shape_slots;
use crate::problem::shape_terms::TileShape;
use crate::samples::observer::Observer;
use crate::samples::visibility::{Tile, Visibility};
use crate::tiles::frame_samples::{SampledFrame, SharedJacobian};
use crate::tiles::grid::TilePoints;
use crate::tiles::tile::ResidualWeighting;
use crate::tiles::tile_moments::TileMoments;
use crate::tiles::workspace::TileWorkspace;
use nalgebra::Matrix2x6;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::Surface;

/// A block of the wall with the frames of its stretch.
struct BlockContext<'b> {
    /// Observations of the stretch.
    visibility: &'b Visibility,
    /// Frames of the stretch.
    sampled_frames: &'b [SampledFrame<'b>],
    /// Indices of these frames among the participants.
    participants: &'b [usize],
    /// Their indices among the active frames.
    slots: Vec<Option<usize>>,
    /// The wall.
    surface: &'b dyn Surface,
    /// The cameras at full size.
    cameras: &'b Cameras,
}

impl PhotometricProblem<'_> {
    /// Sums over the tiles of one block, for the few active frames that observe it.
    pub fn sum_block(
        &self,
        stretch: usize,
        visibility: &Visibility,
        block: &Range<usize>,
        sampled_frames: &[SampledFrame],
        (surface, cameras): (&dyn Surface, &Cameras),
    ) -> BlockSums {
        let participants = self.coverage.frames(stretch);
        let context = BlockContext {
            visibility,
            sampled_frames,
            participants,
            slots: participants.iter().map(|k| self.slot(*k)).collect(),
            surface,
            cameras,
        };
        let frames = visibility.frames(block).into_iter();
        let mut slots: Vec<usize> = frames.filter_map(|k| context.slots[k]).collect();
        let frames = slots.len();
        let functions = self.tile_functions(&visibility.tiles[block.clone()]);
        let of_shape = functions
            .iter()
            .flat_map(|tile| tile.functions.iter().copied());
        slots.extend(shape_slots(of_shape, self.active.len()));
        let mut sums = BlockSums::new(slots, frames, self.estimates_shared);
        let tiles = self.sum_tiles(&context, block, &mut sums);
        dispatch_simd(
            #[inline(always)]
            || {
                for tile in &tiles {
                    sums.add_tile(&tile.columns, &tile.features, tile.total_weight);
                    if let Some(intrinsics) = &mut sums.intrinsics {
                        intrinsics.add_tile(&tile.columns, &tile.features, tile.total_weight);
                    }
                }
            },
        );
        for (tile, shape) in tiles.iter().zip(&functions) {
            sums.add_shape(tile, shape, self.active.len());
        }
        sums
    }

    /// The shape's functions at some tiles; none if the shape is not estimated or has no functions.
    fn tile_functions(&self, tiles: &[Tile]) -> Vec<TileShape> {
        let shape = self.shape.iter().filter(|shape| shape.model.blocks() > 0);
        let of_tile = |(shape, tile): (&Arc<Shape>, &Tile)| {
            let centre = self.grid.centre(tile.id);
            TileShape {
                normal: self.context.nominal.frame(centre).normal(),
                functions: shape.model.functions_at(centre),
            }
        };
        shape
            .flat_map(|shape| tiles.iter().map(move |tile| (shape, tile)))
            .map(of_tile)
            .collect()
    }

    /// Computes the contribution of each tile of a block, and adds its cost to `sums`.
    fn sum_tiles(
        &self,
        context: &BlockContext,
        block: &Range<usize>,
        sums: &mut BlockSums,
    ) -> Vec<TileSums> {
        let visibility = context.visibility;
        let tiles = &visibility.tiles[block.clone()];
        let mut scratch = Vec::new();
        let mut points_of =
            |tile: &Tile| TilePoints::new(&self.grid, context.surface, tile.id, &mut scratch);
        if let Some(wall_model) = &self.wall_model {
            let joint = self.joint_block(visibility, block, context.sampled_frames);
            let moments = joint.moments(wall_model);
            return (tiles.iter().zip(&moments))
                .map(|(tile, moments)| {
                    self.tile_sums(context, tile, &points_of(tile), moments, sums)
                })
                .collect();
        }
        if let Some(texture) = &self.assumed_texture {
            return tiles
                .iter()
                .map(|tile| {
                    let moments = texture.moments(visibility.observers(tile));
                    self.tile_sums(context, tile, &points_of(tile), &moments, sums)
                })
                .collect();
        }
        let spacing_m = (self.grid.spacing_s_m, self.grid.spacing_h_m);
        let weighting = ResidualWeighting {
            noise: &self.noise,
            variance_weighting: self.sampling.variance_weighting,
            denoiser: self.denoiser.as_ref(),
        };
        let mut workspace = TileWorkspace::default();
        tiles
            .iter()
            .map(|tile| {
                let points = points_of(tile);
                dispatch_simd(
                    #[inline(always)]
                    || {
                        let observers = visibility.observers(tile).iter();
                        let observations = observers.map(|o| o.observation(context.sampled_frames));
                        workspace.compute_moments(&points, observations, spacing_m, &weighting);
                    },
                );
                self.tile_sums(context, tile, &points, &workspace.moments, sums)
            })
            .collect()
    }

    /// Turns the moments of a tile into its contribution, and adds its cost to `sums`.
    fn tile_sums(
        &self,
        context: &BlockContext,
        tile: &Tile,
        points: &TilePoints,
        moments: &TileMoments,
        sums: &mut BlockSums,
    ) -> TileSums {
        let observers = context.visibility.observers(tile);
        let mut columns = Vec::with_capacity(observers.len());
        for (observer, moments) in observers.iter().zip(&moments.observers) {
            sums.cost += moments.cost;
            let frame = &context.sampled_frames[observer.frame as usize];
            if let Some(slot) = context.slots[observer.frame as usize] {
                let a = frame.wall_jacobian(points);
                columns.push(ObserverColumn {
                    frame: sums.index_of(slot),
                    moments: *moments,
                    a,
                    c: self.shared_jacobian(context, observer, points, &a),
                    inverse_gain: 1.0 / f64::from(frame.gain() * observer.shade),
                });
            }
        }
        let mut features = moments.features;
        if let Some(texture) = &self.unknown_texture {
            texture.reduce_information(&mut features, observers.len());
        }
        TileSums {
            columns,
            features,
            total_weight: moments
                .observers
                .iter()
                .map(|observer| observer.weight)
                .sum(),
        }
    }

    /// `C` of an observer; zero if the shared parameters are not estimated.
    fn shared_jacobian(
        &self,
        context: &BlockContext,
        observer: &Observer,
        points: &TilePoints,
        a: &Matrix2x6<f64>,
    ) -> SharedJacobian {
        if self.estimates_shared {
            let frame = &context.sampled_frames[observer.frame as usize];
            let participant = context.participants[observer.frame as usize];
            let camera = context.cameras.of(self.participants.start + participant);
            frame.shared_jacobian(points, a, camera, &self.rates[participant])
        } else {
            SharedJacobian::zeros()
        }
    }
}
