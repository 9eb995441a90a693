//! Raster files that bands are written to, tile by tile.

use crate::compositing::band::{Band, Target};
use crate::error::RenderError;
use crate::layout::canvas::{Canvas, Layout};
use crate::layout::tiles::BAND_ROWS;
use crate::sampling::pixel_format::PixelFormat;
use crate::sampling::sample::Samples;
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::path::{Path, PathBuf};
use tunnelstitch_core::persist::atomic::{OutputSet, WriteError};
use tunnelstitch_core::raster::{
    CogState, CogWriter, Compression, DziFormat, DziState, DziWriter, Georeference, Nodata,
    Quantity, RasterError, RasterSpec, RasterTile, Reduce, SampleType, TILE_EDGE_PX, TileOrder,
};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;

/// Layer of a band that is written to a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RasterLayer {
    /// The panorama.
    Panorama,
    /// 255 where some frame sees the wall, else 0.
    Coverage,
    /// Index of the frame that each pixel shows; the largest number of 32 bits where none is.
    Frames,
}

/// State of a raster file that is being written.
#[derive(Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub enum RasterState<'a> {
    /// A Cloud-Optimised GeoTIFF.
    Cog(CogState<'a>),
    /// A Deep Zoom picture.
    Dzi(DziState<'a>),
}

/// State of a raster file from which writing is resumed.
#[derive(Debug)]
pub struct Kept<'a> {
    /// File of its compressed tiles, or the folder of Deep Zoom's. It stays in any case.
    pub place: PathBuf,
    /// State, if writing has begun.
    pub state: Option<RasterState<'a>>,
}

/// Target that writes a raster file.
pub struct RasterTarget {
    layer: RasterLayer,
    layout: Layout,
    pixel_bytes: usize,
    writer: Writer,
}

enum Writer {
    Cog(CogWriter),
    Dzi(DziWriter),
}

impl RasterTarget {
    /// Writes a Cloud-Optimised GeoTIFF. Its axes are metres: arc length and chainage, in the
    /// layout's order.
    ///
    /// # Errors
    /// As [`CogWriter::begin_resumable`].
    pub fn cog(
        path: &Path,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
        layer: RasterLayer,
        compression: Compression,
        kept: Kept,
    ) -> Result<Self, RasterError> {
        let spec = spec(canvas, format, layout, layer);
        let state = match kept.state {
            Some(RasterState::Cog(state)) => Some(state),
            _ => None,
        };
        let writer = CogWriter::begin_resumable(path, spec, compression, &kept.place, state)?;
        Ok(Self::new(layer, layout, &spec, Writer::Cog(writer)))
    }

    /// Writes a Deep Zoom picture of the panorama.
    ///
    /// # Errors
    /// As [`DziWriter::begin_resumable`].
    pub fn dzi(
        path: &Path,
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
        dzi: DziFormat,
        kept: Kept,
    ) -> Result<Self, RasterError> {
        let layer = RasterLayer::Panorama;
        let spec = spec(canvas, format, layout, layer);
        let state = match kept.state {
            Some(RasterState::Dzi(state)) => Some(state),
            _ => None,
        };
        let writer = DziWriter::begin_resumable(path, spec, dzi, &kept.place, state)?;
        Ok(Self::new(layer, layout, &spec, Writer::Dzi(writer)))
    }

    /// State from which writing can be resumed.
    ///
    /// # Errors
    /// An error of the file system.
    pub fn state(&self) -> Result<RasterState<'_>, WriteError> {
        Ok(match &self.writer {
            Writer::Cog(writer) => RasterState::Cog(writer.state()?),
            Writer::Dzi(writer) => RasterState::Dzi(writer.state()?),
        })
    }

    fn new(layer: RasterLayer, layout: Layout, spec: &RasterSpec, writer: Writer) -> Self {
        Self {
            layer,
            layout,
            pixel_bytes: spec.samples_per_pixel() * spec.samples.bytes(),
            writer,
        }
    }

    /// Takes over the tiles of another part of the panorama, compressed in the file `tiles`.
    ///
    /// # Errors
    /// As [`CogWriter::absorb`]; [`RasterError::Unsupported`] for a Deep Zoom picture.
    pub fn absorb(&mut self, part: RasterState, tiles: &Path) -> Result<(), RasterError> {
        match (&mut self.writer, part) {
            (Writer::Cog(writer), RasterState::Cog(part)) => writer.absorb(part, tiles),
            _ => Err(RasterError::Unsupported(
                "only GeoTIFF files are put together from parts",
            )),
        }
    }

    /// Memory of such a file until it is finished, bytes.
    pub fn pending_bytes(
        canvas: &Canvas,
        format: PixelFormat,
        layout: Layout,
        layer: RasterLayer,
    ) -> u64 {
        let order = match layout {
            Layout::ThetaRight => TileOrder::Rows,
            Layout::ChainageRight => TileOrder::Columns,
        };
        spec(canvas, format, layout, layer).pending_bytes(order)
    }

    /// Completes the file and adds it to a set of outputs.
    ///
    /// # Errors
    /// As [`CogWriter::finish`] and [`DziWriter::finish`].
    pub fn finish(self, outputs: &mut OutputSet) -> Result<(), RasterError> {
        match self.writer {
            Writer::Cog(writer) => writer.finish(outputs),
            Writer::Dzi(writer) => writer.finish(outputs),
        }
    }

    /// Cuts the tile that begins at `first` around the section from a band.
    fn tile(&self, canvas: &Canvas, band: &Band, pixels: &[u8], place: usize) -> RasterTile {
        let p = self.pixel_bytes;
        let columns = canvas.columns as usize;
        let first = place * TILE_EDGE_PX;
        let count = TILE_EDGE_PX.min(columns - first);
        let mut tile = vec![0; TILE_EDGE_PX * TILE_EDGE_PX * p];
        for row in 0..band.rows as usize {
            let source = &pixels[row * columns * p..][..columns * p];
            match self.layout {
                Layout::ThetaRight => {
                    tile[row * TILE_EDGE_PX * p..][..count * p]
                        .copy_from_slice(&source[first * p..][..count * p]);
                }
                // Chainage to the right, the last column on top.
                Layout::ChainageRight => {
                    for y in 0..count {
                        let column = columns - 1 - first - y;
                        tile[(y * TILE_EDGE_PX + row) * p..][..p]
                            .copy_from_slice(&source[column * p..][..p]);
                    }
                }
            }
        }
        let along = band.row / BAND_ROWS;
        let (column, row) = match self.layout {
            Layout::ThetaRight => (place as u32, along),
            Layout::ChainageRight => (along, place as u32),
        };
        RasterTile {
            column,
            row,
            pixels: tile,
        }
    }

    fn bytes<'b>(&self, band: &'b Band) -> Cow<'b, [u8]> {
        match self.layer {
            RasterLayer::Panorama => match &band.samples {
                Samples::Eight(samples) => Cow::from(samples),
                Samples::Sixteen(samples) => samples.iter().flat_map(|v| v.to_ne_bytes()).collect(),
            },
            RasterLayer::Coverage => {
                let covered = band.covered().into_iter();
                covered.map(|yes| if yes { u8::MAX } else { 0 }).collect()
            }
            RasterLayer::Frames => band.sources.iter().flat_map(|v| v.to_ne_bytes()).collect(),
        }
    }
}

impl Target for RasterTarget {
    fn wants_sources(&self) -> bool {
        matches!(self.layer, RasterLayer::Frames)
    }

    fn put(&mut self, canvas: &Canvas, band: &Band) -> Result<(), RenderError> {
        let pixels = self.bytes(band);
        let places = (canvas.columns as usize).div_ceil(TILE_EDGE_PX);
        let tiles = (0..places).par_map(|place| self.tile(canvas, band, &pixels, place));
        match &mut self.writer {
            Writer::Cog(writer) => writer.add(tiles)?,
            Writer::Dzi(writer) => writer.add(tiles)?,
        }
        Ok(())
    }
}

fn spec(canvas: &Canvas, format: PixelFormat, layout: Layout, layer: RasterLayer) -> RasterSpec {
    let [width, height] = layout.size(canvas);
    let plain = RasterSpec {
        width,
        height,
        samples: SampleType::U8,
        channels: 1,
        alpha: false,
        nodata: None,
        reduce: Reduce::Mean,
        georeference: Some(georeference(canvas, layout)),
        quantity: None,
    };
    match layer {
        RasterLayer::Panorama => RasterSpec {
            samples: if format.deep {
                SampleType::U16
            } else {
                SampleType::U8
            },
            channels: format.channels as u8,
            alpha: true,
            ..plain
        },
        RasterLayer::Coverage => RasterSpec {
            quantity: Some(Quantity {
                name: "255 where a frame shows the wall",
                unit: "",
            }),
            nodata: Some(Nodata::Zero),
            ..plain
        },
        RasterLayer::Frames => RasterSpec {
            quantity: Some(Quantity {
                name: "index of the frame shown",
                unit: "",
            }),
            samples: SampleType::U32,
            nodata: Some(Nodata::Max),
            reduce: Reduce::First,
            ..plain
        },
    }
}

/// The plane of the unrolled wall: as seen from inside, with chainage to the right.
const PLANE: &str = "Unrolled wall: x chainage, y arc length";
/// Names of its axes.
const AXES: [&str; 2] = ["Chainage", "Arc length"];

/// Georeference of a picture in the plane of the unrolled wall, metres: x is the chainage, y the
/// arc length. There, y up, the wall is as seen from inside in both layouts: writing is readable.
pub(crate) fn georeference(canvas: &Canvas, layout: Layout) -> Georeference {
    let step_m = 1.0 / canvas.px_per_metre;
    let around_m = f64::from(canvas.columns) * step_m;
    match layout {
        Layout::ThetaRight => Georeference {
            plane: PLANE,
            axes: AXES,
            origin_m: [canvas.h_start_m, 0.0],
            column_m: [0.0, step_m],
            row_m: [step_m, 0.0],
        },
        Layout::ChainageRight => Georeference {
            plane: PLANE,
            axes: AXES,
            origin_m: [canvas.h_start_m, around_m],
            column_m: [step_m, 0.0],
            row_m: [0.0, -step_m],
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pixel of either layout is at its chainage and arc length, and nothing is mirrored.
    #[test]
    fn both_layouts_lie_in_one_plane_that_is_not_mirrored() {
        let canvas = Canvas {
            columns: 8,
            rows: 5,
            px_per_metre: 4.0,
            h_start_m: -1.5,
        };
        for layout in [Layout::ThetaRight, Layout::ChainageRight] {
            let place = georeference(&canvas, layout);
            let ([cx, cy], [rx, ry]) = (place.column_m, place.row_m);
            assert!(cx * ry - cy * rx < 0.0, "{layout:?}");
            let wall = canvas.wall(6, 3);
            // The centre of a pixel is half a pixel beyond its corner.
            let [u, v] = layout.to_picture(&canvas, [6.0, 3.0]).map(|k| k + 0.5);
            let x_m = place.origin_m[0] + u * cx + v * rx;
            let y_m = place.origin_m[1] + u * cy + v * ry;
            assert!((x_m - wall.h_m).abs() < 1e-12, "{layout:?}");
            assert!((y_m - wall.s_m).abs() < 1e-12, "{layout:?}");
        }
    }
}
