//! Median of values of which some may be unknown.

/// The median of the finite values (the upper of the two middle ones), if there are any.
pub(crate) fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
