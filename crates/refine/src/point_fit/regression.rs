//! Polynomials along the tunnel through values that scatter by more than their own noise.

use nalgebra::{Matrix3, Vector3};

/// Halvings of the interval in which the scatter is looked for: to 1e-12 of its largest value.
const BISECTIONS: usize = 40;

/// A value at a chainage.
#[derive(Clone, Copy, Debug)]
pub struct Sample {
    /// Distance along the tunnel from the pivot, metres.
    pub along_m: f64,
    /// The value, metres.
    pub value_m: f64,
    /// Variance by its own noise, m².
    pub variance_m2: f64,
}

/// `β_0 + β_1 x + β_2 x²/2` through samples, of which each is off by a further τ.
#[derive(Clone, Copy, Debug)]
pub struct Regression {
    /// β; 0 beyond the degree.
    pub beta: Vector3<f64>,
    /// Covariance of β.
    pub covariance: Matrix3<f64>,
    /// τ², m².
    pub between_m2: f64,
    /// Samples less coefficients.
    pub freedoms: usize,
}

/// Fits a polynomial of the given degree, 0 to 2, with the prior `N(0, prior_sigma²)` of its
/// coefficients; None for no samples.
///
/// τ² is such that `Σ (y − p(x))²/(v + τ²)` is the number of samples less that of the coefficients,
/// or 0 if noise alone makes the sum smaller.
///
/// Source: R. C. Paule, J. Mandel, "Consensus values and weighting factors", Journal of Research of
/// the National Bureau of Standards 87(5), 1982.
pub fn fit_polynomial(
    samples: &[Sample],
    degree: usize,
    prior_sigma: &Vector3<f64>,
) -> Option<Regression> {
    if samples.is_empty() {
        return None;
    }
    let freedoms = samples.len().saturating_sub(degree + 1);
    let at = |between_m2: f64| solve(samples, degree, prior_sigma, between_m2);
    let mean_square = samples.iter().map(|s| s.value_m * s.value_m).sum::<f64>();
    let (mut low, mut high) = (0.0, mean_square);
    if freedoms > 0 && at(0.0)?.1 > freedoms as f64 {
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (low + high);
            if at(middle)?.1 > freedoms as f64 {
                low = middle;
            } else {
                high = middle;
            }
        }
    }
    let (mut regression, _) = at(low)?;
    regression.freedoms = freedoms;
    Some(regression)
}

/// The polynomial for a given τ², and `Σ (y − p(x))²/(v + τ²)`.
fn solve(
    samples: &[Sample],
    degree: usize,
    prior_sigma: &Vector3<f64>,
    between_m2: f64,
) -> Option<(Regression, f64)> {
    let mut normal = Matrix3::from_diagonal(&prior_sigma.map(|sigma| sigma.powi(-2)));
    let mut right = Vector3::zeros();
    for sample in samples {
        let row = sample.row(degree);
        let information = 1.0 / (sample.variance_m2 + between_m2);
        normal += row * row.transpose() * information;
        right += row * (information * sample.value_m);
    }
    let factor = normal.cholesky()?;
    let beta = factor.solve(&right);
    let square = |sample: &Sample| {
        let residual = sample.value_m - sample.row(degree).dot(&beta);
        residual * residual / (sample.variance_m2 + between_m2)
    };
    let regression = Regression {
        beta,
        covariance: factor.inverse(),
        between_m2,
        freedoms: 0,
    };
    Some((regression, samples.iter().map(square).sum()))
}

impl Sample {
    /// `(1, x, x²/2)`, without what is beyond the degree.
    fn row(&self, degree: usize) -> Vector3<f64> {
        let x = self.along_m;
        let row = [1.0, x, 0.5 * x * x];
        Vector3::from_fn(|k, _| if k <= degree { row[k] } else { 0.0 })
    }
}

impl Regression {
    /// The polynomial, metres.
    pub fn at(&self, along_m: f64) -> f64 {
        let x = along_m;
        self.beta.dot(&Vector3::new(1.0, x, 0.5 * x * x))
    }

    /// The best estimate of what a sample observes: the polynomial, and the share of the sample's
    /// distance from it that is not noise.
    ///
    /// Source: D. A. Harville, "Extension of the Gauss–Markov theorem to include the estimation of
    /// random effects", Annals of Statistics 4(2), 1976.
    pub fn deviation_m(&self, sample: &Sample) -> f64 {
        let share = self.between_m2 / (self.between_m2 + sample.variance_m2);
        share * (sample.value_m - self.at(sample.along_m))
    }

    /// 1-σ of a coefficient.
    pub fn sigma(&self, k: usize) -> f64 {
        self.covariance[(k, k)].sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn a_parabola_is_found_within_its_sigma() {
        let wide = Vector3::repeat(1e3);
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut chi_squared, mut between) = (0.0, 0.0);
        const RUNS: usize = 200;
        for _ in 0..RUNS {
            let sample = |k: usize| {
                let x = k as f64 - 7.0;
                Sample {
                    along_m: x,
                    value_m: 0.01 + 0.002 * x + 0.5 * 0.003 * x * x + 0.002 * normal(),
                    variance_m2: 1e-6,
                }
            };
            let samples: Vec<Sample> = (0..16).map(sample).collect();
            let fit = fit_polynomial(&samples, 2, &wide).unwrap();
            let error = fit.beta - Vector3::new(0.01, 0.002, 0.003);
            chi_squared += error.dot(&(fit.covariance.try_inverse().unwrap() * error));
            between += fit.between_m2;
        }
        let (mean, between) = (chi_squared / RUNS as f64, between / RUNS as f64);
        assert!((2.4..4.6).contains(&mean), "{mean}");
        assert!((2e-6..4e-6).contains(&between), "{between}");
    }

    #[test]
    fn values_that_agree_have_no_further_scatter() {
        let sample = |k: usize| Sample {
            along_m: k as f64,
            value_m: 0.001 * k as f64,
            variance_m2: 1e-6,
        };
        let samples: Vec<Sample> = (0..5).map(sample).collect();
        let fit = fit_polynomial(&samples, 1, &Vector3::repeat(10.0)).unwrap();
        assert_eq!(fit.between_m2, 0.0);
        assert!((fit.beta[1] - 0.001).abs() < 1e-6);
        assert_eq!(fit.deviation_m(&samples[2]), 0.0);
        assert!(fit_polynomial(&[], 1, &Vector3::repeat(10.0)).is_none());
    }
}
