//! Lossless compression of tiles: a predictor, then deflate.

use super::downsample::{Sample, is_full};
use super::spec::{RasterSpec, SampleType, TILE_EDGE_PX};

/// Compression level of [`miniz_oxide`], of 10.
const DEFLATE_LEVEL: u8 = 1;

/// The value of TIFF tag 317 for the predictor of [`deflate`].
pub(super) fn predictor(samples: SampleType) -> u16 {
    match samples {
        SampleType::F32 => 3,
        _ => 2,
    }
}

/// Compresses the pixels of a tile: horizontal differences, little-endian, as a zlib stream.
///
/// Differences of 8 bits use a specialised Huffman code, several times as fast; wider samples need
/// an encoder that finds repetitions.
pub(super) fn deflate(spec: &RasterSpec, pixels: &[u8]) -> Vec<u8> {
    let n = spec.samples_per_pixel();
    match spec.samples {
        SampleType::U8 => fdeflate::compress_to_vec(&differences(pixels, n, u8_difference)),
        SampleType::U16 => deflate_repetitions(&differences(pixels, n, u16_difference)),
        SampleType::U32 => deflate_repetitions(&differences(pixels, n, u32_difference)),
        SampleType::F32 => deflate_repetitions(&byte_planes(pixels, n)),
    }
}

fn deflate_repetitions(bytes: &[u8]) -> Vec<u8> {
    miniz_oxide::deflate::compress_to_vec_zlib(bytes, DEFLATE_LEVEL)
}

/// Compresses the mask of 8-bit samples as a zlib stream: one bit per pixel, the highest first, set
/// if alpha is more than 0.
pub(super) fn deflate_mask(spec: &RasterSpec, pixels: &[u8]) -> Vec<u8> {
    deflate_repetitions(&match spec.channels {
        1 => mask::<2>(pixels),
        _ => mask::<4>(pixels),
    })
}

/// The bits of [`deflate_mask`] for pixels of `N` samples.
fn mask<const N: usize>(pixels: &[u8]) -> Vec<u8> {
    let (pixels, _) = pixels.as_chunks::<N>();
    let mut bits = Vec::with_capacity(pixels.len() / 8);
    for row in pixels.chunks_exact(TILE_EDGE_PX) {
        // Most rows are full.
        if is_full(row) {
            bits.resize(bits.len() + TILE_EDGE_PX / 8, u8::MAX);
            continue;
        }
        bits.extend(row.as_chunks::<8>().0.iter().map(|eight| {
            let set = eight.iter().map(|pixel| u8::from(pixel[N - 1] > 0));
            set.fold(0, |bits, set| bits << 1 | set)
        }));
    }
    bits
}

fn u8_difference(sample: u8, before: u8) -> [u8; 1] {
    [sample.wrapping_sub(before)]
}

fn u16_difference(sample: u16, before: u16) -> [u8; 2] {
    sample.wrapping_sub(before).to_le_bytes()
}

fn u32_difference(sample: u32, before: u32) -> [u8; 4] {
    sample.wrapping_sub(before).to_le_bytes()
}

/// Horizontal differences: every sample minus that of the pixel on its left, if any.
fn differences<S: Sample, const B: usize>(
    pixels: &[u8],
    samples_per_pixel: usize,
    difference: impl Fn(S, S) -> [u8; B],
) -> Vec<u8> {
    let mut predicted = vec![0; pixels.len()];
    let row_bytes = TILE_EDGE_PX * samples_per_pixel * B;
    let pixel_bytes = samples_per_pixel * B;
    for (row, out) in pixels
        .chunks_exact(row_bytes)
        .zip(predicted.chunks_exact_mut(row_bytes))
    {
        let (first, others) = out.split_at_mut(pixel_bytes);
        for (sample, out) in row.chunks_exact(B).zip(first.chunks_exact_mut(B)) {
            out.copy_from_slice(&difference(S::read(sample), S::nothing(0)));
        }
        let samples = row[pixel_bytes..].chunks_exact(B);
        for ((sample, before), out) in samples
            .zip(row.chunks_exact(B))
            .zip(others.chunks_exact_mut(B))
        {
            out.copy_from_slice(&difference(S::read(sample), S::read(before)));
        }
    }
    predicted
}

/// The floating-point predictor of TIFF's technical note 3: the bytes of a row grouped by
/// significance, highest first, then differences.
fn byte_planes(pixels: &[u8], samples_per_pixel: usize) -> Vec<u8> {
    let mut predicted = vec![0; pixels.len()];
    let row_bytes = TILE_EDGE_PX * samples_per_pixel * f32::BYTES;
    let mut planes = vec![0; row_bytes];
    for (row, out) in pixels
        .chunks_exact(row_bytes)
        .zip(predicted.chunks_exact_mut(row_bytes))
    {
        for (i, sample) in row.chunks_exact(f32::BYTES).enumerate() {
            for (k, byte) in f32::read(sample).to_be_bytes().into_iter().enumerate() {
                planes[k * TILE_EDGE_PX * samples_per_pixel + i] = byte;
            }
        }
        out.copy_from_slice(&planes);
        for i in samples_per_pixel..row_bytes {
            out[i] = planes[i].wrapping_sub(planes[i - samples_per_pixel]);
        }
    }
    predicted
}
