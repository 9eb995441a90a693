//! ComparedPanorama of a panorama, band by band, with exposures and seams found before.

use super::budget::Budget;
use crate::compositing::band::{Band, Target};
use crate::compositing::options::{Mode, RenderOptions};
use crate::compositing::seam_grid;
use crate::compositing::seams::Seams;
use crate::compositing::super_resolution::FrameReadings;
use crate::compositing::tile_renderer::{Composition, TileBuffers, TileRenderer};
use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::layout::placement::Placement;
use crate::layout::tiles::{BAND_ROWS, EDGE, Tile, tiles_at};
use crate::sampling::exposure::Exposure;
use crate::sampling::frame_view::StretchedKernels;
use crate::sampling::picture_cache::PictureCache;
use crate::sampling::thumbnails::Thumbnails;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;

/// Name of the stage in which bands are drawn.
pub(super) const DRAWING: &str = "panorama";

/// Exposures and seams, found before the first tile is drawn.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Settled {
    exposure: Exposure,
    seams: Option<Seams>,
}

/// A panorama that is ready to be drawn.
pub struct Plan<'a> {
    surface: &'a dyn Surface,
    placements: &'a [Placement],
    canvas: Canvas,
    mode: Mode,
    kernels: StretchedKernels,
    settled: Settled,
    super_resolve: bool,
}

impl Settled {
    /// Finds exposures and seams.
    ///
    /// # Errors
    /// [`RenderError::Count`] unless there is one placement per frame; a frame that cannot be
    /// decoded.
    pub(crate) fn find(
        surface: &dyn Surface,
        frames: &PictureCache,
        placements: &[Placement],
        canvas: &Canvas,
        options: &RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        if frames.len() != placements.len() {
            return Err(RenderError::Count {
                poses: placements.len(),
                frames: frames.len(),
            });
        }
        let mut settled = Self {
            exposure: Exposure::none(frames.len()),
            seams: None,
        };
        if !options.needs_thumbnails() {
            return Ok(settled);
        }
        let level = Thumbnails::level(surface, frames, placements, &seam_grid::grid(canvas))?;
        let thumbnails = Thumbnails::of(frames, level, progress)?;
        progress.start("seams", 1);
        // Seams are sought in evenly lit frames, even where frames are to stay as they are.
        let white = frames.format().white();
        let exposure = Exposure::solve(surface, &thumbnails, placements, canvas, white);
        if options.mode == Mode::BestView {
            settled.seams = Some(Seams::find(
                surface,
                &thumbnails,
                &exposure.of_thumbnails(&thumbnails),
                placements,
                canvas,
                options.blend.then_some(white),
            ));
        }
        if options.blend {
            settled.exposure = exposure;
        }
        progress.finish();
        Ok(settled)
    }
}

impl<'a> Plan<'a> {
    /// Finds exposures and seams.
    ///
    /// # Errors
    /// As [`Settled::find`].
    pub fn new(
        surface: &'a dyn Surface,
        frames: &PictureCache,
        placements: &'a [Placement],
        canvas: &Canvas,
        options: &RenderOptions,
        progress: &dyn Progress,
    ) -> Result<Self, RenderError> {
        let settled = Settled::find(surface, frames, placements, canvas, options, progress)?;
        Ok(Self::with(surface, placements, canvas, options, settled))
    }

    /// Plans with exposures and seams that were found before.
    pub fn with(
        surface: &'a dyn Surface,
        placements: &'a [Placement],
        canvas: &Canvas,
        options: &RenderOptions,
        settled: Settled,
    ) -> Self {
        Self {
            surface,
            placements,
            canvas: *canvas,
            mode: options.mode,
            kernels: StretchedKernels::new(options.interpolation),
            settled,
            super_resolve: options.super_resolve,
        }
    }

    /// The canvas.
    pub fn canvas(&self) -> &Canvas {
        &self.canvas
    }

    /// The tunnel.
    pub fn surface(&self) -> &dyn Surface {
        self.surface
    }

    /// Places of the frames.
    pub fn placements(&self) -> &[Placement] {
        self.placements
    }

    /// Grid of the seams, or the one they would have.
    pub fn grid(&self) -> Canvas {
        seam_grid::grid(&self.canvas)
    }

    /// Exposure that is undone.
    pub fn exposure(&self) -> &Exposure {
        &self.settled.exposure
    }

    /// Frames that are shown at each place, if one is.
    pub fn seams(&self) -> Option<&Seams> {
        self.settled.seams.as_ref()
    }

    /// Draws all bands into `targets`. The bytes do not depend on the number of threads, nor on the
    /// memory for frames (`room` bytes, and at least those of one band).
    ///
    /// # Errors
    /// A frame that cannot be decoded; what the targets say.
    pub fn draw(
        &self,
        frames: &mut PictureCache,
        room: u64,
        targets: &mut [&mut dyn Target],
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        self.draw_bands(0..self.bands(), frames, room, targets, progress)
    }

    /// Number of bands.
    pub fn bands(&self) -> usize {
        self.canvas.rows.div_ceil(BAND_ROWS) as usize
    }

    /// Draws some of the bands.
    ///
    /// # Errors
    /// As [`Plan::draw`].
    pub fn draw_bands(
        &self,
        bands: Range<usize>,
        frames: &mut PictureCache,
        room: u64,
        targets: &mut [&mut dyn Target],
        progress: &dyn Progress,
    ) -> Result<(), RenderError> {
        let starts: Vec<u32> = bands.map(|band| band as u32 * BAND_ROWS).collect();
        let needs: Vec<Vec<usize>> = starts.par_map(|row| self.needed(frames, &self.tiles(*row)));
        progress.start(DRAWING, starts.len());
        let sources = targets.iter().any(|target| target.wants_sources());
        let empty = || Band::empty(&self.canvas, frames.format(), sources);
        // While a band is drawn the one before is written.
        let (mut band, mut before) = (empty(), empty());
        let mut put = |band: &Band| {
            if band.rows > 0 {
                for target in &mut *targets {
                    target.put(&self.canvas, band)?;
                }
                progress.advance(1);
            }
            Ok::<_, RenderError>(())
        };
        let mut readings = FrameReadings::default();
        for (k, row) in starts.iter().enumerate() {
            let later: Vec<usize> = needs[k + 1..]
                .iter()
                .take(Budget::BANDS_AHEAD)
                .flatten()
                .copied()
                .collect();
            frames.load(&needs[k], &later, room)?;
            let tiles = self.tiles(*row);
            let draw = || {
                self.fill(&mut band, frames, *row, &tiles);
                if self.super_resolve {
                    readings.keep(frames, &self.settled.exposure, &needs[k]);
                    let (surface, placements) = (self.surface, self.placements);
                    readings.resolve(surface, frames, placements, &self.canvas, &tiles, &mut band);
                }
            };
            let ((), written) = rayon::join(draw, || put(&before));
            written?;
            std::mem::swap(&mut band, &mut before);
        }
        put(&before)?;
        progress.finish();
        Ok(())
    }

    /// Tiles of the band that begins at `row`.
    fn tiles(&self, row: u32) -> Vec<Tile> {
        let end = (row + BAND_ROWS).min(self.canvas.rows);
        (row..end)
            .step_by(EDGE as usize)
            .flat_map(|row| tiles_at(self.surface, &self.canvas, self.placements, EDGE, row))
            .collect()
    }

    fn needed(&self, frames: &PictureCache, tiles: &[Tile]) -> Vec<usize> {
        let renderer = self.renderer(frames);
        let of_tile = |tile: &Tile| {
            if self.super_resolve {
                tile.frames.clone()
            } else {
                renderer.needed(tile)
            }
        };
        let mut needed: Vec<usize> = tiles.iter().flat_map(of_tile).collect();
        needed.sort_unstable();
        needed.dedup();
        needed
    }

    fn fill(&self, band: &mut Band, frames: &PictureCache, row: u32, tiles: &[Tile]) {
        let renderer = self.renderer(frames);
        band.begin(&self.canvas, row, BAND_ROWS.min(self.canvas.rows - row));
        let places = band.tile_pixels(&self.canvas, tiles);
        (tiles.par_iter().zip(places)).for_each_init(
            TileBuffers::default,
            |buffers, (tile, place)| {
                renderer.draw(tile, place, buffers);
            },
        );
    }

    fn renderer<'b>(&'b self, frames: &'b PictureCache) -> TileRenderer<'b> {
        let composition = match (self.mode, &self.settled.seams) {
            (Mode::BestView, Some(seams)) => Composition::Seams(seams),
            (Mode::Median, _) => Composition::Median,
            _ => Composition::Average,
        };
        TileRenderer {
            surface: self.surface,
            frames,
            placements: self.placements,
            canvas: &self.canvas,
            kernels: &self.kernels,
            exposure: &self.settled.exposure,
            composition,
        }
    }
}
