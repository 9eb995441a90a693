//! Kernels of the sampling of a tile: positions of its samples in an image, and the values there.
//!
//! Each is a loop over all samples without a branch, compiled once for the processor's vectors.
//! With the pixel `(x, y)` to the upper left of a sample and the fractions `(f, g)` from it, values
//! are `Σ_ij K(j − g) K(i − f) I(x + i, y + j)` ([`Interpolation`]), rows before columns.

use crate::tiles::grid::{Plane, ZERO};
use crate::tiles::interpolation::{Interpolation, cubic_weights};
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::{LensF32, LensLoop, ProjectF32};
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// 2²³: added to a non-negative float, it rounds it to an integer in the last bits of the sum.
/// Unlike a cast, which saturates, this vectorises.
const ROUNDING: f32 = 8_388_608.0;

/// Positions of a tile's samples in an image.
pub struct SamplePositions {
    /// Index of the pixel to the upper left of each sample.
    index: [u32; ZERO.len()],
    /// Fraction from it to the right, 0 to 1.
    fu: Plane,
    /// Fraction from it down, 0 to 1.
    fv: Plane,
}

impl SamplePositions {
    /// The positions of no samples yet.
    pub const NONE: Self = Self {
        index: [0; ZERO.len()],
        fu: ZERO,
        fv: ZERO,
    };
}

/// A camera at a pose, in single precision, and a tile before it.
pub struct TileProjection<'a> {
    /// `fx, fy, cx, cy`.
    pub intrinsics: [f32; 4],
    /// Rotation from the world to the camera, row by row.
    pub r_cw: [[f32; 3]; 3],
    /// The tile's centre in camera coordinates, metres.
    pub centre: [f32; 3],
    /// The samples relative to the centre, world axes, metres.
    pub offsets: [&'a Plane; 3],
    /// The image.
    pub image: &'a GreyImage,
    /// Pixels that the kernel reads beyond the two of a sample, on either side.
    pub margin: usize,
}

impl TileProjection<'_> {
    /// Writes the positions of the samples through `lens`; samples outside the image are moved to
    /// its border, those behind the camera to its first pixel.
    pub fn project(&self, lens: LensF32, positions: &mut SamplePositions) {
        lens.run(ProjectionLoop {
            projection: self,
            positions,
        });
    }

    #[inline(always)]
    fn project_through(&self, lens: impl ProjectF32, positions: &mut SamplePositions) {
        let ([fx, fy, cx, cy], r, c) = (self.intrinsics, &self.r_cw, &self.centre);
        let [dx, dy, dz] = self.offsets;
        let width = self.image.width() as u32;
        let first = self.margin as f32;
        let last = |size: usize| (size - 2 - self.margin) as f32;
        let (last_u, last_v) = (last(self.image.width()), last(self.image.height()));
        for k in 0..ZERO.len() {
            let x = c[0] + r[0][0] * dx[k] + r[0][1] * dy[k] + r[0][2] * dz[k];
            let y = c[1] + r[1][0] * dx[k] + r[1][1] * dy[k] + r[1][2] * dz[k];
            let z = c[2] + r[2][0] * dx[k] + r[2][1] * dy[k] + r[2][2] * dz[k];
            let (p, q, _) = lens.project_f32(x, y, z);
            let (u, v) = (fx * p + cx, fy * q + cy);
            // `max` first: a NaN (a sample behind the camera) becomes the first pixel.
            let x0 = (u - 0.5).max(first).min(last_u) + ROUNDING;
            let y0 = (v - 0.5).max(first).min(last_v) + ROUNDING;
            positions.fu[k] = (u - (x0 - ROUNDING)).clamp(0.0, 1.0);
            positions.fv[k] = (v - (y0 - ROUNDING)).clamp(0.0, 1.0);
            positions.index[k] =
                (y0.to_bits() - ROUNDING.to_bits()) * width + (x0.to_bits() - ROUNDING.to_bits());
        }
    }
}

/// [`TileProjection::project`], compiled for each lens model.
struct ProjectionLoop<'a, 'p> {
    projection: &'a TileProjection<'p>,
    positions: &'a mut SamplePositions,
}

impl LensLoop for ProjectionLoop<'_, '_> {
    fn run(self, lens: impl ProjectF32) {
        let (projection, positions) = (self.projection, self.positions);
        dispatch_simd(
            #[inline(always)]
            || projection.project_through(lens, positions),
        );
    }
}

/// Writes `(I − bias) · inverse_gain` at the positions into `values`; NaN where an interpolated
/// pixel has no value.
pub fn interpolate(
    interpolation: Interpolation,
    image: &GreyImage,
    positions: &SamplePositions,
    (bias, inverse_gain): (f32, f32),
    values: &mut Plane,
) {
    let (data, width) = (image.data(), image.width());
    dispatch_simd(
        #[inline(always)]
        || {
            match interpolation {
                Interpolation::Bilinear => bilinear(data, width, positions, values),
                Interpolation::Bicubic => bicubic(data, width, positions, values),
            }
            for value in values.iter_mut() {
                *value = (*value - bias) * inverse_gain;
            }
        },
    );
}

/// The pixels of `N` rows below each other: those at the same index in each. As all have one
/// length, one comparison of an index with it serves for all rows.
#[inline(always)]
fn rows<const N: usize>(data: &[f32], width: usize) -> [&[f32]; N] {
    let count = data.len() - (N - 1) * width;
    let mut rows = [data; N];
    for (j, row) in rows.iter_mut().enumerate() {
        *row = &data[j * width..][..count];
    }
    rows
}

/// Bilinear interpolation.
#[inline(always)]
fn bilinear(data: &[f32], width: usize, positions: &SamplePositions, values: &mut Plane) {
    let (fu, fv) = (&positions.fu, &positions.fv);
    let [upper_row, lower_row] = rows::<2>(data, width);
    let (mut upper, mut lower) = ([[0.0f32; 2]; ZERO.len()], [[0.0f32; 2]; ZERO.len()]);
    for k in 0..ZERO.len() {
        let start = positions.index[k] as usize;
        upper[k].copy_from_slice(&upper_row[start..start + 2]);
        lower[k].copy_from_slice(&lower_row[start..start + 2]);
    }
    for k in 0..ZERO.len() {
        let a = upper[k][0] + fu[k] * (upper[k][1] - upper[k][0]);
        let b = lower[k][0] + fu[k] * (lower[k][1] - lower[k][0]);
        values[k] = a + fv[k] * (b - a);
    }
}

/// Bicubic interpolation.
#[inline(always)]
fn bicubic(data: &[f32], width: usize, positions: &SamplePositions, values: &mut Plane) {
    let rows = rows::<4>(data, width);
    let to_first = width as u32 + 1;
    let (mut across, mut down) = ([ZERO; 4], [ZERO; 4]);
    write_weights(&positions.fu, &mut across);
    write_weights(&positions.fv, &mut down);
    let mut columns = [[0.0f32; 4]; ZERO.len()];
    for k in 0..ZERO.len() {
        let start = positions.index[k].wrapping_sub(to_first) as usize;
        let mut sums = [0.0f32; 4];
        for j in 0..4 {
            let pixels: &[f32] = &rows[j][start..start + 4];
            for i in 0..4 {
                sums[i] += down[j][k] * pixels[i];
            }
        }
        columns[k] = sums;
    }
    for k in 0..ZERO.len() {
        let [a, b, c, d] = columns[k];
        let left = across[0][k] * a + across[1][k] * b;
        values[k] = left + (across[2][k] * c + across[3][k] * d);
    }
}

/// Writes [`cubic_weights`] at all samples.
#[inline(always)]
fn write_weights(fractions: &Plane, weights: &mut [Plane; 4]) {
    for k in 0..ZERO.len() {
        let of_sample = cubic_weights(fractions[k]);
        for i in 0..4 {
            weights[i][k] = of_sample[i];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Positions all over an image of 24 × 20 pixels, two pixels from its border.
    fn positions() -> SamplePositions {
        let mut positions = SamplePositions::NONE;
        for k in 0..ZERO.len() {
            let (x, y) = (2 + 7 * k % 19, 2 + 5 * k % 15);
            positions.index[k] = (24 * y + x) as u32;
            (positions.fu[k], positions.fv[k]) = (k as f32 / 103.0, (3 * k % 104) as f32 / 104.0);
        }
        positions
    }

    /// Plain loops over pixels and samples, with the same order of sums, to the byte.
    #[test]
    fn kernels_are_the_plain_sums_over_pixels() {
        let grey = |k: usize| (1000.0 * (12.9 * k as f32).sin()).fract() * 200.0;
        let image = GreyImage::new(24, 20, (0..24 * 20).map(grey).collect());
        let positions = positions();
        let at = |k: usize, i: usize, j: usize| {
            let index = positions.index[k] as usize;
            image.at(index % 24 + i - 1, index / 24 + j - 1)
        };
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            let mut values = ZERO;
            interpolate(interpolation, &image, &positions, (3.0, 0.5), &mut values);
            for (k, value) in values.into_iter().enumerate() {
                let (fu, fv) = (positions.fu[k], positions.fv[k]);
                let plain = match interpolation {
                    Interpolation::Bilinear => {
                        let row = |j| at(k, 1, j) + fu * (at(k, 2, j) - at(k, 1, j));
                        row(1) + fv * (row(2) - row(1))
                    }
                    Interpolation::Bicubic => {
                        let (u, v) = (cubic_weights(fu), cubic_weights(fv));
                        let column = |i| (0..4).fold(0.0, |sum, j| sum + v[j] * at(k, i, j));
                        (u[0] * column(0) + u[1] * column(1))
                            + (u[2] * column(2) + u[3] * column(3))
                    }
                };
                assert_eq!(value, (plain - 3.0) * 0.5, "{interpolation:?} {k}");
            }
        }
    }
}
