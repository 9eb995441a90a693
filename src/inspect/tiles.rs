//! The wall as 3D Tiles: a folder that programs stream from.

use super::InspectError;
use super::cut::{Cutter, part};
use super::glb::{Part, glb};
use super::strip::Block;
use super::tileset::{Key, Tree, content_name};
use crate::persist::atomic::{self, StagedFolder, WriteError};
use crate::raster::RasterError;
use crate::render::{Band, Canvas, PixelFormat, RenderError, Target};
use crate::surface::Surface;
use nalgebra::Vector3;
use rayon::prelude::*;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Takes bands and writes `tileset.json` and `LEVEL/COLUMN_ROW.glb` into a folder: textures of 512
/// × 512 px and their borders.
pub struct TilesTarget<'a> {
    surface: &'a dyn Surface,
    folder: PathBuf,
    quality: u8,
    cutter: Cutter,
    bounds_m: HashMap<Key, [Vector3<f64>; 2]>,
    map: Option<usize>,
}

/// Columns of the canvas are a multiple of this, so that overviews go around as exactly as the
/// canvas does.
const COLUMNS: f64 = 64.0;

/// Columns of the level of which a map is made, at the most.
const MAP_COLUMNS: u32 = 512;

/// Folder of the map's pictures.
pub(super) const MAP: &str = "map";

/// The next resolution from `px_per_metre` on at which the levels of a tunnel meet themselves
/// around the section.
pub fn tiles_px_per_metre(surface: &dyn Surface, px_per_metre: f64) -> f64 {
    let perimeter_m = surface.perimeter_m();
    // A resolution of this kind stays as it is, whatever its last digit.
    let columns = (perimeter_m * px_per_metre / COLUMNS - 1e-6)
        .ceil()
        .max(1.0)
        * COLUMNS;
    columns / perimeter_m
}

impl<'a> TilesTarget<'a> {
    /// Begins the tiles in `folder`, which is there; their pictures are JPEGs of `quality` (1–100).
    ///
    /// # Errors
    /// A canvas that is no raster; whatever the system says.
    pub fn new(
        surface: &'a dyn Surface,
        canvas: &Canvas,
        format: PixelFormat,
        folder: &Path,
        quality: u8,
    ) -> Result<Self, InspectError> {
        let cutter = Cutter::pyramid(canvas, format)?;
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

    /// Also writes the pictures of one level into `map/ROW.jpg`, for [`super::Manifest`]; its place
    /// in it.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn with_map(&mut self, canvas: &Canvas) -> Result<super::MapPlace, InspectError> {
        atomic::create_folder(&self.folder.join(MAP))?;
        let last = self.cutter.levels() - 1;
        let narrow = |level: &usize| canvas.columns >> level <= MAP_COLUMNS;
        let level = (0..last).find(narrow).unwrap_or(last);
        self.map = Some(level);
        Ok(super::MapPlace::new(canvas, level))
    }

    /// Memory that it holds at the most, bytes.
    pub fn most_bytes(&self) -> u64 {
        self.cutter.most_bytes()
    }

    /// Writes the tree.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn finish(self, canvas: &Canvas) -> Result<(), InspectError> {
        let tree = Tree {
            px_per_metre: canvas.px_per_metre,
            grids: (0..self.cutter.levels())
                .map(|level| self.cutter.grid(level))
                .collect(),
            bounds_m: &self.bounds_m,
        };
        for (name, file) in tree.files() {
            write(&self.folder.join(name), file.to_string().as_bytes())?;
        }
        Ok(())
    }

    fn write(
        &self,
        canvas: &Canvas,
        block: &(usize, Block),
    ) -> Result<(Key, [Vector3<f64>; 2]), WriteError> {
        let (level, Block { column, row, .. }) = block;
        let key = (*level, *column, *row);
        let path = self.folder.join(content_name(key));
        let part = part(
            self.surface,
            canvas,
            block,
            self.cutter.channels(),
            self.quality,
        )
        .map_err(|error| WriteError::new(&path, error))?;
        if self.map == Some(*level) {
            write(
                &self.folder.join(MAP).join(format!("{row}.jpg")),
                &part.jpeg,
            )?;
        }
        let bounds_m = part.mesh.bounds_m();
        let parts: [Part; 1] = [part];
        write(&path, &glb(&parts))?;
        Ok((key, bounds_m))
    }
}

/// Writes a file of a folder that is not yet in its place.
fn write(path: &Path, bytes: &[u8]) -> Result<(), WriteError> {
    std::fs::write(path, bytes).map_err(|source| WriteError::new(path, source))
}

impl Target for TilesTarget<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let blocks = self.cutter.add(band)?;
        let written = blocks
            .par_iter()
            .map(|block| self.write(canvas, block))
            .collect::<Result<Vec<_>, WriteError>>()
            .map_err(RasterError::Write)?;
        self.bounds_m.extend(written);
        Ok(())
    }
}

/// A folder of tiles of its own: appears whole or not at all.
pub struct TilesFolder<'a> {
    staged: StagedFolder,
    target: TilesTarget<'a>,
}

impl<'a> TilesFolder<'a> {
    /// Begins `folder`.
    ///
    /// # Errors
    /// As [`TilesTarget::new`].
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

    /// What takes the bands.
    pub fn target(&mut self) -> &mut TilesTarget<'a> {
        &mut self.target
    }

    /// Gives the folder its name.
    ///
    /// # Errors
    /// Whatever the system says.
    pub fn finish(self, canvas: &Canvas) -> Result<(), InspectError> {
        self.target.finish(canvas)?;
        Ok(self.staged.finish()?)
    }
}
