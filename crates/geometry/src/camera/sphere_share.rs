//! Denominators `α d + (1 − α) z` of the enhanced unified and the double-sphere model: the
//! projection from a unit sphere (or an ellipsoid that is stretched to one), α of the way to its
//! centre.

/// The share w at which the radius of `p = (x, y)/(α d + (1 − α) z)` stops rising, at `z = −w d`:
/// `α/(1 − α)` for α ≤ ½ and `(1 − α)/α` above.
pub fn fold_share(alpha: f64) -> f64 {
    if alpha <= 0.5 {
        alpha / (1.0 - alpha)
    } else {
        (1.0 - alpha) / alpha
    }
}

/// The depth m at which `(p, m)` lies on the ray of an image point p with `square = |p|²`:
/// `m = (1 − α² |p|²)/(α √(1 − (2α − 1) |p|²) + 1 − α)`; NaN where p shows none.
pub fn lifted_depth(alpha: f64, square: f64) -> f64 {
    let root = (1.0 - (2.0 * alpha - 1.0) * square).sqrt();
    (1.0 - alpha * alpha * square) / (alpha * root + 1.0 - alpha)
}
