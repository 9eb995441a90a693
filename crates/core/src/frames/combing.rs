//! Combing: the traces of interlaced fields in a picture.

use super::grey::GreyImage;
use tunnelstitch_geometry::numerics::median::median;

/// Side of the blocks, pixels.
const BLOCK_PX: usize = 16;

/// Axis along which neighbours are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CombAxis {
    /// Each row with those below.
    Rows,
    /// Each column with those to the right.
    Columns,
}

/// Ratio of the contrast between neighbouring rows to that between rows of one field: the
/// median over blocks of `Σ (I(v + 1) − I(v))² / Σ (I(v + 2) − I(v))²`; or that of columns.
///
/// Neighbouring rows of a progressive picture are more alike than rows that are two apart; the
/// ratio is below 1, and 1 if there is only noise. In a picture of two fields that were taken at
/// different times, the rows of a field are more alike, so that it is above 1. So are those of a
/// dithered picture, but its columns as well. None if the picture is smaller than a block or has
/// no contrast.
pub fn comb_ratio(image: &GreyImage, axis: CombAxis) -> Option<f64> {
    let [across, down] = match axis {
        CombAxis::Rows => [0, 1],
        CombAxis::Columns => [1, 0],
    };
    let columns = image.width().saturating_sub(2 * across) / BLOCK_PX;
    let rows = image.height().saturating_sub(2 * down) / BLOCK_PX;
    let mut ratios: Vec<f32> = (0..columns * rows)
        .filter_map(|k| {
            let (left, top) = (k % columns * BLOCK_PX, k / columns * BLOCK_PX);
            let contrast = |step: usize| -> f32 {
                let next = |u: usize, v: usize| image.at(u + across * step, v + down * step);
                let rows = top..top + BLOCK_PX;
                let row = |v: usize| {
                    let pixels = left..left + BLOCK_PX;
                    let squares = pixels.map(|u| (next(u, v) - image.at(u, v)).powi(2));
                    squares.filter(|square| square.is_finite()).sum::<f32>()
                };
                rows.map(row).sum()
            };
            let same_field = contrast(2);
            (same_field > 0.0).then(|| contrast(1) / same_field)
        })
        .collect();
    (!ratios.is_empty()).then(|| f64::from(median(&mut ratios)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, Normal};

    /// Waves that move by `shift` pixels from the even to the odd rows.
    fn waves(shift: f32) -> GreyImage {
        let value = |k: usize| {
            let (u, v) = ((k % 96) as f32, k / 96);
            let u = u + if v % 2 == 1 { shift } else { 0.0 };
            100.0 + 30.0 * (0.4 * u + 0.2 * v as f32).sin()
        };
        GreyImage::new(96, 96, (0..96 * 96).map(value).collect())
    }

    #[test]
    fn fields_that_move_comb() {
        let of_rows = |image: &GreyImage| comb_ratio(image, CombAxis::Rows);
        assert!(of_rows(&waves(0.0)).unwrap() < 0.4);
        assert!(of_rows(&waves(3.0)).unwrap() > 2.0);
        assert!(comb_ratio(&waves(3.0), CombAxis::Columns).unwrap() < 0.4);
        assert_eq!(of_rows(&GreyImage::new(96, 96, vec![7.0; 96 * 96])), None);
        assert_eq!(of_rows(&GreyImage::new(8, 8, vec![7.0; 64])), None);
    }

    /// Error diffusion after Floyd and Steinberg.
    fn dithered(image: &GreyImage) -> GreyImage {
        let (width, height) = (image.width(), image.height());
        let mut data = image.data().to_vec();
        for k in 0..data.len() {
            let (u, v) = (k % width, k / width);
            let rounded = if data[k] > 127.0 { 255.0 } else { 0.0 };
            let error = (data[k] - rounded) / 16.0;
            data[k] = rounded;
            for (right, down, weight) in [(1, 0, 7.0), (-1, 1, 3.0), (0, 1, 5.0), (1, 1, 1.0)] {
                let u = u.checked_add_signed(right).filter(|u| *u < width);
                if let (Some(u), true) = (u, v + down < height) {
                    data[(v + down) * width + u] += weight * error;
                }
            }
        }
        GreyImage::new(width, height, data)
    }

    #[test]
    fn a_dithered_picture_combs_both_ways() {
        let picture = dithered(&waves(0.0));
        for axis in [CombAxis::Rows, CombAxis::Columns] {
            assert!(comb_ratio(&picture, axis).unwrap() > 1.2, "{axis:?}");
        }
    }

    #[test]
    fn noise_has_a_ratio_of_one() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let noise = Normal::new(90.0f32, 5.0).unwrap();
        let ratios: Vec<f64> = (0..20)
            .filter_map(|_| {
                let data = (0..320 * 240).map(|_| noise.sample(&mut rng)).collect();
                comb_ratio(&GreyImage::new(320, 240, data), CombAxis::Rows)
            })
            .collect();
        assert!(
            ratios.iter().all(|ratio| (ratio - 1.0).abs() < 0.05),
            "{ratios:?}"
        );
    }
}
