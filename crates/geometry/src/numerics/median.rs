//! Medians.

/// Ratio of a Gaussian's standard deviation to its median absolute deviation.
pub const MAD_TO_SIGMA: f64 = 1.4826;

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
