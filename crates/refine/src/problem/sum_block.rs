//! Sums over the tiles of one block of the wall.

use crate::parameters::shape::Shape;
use crate::problem::block_sums::{BlockSums, TileSums};
use crate::problem::observer_column::ObserverColumn;
use crate::problem::photometric_problem::PhotometricProblem;
use crate::problem::set_up::shape_slots;
use crate::problem::shape_terms::TileShape;
use crate::problem::tile_share::TileShare;
use crate::samples::observer::Observer;
use crate::samples::outlier_mask::OutlierMask;
use crate::samples::visibility::{Tile, Visibility};
use crate::tiles::frame_samples::{SampledFrame, SharedJacobian};
use crate::tiles::grid::TilePoints;
use crate::tiles::tile::ResidualWeighting;
use crate::tiles::tile_moments::TileMoments;
use crate::tiles::workspace::{Misfit, TileWorkspace};
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

/// A tile with the values of its observers.
struct SampledTile<'t> {
    tile: &'t Tile,
    points: TilePoints,
    observers: Vec<Observer>,
    workspace: TileWorkspace,
}

impl SampledTile<'_> {
    /// Excludes the observers for which `is_outlier` is true.
    fn exclude<'o>(&mut self, is_outlier: &mut impl Iterator<Item = &'o bool>) {
        let is_outlier: Vec<bool> = is_outlier
            .by_ref()
            .take(self.observers.len())
            .copied()
            .collect();
        let (mut of_observer, mut of_frame) = (is_outlier.iter(), is_outlier.iter());
        self.observers
            .retain(|_| of_observer.next() == Some(&false));
        (self.workspace.frames).retain(|_| of_frame.next() == Some(&false));
    }
}

impl PhotometricProblem<'_> {
    /// Sums over a share of the tiles of one block of a stretch, for the few active frames that
    /// observe it.
    pub fn sum_block(
        &self,
        (stretch, share): (usize, TileShare),
        visibility: &Visibility,
        block: &Range<usize>,
        sampled_frames: &[SampledFrame],
        wall: (&dyn Surface, &Cameras),
    ) -> BlockSums {
        let context = self.block_context(stretch, visibility, sampled_frames, wall);
        let tiles = visibility.tiles[block.clone()].iter();
        let tiles: Vec<&Tile> = tiles.filter(|tile| share.has(&tile.id)).collect();
        let functions = self.tile_functions(&tiles);
        let frames = visibility.frames(block);
        let mut sums = self.zero_sums(&context, &frames, &functions);
        let tiles = self.sum_tiles(&context, block, &tiles, &mut sums);
        self.add_tiles(&mut sums, &tiles, &functions);
        sums
    }

    /// Sums over the tiles of one block that its observers but for the outliers among them give,
    /// and the outliers, tile by tile; no sums if no tile is left.
    pub fn sum_inliers(
        &self,
        (stretch, mask): (usize, &OutlierMask),
        visibility: &Visibility,
        block: &Range<usize>,
        sampled_frames: &[SampledFrame],
        wall: (&dyn Surface, &Cameras),
    ) -> (Vec<bool>, Option<BlockSums>) {
        let context = self.block_context(stretch, visibility, sampled_frames, wall);
        let tiles = &visibility.tiles[block.clone()];
        let mut misfits = Vec::new();
        let mut sampled = self.sample_tiles(&context, tiles, &mut misfits);
        let is_outlier = mask.find_outliers(visibility, block, &misfits);
        let mut next = is_outlier.iter();
        for tile in &mut sampled {
            tile.exclude(&mut next);
        }
        sampled.retain(|tile| tile.observers.len() > 1);
        if sampled.is_empty() {
            return (is_outlier, None);
        }
        let left: Vec<&Tile> = sampled.iter().map(|tile| tile.tile).collect();
        let functions = self.tile_functions(&left);
        let observers = sampled.iter().flat_map(|tile| &tile.observers);
        let mut frames: Vec<usize> = observers.map(|o| o.frame as usize).collect();
        frames.sort_unstable();
        frames.dedup();
        let mut sums = self.zero_sums(&context, &frames, &functions);
        let (spacing_m, weighting) = self.moments_input();
        let tiles: Vec<TileSums> = sampled
            .iter_mut()
            .map(|tile| {
                let workspace = &mut tile.workspace;
                dispatch_simd(
                    #[inline(always)]
                    || workspace.compute_sampled_moments(spacing_m, &weighting),
                );
                let moments = &tile.workspace.moments;
                self.tile_sums(&context, &tile.observers, &tile.points, moments, &mut sums)
            })
            .collect();
        self.add_tiles(&mut sums, &tiles, &functions);
        (is_outlier, Some(sums))
    }

    /// The frames of a stretch before the wall.
    fn block_context<'b>(
        &'b self,
        stretch: usize,
        visibility: &'b Visibility,
        sampled_frames: &'b [SampledFrame<'b>],
        (surface, cameras): (&'b dyn Surface, &'b Cameras),
    ) -> BlockContext<'b> {
        let participants = self.coverage.frames(stretch);
        BlockContext {
            visibility,
            sampled_frames,
            participants,
            slots: participants.iter().map(|k| self.slot(*k)).collect(),
            surface,
            cameras,
        }
    }

    /// Samples some tiles, and adds the misfits of their observers to `misfits`.
    fn sample_tiles<'t>(
        &self,
        context: &BlockContext,
        tiles: &'t [Tile],
        misfits: &mut Vec<Misfit>,
    ) -> Vec<SampledTile<'t>> {
        let (mut scratch, mut sorted) = (Vec::new(), Vec::new());
        let sample = |tile: &'t Tile| {
            let points = TilePoints::new(&self.grid, context.surface, tile.id, &mut scratch);
            let observers = context.visibility.observers(tile);
            let mut workspace = TileWorkspace {
                sorted: std::mem::take(&mut sorted),
                ..TileWorkspace::default()
            };
            dispatch_simd(
                #[inline(always)]
                || {
                    let observers = observers.iter();
                    let observations = observers.map(|o| o.observation(context.sampled_frames));
                    workspace.compute_misfits(&points, observations, &self.noise);
                },
            );
            misfits.append(&mut workspace.misfits);
            sorted = std::mem::take(&mut workspace.sorted);
            SampledTile {
                tile,
                points,
                observers: observers.to_vec(),
                workspace,
            }
        };
        tiles.iter().map(sample).collect()
    }

    /// Zero sums of a block that the `frames` of its stretch observe.
    fn zero_sums(
        &self,
        context: &BlockContext,
        frames: &[usize],
        functions: &[TileShape],
    ) -> BlockSums {
        let mut slots: Vec<usize> = frames.iter().filter_map(|k| context.slots[*k]).collect();
        let frames = slots.len();
        let of_shape = functions
            .iter()
            .flat_map(|tile| tile.functions.iter().copied());
        slots.extend(shape_slots(of_shape, self.active.len()));
        BlockSums::new(slots, frames, self.estimates_shared)
    }

    /// Adds tiles to the sums of their block.
    fn add_tiles(&self, sums: &mut BlockSums, tiles: &[TileSums], functions: &[TileShape]) {
        dispatch_simd(
            #[inline(always)]
            || {
                for tile in tiles {
                    sums.add_tile(&tile.columns, &tile.features, tile.total_weight);
                    if let Some(intrinsics) = &mut sums.intrinsics {
                        intrinsics.add_tile(&tile.columns, &tile.features, tile.total_weight);
                    }
                }
            },
        );
        for (tile, shape) in tiles.iter().zip(functions) {
            sums.add_shape(tile, shape, self.active.len());
        }
    }

    /// Spacing of the samples along s and h, metres, and the weighting of the residuals.
    fn moments_input(&self) -> ((f64, f64), ResidualWeighting<'_>) {
        let weighting = ResidualWeighting {
            noise: &self.noise,
            variance_weighting: self.sampling.variance_weighting,
            denoiser: self.denoiser.as_ref(),
        };
        ((self.grid.spacing_s_m, self.grid.spacing_h_m), weighting)
    }

    /// The shape's functions at some tiles; none if the shape is not estimated or has no functions.
    fn tile_functions(&self, tiles: &[&Tile]) -> Vec<TileShape> {
        let shape = self.shape.iter().filter(|shape| shape.model.blocks() > 0);
        let of_tile = |(shape, tile): (&Arc<Shape>, &&Tile)| {
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

    /// Computes the contribution of each of the `tiles` of a block, and adds its cost to `sums`. In
    /// the joint solve they are all of them.
    fn sum_tiles(
        &self,
        context: &BlockContext,
        block: &Range<usize>,
        tiles: &[&Tile],
        sums: &mut BlockSums,
    ) -> Vec<TileSums> {
        let visibility = context.visibility;
        let mut scratch = Vec::new();
        let mut points_of =
            |tile: &Tile| TilePoints::new(&self.grid, context.surface, tile.id, &mut scratch);
        if let Some(wall_model) = &self.wall_model {
            let joint = self.joint_block(visibility, block, context.sampled_frames);
            let moments = joint.moments(wall_model);
            return (tiles.iter().zip(&moments))
                .map(|(tile, moments)| {
                    let observers = visibility.observers(tile);
                    self.tile_sums(context, observers, &points_of(tile), moments, sums)
                })
                .collect();
        }
        if let Some(texture) = &self.assumed_texture {
            return tiles
                .iter()
                .map(|tile| {
                    let observers = visibility.observers(tile);
                    let moments = texture.moments(observers);
                    self.tile_sums(context, observers, &points_of(tile), &moments, sums)
                })
                .collect();
        }
        let (spacing_m, weighting) = self.moments_input();
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
                let observers = visibility.observers(tile);
                self.tile_sums(context, observers, &points, &workspace.moments, sums)
            })
            .collect()
    }

    /// Turns the moments of a tile into its contribution, and adds its cost to `sums`.
    fn tile_sums(
        &self,
        context: &BlockContext,
        observers: &[Observer],
        points: &TilePoints,
        moments: &TileMoments,
        sums: &mut BlockSums,
    ) -> TileSums {
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
