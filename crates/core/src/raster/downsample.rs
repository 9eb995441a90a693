//! Downsampling for overviews: 2 × 2 pixels become one.

use super::spec::{RasterSpec, Reduce, SampleType, TILE_EDGE_PX};
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Columns and rows of a reduced tile.
pub(super) const HALF_EDGE_PX: usize = TILE_EDGE_PX / 2;

/// Downsamples a tile to [`HALF_EDGE_PX`] × [`HALF_EDGE_PX`] pixels; `extent` are its columns and
/// rows within the picture. Pixels beyond are ignored and become 0.
pub(super) fn reduce(spec: &RasterSpec, pixels: &[u8], extent: [usize; 2]) -> Vec<u8> {
    match spec.samples {
        SampleType::U8 => of_type::<u8>(spec, pixels, extent),
        SampleType::U16 => of_type::<u16>(spec, pixels, extent),
        SampleType::U32 => of_type::<u32>(spec, pixels, extent),
        SampleType::F32 => of_type::<f32>(spec, pixels, extent),
    }
}

/// The numeric type of a sample.
pub(super) trait Sample: Copy {
    /// Size, bytes.
    const BYTES: usize;
    /// The alpha of an opaque pixel.
    const OPAQUE: Self;
    /// Reads a sample from its bytes.
    fn read(bytes: &[u8]) -> Self;
    /// Writes a sample to its bytes.
    fn write(self, bytes: &mut [u8]);
    /// True for NaN or the no-data value `nothing`.
    fn is_nothing(self, nothing: Option<u32>) -> bool;
    /// The mean of the `count` valid values (`there`), at least one.
    fn mean(values: [Self; 4], there: [bool; 4], count: u32) -> Self;
    /// The sample of no data.
    fn nothing(number: u32) -> Self;
}

/// Implements [`Sample`] for an integer type; the sum of four values fits into `$sum`.
macro_rules! whole_number {
    ($type:ty, $sum:ty) => {
        impl Sample for $type {
            const BYTES: usize = size_of::<Self>();
            const OPAQUE: Self = Self::MAX;

            fn read(bytes: &[u8]) -> Self {
                let mut own = [0; size_of::<Self>()];
                own.copy_from_slice(bytes);
                Self::from_ne_bytes(own)
            }

            fn write(self, bytes: &mut [u8]) {
                bytes.copy_from_slice(&self.to_ne_bytes());
            }

            fn is_nothing(self, nothing: Option<u32>) -> bool {
                nothing.is_some_and(|nothing| u32::from(self) == nothing)
            }

            fn mean(values: [Self; 4], there: [bool; 4], count: u32) -> Self {
                let sum: $sum = (0..4)
                    .map(|i| <$sum>::from(values[i]) * <$sum>::from(there[i]))
                    .sum();
                // Rounded to the nearest, halves up. Division by constants is faster; the mean fits
                // into the type of its values.
                (match count {
                    1 => sum,
                    2 => sum.div_ceil(2),
                    3 => (sum + 1) / 3,
                    _ => (sum + 2) / 4,
                }) as Self
            }

            fn nothing(number: u32) -> Self {
                number as Self
            }
        }
    };
}
whole_number!(u8, u32);
whole_number!(u16, u32);
whole_number!(u32, u64);

impl Sample for f32 {
    const BYTES: usize = 4;
    const OPAQUE: Self = 1.0;

    fn read(bytes: &[u8]) -> Self {
        Self::from_bits(u32::read(bytes))
    }

    fn write(self, bytes: &mut [u8]) {
        self.to_bits().write(bytes);
    }

    fn is_nothing(self, _: Option<u32>) -> bool {
        self.is_nan()
    }

    fn mean(values: [Self; 4], there: [bool; 4], count: u32) -> Self {
        let sum: f64 = (0..4)
            .map(|i| if there[i] { f64::from(values[i]) } else { 0.0 })
            .sum();
        (sum / f64::from(count)) as Self
    }

    fn nothing(_: u32) -> Self {
        Self::NAN
    }
}

fn of_type<S: Sample>(spec: &RasterSpec, pixels: &[u8], extent: [usize; 2]) -> Vec<u8> {
    match (spec.channels, spec.alpha) {
        (1, false) => of_pixel::<S, 1>(spec, pixels, extent),
        (1, true) => of_pixel::<S, 2>(spec, pixels, extent),
        (_, false) => of_pixel::<S, 3>(spec, pixels, extent),
        (_, true) => of_pixel::<S, 4>(spec, pixels, extent),
    }
}

/// Implements [`reduce`] for pixels of `N` samples.
fn of_pixel<S: Sample, const N: usize>(
    spec: &RasterSpec,
    pixels: &[u8],
    [width, height]: [usize; 2],
) -> Vec<u8> {
    let bytes = N * S::BYTES;
    let nothing = spec.nodata.map(|_| spec.nothing());
    let read = |pixel: &[u8]| -> [S; N] {
        std::array::from_fn(|k| S::read(&pixel[k * S::BYTES..][..S::BYTES]))
    };
    let mut reduced = vec![0; HALF_EDGE_PX * HALF_EDGE_PX * bytes];
    let two_rows = pixels.chunks_exact(2 * TILE_EDGE_PX * bytes);
    for (y, (rows, out)) in two_rows
        .zip(reduced.chunks_exact_mut(HALF_EDGE_PX * bytes))
        .take(height.div_ceil(2))
        .enumerate()
    {
        let (upper, lower) = rows.split_at(TILE_EDGE_PX * bytes);
        let all = width == TILE_EDGE_PX && 2 * y + 1 < height;
        if all
            && spec.alpha
            && spec.reduce == Reduce::Mean
            && S::BYTES == 1
            && is_full::<N>(rows.as_chunks().0)
        {
            means::<N>(upper, lower, out);
            continue;
        }
        let pairs = upper
            .chunks_exact(2 * bytes)
            .zip(lower.chunks_exact(2 * bytes));
        for (x, ((upper, lower), out)) in pairs
            .zip(out.chunks_exact_mut(bytes))
            .take(width.div_ceil(2))
            .enumerate()
        {
            let four = [
                read(&upper[..bytes]),
                read(&upper[bytes..]),
                read(&lower[..bytes]),
                read(&lower[bytes..]),
            ];
            let (right, below) = (2 * x + 1 < width, 2 * y + 1 < height);
            let within = [true, right, below, right && below];
            let mut put = |k: usize, sample: S| sample.write(&mut out[k * S::BYTES..][..S::BYTES]);
            if spec.alpha {
                let there =
                    std::array::from_fn(|i| within[i] && !four[i][N - 1].is_nothing(Some(0)));
                for k in 0..N - 1 {
                    let values = four.map(|pixel| pixel[k]);
                    put(
                        k,
                        one_of(spec.reduce, values, there).unwrap_or(S::nothing(0)),
                    );
                }
                let covered = there.contains(&true);
                put(N - 1, if covered { S::OPAQUE } else { S::nothing(0) });
            } else {
                for k in 0..N {
                    let values = four.map(|pixel| pixel[k]);
                    let there =
                        std::array::from_fn(|i| within[i] && !values[i].is_nothing(nothing));
                    let one = one_of(spec.reduce, values, there);
                    put(k, one.unwrap_or(S::nothing(spec.nothing())));
                }
            }
        }
    }
    reduced
}

/// True if all pixels of `N` bytes are opaque.
pub(super) fn is_full<const N: usize>(pixels: &[[u8; N]]) -> bool {
    let mut least = u8::MAX;
    dispatch_simd(
        #[inline(always)]
        || {
            for pixel in pixels {
                least = least.min(pixel[N - 1]);
            }
        },
    );
    least > 0
}

/// Downsamples two rows of opaque pixels of `N` bytes.
fn means<const N: usize>(upper: &[u8], lower: &[u8], out: &mut [u8]) {
    let (upper, _) = upper.as_chunks::<N>().0.as_chunks::<2>();
    let (lower, _) = lower.as_chunks::<N>().0.as_chunks::<2>();
    let (out, _) = out.as_chunks_mut::<N>();
    dispatch_simd(
        #[inline(always)]
        || {
            for (([a, b], [c, d]), out) in upper.iter().zip(lower).zip(out.iter_mut()) {
                for k in 0..N - 1 {
                    let sum = u16::from(a[k]) + u16::from(b[k]) + u16::from(c[k]) + u16::from(d[k]);
                    out[k] = ((sum + 2) / 4) as u8;
                }
                out[N - 1] = u8::OPAQUE;
            }
        },
    );
}

/// Reduces the valid values (`there`); None if there are none.
fn one_of<S: Sample>(reduce: Reduce, values: [S; 4], there: [bool; 4]) -> Option<S> {
    match reduce {
        Reduce::Mean => {
            let count = there.iter().map(|&there| u32::from(there)).sum();
            (count > 0).then(|| S::mean(values, there, count))
        }
        Reduce::First => there.iter().position(|&there| there).map(|i| values[i]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::raster::spec::Nodata;
    use crate::raster::test_picture::grey_alpha;

    /// Downsamples the upper left 2 × 2 pixels with `extent`.
    fn corner<T: Sample, const N: usize>(
        spec: &RasterSpec,
        four: [[T; N]; 4],
        extent: [usize; 2],
    ) -> [T; N] {
        let bytes = spec.pixel_bytes();
        let mut pixels = vec![0; spec.tile_bytes()];
        for (i, pixel) in four.iter().enumerate() {
            for (k, sample) in pixel.iter().enumerate() {
                let place = (i / 2 * TILE_EDGE_PX + i % 2) * bytes + k * T::BYTES;
                sample.write(&mut pixels[place..][..T::BYTES]);
            }
        }
        let reduced = reduce(spec, &pixels, extent);
        assert!(reduced[bytes..].iter().all(|&byte| byte == 0));
        std::array::from_fn(|k| T::read(&reduced[k * T::BYTES..][..T::BYTES]))
    }

    #[test]
    fn the_mean_is_of_what_is_covered() {
        let spec = grey_alpha(2, 2);
        let four = [[10u8, 255], [20, 255], [0, 0], [31, 255]];
        assert_eq!(corner(&spec, four, [2, 2]), [20, 255]);
        assert_eq!(corner(&spec, [[0u8, 0]; 4], [2, 2]), [0, 0]);
        let white = RasterSpec {
            samples: SampleType::U16,
            ..spec
        };
        let four = [[u16::MAX; 2]; 4];
        assert_eq!(corner(&white, four, [2, 2]), [u16::MAX; 2]);
    }

    #[test]
    fn what_lies_beyond_the_border_counts_for_nothing() {
        let spec = RasterSpec {
            alpha: false,
            ..grey_alpha(1, 2)
        };
        let four = [[10u8], [255], [20], [255]];
        assert_eq!(corner(&spec, four, [1, 2]), [15]);
        assert_eq!(corner(&spec, four, [2, 1]), [133]);
        assert_eq!(corner(&spec, four, [1, 1]), [10]);
    }

    #[test]
    fn labels_are_not_mixed() {
        let spec = RasterSpec {
            samples: SampleType::U32,
            alpha: false,
            nodata: Some(Nodata::Max),
            reduce: Reduce::First,
            ..grey_alpha(2, 2)
        };
        let none = u32::MAX;
        assert_eq!(corner(&spec, [[7], [8], [9], [9u32]], [2, 2]), [7]);
        assert_eq!(corner(&spec, [[none], [none], [9], [8]], [2, 2]), [9]);
        assert_eq!(corner(&spec, [[none]; 4], [2, 2]), [none]);
        let zero = RasterSpec {
            nodata: None,
            ..spec
        };
        assert_eq!(corner(&zero, [[0], [8], [9], [9u32]], [2, 2]), [0]);
    }

    #[test]
    fn not_a_number_is_nothing() {
        let spec = RasterSpec {
            samples: SampleType::F32,
            alpha: false,
            ..grey_alpha(2, 2)
        };
        let four = [[1.5], [f32::NAN], [2.5], [f32::NAN]];
        assert_eq!(corner(&spec, four, [2, 2]), [2.0]);
        assert!(corner(&spec, [[f32::NAN]; 4], [2, 2])[0].is_nan());
    }
}
