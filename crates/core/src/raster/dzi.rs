//! Deep Zoom: a folder of small pictures for viewers in the browser, without a special server.

use super::error::RasterError;
use super::jpeg;
use super::overviews::{LevelTile, OverviewBuilder, Waiting};
use super::spec::{RasterSpec, RasterTile, SampleType, TILE_EDGE_PX};
use crate::persist::atomic::{self, OutputSet, StagedFolder, WriteError};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use tunnelstitch_geometry::files::write_without_links;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// The format of the pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DziFormat {
    /// Lossy; no data is black.
    Jpeg {
        /// 1 to 100.
        quality: u8,
    },
    /// Lossless, with alpha.
    Png,
}

/// A writer of Deep Zoom pictures: `NAME.dzi` and the folder `NAME_files/LEVEL/COLUMN_ROW.jpg` or
/// `.png`, from one pixel at level 0 to full resolution, in tiles of [`TILE_EDGE_PX`] pixels
/// without overlap. 8-bit samples only.
pub struct DziWriter {
    spec: RasterSpec,
    format: DziFormat,
    target: PathBuf,
    pyramid: OverviewBuilder,
    levels: usize,
    folder: StagedFolder,
    /// Tiles written.
    written: u64,
    /// Tiles that may not be synchronised to disk yet.
    unsynced: Mutex<Vec<PathBuf>>,
}

/// The state of a resumable [`DziWriter`].
#[derive(Debug, Serialize, Deserialize)]
pub struct DziState<'a> {
    waiting: Cow<'a, Waiting>,
    written: u64,
}

impl DziWriter {
    /// Begins the picture `target`, a name that ends in `.dzi`, and the folder beside it.
    ///
    /// # Errors
    /// [`RasterError::Unsupported`] for another name, or an inconsistent raster or one without
    /// samples of 8 bits; an error of the operating system.
    pub fn begin(target: &Path, spec: RasterSpec, format: DziFormat) -> Result<Self, RasterError> {
        Self::with(target, spec, format, || {
            StagedFolder::begin(&files_folder(target))
        })
    }

    /// Begins the picture `target`, or resumes from `state`, with the tiles in `folder` on the same
    /// disk, which is kept in any case.
    ///
    /// # Errors
    /// The errors of [`DziWriter::begin`].
    pub fn begin_resumable(
        target: &Path,
        spec: RasterSpec,
        format: DziFormat,
        folder: &Path,
        state: Option<DziState>,
    ) -> Result<Self, RasterError> {
        let mut writer = Self::with(target, spec, format, || {
            StagedFolder::adopt(&files_folder(target), folder)
        })?;
        if let Some(state) = state {
            writer.pyramid.go_on(state.waiting.into_owned());
            writer.written = state.written;
        }
        Ok(writer)
    }

    /// The current state; all of its tiles are synchronised to disk.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn state(&self) -> Result<DziState<'_>, WriteError> {
        let fail = |source| WriteError::new(self.folder.path(), source);
        let mut unsynced = self.unsynced.lock().unwrap_or_else(PoisonError::into_inner);
        atomic::sync_files(&unsynced).map_err(fail)?;
        unsynced.clear();
        Ok(DziState {
            waiting: Cow::Borrowed(self.pyramid.waiting()),
            written: self.written,
        })
    }

    fn with(
        target: &Path,
        spec: RasterSpec,
        format: DziFormat,
        folder: impl FnOnce() -> Result<StagedFolder, WriteError>,
    ) -> Result<Self, RasterError> {
        let levels = spec.levels_to(1);
        let pyramid = OverviewBuilder::new(spec, levels)?;
        if let DziFormat::Jpeg { quality } = format {
            jpeg::check(&spec, quality)?;
        }
        if spec.samples != SampleType::U8 {
            return Err(RasterError::Unsupported("Deep Zoom has samples of 8 bits"));
        }
        if target
            .extension()
            .is_none_or(|extension| extension != "dzi")
        {
            return Err(RasterError::Unsupported(
                "the name of a Deep Zoom picture ends in .dzi",
            ));
        }
        if target.is_dir() {
            let what = io::Error::other("it is a folder, and a file is to be written");
            return Err(WriteError::new(target, what).into());
        }
        let folder = folder()?;
        for level in 0..levels {
            atomic::create_folder(&folder.path().join(level.to_string()))?;
        }
        Ok(Self {
            spec,
            format,
            target: target.to_owned(),
            pyramid,
            levels,
            folder,
            written: 0,
            unsynced: Mutex::default(),
        })
    }

    /// Adds tiles of full resolution, in any order. The picture is abandoned if this fails.
    ///
    /// # Errors
    /// [`RasterError::Tile`] for one outside the picture, a duplicate or one of the wrong size; an
    /// error of the operating system.
    pub fn add(&mut self, batch: Vec<RasterTile>) -> Result<(), RasterError> {
        let complete = self.pyramid.add(batch)?;
        let written: Vec<PathBuf> = complete
            .par_map(|tile| self.write(tile))
            .into_iter()
            .collect::<Result<_, _>>()?;
        self.written += written.len() as u64;
        let unsynced = self.unsynced.get_mut();
        unsynced
            .unwrap_or_else(PoisonError::into_inner)
            .extend(written);
        Ok(())
    }

    /// Adds the folder and the `.dzi` to a set of outputs; existing ones are replaced.
    ///
    /// # Errors
    /// [`RasterError::Incomplete`]; an error of the operating system.
    pub fn finish(self, outputs: &mut OutputSet) -> Result<(), RasterError> {
        let tiles = self.spec.tiles(self.levels);
        let missing = tiles - self.written;
        if missing > 0 {
            return Err(RasterError::Incomplete { missing, tiles });
        }
        outputs.write_text(&self.target, &description(&self.spec, self.format))?;
        outputs.folder(self.folder)?;
        Ok(())
    }

    /// Writes the part of a tile within the picture and returns its name.
    fn write(&self, LevelTile { level, tile }: &LevelTile) -> Result<PathBuf, WriteError> {
        let RasterTile {
            column,
            row,
            pixels,
        } = tile;
        let extent = self.spec.extent(*level, *column, *row);
        // Deep Zoom counts levels from the smallest.
        let level = self.levels - 1 - level;
        let name = format!("{level}/{column}_{row}.{}", self.format.extension());
        let path = self.folder.path().join(name);
        let encoded = match self.format {
            DziFormat::Jpeg { quality } => {
                jpeg::encode(&self.spec, pixels, extent, extent, quality)
            }
            DziFormat::Png => encode_png(&self.spec, pixels, extent),
        };
        encoded
            .and_then(|bytes| write_without_links(&path, &bytes))
            .map_err(|source| WriteError::new(&path, source))?;
        Ok(path)
    }
}

impl DziFormat {
    fn extension(self) -> &'static str {
        match self {
            Self::Jpeg { .. } => "jpg",
            Self::Png => "png",
        }
    }
}

/// The folder of the tiles of `NAME.dzi`: `NAME_files`.
pub fn files_folder(target: &Path) -> PathBuf {
    let mut name = target.file_stem().unwrap_or_default().to_owned();
    name.push("_files");
    target.with_file_name(name)
}

/// The content of the `.dzi`.
fn description(spec: &RasterSpec, format: DziFormat) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n\
         <Image xmlns=\"http://schemas.microsoft.com/deepzoom/2008\" \
         Format=\"{}\" Overlap=\"0\" TileSize=\"{TILE_EDGE_PX}\">\
         <Size Width=\"{}\" Height=\"{}\"/></Image>\n",
        format.extension(),
        spec.width,
        spec.height
    )
}

/// Encodes the upper left `extent` of a tile.
fn encode_png(spec: &RasterSpec, pixels: &[u8], extent: [usize; 2]) -> io::Result<Vec<u8>> {
    let [width, height] = extent;
    let bytes = spec.pixel_bytes();
    let rows = pixels.chunks_exact(TILE_EDGE_PX * bytes).take(height);
    let visible: Vec<&[u8]> = rows.map(|row| &row[..width * bytes]).collect();
    let visible = visible.concat();
    let colour = match (spec.channels, spec.alpha) {
        (1, false) => ExtendedColorType::L8,
        (1, true) => ExtendedColorType::La8,
        (_, false) => ExtendedColorType::Rgb8,
        (_, true) => ExtendedColorType::Rgba8,
    };
    let mut encoded = Vec::new();
    PngEncoder::new_with_quality(&mut encoded, CompressionType::Fast, FilterType::Adaptive)
        .write_image(&visible, width as u32, height as u32, colour)
        .map_err(io::Error::other)?;
    Ok(encoded)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::test_picture::{grey_alpha, pixel, tiles};

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    fn finish(writer: DziWriter) -> Result<(), RasterError> {
        let mut outputs = OutputSet::default();
        writer.finish(&mut outputs)?;
        Ok(outputs.commit()?)
    }

    #[test]
    fn a_picture_of_all_levels_appears_when_it_is_whole() {
        let dir = tempfile::tempdir().unwrap();
        let spec = grey_alpha(700, 1100);
        let target = dir.path().join("wall.dzi");
        let mut writer = DziWriter::begin(&target, spec, DziFormat::Png).unwrap();
        let mut all = tiles(&spec);
        let last = all.pop().unwrap();
        writer.add(all).unwrap();
        assert_eq!(names(dir.path()).len(), 1, "a temporary folder only");
        writer.add(vec![last]).unwrap();
        finish(writer).unwrap();
        assert_eq!(names(dir.path()), ["wall.dzi", "wall_files"]);

        let files = dir.path().join("wall_files");
        assert_eq!(names(&files).len(), 12);
        let tile = image::open(files.join("11/1_2.png"))
            .unwrap()
            .to_luma_alpha8();
        assert_eq!(tile.dimensions(), (700 - 512, 1100 - 1024));
        assert_eq!(tile.get_pixel(9, 7).0.to_vec(), pixel(&spec, 521, 1031));
        let smallest = image::open(files.join("0/0_0.png")).unwrap();
        assert_eq!((smallest.width(), smallest.height()), (1, 1));
        let text = std::fs::read_to_string(&target).unwrap();
        assert!(text.contains("Width=\"700\" Height=\"1100\""), "{text}");
    }

    #[test]
    fn jpeg_puts_holes_on_black() {
        let dir = tempfile::tempdir().unwrap();
        let spec = grey_alpha(700, 100);
        let target = dir.path().join("wall.dzi");
        let format = DziFormat::Jpeg { quality: 90 };
        let mut writer = DziWriter::begin(&target, spec, format).unwrap();
        writer.add(tiles(&spec)).unwrap();
        finish(writer).unwrap();
        let path = dir.path().join("wall_files/10/1_0.jpg");
        let tile = image::open(path).unwrap().to_luma8();
        assert_eq!(tile.dimensions(), (188, 100));
        assert_eq!(tile.get_pixel(0, 0).0, [0]);
    }

    #[test]
    fn what_is_not_whole_leaves_the_old_picture_and_no_litter() {
        let dir = tempfile::tempdir().unwrap();
        let spec = grey_alpha(700, 100);
        let target = dir.path().join("wall.dzi");
        for whole in [true, false] {
            let mut writer = DziWriter::begin(&target, spec, DziFormat::Png).unwrap();
            let mut all = tiles(&spec);
            if !whole {
                all.pop();
            }
            writer.add(all).unwrap();
            assert_eq!(finish(writer).is_ok(), whole);
            assert_eq!(names(dir.path()), ["wall.dzi", "wall_files"]);
        }
        assert_eq!(names(&dir.path().join("wall_files/10")).len(), 2);
        for bad in ["wall", "wall.jpg"] {
            assert!(DziWriter::begin(&dir.path().join(bad), spec, DziFormat::Png).is_err());
        }
    }
}
