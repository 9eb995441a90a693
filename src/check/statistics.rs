//! Median of values that may be absent.

use tunnelstitch_geometry::numerics::median::upper_median;

/// The median; 0 of no values.
pub(super) fn median_or_zero(values: impl Iterator<Item = f64>) -> f64 {
    upper_median(values.collect()).unwrap_or(0.0)
}
