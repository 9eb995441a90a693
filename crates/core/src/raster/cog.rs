//! Cloud-Optimised GeoTIFF: a file from which any window at any resolution can be read separately.

use super::compression::Compression;
use super::compression::Packed;
use super::directory::{self, Directory, Values, tag};
use super::error::RasterError;
use super::geo_tags::{bands_tag, geo_tags};
use super::overviews::{LevelTile, OverviewBuilder, Waiting};
use super::spec::{Nodata, RasterSpec, RasterTile, SampleType, TILE_EDGE_PX};
use super::spool::{Spool, Stored};
use super::{deflate, jpeg};
use crate::persist::atomic::{OutputSet, WriteError};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// A writer of Cloud-Optimised GeoTIFF (BigTIFF, tiles of [`TILE_EDGE_PX`] pixels, overviews down
/// to one tile).
///
/// Compressed tiles are spooled to a temporary file beside the target and copied into it by
/// [`CogWriter::finish`], smallest overview first, so that twice the size of the file is needed on
/// disk for that time. Empty tiles take no space.
pub struct CogWriter {
    spec: RasterSpec,
    compression: Compression,
    target: PathBuf,
    pyramid: OverviewBuilder,
    spool: Spool,
    /// Tiles of every level, row by row.
    stored: Vec<Vec<Option<Stored>>>,
}

/// The state of a resumable [`CogWriter`].
#[derive(Debug, Serialize, Deserialize)]
pub struct CogState<'a> {
    waiting: Cow<'a, Waiting>,
    stored: Cow<'a, [Vec<Option<Stored>>]>,
    /// Size of the spool file, bytes.
    end: u64,
}

/// Offsets and sizes of the tiles of a level in the file; 0 for empty tiles.
#[derive(Debug, Default)]
struct Places {
    offsets: Vec<u64>,
    bytes: Vec<u32>,
}

impl Places {
    /// Adds a tile after its leader at `at`, and advances `at` past its trailer.
    fn push(&mut self, at: &mut u64, bytes: u32) {
        self.bytes.push(bytes);
        if bytes == 0 {
            self.offsets.push(0);
            return;
        }
        self.offsets.push(*at + TILE_FRAME_BYTES);
        *at += u64::from(bytes) + 2 * TILE_FRAME_BYTES;
    }
}

/// Size of a tile's leader and of its trailer, bytes.
const TILE_FRAME_BYTES: u64 = 4;

impl CogWriter {
    /// Begins the file `target`.
    ///
    /// # Errors
    /// [`RasterError::Unsupported`] for an inconsistent raster or one that `compression` does not
    /// support; an error of the operating system about the temporary file.
    pub fn begin(
        target: &Path,
        spec: RasterSpec,
        compression: Compression,
    ) -> Result<Self, RasterError> {
        Self::with(target, spec, compression, || {
            Spool::temporary_beside(target)
        })
    }

    /// Begins the file `target`, or resumes from `state`, with the compressed tiles in the file
    /// `tiles`, which is kept in any case.
    ///
    /// # Errors
    /// The errors of [`CogWriter::begin`]; fewer tiles in the file than in the state.
    pub fn begin_resumable(
        target: &Path,
        spec: RasterSpec,
        compression: Compression,
        tiles: &Path,
        state: Option<CogState>,
    ) -> Result<Self, RasterError> {
        let end = state.as_ref().map_or(0, |state| state.end);
        let mut writer = Self::with(target, spec, compression, || Spool::reopen(tiles, end))?;
        if let Some(state) = state {
            writer.pyramid.go_on(state.waiting.into_owned());
            writer.stored = state.stored.into_owned();
        }
        Ok(writer)
    }

    fn with(
        target: &Path,
        spec: RasterSpec,
        compression: Compression,
        spool: impl FnOnce() -> Result<Spool, WriteError>,
    ) -> Result<Self, RasterError> {
        let levels = spec.levels_to_one_tile();
        let pyramid = OverviewBuilder::new(spec, levels)?;
        compression.check(&spec)?;
        if target.is_dir() {
            let what = io::Error::other("it is a folder, and a file is to be written");
            return Err(WriteError::new(target, what).into());
        }
        let stored = (0..levels)
            .map(|level| vec![None; spec.tiles_of(level)])
            .collect();
        Ok(Self {
            spec,
            compression,
            target: target.to_owned(),
            pyramid,
            spool: spool()?,
            stored,
        })
    }

    /// The current state; all of its tiles are synchronised to disk.
    ///
    /// # Errors
    /// An error of the operating system.
    pub fn state(&self) -> Result<CogState<'_>, WriteError> {
        let end = self.spool.synced();
        Ok(CogState {
            waiting: Cow::Borrowed(self.pyramid.waiting()),
            stored: Cow::Borrowed(&self.stored),
            end: end.map_err(|source| WriteError::new(&self.target, source))?,
        })
    }

    /// Adds tiles of full resolution, in any order. The file is abandoned if this fails.
    ///
    /// # Errors
    /// [`RasterError::Tile`] for one outside the picture, a duplicate or one of the wrong size; an
    /// error of the operating system.
    pub fn add(&mut self, batch: Vec<RasterTile>) -> Result<(), RasterError> {
        let complete = self.pyramid.add(batch)?;
        self.store(&complete)
    }

    /// Takes over the tiles of another writer of a part of the same picture: its state, and its
    /// file of compressed tiles, which is left as it is. Overviews of tiles of both are completed,
    /// so that the file does not depend on how the picture was divided.
    ///
    /// # Errors
    /// [`RasterError::Tile`] for a tile that is there already; [`RasterError::Unsupported`] for the
    /// state of another picture; an error of the operating system.
    pub fn absorb(&mut self, part: CogState, tiles: &Path) -> Result<(), RasterError> {
        let fail = |source| WriteError::new(tiles, source);
        let sizes =
            |stored: &[Vec<Option<Stored>>]| stored.iter().map(Vec::len).collect::<Vec<_>>();
        if sizes(&self.stored) != sizes(&part.stored) {
            return Err(RasterError::Unsupported("a part of another picture"));
        }
        let complete = self.pyramid.absorb(part.waiting.into_owned())?;
        let mut spool = Spool::of_part(tiles)?;
        let mut packed = Packed::default();
        for (own, part) in self.stored.iter_mut().zip(part.stored.iter()) {
            for (own, part) in own.iter_mut().zip(part) {
                if let Some(stored) = part {
                    spool.read(stored, &mut packed).map_err(fail)?;
                    *own = Some(self.spool.append(&packed).map_err(fail)?);
                }
            }
        }
        self.store(&complete)
    }

    /// Compresses complete tiles and appends them to the spool.
    fn store(&mut self, complete: &[LevelTile]) -> Result<(), RasterError> {
        let fail = |source| WriteError::new(&self.target, source);
        let (spec, compression) = (self.spec, self.compression);
        let packed: Vec<Packed> = complete
            .par_map(|tile| compression.pack(&spec, tile))
            .into_iter()
            .collect::<io::Result<_>>()
            .map_err(fail)?;
        for (LevelTile { level, tile }, packed) in complete.iter().zip(&packed) {
            let place = spec.place(*level, tile.column, tile.row);
            self.stored[*level][place] = Some(self.spool.append(packed).map_err(fail)?);
        }
        Ok(())
    }

    /// Writes the file and adds it to a set of outputs; a file of that name is replaced.
    ///
    /// # Errors
    /// [`RasterError::Incomplete`]; an error of the operating system.
    pub fn finish(mut self, outputs: &mut OutputSet) -> Result<(), RasterError> {
        let tiles = self.spec.tiles(self.stored.len());
        let levels: Vec<Vec<Stored>> = (self.stored.iter())
            .map(|tiles| tiles.iter().copied().flatten().collect())
            .collect();
        let missing = tiles - levels.iter().map(|tiles| tiles.len() as u64).sum::<u64>();
        if missing > 0 {
            return Err(RasterError::Incomplete { missing, tiles });
        }
        let head = self.head(&levels);
        outputs.write(&self.target, |writer| {
            writer.write_all(&head)?;
            let mut packed = Packed::default();
            for stored in levels.iter().rev().flatten() {
                self.spool.read(stored, &mut packed)?;
                for block in [&packed.image, &packed.mask] {
                    write_block(writer, block)?;
                }
            }
            Ok(())
        })?;
        Ok(())
    }

    /// The part of the file before the first tile.
    fn head(&self, levels: &[Vec<Stored>]) -> Vec<u8> {
        let ghost = ghost(self.compression.masks(&self.spec));
        // The first pass determines the length only.
        let length = directory::encode(&ghost, &self.directories(levels, 0)).len();
        directory::encode(&ghost, &self.directories(levels, length as u64))
    }

    /// The directories of all levels, full resolution first, each before that of its mask; `at` is
    /// the offset of the first tile.
    fn directories(&self, levels: &[Vec<Stored>], mut at: u64) -> Vec<Directory> {
        let mut directories = Vec::new();
        for (level, tiles) in levels.iter().enumerate().rev() {
            let (mut images, mut masks) = (Places::default(), Places::default());
            for tile in tiles {
                images.push(&mut at, tile.image);
                masks.push(&mut at, tile.mask);
            }
            if self.compression.masks(&self.spec) {
                directories.push(self.mask_directory(level, masks));
            }
            directories.push(self.image_directory(level, images));
        }
        directories.reverse();
        directories
    }

    fn image_directory(&self, level: usize, places: Places) -> Directory {
        let spec = &self.spec;
        let masked = self.compression.masks(spec);
        let alpha = spec.alpha && !masked;
        let samples = usize::from(spec.channels) + usize::from(alpha);
        let bits = 8 * spec.samples.bytes() as u16;
        let (compression, photometric) = match (self.compression, spec.channels) {
            (Compression::Deflate, 1) => (ADOBE_DEFLATE, BLACK_IS_ZERO),
            (Compression::Deflate, _) => (ADOBE_DEFLATE, RGB),
            (Compression::Jpeg { .. }, 1) => (JPEG, BLACK_IS_ZERO),
            (Compression::Jpeg { .. }, _) => (JPEG, YCBCR),
        };
        let kind = if level > 0 { REDUCED } else { 0 };
        let mut tags = self.common_tags(level, kind, compression, photometric, places);
        tags.push((tag::BITS_PER_SAMPLE, Values::Short(vec![bits; samples])));
        tags.push((tag::SAMPLES_PER_PIXEL, Values::Short(vec![samples as u16])));
        let format = match spec.samples {
            SampleType::F32 => IEEE_FLOAT,
            _ => UNSIGNED,
        };
        tags.push((tag::SAMPLE_FORMAT, Values::Short(vec![format; samples])));
        if alpha {
            tags.push((tag::EXTRA_SAMPLES, Values::Short(vec![UNASSOCIATED_ALPHA])));
        }
        if self.compression == Compression::Deflate {
            let predictor = deflate::predictor(spec.samples);
            tags.push((tag::PREDICTOR, Values::Short(vec![predictor])));
        }
        if photometric == YCBCR {
            let subsampling = vec![jpeg::SUBSAMPLING; 2];
            tags.push((tag::YCBCR_SUBSAMPLING, Values::Short(subsampling)));
            let range = [0, 255, 128, 255, 128, 255].map(|value| [value, 1]);
            tags.push((tag::REFERENCE_BLACK_WHITE, Values::Rational(range.to_vec())));
        }
        let nothing = match (spec.samples, spec.nodata) {
            (SampleType::F32, _) => Some("nan".to_owned()),
            (_, Some(Nodata::Zero | Nodata::Max)) => Some(spec.nothing().to_string()),
            (_, None) => None,
        };
        if let Some(nothing) = nothing {
            tags.push((tag::GDAL_NODATA, Values::Ascii(nothing)));
        }
        if let Some(georeference) = spec.georeference.filter(|_| level == 0) {
            tags.extend(geo_tags(&georeference));
        }
        if level == 0 {
            tags.push(bands_tag(spec, alpha));
        }
        tags.sort_by_key(|&(number, _)| number);
        tags
    }

    fn mask_directory(&self, level: usize, places: Places) -> Directory {
        let kind = if level > 0 { MASK | REDUCED } else { MASK };
        let mut tags = self.common_tags(level, kind, ADOBE_DEFLATE, TRANSPARENCY_MASK, places);
        tags.push((tag::BITS_PER_SAMPLE, Values::Short(vec![1])));
        tags.push((tag::SAMPLES_PER_PIXEL, Values::Short(vec![1])));
        tags.sort_by_key(|&(number, _)| number);
        tags
    }

    /// The tags common to pictures and masks.
    fn common_tags(
        &self,
        level: usize,
        kind: u32,
        compression: u16,
        photometric: u16,
        places: Places,
    ) -> Directory {
        let [width, height] = self.spec.size(level);
        vec![
            (tag::NEW_SUBFILE_TYPE, Values::Long(vec![kind])),
            (tag::IMAGE_WIDTH, Values::Long(vec![width])),
            (tag::IMAGE_LENGTH, Values::Long(vec![height])),
            (tag::COMPRESSION, Values::Short(vec![compression])),
            (
                tag::PHOTOMETRIC_INTERPRETATION,
                Values::Short(vec![photometric]),
            ),
            (tag::PLANAR_CONFIGURATION, Values::Short(vec![CONTIGUOUS])),
            (tag::TILE_WIDTH, Values::Short(vec![TILE_EDGE_PX as u16])),
            (tag::TILE_LENGTH, Values::Short(vec![TILE_EDGE_PX as u16])),
            (tag::TILE_OFFSETS, Values::Long8(places.offsets)),
            (tag::TILE_BYTE_COUNTS, Values::Long(places.bytes)),
        ]
    }
}

// Values of tags.
const REDUCED: u32 = 1;
const MASK: u32 = 4;
const JPEG: u16 = 7;
const ADOBE_DEFLATE: u16 = 8;
const BLACK_IS_ZERO: u16 = 1;
const RGB: u16 = 2;
const TRANSPARENCY_MASK: u16 = 4;
const YCBCR: u16 = 6;
const CONTIGUOUS: u16 = 1;
const UNSIGNED: u16 = 1;
const IEEE_FLOAT: u16 = 3;
const UNASSOCIATED_ALPHA: u16 = 2;

/// The layout metadata for GDAL's readers.
fn ghost(masked: bool) -> String {
    let mut text = "LAYOUT=IFDS_BEFORE_DATA\n\
                    BLOCK_ORDER=ROW_MAJOR\n\
                    BLOCK_LEADER=SIZE_AS_UINT4\n\
                    BLOCK_TRAILER=LAST_4_BYTES_REPEATED\n\
                    KNOWN_INCOMPATIBLE_EDITION=NO\n "
        .to_owned();
    if masked {
        text += "MASK_INTERLEAVED_WITH_IMAGERY=YES\n";
    }
    format!(
        "GDAL_STRUCTURAL_METADATA_SIZE={:06} bytes\n{text}",
        text.len()
    )
}

/// Writes a tile between its leader (its size) and its trailer (its last four bytes); writes
/// nothing for an empty tile.
fn write_block(writer: &mut impl Write, block: &[u8]) -> io::Result<()> {
    let Some(last) = block.last_chunk::<{ TILE_FRAME_BYTES as usize }>() else {
        return Ok(());
    };
    writer.write_all(&(block.len() as u32).to_le_bytes())?;
    writer.write_all(block)?;
    writer.write_all(last)
}

#[cfg(test)]
mod tests;
