//! Grey images in floating point.

/// A grey image, row-major, in grey levels of an 8-bit image (0–255; 16-bit input is scaled to that
/// range and keeps its finer steps). NaN marks pixels without a value, such as clipped white or
/// black.
#[derive(Clone, Debug, PartialEq)]
pub struct GreyImage {
    width: usize,
    height: usize,
    data: Vec<f32>,
}

impl GreyImage {
    /// Creates an image from its rows.
    ///
    /// # Panics
    /// If `data` does not hold `width · height` values.
    pub fn new(width: usize, height: usize, data: Vec<f32>) -> Self {
        assert_eq!(data.len(), width * height, "pixels of a grey image");
        Self {
            width,
            height,
            data,
        }
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.height
    }

    /// The pixels, row-major.
    pub fn data(&self) -> &[f32] {
        &self.data
    }

    /// The mutable pixels, row-major.
    pub fn data_mut(&mut self) -> &mut [f32] {
        &mut self.data
    }

    /// True if a pixel has no value.
    pub fn has_gaps(&self) -> bool {
        self.data.iter().any(|value| value.is_nan())
    }

    /// The value of a pixel.
    pub fn at(&self, x: usize, y: usize) -> f32 {
        self.data[y * self.width + x]
    }

    /// Halves the image: each pixel is the `[1 3 3 1]/8 ⊗ [1 3 3 1]/8` weighted mean around the
    /// corner shared by four pixels.
    ///
    /// The filter is even, so the new centre lies exactly between the old ones (see
    /// [`tunnelstitch_geometry::camera::Camera::at_level`]); borders repeat the outermost pixel.
    ///
    /// Pixels without a value have no weight; where they make up more than half of the kernel, the
    /// result has no value.
    pub fn halved(&self) -> Self {
        if !self.has_gaps() {
            return self.filtered_half();
        }
        let with = |value: fn(f32) -> f32| {
            let data = self.data.iter().map(|v| value(*v)).collect();
            Self::new(self.width, self.height, data).filtered_half()
        };
        let mut half = with(|v| if v.is_nan() { 0.0 } else { v });
        let weight = with(|v| if v.is_nan() { 0.0 } else { 1.0 });
        for (value, weight) in half.data.iter_mut().zip(&weight.data) {
            *value = if *weight < 0.5 {
                f32::NAN
            } else {
                *value / weight
            };
        }
        half
    }

    fn filtered_half(&self) -> Self {
        let (w, h) = (self.width / 2, self.height / 2);
        // Horizontally first: four taps per pixel, into rows of half width.
        let mut across = vec![0.0f32; w * self.height];
        for (row, out) in self
            .data
            .chunks_exact(self.width)
            .zip(across.chunks_exact_mut(w))
        {
            let last = self.width - 1;
            for (x, value) in out.iter_mut().enumerate() {
                let c = 2 * x;
                let (a, d) = (row[c.saturating_sub(1)], row[(c + 2).min(last)]);
                *value = 0.125 * (a + d) + 0.375 * (row[c] + row[c + 1]);
            }
        }
        let mut data = vec![0.0f32; w * h];
        for (y, out) in data.chunks_exact_mut(w).enumerate() {
            let c = 2 * y;
            let row = |k: usize| &across[k * w..(k + 1) * w];
            let (a, b) = (row(c.saturating_sub(1)), row(c));
            let (e, d) = (row(c + 1), row((c + 2).min(self.height - 1)));
            for x in 0..w {
                out[x] = 0.125 * (a[x] + d[x]) + 0.375 * (b[x] + e[x]);
            }
        }
        Self::new(w, h, data)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halving_keeps_a_ramp_with_the_half_pixel_shift() {
        let ramp = GreyImage::new(16, 8, (0..128).map(|k| (k % 16) as f32).collect());
        let half = ramp.halved();
        assert_eq!((half.width(), half.height()), (8, 4));
        // u = 2 u_1 + ½ away from the border.
        for x in 1..7 {
            assert!((half.at(x, 2) - (2.0 * x as f32 + 0.5)).abs() < 1e-5);
        }
    }

    #[test]
    fn halving_an_odd_size_drops_the_last_row_and_column() {
        let half = GreyImage::new(5, 7, vec![3.0; 35]).halved();
        assert_eq!((half.width(), half.height()), (2, 3));
        assert!(half.data().iter().all(|v| (v - 3.0).abs() < 1e-6));
    }

    #[test]
    fn gaps_shrink_into_the_coarse_picture_or_vanish() {
        let mut image = GreyImage::new(16, 16, vec![7.0; 256]);
        image.data_mut()[5 * 16 + 5] = f32::NAN;
        let half = image.halved();
        assert!(half.data().iter().all(|v| (v - 7.0).abs() < 1e-5));
        for y in 4..10 {
            image.data_mut()[y * 16 + 4..y * 16 + 10].fill(f32::NAN);
        }
        let half = image.halved();
        assert!(half.at(3, 3).is_nan() && (half.at(1, 1) - 7.0).abs() < 1e-5);
    }
}
