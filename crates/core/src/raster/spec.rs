//! Specification of a raster: size, pixels and georeference.

use super::error::RasterError;

/// Columns and rows of a tile, pixels.
pub const TILE_EDGE_PX: usize = 512;

/// The numeric type of the samples of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SampleType {
    /// Whole numbers of 8 bits.
    U8,
    /// Whole numbers of 16 bits.
    U16,
    /// Whole numbers of 32 bits.
    U32,
    /// Single precision; NaN is no data.
    F32,
}

impl SampleType {
    /// Bytes of a sample.
    pub fn bytes(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 => 2,
            Self::U32 | Self::F32 => 4,
        }
    }

    /// The largest whole number; None for [`SampleType::F32`].
    pub(super) fn max(self) -> Option<u32> {
        match self {
            Self::U8 => Some(u8::MAX.into()),
            Self::U16 => Some(u16::MAX.into()),
            Self::U32 => Some(u32::MAX),
            Self::F32 => None,
        }
    }
}

/// The reduction of 2 × 2 pixels to one in an overview.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reduce {
    /// The mean of the valid pixels.
    Mean,
    /// The first valid pixel, row by row: for labels, which cannot be averaged.
    First,
}

/// The no-data value of whole numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Nodata {
    /// 0.
    Zero,
    /// The largest number of the type.
    Max,
}

/// The position of the picture in a plane in metres.
///
/// Programs show the plane with x to the right and y up. A picture is not mirrored there if a turn
/// takes its columns and rows to these axes: the determinant of both steps is negative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Georeference {
    /// Name of the plane, ASCII without `|` and `"`.
    pub plane: &'static str,
    /// Names of x and y, ASCII without `|` and `"`.
    pub axes: [&'static str; 2],
    /// x and y of the upper left corner of the first pixel, metres.
    pub origin_m: [f64; 2],
    /// Change of x and y from a column to the next one to the right, metres.
    pub column_m: [f64; 2],
    /// Change of x and y from a row to the next one below, metres.
    pub row_m: [f64; 2],
}

/// The quantity that the samples of a raster of one channel are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quantity {
    /// Its name, without characters that XML escapes.
    pub name: &'static str,
    /// Its unit, likewise; empty for plain numbers.
    pub unit: &'static str,
}

/// The specification of a raster.
///
/// A pixel is its channels and then, if there is one, its alpha, in native byte order. *No data* is
/// an alpha of 0, NaN, or the value of [`RasterSpec::nodata`]. Alpha is either 0 or the largest
/// number; the channels of a no-data pixel with alpha are 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RasterSpec {
    /// Columns, pixels; at least 1.
    pub width: u32,
    /// Rows, pixels; at least 1.
    pub height: u32,
    /// The type of the samples.
    pub samples: SampleType,
    /// Number of channels: 1 (grey or a quantity) or 3 (red, green, blue).
    pub channels: u8,
    /// True if an alpha follows the channels; [`SampleType::U8`] and [`SampleType::U16`] only.
    pub alpha: bool,
    /// The no-data value of whole numbers without alpha.
    pub nodata: Option<Nodata>,
    /// The reduction of overviews.
    pub reduce: Reduce,
    /// The georeference.
    pub georeference: Option<Georeference>,
    /// The quantity, if the raster is none of brightness or colour.
    pub quantity: Option<Quantity>,
}

/// A square of [`TILE_EDGE_PX`] × [`TILE_EDGE_PX`] pixels.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RasterTile {
    /// Column in the grid of tiles, from the left.
    pub column: u32,
    /// Row in the grid of tiles, from the top.
    pub row: u32,
    /// Its pixels, row by row; pixels beyond the right and lower border of the picture are 0.
    pub pixels: Vec<u8>,
}

/// The order in which tiles arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TileOrder {
    /// Row by row.
    Rows,
    /// Column by column.
    Columns,
}

impl RasterSpec {
    /// Largest size of the incomplete overview tiles while tiles arrive in `order`, bytes.
    ///
    /// Each level holds at most a row (or column) of its tiles. The batch given to
    /// [`CogWriter::add`] adds to it: the batch itself, a quarter of it during downsampling, and
    /// its compressed form.
    ///
    /// [`CogWriter::add`]: super::CogWriter::add
    pub fn pending_bytes(&self, order: TileOrder) -> u64 {
        let tiles: u64 = (1..self.levels_to_one_tile())
            .map(|level| {
                let [columns, rows] = self.grid(level);
                u64::from(match order {
                    TileOrder::Rows => columns,
                    TileOrder::Columns => rows,
                })
            })
            .sum();
        tiles * self.tile_bytes() as u64
    }

    /// Samples of a pixel, alpha included.
    pub fn samples_per_pixel(&self) -> usize {
        usize::from(self.channels) + usize::from(self.alpha)
    }

    /// Bytes of a tile.
    pub fn tile_bytes(&self) -> usize {
        TILE_EDGE_PX * TILE_EDGE_PX * self.pixel_bytes()
    }

    /// Bytes of a pixel.
    pub fn pixel_bytes(&self) -> usize {
        self.samples_per_pixel() * self.samples.bytes()
    }

    /// Columns and rows of pixels at `level`, where 0 is full resolution.
    pub fn size(&self, level: usize) -> [u32; 2] {
        [self.width, self.height].map(|side| (0..level).fold(side, |side, _| side.div_ceil(2)))
    }

    /// Columns and rows of tiles at `level`.
    pub fn grid(&self, level: usize) -> [u32; 2] {
        self.size(level)
            .map(|side| side.div_ceil(TILE_EDGE_PX as u32))
    }

    /// Number of tiles of `level`.
    pub(super) fn tiles_of(&self, level: usize) -> usize {
        let [columns, rows] = self.grid(level);
        columns as usize * rows as usize
    }

    /// Number of tiles of the first `levels` levels.
    pub(super) fn tiles(&self, levels: usize) -> u64 {
        (0..levels).map(|level| self.tiles_of(level) as u64).sum()
    }

    /// The index of a tile among those of its level, row by row.
    pub(super) fn place(&self, level: usize, column: u32, row: u32) -> usize {
        let [columns, _] = self.grid(level);
        row as usize * columns as usize + column as usize
    }

    /// Columns and rows of a tile that are within the picture.
    pub(super) fn extent(&self, level: usize, column: u32, row: u32) -> [usize; 2] {
        let [width, height] = self.size(level);
        let within = |side: u32, place: u32| {
            (side as usize - place as usize * TILE_EDGE_PX).min(TILE_EDGE_PX)
        };
        [within(width, column), within(height, row)]
    }

    /// Levels until one has both sides within a tile.
    pub fn levels_to_one_tile(&self) -> usize {
        self.levels_to(TILE_EDGE_PX as u32)
    }

    /// Levels until one has no side longer than `side` pixels, at least 1.
    pub(super) fn levels_to(&self, side: u32) -> usize {
        let longest = self.width.max(self.height);
        std::iter::successors(Some(longest), |&longest| {
            (longest > side).then(|| longest.div_ceil(2))
        })
        .count()
    }

    /// The no-data value without alpha and of whole numbers; 0 otherwise.
    pub(super) fn nothing(&self) -> u32 {
        match self.nodata {
            Some(Nodata::Max) => self.samples.max().unwrap_or_default(),
            _ => 0,
        }
    }

    /// Rejects inconsistent specifications.
    pub(super) fn check(&self) -> Result<(), RasterError> {
        let refuse = |what| Err(RasterError::Unsupported(what));
        if self.width == 0 || self.height == 0 {
            return refuse("a picture needs at least one pixel");
        }
        if self.width.max(self.height) > i32::MAX as u32 {
            return refuse("a side of a picture is at most 2147483647 px long");
        }
        if !matches!(self.channels, 1 | 3) {
            return refuse("a picture has one channel or three");
        }
        let narrow = matches!(self.samples, SampleType::U8 | SampleType::U16);
        if self.alpha && !narrow {
            return refuse("only samples of 8 and 16 bits can have an alpha");
        }
        if self.nodata.is_some() && (self.alpha || self.samples == SampleType::F32) {
            return refuse(
                "a picture with alpha or of floating point needs no other no-data value",
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::test_picture::grey_alpha;

    #[test]
    fn levels_halve_until_one_tile_or_one_pixel() {
        let spec = grey_alpha(1900, 5000);
        assert_eq!(spec.levels_to_one_tile(), 5);
        assert_eq!(spec.size(4), [119, 313]);
        assert_eq!(spec.grid(0), [4, 10]);
        assert_eq!(spec.extent(0, 3, 9), [364, 392]);
        assert_eq!(spec.tiles(5), 40 + 10 + 3 + 2 + 1);
        assert_eq!(spec.levels_to(1), 14);
        assert_eq!(spec.size(13), [1, 1]);
        assert_eq!(grey_alpha(300, 200).levels_to_one_tile(), 1);
        assert_eq!(grey_alpha(1, 1).levels_to(1), 1);
    }

    #[test]
    fn a_long_tunnel_along_its_short_side_takes_little_memory() {
        let spec = grey_alpha(10_000, 1_000_000);
        let mib = |order| spec.pending_bytes(order) >> 20;
        assert!(mib(TileOrder::Rows) < 16, "{}", mib(TileOrder::Rows));
        assert!(mib(TileOrder::Columns) > 900);
    }

    #[test]
    fn contradictions_are_refused() {
        let good = grey_alpha(10, 10);
        assert!(good.check().is_ok());
        for bad in [
            RasterSpec { width: 0, ..good },
            RasterSpec {
                channels: 2,
                ..good
            },
            RasterSpec {
                samples: SampleType::F32,
                ..good
            },
            RasterSpec {
                nodata: Some(Nodata::Zero),
                ..good
            },
        ] {
            assert!(bad.check().is_err(), "{bad:?}");
        }
    }
}
