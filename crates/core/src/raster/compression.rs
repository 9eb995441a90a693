//! Compression of the tiles of a [`CogWriter`](super::CogWriter).

use super::error::RasterError;
use super::overviews::LevelTile;
use super::spec::{Nodata, RasterSpec, RasterTile, SampleType, TILE_EDGE_PX};
use super::{deflate, jpeg};
use std::io;

/// The compression of the tiles of a [`CogWriter`](super::CogWriter).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compression {
    /// Lossless.
    Deflate,
    /// Lossy, for [`SampleType::U8`] only. An alpha channel becomes a lossless one-bit mask beside
    /// the picture.
    Jpeg {
        /// 1 to 100.
        quality: u8,
    },
}

/// A compressed tile.
#[derive(Debug, Default)]
pub(super) struct Packed {
    /// The compressed picture; empty for an empty tile.
    pub(super) image: Vec<u8>,
    /// The compressed mask; empty if the picture has no separate mask or the tile is empty.
    pub(super) mask: Vec<u8>,
}

impl Compression {
    /// Rejects rasters that the compression does not support.
    pub(super) fn check(self, spec: &RasterSpec) -> Result<(), RasterError> {
        match self {
            Self::Deflate => Ok(()),
            Self::Jpeg { quality } => jpeg::check(spec, quality),
        }
    }

    /// True if the alpha of such pictures is stored as a separate mask.
    pub(super) fn masks(self, spec: &RasterSpec) -> bool {
        matches!(self, Self::Jpeg { .. }) && spec.alpha
    }

    /// Compresses a tile.
    pub(super) fn pack(self, spec: &RasterSpec, level_tile: &LevelTile) -> io::Result<Packed> {
        let LevelTile { level, tile } = level_tile;
        let RasterTile {
            column,
            row,
            pixels,
        } = tile;
        let extent = spec.extent(*level, *column, *row);
        if is_nothing(spec, pixels, extent) {
            return Ok(Packed::default());
        }
        let image = match self {
            Self::Deflate => deflate::deflate(spec, pixels),
            Self::Jpeg { quality } => {
                jpeg::encode(spec, pixels, extent, [TILE_EDGE_PX; 2], quality)?
            }
        };
        let mask = if self.masks(spec) {
            deflate::deflate_mask(spec, pixels)
        } else {
            Vec::new()
        };
        Ok(Packed { image, mask })
    }
}

/// True if a tile equals, within `extent`, the value that readers assume for a missing tile.
fn is_nothing(spec: &RasterSpec, pixels: &[u8], [width, height]: [usize; 2]) -> bool {
    let bytes = spec.pixel_bytes();
    let mut rows = pixels
        .chunks_exact(TILE_EDGE_PX * bytes)
        .take(height)
        .map(|row| &row[..width * bytes]);
    match (spec.samples, spec.nodata) {
        (SampleType::F32, _) => rows.all(|row| {
            row.chunks_exact(4).all(|number| {
                f32::from_ne_bytes([number[0], number[1], number[2], number[3]]).is_nan()
            })
        }),
        (_, Some(Nodata::Max)) => rows.all(|row| row.iter().all(|&byte| byte == u8::MAX)),
        _ => rows.all(|row| row.iter().all(|&byte| byte == 0)),
    }
}
