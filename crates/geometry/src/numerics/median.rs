//! Medians and quartiles.

/// Ratio of a Gaussian's standard deviation to its median absolute deviation.
pub const MAD_TO_SIGMA: f64 = 1.4826;

/// Ratio of a Gaussian's standard deviation to the upper quartile of its absolute deviations.
///
/// The quartile stands outliers up to a quarter. Deviations of rounded or compressed values are
/// often zero, and their median then too: the quartile still measures them.
pub const QUARTILE_TO_SIGMA: f64 = 1.0 / 1.150_349_4;

/// The median of the finite values (the upper of the two middle ones), if there are any.
pub fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

/// Median; the mean of the middle two of an even number, NaN of none. The values are sorted.
pub fn median(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return f32::NAN;
    }
    values.sort_unstable_by(f32::total_cmp);
    0.5 * (values[(n - 1) / 2] + values[n / 2])
}

/// Tukey's upper fence, `Q₃ + 1.5 (Q₃ − Q₁)`: values above it are outliers; 0 of none. Reorders the
/// values.
///
/// Source: J. W. Tukey, "Exploratory Data Analysis", 1977.
pub fn upper_fence(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    values.sort_unstable_by(f32::total_cmp);
    let (lower, upper) = (values[n / 4], values[n * 3 / 4]);
    upper + 1.5 * (upper - lower)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upper_fence_is_one_and_a_half_interquartile_ranges_above() {
        let mut values: Vec<f32> = (0..=100).rev().map(|k| k as f32).collect();
        assert_eq!(upper_fence(&mut values), 75.0 + 1.5 * 50.0);
        assert_eq!(upper_fence(&mut []), 0.0);
    }
}
