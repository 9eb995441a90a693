//! Choice of the code, compiled for the number of the kernel's taps: vectors where the processor
//! has them, else plain loops.

#[cfg(target_arch = "x86_64")]
use super::avx2;
use super::format::{bits, rounding};
use super::inputs::{
    BlendPart, BlendedBlock, KernelPositions, MAX_BLEND_PARTS, PatchBlock, PictureSamples,
    SampledPatch,
};
use super::scalar;
use std::ops::Range;
use tunnelstitch_geometry::numerics::kernel::Kernel;
#[cfg(target_arch = "x86_64")]
use tunnelstitch_geometry::numerics::simd_dispatch;

/// Runs the code compiled for the kernel's taps; 0 stands for any other number of them.
#[cfg(target_arch = "x86_64")]
macro_rules! by_taps {
    ($kernel:expr, |$simd:ident, $taps:ident| $work:expr) => {
        match $kernel.taps() {
            2 => by_taps!(2, $simd, $taps, $work),
            4 => by_taps!(4, $simd, $taps, $work),
            6 => by_taps!(6, $simd, $taps, $work),
            8 => by_taps!(8, $simd, $taps, $work),
            _ => by_taps!(0, $simd, $taps, $work),
        }
    };
    ($number:literal, $simd:ident, $taps:ident, $work:expr) => {{
        const $taps: usize = $number;
        simd_dispatch::dispatch_avx2(
            #[inline(always)]
            |$simd| $work,
        )
    }};
}

/// Sums the samples under each kernel, one lane a channel: colour in the first three, grey in the
/// first. `C`: 1 or 3 channels.
pub fn sum_samples<const C: usize>(
    source: PictureSamples,
    kernel: &Kernel,
    places: KernelPositions,
    sums: &mut [[i32; 4]],
) {
    #[cfg(target_arch = "x86_64")]
    if by_taps!(kernel, |simd, TAPS| avx2::sums::sum_samples::<C, TAPS>(
        simd, source, kernel, places, sums
    )) {
        return;
    }
    scalar::sum_samples::<C>(source, kernel, places, sums);
}

/// Rounds sums to 8-bit samples, alpha last and full.
pub fn write_pixels<const C: usize>(kernel: &Kernel, sums: &[[i32; 4]], pixels: &mut [u8]) {
    let bits = bits(kernel.taps());
    let mut more = [rounding(kernel.taps()); 4];
    more[C] = 255 << bits;
    #[cfg(target_arch = "x86_64")]
    if simd_dispatch::dispatch_avx2(
        #[inline(always)]
        |simd| avx2::pixels::write_pixels::<C>(simd, sums, &more, bits, pixels),
    ) {
        return;
    }
    scalar::write_pixels::<C>(sums, &more, bits, pixels);
}

/// Draws a block of one frame into rows of a tile, alpha last and full. False without doing it
/// where the processor lacks the vectors for it.
pub fn draw_block<const C: usize>(block: &PatchBlock, pixels: &mut [&mut [u8]]) -> bool {
    #[cfg(target_arch = "x86_64")]
    return by_taps!(
        block.patch.kernel,
        |simd, TAPS| avx2::block::draw::<C, TAPS>(simd, block, pixels)
    );
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Draws a block of one or several frames, exposure undone and corrections added. False without
/// doing it where the processor lacks the vectors for it, or kernels have different taps.
pub fn draw_blended_block<const C: usize, const L: usize>(
    block: &BlendedBlock<L>,
    pixels: &mut [&mut [u8]],
) -> bool {
    let Some((one, others)) = block.parts.split_first() else {
        return false;
    };
    let taps = one.patch.kernel.taps();
    let odd = |part: &BlendPart| part.patch.kernel.taps() != taps;
    if others.iter().any(odd) || others.len() >= MAX_BLEND_PARTS {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    return by_taps!(one.patch.kernel, |simd, TAPS| avx2::blended_block::draw::<
        C,
        L,
        TAPS,
    >(simd, block, pixels));
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Samples some columns of a row of a patch, in the lanes of [`sum_samples`]; `values`: of all the
/// patch, those beside `columns` have no meaning afterwards.
pub fn sample_values<const C: usize>(
    patch: &SampledPatch,
    row: usize,
    columns: Range<usize>,
    values: &mut [[f32; 4]],
) -> bool {
    #[cfg(target_arch = "x86_64")]
    return by_taps!(patch.kernel, |simd, TAPS| avx2::block::sample_values::<
        C,
        TAPS,
    >(
        simd,
        patch,
        row,
        columns.clone(),
        values
    ));
    #[cfg(not(target_arch = "x86_64"))]
    false
}
