//! Sums and values as pixels, alpha last and full.

use super::super::format::{bits, rounding};
use super::super::scalar;
use super::lanes::ZERO_BYTE;
use super::positions::ColumnGroup;
use crate::warp::patches::LANES;
use pulp::bytemuck::cast;
use pulp::x86::V3;
use std::arch::x86_64::{__m128i, __m256i};

#[inline(always)]
pub fn write_pixels<const C: usize>(
    simd: V3,
    sums: &[[i32; 4]],
    more: &[i32; 4],
    bits: u32,
    pixels: &mut [u8],
) {
    let avx2 = simd.avx2;
    let (column_groups, rest) = sums.as_chunks::<8>();
    let (there, there_rest) = pixels.split_at_mut(8 * (C + 1) * column_groups.len());
    let more_twice: __m256i = cast([*more; 2]);
    // Packing leaves pixels 0, 2, 4, 6 in the lower half and 1, 3, 5, 7 in the upper one.
    let order: __m256i = cast([0, 4, 1, 5, 2, 6, 3, 7]);
    let first_two: __m256i = cast(
        [[
            0i8, 1, 4, 5, 8, 9, 12, 13, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
            ZERO_BYTE, ZERO_BYTE, ZERO_BYTE,
        ]; 2],
    );
    for (eight, there) in column_groups
        .iter()
        .zip(there.chunks_exact_mut(8 * (C + 1)))
    {
        let all = pack_sums(simd, cast(*eight), more_twice, bits);
        let all = avx2._mm256_permutevar8x32_epi32(all, order);
        if C == 3 {
            let all: [u8; 32] = cast(all);
            there.copy_from_slice(&all);
        } else {
            let [low, _, high, _]: [[u8; 8]; 4] = cast(avx2._mm256_shuffle_epi8(all, first_two));
            let (first, last) = there.split_at_mut(8);
            first.copy_from_slice(&low);
            last.copy_from_slice(&high);
        }
    }
    scalar::write_pixels::<C>(rest, more, bits, there_rest);
}

/// Adds `more` to sums, cuts off their last `bits` and packs them as bytes: the lower halves of all
/// vectors first.
#[inline(always)]
pub fn pack_sums(simd: V3, [a, b, c, d]: [__m256i; 4], more: __m256i, bits: u32) -> __m256i {
    let avx2 = simd.avx2;
    let count: __m128i = cast([bits, 0, 0, 0]);
    let a = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(a, more), count);
    let b = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(b, more), count);
    let c = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(c, more), count);
    let d = avx2._mm256_sra_epi32(avx2._mm256_add_epi32(d, more), count);
    pack_bytes(simd, [a, b, c, d])
}

/// Packs whole numbers as bytes, those beyond the scale as its ends: the lower halves of all
/// vectors first.
#[inline(always)]
pub fn pack_bytes(simd: V3, [a, b, c, d]: [__m256i; 4]) -> __m256i {
    let avx2 = simd.avx2;
    let (ab, cd) = (avx2._mm256_packs_epi32(a, b), avx2._mm256_packs_epi32(c, d));
    avx2._mm256_packus_epi16(ab, cd)
}

/// Pixels of sums, those of k and k + 4 in the halves of the k-th vector, alpha last and full.
#[inline(always)]
pub fn colour_bytes<const TAPS: usize>(simd: V3, sums: [__m256i; 4]) -> __m256i {
    let (bits, half) = (bits(TAPS), rounding(TAPS));
    let more = cast([[half, half, half, 255 << bits]; 2]);
    pack_sums(simd, sums, more, bits)
}

/// Grey pixels of eight sums, alpha last and full.
#[inline(always)]
pub fn grey_bytes<const TAPS: usize>(simd: V3, sums: __m256i) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let count: __m128i = cast([bits(TAPS), 0, 0, 0]);
    let value = avx2._mm256_add_epi32(sums, avx._mm256_set1_epi32(rounding(TAPS)));
    grey_pixels(simd, avx2._mm256_sra_epi32(value, count))
}

/// Eight grey pixels of these values, alpha last and full.
#[inline(always)]
pub fn grey_pixels(simd: V3, value: __m256i) -> __m256i {
    let (avx, avx2) = (simd.avx, simd.avx2);
    let value = avx2._mm256_max_epi32(value, avx._mm256_setzero_si256());
    let value = avx2._mm256_min_epi32(value, avx._mm256_set1_epi32(255));
    let pixel = avx2._mm256_or_si256(value, avx._mm256_set1_epi32(255 << 8));
    // The lower 16 bits of each number.
    let lower = avx._mm256_castsi256_si128(pixel);
    let upper = avx2._mm256_extracti128_si256::<1>(pixel);
    let pack_sums = simd.sse4_1._mm_packus_epi32(lower, upper);
    avx._mm256_castsi128_si256(pack_sums)
}

/// Stores those of eight pixels that are in the block into a row of the tile, where the patch
/// begins at column `patch`.
#[inline(always)]
pub fn store_pixels<const C: usize>(
    simd: V3,
    eight: __m256i,
    ColumnGroup { first, own, .. }: &ColumnGroup,
    patch: usize,
    pixels: &mut [u8],
) {
    let pixel = C + 1;
    if own.len() < LANES {
        let there = &mut pixels[(patch + own.start) * pixel..(patch + own.end) * pixel];
        let eight: [u8; 32] = cast(eight);
        let eight = &eight[(own.start - first) * pixel..];
        for (there, own) in there.iter_mut().zip(eight) {
            *there = *own;
        }
        return;
    }
    let there = &mut pixels[(patch + first) * pixel..][..LANES * pixel];
    if C == 1 {
        let eight: [u8; 16] = cast(simd.avx._mm256_castsi256_si128(eight));
        there.copy_from_slice(&eight);
    } else {
        let eight: [u8; 32] = cast(eight);
        there.copy_from_slice(&eight);
    }
}
