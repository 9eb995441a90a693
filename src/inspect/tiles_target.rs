//! Export of the wall as 3D Tiles, a folder that programs stream from.

use crate::inspect::block_cutter::{BlockCutter, build_part};
use crate::inspect::error::InspectError;
use crate::inspect::glb::{WallPart, encode_glb};
use crate::inspect::level_strip::TextureBlock;
use crate::inspect::manifest::{MAP_FOLDER, MapImages};
use crate::inspect::tileset::{TileKey, TileTree, content_name};
use crate::persist::atomic::{self, OutputSet, StagedFolder, WriteError};
use crate::raster::RasterError;
use crate::render::{Band, Canvas, PixelFormat, RenderError, Target};
use crate::surface::Surface;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Render target that writes `tileset.json` and `LEVEL/COLUMN_ROW.glb` into a folder.
///
/// Textures have 512 × 512 px and a border.
pub struct TilesTarget<'a> {
    surface: &'a dyn Surface,
    folder: PathBuf,
    quality: u8,
    cutter: BlockCutter,
    bounds_m: HashMap<TileKey, [Vector3<f64>; 2]>,
    map: Option<usize>,
}

/// Divisor of the number of columns of a canvas, so that overviews close around the section.
const COLUMN_MULTIPLE: f64 = 64.0;

/// Maximum columns of the level of the map.
const MAX_MAP_COLUMNS: u32 = 512;

/// Smallest resolution of at least `px_per_metre` at which all levels close around the section.
pub fn tiles_px_per_metre(surface: &dyn Surface, px_per_metre: f64) -> f64 {
    let perimeter_m = surface.perimeter_m();
    // The margin keeps a resolution that is already suitable despite rounding.
    let columns = (perimeter_m * px_per_metre / COLUMN_MULTIPLE - 1e-6)
        .ceil()
        .max(1.0)
        * COLUMN_MULTIPLE;
    columns / perimeter_m
}

impl<'a> TilesTarget<'a> {
    /// A target for the existing `folder`, with JPEG textures of `quality` (1–100).
    ///
    /// # Errors
    /// [`InspectError::Raster`] for a canvas that cannot be a raster; [`InspectError::Write`].
    pub fn new(
        surface: &'a dyn Surface,
        canvas: &Canvas,
        format: PixelFormat,
        folder: &Path,
        quality: u8,
    ) -> Result<Self, InspectError> {
        let cutter = BlockCutter::pyramid(canvas, format)?;
        for level in 0..cutter.levels() {
            atomic::create_folder(&folder.join(level.to_string()))?;
        }
        Ok(Self {
            surface,
            folder: folder.to_owned(),
            quality,
            cutter,
            bounds_m: HashMap::new(),
            map: None,
        })
    }

    /// Also writes the images of one level, `map/ROW.jpg`, and returns their description.
    ///
    /// # Errors
    /// [`InspectError::Write`].
    pub fn with_map(&mut self, canvas: &Canvas) -> Result<MapImages, InspectError> {
        atomic::create_folder(&self.folder.join(MAP_FOLDER))?;
        let last = self.cutter.levels() - 1;
        let narrow = |level: &usize| canvas.columns >> level <= MAX_MAP_COLUMNS;
        let level = (0..last).find(narrow).unwrap_or(last);
        self.map = Some(level);
        Ok(MapImages::new(canvas, level))
    }

    /// Maximum memory of a target for `canvas`, bytes.
    ///
    /// # Errors
    /// [`RasterError`] for a canvas that cannot be a raster.
    pub fn bytes_for(canvas: &Canvas, format: PixelFormat) -> Result<u64, RasterError> {
        Ok(BlockCutter::pyramid(canvas, format)?.max_bytes())
    }

    /// Maximum memory of the target, bytes.
    pub fn max_bytes(&self) -> u64 {
        self.cutter.max_bytes()
    }

    /// Writes the tree of tiles.
    ///
    /// # Errors
    /// [`InspectError::Write`].
    pub fn finish(self, canvas: &Canvas) -> Result<(), InspectError> {
        let tree = TileTree {
            px_per_metre: canvas.px_per_metre,
            grids: (0..self.cutter.levels())
                .map(|level| self.cutter.grid(level))
                .collect(),
            bounds_m: &self.bounds_m,
        };
        for (name, file) in tree.files() {
            write_file(&self.folder.join(name), file.to_string().as_bytes())?;
        }
        Ok(())
    }

    /// Writes the tile of a block; returns its key and bounding box.
    fn write_tile(
        &self,
        canvas: &Canvas,
        block: &(usize, TextureBlock),
    ) -> Result<(TileKey, [Vector3<f64>; 2]), WriteError> {
        let (level, TextureBlock { column, row, .. }) = block;
        let key = (*level, *column, *row);
        let path = self.folder.join(content_name(key));
        let part = build_part(
            self.surface,
            canvas,
            block,
            self.cutter.channels(),
            self.quality,
        )
        .map_err(|error| WriteError::new(&path, error))?;
        if self.map == Some(*level) {
            write_file(
                &self.folder.join(MAP_FOLDER).join(format!("{row}.jpg")),
                &part.jpeg,
            )?;
        }
        let bounds_m = part.mesh.bounds_m();
        let parts: [WallPart; 1] = [part];
        write_file(&path, &encode_glb(&parts))?;
        Ok((key, bounds_m))
    }
}

/// Writes a file of a staged folder.
fn write_file(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    std::fs::write(path, bytes).map_err(|source| WriteError::new(path, source))
}

impl Target for TilesTarget<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let blocks = self.cutter.add(band)?;
        let written = blocks
            .par_map(|block| self.write_tile(canvas, block))
            .into_iter()
            .collect::<Result<Vec<_>, WriteError>>()
            .map_err(RasterError::Write)?;
        self.bounds_m.extend(written);
        Ok(())
    }
}

/// Folder of tiles that appears atomically.
pub struct TilesFolder<'a> {
    staged: StagedFolder,
    target: TilesTarget<'a>,
}

impl<'a> TilesFolder<'a> {
    /// Starts to write `folder`.
    ///
    /// # Errors
    /// [`InspectError::Raster`] for a canvas that cannot be a raster; [`InspectError::Write`].
    pub fn begin(
        surface: &'a dyn Surface,
        canvas: &Canvas,
        format: PixelFormat,
        folder: &Path,
        quality: u8,
    ) -> Result<Self, InspectError> {
        let staged = StagedFolder::begin(folder)?;
        let target = TilesTarget::new(surface, canvas, format, staged.path(), quality)?;
        Ok(Self { staged, target })
    }

    /// The render target.
    pub fn target(&mut self) -> &mut TilesTarget<'a> {
        &mut self.target
    }

    /// Writes the tree of tiles and adds the folder to a set of outputs.
    ///
    /// # Errors
    /// [`InspectError::Write`].
    pub fn finish(self, outputs: &mut OutputSet, canvas: &Canvas) -> Result<(), InspectError> {
        self.target.finish(canvas)?;
        Ok(outputs.folder(self.staged)?)
    }
}
