//! Means and variances in windows around the pixels of an image.

/// Number, mean and variance of the values in a window.
#[derive(Clone, Copy, Debug)]
pub struct Moments {
    /// Number of pixels with a value.
    pub count: f32,
    /// Mean; of no values, one near the mean of the image.
    pub mean: f32,
    /// Variance.
    pub variance: f32,
}

/// Sums of 1, I and I² over a row of windows, or over the columns that these cover.
type Sums = [Vec<f64>; 3];

/// Moments in the windows of `2 reach + 1` pixels along x and y around all pixels of an image whose
/// rows have `width` values, row by row. Pixels without a value (NaN) do not count.
///
/// The sums over the columns of a row of windows follow from those of the row above; differences of
/// their running sums are those over the windows.
pub fn window_moments(values: &[f32], width: usize, reach: [usize; 2]) -> Vec<Moments> {
    let height = values.len() / width;
    let known = values.iter().filter(|v| !v.is_nan());
    // A grey level near the mean, subtracted before summing.
    let level = known.clone().sum::<f32>() / known.count().max(1) as f32;
    let row = |y: usize| &values[y * width..(y + 1) * width];
    let [reach_x, reach_y] = reach;
    let mut columns: Sums = std::array::from_fn(|_| vec![0.0; width]);
    let mut running: Sums = std::array::from_fn(|_| vec![0.0; width + 2 * reach_x + 1]);
    for y in 0..reach_y.min(height) {
        add_row(&mut columns, row(y), level, 1.0);
    }
    let mut moments = Vec::with_capacity(values.len());
    for y in 0..height {
        if y + reach_y < height {
            add_row(&mut columns, row(y + reach_y), level, 1.0);
        }
        if y > reach_y {
            add_row(&mut columns, row(y - reach_y - 1), level, -1.0);
        }
        for (running, columns) in running.iter_mut().zip(&columns) {
            add_up(columns, reach_x, running);
        }
        let [counts, sums, squares] = &running;
        let window = 2 * reach_x + 1;
        let over = |running: &[f64], x: usize| running[x + window] - running[x];
        moments.extend((0..width).map(|x| {
            let count = over(counts, x);
            let n = count.max(1.0);
            let mean = over(sums, x) / n;
            Moments {
                count: count as f32,
                mean: level + mean as f32,
                variance: (over(squares, x) / n - mean * mean).max(0.0) as f32,
            }
        }));
    }
    moments
}

/// Means in windows around every pixel, as [`window_moments`]; NaN where no pixel of the window has
/// a value.
pub fn window_means(values: &[f32], width: usize, reach: [usize; 2]) -> Vec<f32> {
    let means = window_moments(values, width, reach).into_iter();
    means
        .map(|moments| match moments.count {
            0.0 => f32::NAN,
            _ => moments.mean,
        })
        .collect()
}

/// Adds `times` the values of a row, less `level`, to the sums over the columns.
fn add_row([counts, sums, squares]: &mut Sums, row: &[f32], level: f32, times: f64) {
    let sums = counts.iter_mut().zip(sums).zip(squares);
    for (((count, sum), square), value) in sums.zip(row) {
        let is_known = !value.is_nan();
        let value = f64::from(if is_known { value - level } else { 0.0 });
        *count += if is_known { times } else { 0.0 };
        *sum += times * value;
        *square += times * value * value;
    }
}

/// Running sums: element i is the sum of the columns before `i − reach`.
fn add_up(columns: &[f64], reach: usize, running: &mut [f64]) {
    let mut sum = 0.0;
    let inner = &mut running[reach + 1..=reach + columns.len()];
    for (running, column) in inner.iter_mut().zip(columns) {
        sum += column;
        *running = sum;
    }
    running[reach + 1 + columns.len()..].fill(sum);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Against sums over every window, with gaps, in windows that reach beyond the image.
    #[test]
    fn moments_are_those_of_the_pixels_in_the_window() {
        let (width, height) = (11, 7);
        let mut values: Vec<f32> = (0..width * height)
            .map(|k| 90.0 + 7.0 * (1.7 * k as f32).sin())
            .collect();
        for k in [0, 13, 14, 60] {
            values[k] = f32::NAN;
        }
        for reach in [[0, 0], [2, 1], [3, 9], [40, 2]] {
            let moments = window_moments(&values, width, reach);
            assert_eq!(moments.len(), values.len());
            for (k, found) in moments.iter().enumerate() {
                let near = |other: &usize| {
                    (other % width).abs_diff(k % width) <= reach[0]
                        && (other / width).abs_diff(k / width) <= reach[1]
                        && !values[*other].is_nan()
                };
                let window: Vec<f64> = (0..values.len())
                    .filter(near)
                    .map(|other| f64::from(values[other]))
                    .collect();
                assert_eq!(found.count as usize, window.len());
                let n = window.len().max(1) as f64;
                let mean = window.iter().sum::<f64>() / n;
                let variance = window.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
                if !window.is_empty() {
                    assert!((f64::from(found.mean) - mean).abs() < 1e-4);
                }
                assert!((f64::from(found.variance) - variance).abs() < 1e-3);
            }
        }
    }
}
