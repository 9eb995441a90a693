//! The functions that spectra are computed with.

use std::f64::consts::PI;

/// `sin πx / πx`: what averaging over a width of 1 leaves of the frequency x.
pub(crate) fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// Hann's window at the k-th of n evenly spaced samples.
pub(crate) fn hann(k: usize, n: usize) -> f64 {
    0.5 - 0.5 * (2.0 * PI * (k as f64 + 0.5) / n as f64).cos()
}
