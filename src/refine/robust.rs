//! The robust loss.

/// Geman–McClure loss `ρ(r) = ½ r² / (1 + r²/c²)` with weight `ω(r) = ρ'(r)/r = 1/(1 + r²/c²)²`.
///
/// Bounded, so something that moved or a wet patch costs at most `½ c²` and pulls nothing; at six times the
/// residuals' σ it loses under 1 % of the information in Gaussian noise. Rational, so it vectorises.
#[derive(Clone, Copy, Debug)]
pub struct Loss {
    inverse_square: f32,
}

/// Threshold `c` as a multiple of the residuals' robust standard deviation.
const THRESHOLD: f64 = 6.0;

impl Loss {
    /// The loss for residuals of standard deviation `sigma` (grey levels).
    pub fn for_sigma(sigma: f64) -> Self {
        let c = THRESHOLD * sigma;
        Self {
            inverse_square: (1.0 / (c * c)) as f32,
        }
    }

    /// `ω(r)`.
    #[inline]
    pub fn weight(&self, r: f32) -> f32 {
        let shrink = 1.0 / (1.0 + r * r * self.inverse_square);
        shrink * shrink
    }

    /// `ρ(r)`.
    #[inline]
    pub fn value(&self, r: f32) -> f32 {
        0.5 * r * r / (1.0 + r * r * self.inverse_square)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_is_the_slope_over_the_residual() {
        let loss = Loss::for_sigma(2.0);
        for r in [0.1f32, 1.0, 5.0, 20.0, 80.0] {
            let step = 1e-2 * r.max(1.0);
            let slope = (loss.value(r + step) - loss.value(r - step)) / (2.0 * step);
            assert!((slope / r - loss.weight(r)).abs() < 2e-3, "{r}");
        }
    }
}
