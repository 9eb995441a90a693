//! Tiles without loss: a predictor, then deflate.

use super::downsample::{Sample, is_full};
use super::spec::{RasterSpec, SampleType, TILE_EDGE_PX};

/// Effort of [`miniz_oxide`], of 10.
const DEFLATE_LEVEL: u8 = 1;

/// How a TIFF's tag 317 calls what [`deflate`] does first.
pub(super) fn predictor(samples: SampleType) -> u16 {
    match samples {
        SampleType::F32 => 3,
        _ => 2,
    }
}

/// The pixels of a tile as differences along the rows, little-endian, as a zlib stream.
///
/// Differences of 8 bits go through a code of fixed lengths that was made for them and is several
/// times as fast; for wider samples it is no good, and they go through one that finds repetitions.
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

/// One bit per pixel of 8-bit samples, the highest first, that says whether its last sample, alpha,
/// is more than 0; as a zlib stream.
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
        // Most rows are.
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

/// Every sample less the same of the pixel on its left, where there is one.
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

/// The predictor of floating point of TIFF's technical note 3: the bytes of a row, those of most
/// weight of all its numbers first, and of these the differences.
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
