//! Pictures for tests of raster output.

use super::spec::{RasterSpec, RasterTile, Reduce, SampleType, TILE_EDGE_PX};

/// Specification of 8-bit grey with alpha and mean overviews.
pub(super) fn grey_alpha(width: u32, height: u32) -> RasterSpec {
    RasterSpec {
        width,
        height,
        samples: SampleType::U8,
        channels: 1,
        alpha: true,
        nodata: None,
        reduce: Reduce::Mean,
        georeference: None,
        quantity: None,
    }
}

/// The bytes of a pixel of [`tiles`]: ramps, with a hole at the upper left.
pub(super) fn pixel(spec: &RasterSpec, x: usize, y: usize) -> Vec<u8> {
    let hole = x < 700 && y < 600 + x / 3;
    let value = |k: usize| ((x + 2 * y + 300 * k) % 997 + 10) as f64 / 1024.0;
    let opaque = |k: usize| spec.alpha && k == usize::from(spec.channels);
    (0..spec.samples_per_pixel())
        .flat_map(|k| match (spec.samples, spec.samples.max()) {
            (SampleType::F32, _) | (_, None) => {
                let value = if hole { f32::NAN } else { value(k) as f32 };
                value.to_ne_bytes().to_vec()
            }
            (samples, Some(max)) => {
                let number = match (hole, opaque(k)) {
                    (true, _) => spec.nothing(),
                    (false, true) => max,
                    (false, false) => (value(k) * f64::from(max)) as u32,
                };
                match samples {
                    SampleType::U8 => vec![number as u8],
                    SampleType::U16 => (number as u16).to_ne_bytes().to_vec(),
                    _ => number.to_ne_bytes().to_vec(),
                }
            }
        })
        .collect()
}

/// All tiles of a picture, row by row.
pub(super) fn tiles(spec: &RasterSpec) -> Vec<RasterTile> {
    let [columns, rows] = spec.grid(0);
    let places = (0..rows).flat_map(|row| (0..columns).map(move |column| (column, row)));
    places
        .map(|(column, row)| {
            let [width, height] = spec.extent(0, column, row);
            let mut pixels = vec![0; spec.tile_bytes()];
            let bytes = spec.pixel_bytes();
            for y in 0..height {
                for x in 0..width {
                    let place = (y * TILE_EDGE_PX + x) * bytes;
                    let (column, row) = (column as usize, row as usize);
                    let pixel = pixel(spec, column * TILE_EDGE_PX + x, row * TILE_EDGE_PX + y);
                    pixels[place..][..bytes].copy_from_slice(&pixel);
                }
            }
            RasterTile {
                column,
                row,
                pixels,
            }
        })
        .collect()
}
