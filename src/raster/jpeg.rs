//! Tiles with loss.

use super::{EDGE, RasterError, RasterSpec, SampleType};
use jpeg_encoder::{ColorType, Encoder, SamplingFactor};
use std::io;

/// Columns and rows of pixels that share their colour, but not their brightness.
pub(super) const SUBSAMPLING: u16 = 2;

/// Refuses what cannot be a JPEG.
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
            "a JPEG's values are not exact, so none can stand for nothing; give it an alpha",
        );
    }
    Ok(())
}

/// The upper left `size` (columns, rows) of a tile without its alpha. What lies beyond `extent` repeats the last column
/// and row, so that no false edge is there to be drawn.
pub(super) fn encode(
    spec: &RasterSpec,
    pixels: &[u8],
    extent: [usize; 2],
    size: [usize; 2],
    quality: u8,
) -> io::Result<Vec<u8>> {
    let [width, height] = size;
    let channels = usize::from(spec.channels);
    let bytes = spec.pixel_bytes();
    let mut visible = vec![0; width * height * channels];
    for (y, out) in visible.chunks_exact_mut(width * channels).enumerate() {
        let row = &pixels[y.min(extent[1] - 1) * EDGE * bytes..][..extent[0] * bytes];
        let (within, beyond) = out.split_at_mut(extent[0].min(width) * channels);
        match (channels, spec.alpha) {
            (_, false) => within.copy_from_slice(&row[..within.len()]),
            (1, true) => channels_of::<2, 1>(row, within),
            (_, true) => channels_of::<4, 3>(row, within),
        }
        let last = &row[row.len() - bytes..][..channels];
        for pixel in beyond.chunks_exact_mut(channels) {
            pixel.copy_from_slice(last);
        }
    }
    compress(&visible, size, channels, quality)
}

/// A picture of one channel or three, 8 bits, of at most 65535 columns and rows.
pub(crate) fn compress(
    pixels: &[u8],
    [width, height]: [usize; 2],
    channels: usize,
    quality: u8,
) -> io::Result<Vec<u8>> {
    let mut stream = Vec::with_capacity(pixels.len() / 4);
    let mut encoder = Encoder::new(&mut stream, quality);
    encoder.set_sampling_factor(SamplingFactor::F_2_2);
    let colour = match channels {
        1 => ColorType::Luma,
        _ => ColorType::Rgb,
    };
    encoder
        .encode(pixels, width as u16, height as u16, colour)
        .map_err(io::Error::other)?;
    Ok(stream)
}

/// The first `C` of the `B` samples of every pixel.
fn channels_of<const B: usize, const C: usize>(row: &[u8], out: &mut [u8]) {
    for (pixel, out) in row.chunks_exact(B).zip(out.chunks_exact_mut(C)) {
        out.copy_from_slice(&pixel[..C]);
    }
}
