//! Conversion of panorama bands to textured pieces of the wall, level by level.

use crate::inspect::glb::{TextureExtent, WallPart};
use crate::inspect::level_strip::{BORDER, LevelStrip, TextureBlock};
use crate::inspect::mesh::{GridLines, Mesh, WallRectangle};
use crate::raster::{
    LevelTile, OverviewBuilder, RasterError, RasterSpec, RasterTile, Reduce, SampleType,
    TILE_EDGE_PX, compress_jpeg,
};
use crate::render::{Band, Canvas, PixelFormat};
use crate::surface::Surface;
use std::io;

/// Maximum deviation of the triangles from the wall, pixels of the texture.
const TOLERANCE_PX: f64 = 0.125;

/// Cuts bands into the texture blocks of all levels.
pub(super) struct BlockCutter {
    spec: RasterSpec,
    pyramid: OverviewBuilder,
    strips: Vec<LevelStrip>,
}

/// Format of the textures' source: 8 bits per sample, alpha last.
fn raster_spec(canvas: &Canvas, format: PixelFormat) -> RasterSpec {
    RasterSpec {
        width: canvas.columns,
        height: canvas.rows,
        samples: SampleType::U8,
        channels: format.channels as u8,
        alpha: true,
        nodata: None,
        reduce: Reduce::Mean,
        georeference: None,
        quantity: None,
    }
}

impl BlockCutter {
    /// A cutter of all levels of a canvas into blocks of one tile.
    ///
    /// # Errors
    /// [`RasterError`] for a canvas that cannot be a raster.
    pub(super) fn pyramid(canvas: &Canvas, format: PixelFormat) -> Result<Self, RasterError> {
        let spec = raster_spec(canvas, format);
        Self::new(spec, spec.levels_to_one_tile(), 1)
    }

    /// A cutter of the finest level of a canvas into blocks of `tiles` × `tiles` tiles.
    ///
    /// # Errors
    /// [`RasterError`] for a canvas that cannot be a raster.
    pub(super) fn single(
        canvas: &Canvas,
        format: PixelFormat,
        tiles: usize,
    ) -> Result<Self, RasterError> {
        Self::new(raster_spec(canvas, format), 1, tiles)
    }

    fn new(spec: RasterSpec, levels: usize, tiles: usize) -> Result<Self, RasterError> {
        let strip = |level| LevelStrip::new(spec.size(level), spec.pixel_bytes(), tiles);
        Ok(Self {
            spec,
            pyramid: OverviewBuilder::new(spec, levels)?,
            strips: (0..levels).map(strip).collect(),
        })
    }

    /// Number of levels.
    pub(super) fn levels(&self) -> usize {
        self.strips.len()
    }

    /// Number of columns and rows of one-tile blocks of a level.
    pub(super) fn grid(&self, level: usize) -> [u32; 2] {
        self.spec.grid(level)
    }

    /// Number of channels of a texture without alpha.
    pub(super) fn channels(&self) -> usize {
        usize::from(self.spec.channels)
    }

    /// Maximum memory of the cutter, bytes.
    pub(super) fn max_bytes(&self) -> u64 {
        let strips: u64 = self.strips.iter().map(LevelStrip::max_bytes).sum();
        strips + self.spec.pending_bytes(crate::raster::TileOrder::Rows)
    }

    /// Adds the next band; returns the blocks that it completes, with their levels.
    ///
    /// # Errors
    /// [`RasterError`] for a band that was added before.
    pub(super) fn add(&mut self, band: &Band) -> Result<Vec<(usize, TextureBlock)>, RasterError> {
        let complete = self.pyramid.add(self.tiles(band))?;
        let mut blocks = Vec::new();
        for (level, strip) in self.strips.iter_mut().enumerate() {
            let of_level = |tile: &&LevelTile| tile.level == level;
            let tiles: Vec<&RasterTile> =
                complete.iter().filter(of_level).map(|t| &t.tile).collect();
            blocks.extend(strip.add(&tiles).into_iter().map(|block| (level, block)));
        }
        Ok(blocks)
    }

    /// Divides a band into tiles.
    fn tiles(&self, band: &Band) -> Vec<RasterTile> {
        let (width, bytes) = (self.spec.width as usize, self.spec.pixel_bytes());
        let samples = band.samples.to_eight();
        let tile = |column: usize| {
            let first = column * TILE_EDGE_PX * bytes;
            let count = TILE_EDGE_PX.min(width - column * TILE_EDGE_PX) * bytes;
            let mut pixels = vec![0; TILE_EDGE_PX * TILE_EDGE_PX * bytes];
            for (to, from) in pixels
                .chunks_exact_mut(TILE_EDGE_PX * bytes)
                .zip(samples.chunks_exact(width * bytes))
            {
                to[..count].copy_from_slice(&from[first..][..count]);
            }
            RasterTile {
                column: column as u32,
                row: band.row / TILE_EDGE_PX as u32,
                pixels,
            }
        };
        (0..width.div_ceil(TILE_EDGE_PX)).map(tile).collect()
    }
}

/// Builds the textured mesh of a block of a level.
///
/// # Errors
/// An [`io::Error`] if the texture cannot be encoded.
pub(super) fn build_part(
    surface: &dyn Surface,
    canvas: &Canvas,
    (level, block): &(usize, TextureBlock),
    channels: usize,
    quality: u8,
) -> io::Result<WallPart> {
    let px_m = 2f64.powi(*level as i32) / canvas.px_per_metre;
    let start_m = [0.0, canvas.h_start_m];
    let end_m = [surface.perimeter_m(), canvas.chainage_m()[1]];
    // The last pixels of an overview cover less wall than others.
    let range = |k: usize| {
        let [from, size] = [block.corner[k], block.size[k]].map(|px| px as f64 * px_m);
        [start_m[k] + from, (start_m[k] + from + size).min(end_m[k])]
    };
    let rectangle = WallRectangle {
        s_m: range(0),
        h_m: range(1),
    };
    let border_m = BORDER as f64 * px_m;
    let lines = GridLines::cut(surface, &rectangle, TOLERANCE_PX * px_m, px_m);
    Ok(WallPart {
        mesh: Mesh::new(surface, &lines),
        jpeg: compress_jpeg(&block.pixels, block.texture_size(), channels, quality)?,
        extent: TextureExtent {
            corner_m: [rectangle.s_m[0] - border_m, rectangle.h_m[0] - border_m],
            extent_m: block.texture_size().map(|side| side as f64 * px_m),
        },
    })
}
