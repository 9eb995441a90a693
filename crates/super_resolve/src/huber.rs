//! Huber's loss and a robust standard deviation.

use tunnelstitch_geometry::numerics::median::MAD_TO_SIGMA;

/// Huber's weight of a residual r: 1 up to the limit, `limit/|r|` beyond, where the loss is linear.
///
/// Source: P. J. Huber, "Robust estimation of a location parameter", Annals of Mathematical
/// Statistics 35(1), 1964.
pub fn weight(residual: f32, limit: f32) -> f32 {
    if residual.abs() <= limit {
        1.0
    } else {
        limit / residual.abs()
    }
}

/// Robust standard deviation of values around 0 from their median absolute value; 0 if empty.
pub(super) fn sigma(values: impl Iterator<Item = f32>) -> f32 {
    let mut moduli: Vec<f32> = values.map(f32::abs).collect();
    if moduli.is_empty() {
        return 0.0;
    }
    let middle = moduli.len() / 2;
    MAD_TO_SIGMA as f32 * *moduli.select_nth_unstable_by(middle, f32::total_cmp).1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn outliers_have_limited_influence_and_hardly_increase_sigma() {
        assert_eq!(weight(-1.5, 2.0), 1.0);
        assert_eq!(-50.0 * weight(-50.0, 2.0), -2.0);
        assert_eq!(weight(0.0, 0.0), 1.0);
        let values = (0..1000).map(|k| if k < 100 { 1e6 } else { (k % 2) as f32 - 0.5 });
        assert!((sigma(values) - 0.7413).abs() < 1e-4);
        assert_eq!(sigma(std::iter::empty()), 0.0);
    }
}
