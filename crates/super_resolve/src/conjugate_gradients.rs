//! Preconditioned conjugate gradients.

/// Iterates x towards the solution of `A x = right`, with the diagonal of A as preconditioner.
///
/// `times(x, y)` sets `y = A x` for a symmetric, positive semidefinite A. Where the diagonal is 0,
/// x is unchanged.
///
/// Source: M. R. Hestenes and E. Stiefel, "Methods of conjugate gradients for solving linear
/// systems", 1952.
pub(super) fn conjugate_gradients(
    mut times: impl FnMut(&[f32], &mut [f32]),
    diagonal: &[f32],
    right: &[f32],
    iterations: usize,
    x: &mut [f32],
) {
    let mut product = vec![0.0f32; x.len()];
    times(x, &mut product);
    let mut residual: Vec<f32> = right.iter().zip(&product).map(|(b, p)| b - p).collect();
    let inverse: Vec<f32> = diagonal
        .iter()
        .map(|d| if *d > 0.0 { 1.0 / d } else { 0.0 })
        .collect();
    let mut direction = vec![0.0f32; x.len()];
    let mut last = f64::INFINITY;
    for _ in 0..iterations {
        let weighted = residual.iter().zip(&inverse);
        let rho: f64 = weighted.map(|(r, m)| f64::from(r * r * m)).sum();
        let beta = (rho / last) as f32;
        last = rho;
        for ((p, r), m) in direction.iter_mut().zip(&residual).zip(&inverse) {
            *p = m * r + beta * *p;
        }
        times(&direction, &mut product);
        let both = direction.iter().zip(&product);
        let curvature: f64 = both.map(|(p, q)| f64::from(p * q)).sum();
        let alpha = (rho / curvature) as f32;
        // Converged, or not finite.
        if !(rho > 0.0 && curvature > 0.0 && alpha.is_finite()) {
            return;
        }
        for (x, p) in x.iter_mut().zip(&direction) {
            *x += alpha * p;
        }
        for (r, q) in residual.iter_mut().zip(&product) {
            *r -= alpha * q;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_iterations_as_unknowns_solve_the_system_and_free_ones_stay() {
        let matrix = [[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 0.0]];
        let times = |x: &[f32], y: &mut [f32]| {
            for (y, row) in y.iter_mut().zip(&matrix) {
                *y = row.iter().zip(x).map(|(a, x)| a * x).sum();
            }
        };
        let mut x = [0.0, 0.0, 7.0];
        conjugate_gradients(times, &[4.0, 3.0, 0.0], &[1.0, 2.0, 0.0], 3, &mut x);
        assert!((x[0] - 1.0 / 11.0).abs() < 1e-6 && (x[1] - 7.0 / 11.0).abs() < 1e-6);
        assert_eq!(x[2], 7.0);
    }
}
