//! Lossy compression of tiles.

use super::error::RasterError;
use super::spec::{RasterSpec, SampleType, TILE_EDGE_PX};
use crate::numerics::simd_dispatch::dispatch_simd;
use jpeg_encoder::{ColorType, Encoder, EncodingError, ImageBuffer, JpegColorType, SamplingFactor};
use std::io;

/// Subsampling factor of the chroma.
pub(super) const SUBSAMPLING: u16 = 2;

/// Rejects rasters that JPEG does not support.
pub(super) fn check(spec: &RasterSpec, quality: u8) -> Result<(), RasterError> {
    let refuse = |what| Err(RasterError::Unsupported(what));
    if !(1..=100).contains(&quality) {
        return refuse("the quality of a JPEG is a number from 1 to 100");
    }
    if spec.samples != SampleType::U8 {
        return refuse("a JPEG has samples of 8 bits");
    }
    if spec.nodata.is_some() {
        return refuse(
            "a JPEG's values are not exact, so no value can mark missing data; add an alpha \
             channel",
        );
    }
    Ok(())
}

/// Encodes the upper left `size` (columns, rows) of a tile without its alpha. Pixels beyond
/// `extent` repeat the last column and row, to avoid an artificial edge.
pub(super) fn encode(
    spec: &RasterSpec,
    pixels: &[u8],
    extent: [usize; 2],
    size: [usize; 2],
    quality: u8,
) -> io::Result<Vec<u8>> {
    let [width, height] = size;
    let bytes = spec.pixel_bytes();
    let rows = Rows {
        pixels,
        bytes,
        extent,
        size,
    };
    if spec.channels == 1 {
        return packed(width * height, quality, |encoder| {
            encoder.encode_image(rows)
        });
    }
    let mut visible = Vec::with_capacity(3 * width * height);
    for y in 0..height {
        rows.push::<3>(y, &mut visible);
    }
    compress(&visible, size, 3, quality)
}

/// The encoded part of a tile.
struct Rows<'a> {
    pixels: &'a [u8],
    /// Bytes of a pixel.
    bytes: usize,
    /// Valid columns and rows.
    extent: [usize; 2],
    /// Columns and rows to encode.
    size: [usize; 2],
}

impl Rows<'_> {
    /// Appends the first `C` bytes of every pixel of a row, and repeats those of the last one for
    /// missing pixels.
    fn push<const C: usize>(&self, y: usize, out: &mut Vec<u8>) {
        let start = y.min(self.extent[1] - 1) * TILE_EDGE_PX * self.bytes;
        let there = self.extent[0].min(self.size[0]);
        let row = &self.pixels[start..][..there * self.bytes];
        let from = out.len();
        out.resize(from + there * C, 0);
        let own = &mut out[from..];
        match self.bytes {
            2 => first_of::<2, C>(row, own),
            4 => first_of::<4, C>(row, own),
            _ => own.copy_from_slice(row),
        }
        for _ in there..self.size[0] {
            out.extend_from_within(out.len() - C..);
        }
    }
}

/// Copies the first `C` of the `B` bytes of every pixel.
fn first_of<const B: usize, const C: usize>(row: &[u8], out: &mut [u8]) {
    dispatch_simd(
        #[inline(always)]
        || {
            let out = out.as_chunks_mut::<C>().0;
            for (pixel, out) in row.as_chunks::<B>().0.iter().zip(out) {
                out.copy_from_slice(&pixel[..C]);
            }
        },
    );
}

/// Copies the grey value: the first byte of every pixel.
impl ImageBuffer for Rows<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        JpegColorType::Luma
    }

    fn width(&self) -> u16 {
        self.size[0] as u16
    }

    fn height(&self) -> u16 {
        self.size[1] as u16
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        self.push::<1>(usize::from(y), &mut buffers[0]);
    }
}

/// Compresses a picture of one channel or three, 8 bits, of at most 65535 columns and rows.
pub fn compress(
    pixels: &[u8],
    [width, height]: [usize; 2],
    channels: usize,
    quality: u8,
) -> io::Result<Vec<u8>> {
    let colour = match channels {
        1 => ColorType::Luma,
        _ => ColorType::Rgb,
    };
    packed(pixels.len(), quality, |encoder| {
        encoder.encode(pixels, width as u16, height as u16, colour)
    })
}

/// Runs an encoder of `bytes` bytes.
fn packed(
    bytes: usize,
    quality: u8,
    encode: impl FnOnce(Encoder<&mut Vec<u8>>) -> Result<(), EncodingError>,
) -> io::Result<Vec<u8>> {
    let mut stream = Vec::with_capacity(bytes / 4);
    let mut encoder = Encoder::new(&mut stream, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    encode(encoder).map_err(io::Error::other)?;
    Ok(stream)
}
