//! Tiles of the panorama, row by row.

use super::accumulator::Row;
use super::band::{Place, Rows};
use super::best_view::{self, BestView};
use super::seams::Seams;
use crate::numerics::median::median;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::{NO_FRAME, Placement};
use crate::render::layout::tiles::Tile;
use crate::render::sampling::exposure::Exposure;
use crate::render::sampling::frame_view::{Kernels, View};
use crate::render::sampling::picture_cache::FrameStack;
use crate::render::sampling::point_batch::{RUN, Run};
use crate::render::sampling::sample::Sample;
use crate::render::warp::control_points::Lattice;
use crate::render::warp::local_polynomial::Projected;
use crate::render::warp::projection::Points;
use crate::surface::Surface;
use nalgebra::Vector3;

/// What tiles are drawn from.
pub struct Scene<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The frames.
    pub frames: &'a FrameStack,
    /// Where they lie, in their order.
    pub placements: &'a [Placement],
    /// What is drawn.
    pub canvas: &'a Canvas,
    /// How frames are sampled.
    pub kernels: &'a Kernels,
    /// What is undone of the frames' exposure.
    pub exposure: &'a Exposure,
    /// Which frames are shown where.
    pub composition: Composition<'a>,
}

/// Which frames are shown where.
#[derive(Clone, Copy)]
pub enum Composition<'a> {
    /// One frame at each place, with seams between.
    Seams(&'a Seams),
    /// See [`Mode::Average`].
    Average,
    /// See [`Mode::Median`].
    Median,
}

/// What drawing a tile needs for a while: made once a thread, since fresh memory costs as much as
/// the work in it.
#[derive(Default)]
pub struct Scratch {
    lattice: Lattice,
    projected: Projected,
    exact: Vec<Vector3<f64>>,
    points: Points,
    run: Run,
    sums: Row,
    best_view: best_view::Scratch,
}

impl Scene<'_> {
    /// Draws a tile in its place. The frames that it needs must be held ([`Scene::needed`]).
    pub fn draw(&self, tile: &Tile, place: Place, scratch: &mut Scratch) {
        let Place { pixels, sources } = place;
        match (self.frames.format().channels, pixels) {
            (1, Rows::Eight(pixels)) => self.draw_as::<u8, 1, 1>(tile, pixels, sources, scratch),
            (_, Rows::Eight(pixels)) => self.draw_as::<u8, 3, 4>(tile, pixels, sources, scratch),
            (1, Rows::Sixteen(pixels)) => self.draw_as::<u16, 1, 1>(tile, pixels, sources, scratch),
            (_, Rows::Sixteen(pixels)) => self.draw_as::<u16, 3, 4>(tile, pixels, sources, scratch),
        }
    }

    /// The frames that a tile is drawn from, in their order.
    pub fn needed(&self, tile: &Tile) -> Vec<usize> {
        match self.composition {
            Composition::Seams(seams) => seams.frames_of(self.canvas, tile),
            Composition::Average | Composition::Median => tile.frames.clone(),
        }
    }

    /// With `C` channels and `L` lanes of a correction.
    fn draw_as<T: Sample, const C: usize, const L: usize>(
        &self,
        tile: &Tile,
        mut pixels: Vec<&mut [T]>,
        mut sources: Vec<&mut [u32]>,
        scratch: &mut Scratch,
    ) {
        let Scratch {
            lattice,
            projected,
            exact,
            points,
            run,
            sums,
            best_view,
        } = scratch;
        let camera = self.frames.camera();
        lattice.set(self.surface, self.canvas, tile);
        let views = self.needed(tile).into_iter().filter_map(|frame| {
            let picture = self.frames.picture(frame)?;
            Some(View::new(
                (frame, &self.placements[frame], picture),
                camera,
                self.kernels,
                self.exposure.of(frame),
                lattice,
                projected,
            ))
        });
        let views: Vec<View> = views.filter(View::shows).collect();
        if views.is_empty() {
            for pixels in pixels {
                pixels.fill(T::default());
            }
            for sources in sources {
                sources.fill(NO_FRAME);
            }
            return;
        }
        if views.iter().any(View::is_rough) {
            tile.points_into(self.surface, self.canvas, exact);
            points.set(exact);
        }
        if let Composition::Seams(seams) = self.composition {
            let place = (self.canvas, tile);
            let best = BestView::<C, L>::new(seams, place, &views, points);
            best.draw(&mut pixels, &mut sources, run, sums, best_view);
            return;
        }
        for sources in sources {
            sources.fill(NO_FRAME);
        }
        let mut brush = Brush::<'_, C> {
            width: tile.columns as usize,
            points,
            views: &views,
            run,
            sums,
        };
        if let Composition::Average = self.composition {
            for (row, pixels) in pixels.into_iter().enumerate() {
                brush.average(row, pixels);
            }
        } else {
            let mut stacks = vec![Vec::with_capacity(views.len()); tile.columns as usize];
            for (row, pixels) in pixels.into_iter().enumerate() {
                brush.median(row, &mut stacks, pixels);
            }
        }
    }
}

/// Draws rows of a tile with `C` channels, all views mixed.
struct Brush<'a, const C: usize> {
    /// Columns of the tile.
    width: usize,
    /// The tile's points, if some view is rough.
    points: &'a Points,
    views: &'a [View<'a>],
    run: &'a mut Run,
    sums: &'a mut Row,
}

impl<const C: usize> Brush<'_, C> {
    fn average<T: Sample>(&mut self, row: usize, pixels: &mut [T]) {
        let columns = 0..self.width;
        self.sums.clear(columns.clone());
        for view in self.views {
            view.look_at(self.run, self.points, (row, self.width), columns.clone());
            let (u, v) = self.run.pixels();
            for k in columns.clone() {
                if self.run.seen()[k] {
                    let w = view.feather(u[k], v[k]);
                    self.sums.add(k, &self.run.values()[k], w);
                }
            }
        }
        self.sums.put::<T, C, 4>(columns, &[[0.0; 4]; RUN], pixels);
    }

    /// `stacks`: empty, one a column.
    fn median<T: Sample>(&mut self, row: usize, stacks: &mut [Vec<[f32; 4]>], pixels: &mut [T]) {
        for view in self.views {
            view.look_at(self.run, self.points, (row, self.width), 0..self.width);
            for (k, stack) in stacks.iter_mut().enumerate() {
                if self.run.seen()[k] {
                    stack.push(self.run.values()[k]);
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
            .put::<T, C, 4>(0..self.width, &[[0.0; 4]; RUN], pixels);
    }
}
