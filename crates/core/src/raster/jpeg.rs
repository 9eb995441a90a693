//! Lossy compression of tiles.

use super::error::RasterError;
use super::spec::{RasterSpec, SampleType, TILE_EDGE_PX};
use jpeg_encoder::{Encoder, ImageBuffer, JpegColorType, SamplingFactor, rgb_to_ycbcr};
use std::io;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

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
    let bytes = spec.pixel_bytes();
    let picture = Picture {
        pixels,
        bytes,
        row_bytes: TILE_EDGE_PX * bytes,
        extent,
        size,
        grey: spec.channels == 1,
    };
    picture.encode(quality)
}

/// Compresses a picture of one channel or three, 8 bits, of at most 65535 columns and rows.
pub fn compress(
    pixels: &[u8],
    size: [usize; 2],
    channels: usize,
    quality: u8,
) -> io::Result<Vec<u8>> {
    let picture = Picture {
        pixels,
        bytes: channels,
        row_bytes: channels * size[0],
        extent: size,
        size,
        grey: channels == 1,
    };
    picture.encode(quality)
}

/// Pixels to encode: one type for grey and colour, with and without alpha, so that the encoder is
/// compiled once.
struct Picture<'a> {
    pixels: &'a [u8],
    /// Bytes of a pixel: grey, or red, green and blue; then perhaps alpha.
    bytes: usize,
    /// Bytes from a row to the next.
    row_bytes: usize,
    /// Valid columns and rows.
    extent: [usize; 2],
    /// Columns and rows to encode.
    size: [usize; 2],
    /// True if only the first byte of a pixel counts.
    grey: bool,
}

impl Picture<'_> {
    fn encode(self, quality: u8) -> io::Result<Vec<u8>> {
        let channels = if self.grey { 1 } else { 3 };
        let mut stream = Vec::with_capacity(channels * self.size[0] * self.size[1] / 4);
        let mut encoder = Encoder::new(&mut stream, quality);
        encoder.set_sampling_factor(SamplingFactor::F_2_2);
        encoder.encode_image(self).map_err(io::Error::other)?;
        Ok(stream)
    }

    /// The valid pixels of a row, or of the last one for a missing row.
    fn row(&self, y: usize) -> &[u8] {
        let start = y.min(self.extent[1] - 1) * self.row_bytes;
        &self.pixels[start..][..self.extent[0].min(self.size[0]) * self.bytes]
    }
}

impl ImageBuffer for Picture<'_> {
    fn get_jpeg_color_type(&self) -> JpegColorType {
        if self.grey {
            JpegColorType::Luma
        } else {
            JpegColorType::Ycbcr
        }
    }

    fn width(&self) -> u16 {
        self.size[0] as u16
    }

    fn height(&self) -> u16 {
        self.size[1] as u16
    }

    fn fill_buffers(&self, y: u16, buffers: &mut [Vec<u8>; 4]) {
        let row = self.row(usize::from(y));
        let planes = if self.grey { 1 } else { 3 };
        let [luma, blue, red, _] = buffers;
        match (self.grey, self.bytes) {
            (true, 1) => luma.extend_from_slice(row),
            (true, _) => first_of::<2>(row, luma),
            (false, 3) => to_ycbcr::<3>(row, [luma, blue, red]),
            (false, _) => to_ycbcr::<4>(row, [luma, blue, red]),
        }
        for plane in &mut buffers[..planes] {
            let last = plane[plane.len() - 1];
            plane.resize(plane.len() + self.size[0] - row.len() / self.bytes, last);
        }
    }
}

/// Appends the first of the `B` bytes of every pixel.
fn first_of<const B: usize>(row: &[u8], out: &mut Vec<u8>) {
    dispatch_simd(
        #[inline(always)]
        || out.extend(row.as_chunks::<B>().0.iter().map(|pixel| pixel[0])),
    );
}

/// Appends luma and chroma of every pixel of `B` bytes.
fn to_ycbcr<const B: usize>(row: &[u8], planes: [&mut Vec<u8>; 3]) {
    let pixels = row.as_chunks::<B>().0;
    let [luma, blue, red] = planes.map(|plane| {
        let start = plane.len();
        plane.resize(start + pixels.len(), 0);
        &mut plane[start..]
    });
    dispatch_simd(
        #[inline(always)]
        || {
            let chroma = blue.iter_mut().zip(red.iter_mut());
            for ((pixel, luma), (blue, red)) in pixels.iter().zip(luma.iter_mut()).zip(chroma) {
                (*luma, *blue, *red) = rgb_to_ycbcr(pixel[0], pixel[1], pixel[2]);
            }
        },
    );
}
