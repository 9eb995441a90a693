//! The median of numbers some of which may be unknown.

/// The middle one of those numbers that are finite (the upper one of the middle two), if there are
/// any.
pub(crate) fn upper_median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    values.sort_unstable_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
