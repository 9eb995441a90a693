//! Sums and pixels one at a time: the reference for the vectors.

use super::inputs::{KernelPositions, PictureSamples};
use tunnelstitch_geometry::numerics::kernel::Kernel;

pub fn sum_samples<const C: usize>(
    source: PictureSamples,
    kernel: &Kernel,
    places: KernelPositions,
    sums: &mut [[i32; 4]],
) {
    for (k, sum) in sums.iter_mut().enumerate() {
        let own = &source.samples[places.first[k] as usize..];
        let phases = places.phases.map(|phases| phases[k]);
        *sum = [0; 4];
        for (c, sum) in sum.iter_mut().enumerate().take(C) {
            let at = |x: usize, y: usize| i32::from(own[y * source.stride + x * C + c]);
            *sum = match kernel.taps() {
                2 => {
                    let [s, t] = phases;
                    (128 - t) * ((128 - s) * at(0, 0) + s * at(1, 0))
                        + t * ((128 - s) * at(0, 1) + s * at(1, 1))
                }
                _ => {
                    let [w_x, w_y] = phases.map(|phase| kernel.integer_weights_at(phase as usize));
                    cut_sum(w_x, w_y, at)
                }
            };
        }
    }
}

/// Adds `more` to the lanes up to the `C`th and cuts off the last `bits`.
pub fn write_pixels<const C: usize>(
    sums: &[[i32; 4]],
    more: &[i32; 4],
    bits: u32,
    pixels: &mut [u8],
) {
    for (sum, pixel) in sums.iter().zip(pixels.chunks_exact_mut(C + 1)) {
        for (c, sample) in pixel.iter_mut().enumerate() {
            *sample = ((sum[c] + more[c]) >> bits).clamp(0, 255) as u8;
        }
    }
}

fn cut_sum(w_x: &[i16], w_y: &[i16], at: impl Fn(usize, usize) -> i32) -> i32 {
    let row = |y: usize| {
        let part = |first: usize| {
            let taps = (0..w_x.len()).filter(|x| x % 4 / 2 == first);
            taps.map(|x| i32::from(w_x[x]) * at(x, y)).sum::<i32>() >> 8
        };
        part(0) + part(1)
    };
    let rows = w_y.iter().enumerate();
    rows.map(|(y, w)| i32::from(*w) * row(y)).sum()
}
