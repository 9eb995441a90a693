//! Export of the whole wall as one GLB.

use crate::inspect::block_cutter::{BlockCutter, build_part};
use crate::inspect::error::InspectError;
use crate::inspect::glb::{WallPart, encode_glb};
use crate::persist::atomic::{OutputSet, WriteError};
use crate::raster::{RasterError, TILE_EDGE_PX};
use crate::render::{Band, Canvas, PixelFormat, RenderError, Target};
use crate::surface::Surface;
use std::io::Write;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Tiles along the side of a texture, whose side is at most 4096 pixels with its border.
const TILES_PER_SIDE: usize = (4096 - TILE_EDGE_PX) / TILE_EDGE_PX;

/// Maximum size of a file: half of the format's limit, which common programs can still read.
const MAX_FILE_BYTES: u64 = 2 << 30;

/// Render target that writes one GLB with textures of at most 4096 × 4096 px.
pub struct GlbTarget<'a> {
    surface: &'a dyn Surface,
    path: PathBuf,
    quality: u8,
    cutter: BlockCutter,
    parts: Vec<WallPart>,
    bytes: u64,
}

impl<'a> GlbTarget<'a> {
    /// A target for the file `path`, with JPEG textures of `quality` (1–100).
    ///
    /// # Errors
    /// [`RasterError`] for a canvas that cannot be a raster.
    pub fn new(
        surface: &'a dyn Surface,
        canvas: &Canvas,
        format: PixelFormat,
        path: &Path,
        quality: u8,
    ) -> Result<Self, RasterError> {
        Ok(Self {
            surface,
            path: path.to_owned(),
            quality,
            cutter: BlockCutter::single(canvas, format, TILES_PER_SIDE)?,
            parts: Vec::new(),
            bytes: 0,
        })
    }

    /// Maximum memory of a target for `canvas`, besides the compressed textures, bytes.
    ///
    /// # Errors
    /// [`RasterError`] for a canvas that cannot be a raster.
    pub fn bytes_for(canvas: &Canvas, format: PixelFormat) -> Result<u64, RasterError> {
        Ok(BlockCutter::single(canvas, format, TILES_PER_SIDE)?.max_bytes())
    }

    /// Maximum memory besides the compressed textures, bytes.
    pub fn max_bytes(&self) -> u64 {
        self.cutter.max_bytes()
    }

    /// Writes the file and adds it to a set of outputs.
    ///
    /// # Errors
    /// [`InspectError::TooLong`]; [`InspectError::Write`].
    pub fn finish(self, outputs: &mut OutputSet) -> Result<(), InspectError> {
        if self.bytes > MAX_FILE_BYTES {
            return Err(InspectError::TooLong {
                path: self.path,
                bytes: self.bytes,
                limit_bytes: MAX_FILE_BYTES,
            });
        }
        let file = encode_glb(&self.parts);
        Ok(outputs.write(&self.path, |writer| writer.write_all(&file))?)
    }
}

impl Target for GlbTarget<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let blocks = self.cutter.add(band)?;
        let channels = self.cutter.channels();
        let parts = blocks
            .par_map(|block| build_part(self.surface, canvas, block, channels, self.quality))
            .into_iter()
            .collect::<Result<Vec<WallPart>, _>>()
            .map_err(|error| RasterError::Write(WriteError::new(&self.path, error)))?;
        self.bytes += parts.iter().map(|part| part.jpeg.len() as u64).sum::<u64>();
        // Beyond the limit nothing is kept; `finish` reports the error.
        if self.bytes <= MAX_FILE_BYTES {
            self.parts.extend(parts);
        }
        Ok(())
    }
}
