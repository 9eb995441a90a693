//! Window and kernel functions of spectral analysis.

use std::f64::consts::PI;

/// `sin πx / πx`: the frequency response at x of averaging over a width of 1.
pub fn sinc(x: f64) -> f64 {
    if x == 0.0 {
        1.0
    } else {
        (PI * x).sin() / (PI * x)
    }
}

/// Hann window at the k-th of n uniformly spaced samples.
pub fn hann(k: usize, n: usize) -> f64 {
    0.5 - 0.5 * (2.0 * PI * (k as f64 + 0.5) / n as f64).cos()
}
