//! ComparedPanorama of the panorama's tiles, row by row.

use super::accumulator::RowAccumulator;
use super::band::{PixelRows, TilePixels};
use super::best_view::{BestViewBuffers, BestViewRenderer};
use super::seams::Seams;
use crate::layout::canvas::Canvas;
use crate::layout::placement::{NO_FRAME, Placement};
use crate::layout::tiles::TILE_COLUMNS;
use crate::layout::tiles::Tile;
use crate::sampling::exposure::Exposure;
use crate::sampling::frame_view::{FrameView, StretchedKernels};
use crate::sampling::picture_cache::PictureCache;
use crate::sampling::point_batch::PointBatch;
use crate::sampling::sample::Sample;
use crate::warp::control_points::ControlPoints;
use crate::warp::local_polynomial::ProjectedControlPoints;
use crate::warp::projection::LocalPoints;
use nalgebra::Vector3;
use tunnelstitch_geometry::numerics::median::median;
use tunnelstitch_geometry::surface::Surface;

/// Renderer of tiles from the frames in memory.
pub struct TileRenderer<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The frames.
    pub frames: &'a PictureCache,
    /// Places of the frames, in their order.
    pub placements: &'a [Placement],
    /// Canvas that is drawn.
    pub canvas: &'a Canvas,
    /// Kernels that frames are sampled with.
    pub kernels: &'a StretchedKernels,
    /// Exposure that is undone.
    pub exposure: &'a Exposure,
    /// Choice of frames.
    pub composition: Composition<'a>,
}

/// Choice of the frames that a pixel shows.
#[derive(Clone, Copy)]
pub enum Composition<'a> {
    /// One frame at each place, with seams between.
    Seams(&'a Seams),
    /// Mean of all frames; see [`Mode::Average`](super::options::Mode::Average).
    Average,
    /// Median of all frames; see [`Mode::Median`](super::options::Mode::Median).
    Median,
}

/// Buffers for drawing a tile, made once a thread: allocating them takes as long as the work in
/// them.
#[derive(Default)]
pub struct TileBuffers {
    control_points: ControlPoints,
    projected: ProjectedControlPoints,
    exact: Vec<Vector3<f64>>,
    points: LocalPoints,
    batch: PointBatch,
    sums: RowAccumulator,
    best_view: BestViewBuffers,
}

impl TileRenderer<'_> {
    /// Draws a tile. The frames that it needs must be in memory ([`TileRenderer::needed`]).
    pub fn draw(&self, tile: &Tile, place: TilePixels, buffers: &mut TileBuffers) {
        let TilePixels { pixels, sources } = place;
        match (self.frames.format().channels, pixels) {
            (1, PixelRows::Eight(pixels)) => {
                self.draw_as::<u8, 1, 1>(tile, pixels, sources, buffers)
            }
            (_, PixelRows::Eight(pixels)) => {
                self.draw_as::<u8, 3, 4>(tile, pixels, sources, buffers)
            }
            (1, PixelRows::Sixteen(pixels)) => {
                self.draw_as::<u16, 1, 1>(tile, pixels, sources, buffers)
            }
            (_, PixelRows::Sixteen(pixels)) => {
                self.draw_as::<u16, 3, 4>(tile, pixels, sources, buffers)
            }
        }
    }

    /// Frames that a tile is drawn from, in their order.
    pub fn needed(&self, tile: &Tile) -> Vec<usize> {
        match self.composition {
            Composition::Seams(seams) => seams.frames_of(self.canvas, tile),
            Composition::Average | Composition::Median => tile.frames.clone(),
        }
    }

    /// Draws a tile with `C` channels and `L` lanes of a correction.
    fn draw_as<T: Sample, const C: usize, const L: usize>(
        &self,
        tile: &Tile,
        mut pixels: Vec<&mut [T]>,
        mut sources: Vec<&mut [u32]>,
        buffers: &mut TileBuffers,
    ) {
        let TileBuffers {
            control_points,
            projected,
            exact,
            points,
            batch,
            sums,
            best_view,
        } = buffers;
        let cameras = self.frames.cameras();
        control_points.set(self.surface, self.canvas, tile);
        let views = self.needed(tile).into_iter().filter_map(|frame| {
            let picture = self.frames.picture(frame)?;
            Some(FrameView::new(
                (frame, &self.placements[frame], picture),
                cameras.of(frame),
                self.kernels,
                self.exposure.of(frame),
                control_points,
                projected,
            ))
        });
        let views: Vec<FrameView> = views.filter(FrameView::is_visible).collect();
        if views.is_empty() {
            for pixels in pixels {
                pixels.fill(T::default());
            }
            for sources in sources {
                sources.fill(NO_FRAME);
            }
            return;
        }
        if views.iter().any(FrameView::needs_exact_projection) {
            tile.points_into(self.surface, self.canvas, exact);
            points.set(exact);
        }
        if let Composition::Seams(seams) = self.composition {
            let place = (self.canvas, tile);
            let best = BestViewRenderer::<C, L>::new(seams, place, &views, points);
            best.draw(&mut pixels, &mut sources, batch, sums, best_view);
            return;
        }
        for sources in sources {
            sources.fill(NO_FRAME);
        }
        let mut mixture = MixtureRenderer::<'_, C> {
            width: tile.columns as usize,
            points,
            views: &views,
            batch,
            sums,
        };
        if let Composition::Average = self.composition {
            for (row, pixels) in pixels.into_iter().enumerate() {
                mixture.average(row, pixels);
            }
        } else {
            let mut stacks = vec![Vec::with_capacity(views.len()); tile.columns as usize];
            for (row, pixels) in pixels.into_iter().enumerate() {
                mixture.median(row, &mut stacks, pixels);
            }
        }
    }
}

/// Renderer of rows of a tile with `C` channels, all views mixed.
struct MixtureRenderer<'a, const C: usize> {
    /// Columns of the tile.
    width: usize,
    /// Wall points of the tile, if some view needs exact projection.
    points: &'a LocalPoints,
    views: &'a [FrameView<'a>],
    batch: &'a mut PointBatch,
    sums: &'a mut RowAccumulator,
}

impl<const C: usize> MixtureRenderer<'_, C> {
    fn average<T: Sample>(&mut self, row: usize, pixels: &mut [T]) {
        let columns = 0..self.width;
        self.sums.clear(columns.clone());
        for view in self.views {
            view.sample(self.batch, self.points, (row, self.width), columns.clone());
            let (u, v) = self.batch.pixels();
            for k in columns.clone() {
                if self.batch.seen()[k] {
                    let w = view.feather_weight(u[k], v[k]);
                    self.sums.add(k, &self.batch.values()[k], w);
                }
            }
        }
        self.sums
            .put::<T, C, 4>(columns, &[[0.0; 4]; TILE_COLUMNS], pixels);
    }

    /// Draws a row as the median of all views; `stacks`: empty, one a column.
    fn median<T: Sample>(&mut self, row: usize, stacks: &mut [Vec<[f32; 4]>], pixels: &mut [T]) {
        for view in self.views {
            view.sample(self.batch, self.points, (row, self.width), 0..self.width);
            for (k, stack) in stacks.iter_mut().enumerate() {
                if self.batch.seen()[k] {
                    stack.push(self.batch.values()[k]);
                }
            }
        }
        let mut values = Vec::with_capacity(self.views.len());
        self.sums.clear(0..self.width);
        for (k, stack) in stacks.iter_mut().enumerate().filter(|(_, s)| !s.is_empty()) {
            let mut middle = [0.0; 4];
            for c in 0..C {
                values.clear();
                values.extend(stack.iter().map(|value| value[c]));
                middle[c] = median(&mut values);
            }
            self.sums.add(k, &middle, 1.0);
            stack.clear();
        }
        self.sums
            .put::<T, C, 4>(0..self.width, &[[0.0; 4]; TILE_COLUMNS], pixels);
    }
}
