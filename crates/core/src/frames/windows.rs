//! Means and variances in windows around the pixels of an image.

/// Number, mean and variance of the values in a window.
pub struct Moments {
    /// Number of pixels with a value.
    pub count: f64,
    /// Mean; of no values, one near the mean of the image.
    pub mean: f32,
    /// Variance.
    pub variance: f32,
}

/// Moments in windows around all pixels, by integral images. Pixels without a value (NaN) do not
/// count.
pub struct Windows {
    width: usize,
    height: usize,
    /// Pixels to each side, along x and y.
    reach: [usize; 2],
    /// A grey level near the mean, subtracted before summing.
    level: f32,
    /// Integral images of 1, I, I².
    sums: Vec<[f64; 3]>,
}

impl Windows {
    /// The windows of `2 reach + 1` pixels along x and y around the pixels of an image whose rows
    /// have `width` values.
    pub fn new(values: &[f32], width: usize, reach: [usize; 2]) -> Self {
        let height = values.len() / width;
        let known = values.iter().filter(|v| !v.is_nan());
        let level = known.clone().sum::<f32>() / known.count().max(1) as f32;
        let mut sums = vec![[0.0f64; 3]; (width + 1) * (height + 1)];
        for y in 0..height {
            let mut row = [0.0f64; 3];
            for x in 0..width {
                let value = f64::from(values[y * width + x] - level);
                if !value.is_nan() {
                    row[0] += 1.0;
                    row[1] += value;
                    row[2] += value * value;
                }
                let above = sums[y * (width + 1) + x + 1];
                sums[(y + 1) * (width + 1) + x + 1] = std::array::from_fn(|k| above[k] + row[k]);
            }
        }
        Self {
            width,
            height,
            reach,
            level,
            sums,
        }
    }

    /// Moments around every pixel, row by row.
    pub fn moments(&self) -> impl Iterator<Item = Moments> + '_ {
        let [reach_x, reach_y] = self.reach;
        let at = |x: usize, y: usize| &self.sums[y * (self.width + 1) + x];
        (0..self.width * self.height).map(move |k| {
            let (x, y) = (k % self.width, k / self.width);
            let (x0, x1) = (x.saturating_sub(reach_x), (x + reach_x + 1).min(self.width));
            let (y0, y1) = (
                y.saturating_sub(reach_y),
                (y + reach_y + 1).min(self.height),
            );
            let (a, b, c, d) = (at(x0, y0), at(x1, y0), at(x0, y1), at(x1, y1));
            let sum: [f64; 3] = std::array::from_fn(|k| d[k] - b[k] - c[k] + a[k]);
            let n = sum[0].max(1.0);
            let mean = sum[1] / n;
            Moments {
                count: sum[0],
                mean: self.level + mean as f32,
                variance: (sum[2] / n - mean * mean).max(0.0) as f32,
            }
        })
    }

    /// Means around every pixel, row by row; NaN where no pixel of the window has a value.
    pub fn means(&self) -> Vec<f32> {
        let means = self.moments().map(|moments| match moments.count {
            0.0 => f32::NAN,
            _ => moments.mean,
        });
        means.collect()
    }
}
