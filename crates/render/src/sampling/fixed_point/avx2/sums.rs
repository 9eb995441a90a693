//! Sums of kernels anywhere in a picture, eight at a time.

use super::super::inputs::{KernelPositions, PictureSamples};
use super::super::scalar;
use super::colour::colour_sums;
use super::grey::grey_sums;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Sums the samples under each kernel, eight at a time, the rest by plain loops.
#[inline(always)]
pub fn sum_samples<const C: usize, const TAPS: usize>(
    simd: V3,
    source: PictureSamples,
    kernel: &Kernel,
    places: KernelPositions,
    sums: &mut [[i32; 4]],
) {
    let (chunks, rest) = sums.as_chunks_mut::<8>();
    let [across, down] = places.phases;
    let first = places.first.as_chunks::<8>().0;
    let (s, t) = (across.as_chunks::<8>().0, down.as_chunks::<8>().0);
    let done = 8 * chunks.len();
    for (((sums, first), s), t) in chunks.iter_mut().zip(first).zip(s).zip(t) {
        if C == 1 {
            let all: [i32; 8] = cast(grey_sums::<TAPS>(simd, source, kernel, first, [*s, *t]));
            for (sum, value) in sums.iter_mut().zip(all) {
                *sum = [value, 0, 0, 0];
            }
        } else {
            let [a, b, c, d] = colour_sums::<TAPS>(simd, source, kernel, first, [*s, *t]);
            [sums[0], sums[4]] = cast(a);
            [sums[1], sums[5]] = cast(b);
            [sums[2], sums[6]] = cast(c);
            [sums[3], sums[7]] = cast(d);
        }
    }
    let places = KernelPositions {
        first: &places.first[done..],
        phases: [&across[done..], &down[done..]],
    };
    scalar::sum_samples::<C>(source, kernel, places, rest);
}
