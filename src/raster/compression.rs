//! How the tiles of a [`CogWriter`](super::CogWriter) are packed.

use super::error::RasterError;
use super::overviews::LevelTile;
use super::spec::{Nodata, RasterSpec, RasterTile, SampleType, TILE_EDGE_PX};
use super::{deflate, jpeg};
use std::io;

/// How the tiles of a [`CogWriter`](super::CogWriter) are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Compression {
    /// Without loss.
    Deflate,
    /// With loss: [`SampleType::U8`] only. An alpha becomes a mask of one bit beside the picture,
    /// without loss.
    Jpeg {
        /// 1 to 100.
        quality: u8,
    },
}

/// A packed tile.
#[derive(Debug, Default)]
pub(super) struct Packed {
    /// Its picture; empty if there is nothing in the tile.
    pub(super) image: Vec<u8>,
    /// Which of its pixels are something; empty if the picture says so itself, or there is nothing.
    pub(super) mask: Vec<u8>,
}

impl Compression {
    /// Refuses what this cannot pack.
    pub(super) fn check(self, spec: &RasterSpec) -> Result<(), RasterError> {
        match self {
            Self::Deflate => Ok(()),
            Self::Jpeg { quality } => jpeg::check(spec, quality),
        }
    }

    /// Whether the alpha of such pictures is a mask beside it.
    pub(super) fn masks(self, spec: &RasterSpec) -> bool {
        matches!(self, Self::Jpeg { .. }) && spec.alpha
    }

    /// Packs a tile.
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

/// Whether a tile is, within `extent`, what readers take for a tile that is not there.
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
