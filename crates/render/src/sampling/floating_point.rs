//! Sums under a kernel in single precision: pictures of 16 bits, and the nearest pixel of any.

use super::sample::Sample;

/// Grey value under a kernel that begins with the first sample; columns are summed first, side by
/// side.
///
/// Compilers vectorise arrays of fixed size, here and in [`colour`].
#[inline(always)]
pub fn grey<T: Sample, const N: usize>(
    samples: &[T],
    stride: usize,
    w_x: &[f32; N],
    w_y: &[f32; N],
) -> f32 {
    let mut columns = [0.0f32; N];
    for (j, w) in w_y.iter().enumerate() {
        if let Some(row) = samples[j * stride..].first_chunk::<N>() {
            columns = std::array::from_fn(|k| columns[k] + w * row[k].value());
        }
    }
    let mut value = 0.0;
    for (w, column) in w_x.iter().zip(columns) {
        value += w * column;
    }
    value
}

/// Colour under a kernel that begins with the first sample. Pixels are read four samples wide; the
/// fourth lane belongs to the neighbour and is ignored.
#[inline(always)]
pub fn colour<T: Sample, const N: usize>(
    samples: &[T],
    stride: usize,
    w_x: &[f32; N],
    w_y: &[f32; N],
) -> [f32; 4] {
    let mut value = [0.0f32; 4];
    for (j, w_y) in w_y.iter().enumerate() {
        let row = &samples[j * stride..][..3 * N + 1];
        let mut sum = [0.0f32; 4];
        for (k, w_x) in w_x.iter().enumerate() {
            if let Some(pixel) = row[3 * k..].first_chunk::<4>() {
                sum = std::array::from_fn(|c| sum[c] + w_x * pixel[c].value());
            }
        }
        value = std::array::from_fn(|c| value[c] + w_y * sum[c]);
    }
    value
}
