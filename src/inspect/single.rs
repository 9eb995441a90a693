//! The whole wall as one GLB.

use super::InspectError;
use super::cut::{Cutter, part};
use super::glb::{Part, glb};
use crate::persist::atomic::{self, WriteError};
use crate::raster::{RasterError, TILE_EDGE_PX};
use crate::render::{Band, Canvas, PixelFormat, RenderError, Target};
use crate::surface::Surface;
use rayon::prelude::*;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Tiles along the side of a texture: with its border it has no more than 4096 pixels.
const TILES: usize = (4096 - TILE_EDGE_PX) / TILE_EDGE_PX;

/// The largest file: what programs still read as one, and half of what the format can say.
const LIMIT_BYTES: u64 = 2 << 30;

/// Takes bands and writes one GLB: textures of at most 4096 × 4096 px.
pub struct GlbTarget<'a> {
    surface: &'a dyn Surface,
    path: PathBuf,
    quality: u8,
    cutter: Cutter,
    parts: Vec<Part>,
    bytes: u64,
}

impl<'a> GlbTarget<'a> {
    /// Begins the file `path`, its pictures JPEGs of `quality` (1–100).
    ///
    /// # Errors
    /// A canvas that is no raster.
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
            cutter: Cutter::single(canvas, format, TILES)?,
            parts: Vec::new(),
            bytes: 0,
        })
    }

    /// Memory that it holds besides the compressed pictures, bytes.
    pub fn most_bytes(&self) -> u64 {
        self.cutter.most_bytes()
    }

    /// Writes the file.
    ///
    /// # Errors
    /// [`InspectError::TooLong`]; whatever the system says.
    pub fn finish(self) -> Result<(), InspectError> {
        if self.bytes > LIMIT_BYTES {
            return Err(InspectError::TooLong {
                path: self.path,
                bytes: self.bytes,
                limit_bytes: LIMIT_BYTES,
            });
        }
        let file = glb(&self.parts);
        atomic::write(&self.path, |writer| writer.write_all(&file))?;
        Ok(())
    }
}

impl Target for GlbTarget<'_> {
    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let blocks = self.cutter.add(band)?;
        let channels = self.cutter.channels();
        let parts = blocks
            .par_iter()
            .map(|block| part(self.surface, canvas, block, channels, self.quality))
            .collect::<Result<Vec<Part>, _>>()
            .map_err(|error| RasterError::Write(WriteError::new(&self.path, error)))?;
        self.bytes += parts.iter().map(|part| part.jpeg.len() as u64).sum::<u64>();
        // What is too long is not kept; `finish` says so.
        if self.bytes <= LIMIT_BYTES {
            self.parts.extend(parts);
        }
        Ok(())
    }
}
