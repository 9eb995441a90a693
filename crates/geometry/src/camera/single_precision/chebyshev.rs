//! Polynomials that interpolate functions of one variable.

use std::f64::consts::PI;

/// Degree of the polynomial that approximates a lens.
pub const POLYNOMIAL_DEGREE: usize = 17;

/// Coefficients (lowest degree first) of the polynomial that interpolates `f` at the Chebyshev
/// nodes of [−1, 1].
pub fn interpolate(f: impl Fn(f64) -> f64) -> [f64; POLYNOMIAL_DEGREE + 1] {
    let count = POLYNOMIAL_DEGREE + 1;
    let angle = |j: usize| PI * (j as f64 + 0.5) / count as f64;
    let values: Vec<f64> = (0..count).map(|j| f(angle(j).cos())).collect();
    // T_0 and T_1, and from there T_k = 2 t T_{k−1} − T_{k−2}.
    let mut before = [0.0; POLYNOMIAL_DEGREE + 1];
    let mut now = [0.0; POLYNOMIAL_DEGREE + 1];
    let mut sum = [0.0; POLYNOMIAL_DEGREE + 1];
    now[0] = 1.0;
    for k in 0..count {
        let projected: f64 = (values.iter().enumerate())
            .map(|(j, value)| value * (k as f64 * angle(j)).cos())
            .sum();
        let share = if k == 0 { 1.0 } else { 2.0 } / count as f64;
        for (sum, now) in sum.iter_mut().zip(&now) {
            *sum += share * projected * now;
        }
        let mut next = before.map(|b: f64| -b);
        let twice = if k == 0 { 1.0 } else { 2.0 };
        for place in 0..POLYNOMIAL_DEGREE {
            next[place + 1] += twice * now[place];
        }
        if k == 0 {
            next[0] = 0.0;
        }
        (before, now) = (now, next);
    }
    sum
}
