//! Noise model of the residuals, robust loss, and robust statistics.

use crate::thresholds::residual_weighting::TUKEY_CUTOFF_SIGMAS;
use tunnelstitch_geometry::numerics::median::{MAD_TO_SIGMA, QUARTILE_TO_SIGMA};

/// Variance of the residuals at a wall sample with the texture gradient g (grey levels per sample):
/// `v(g) = σ² + κ g²`.
///
/// σ² is the sensor's noise in an interpolated sample. κ covers the errors that grow with the
/// gradient: aliasing, differences of blur between near and oblique frames, interpolation, and the
/// misalignment still to be removed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoiseModel {
    /// σ², grey levels².
    pub floor: f32,
    /// κ, samples².
    pub steepness: f32,
}

impl NoiseModel {
    /// `1/v(g)` for `g²`.
    #[inline(always)]
    pub fn precision(&self, gradient_square: f32) -> f32 {
        1.0 / (self.floor + self.steepness * gradient_square)
    }
}

/// Tukey's biweight of a residual e with variance v: `ρ = c²/6 (1 − (1 − e²/c²)³)`, weight
/// `ω = ρ'(e)/e = (1 − e²/c²)²`, both constant beyond `c² = 36 v`.
///
/// A moved object or a wet patch costs `c²/6` and exerts no force at all. (A loss whose weight
/// decays slowly gives glints on a faint wall, fifty times as steep as its texture, so much weight
/// in the normal matrix that the steps vanish.) With c at six standard deviations it loses about 2
/// % of the information in Gaussian noise. It is a polynomial, so it vectorises. Arguments: `e²`
/// and `1/v`.
///
/// Source: A. E. Beaton and J. W. Tukey, "The fitting of power series, meaning polynomials,
/// illustrated on band-spectroscopic data", Technometrics 16(2), 1974.
#[derive(Clone, Copy, Debug, Default)]
pub struct Loss;

/// `1/(c²/v)`.
const INVERSE_SQUARE_CUTOFF: f32 = 1.0 / (TUKEY_CUTOFF_SIGMAS * TUKEY_CUTOFF_SIGMAS);

impl Loss {
    /// `ω(e)`.
    #[inline(always)]
    pub fn weight(square: f32, precision: f32) -> f32 {
        let left = (1.0 - INVERSE_SQUARE_CUTOFF * square * precision).max(0.0);
        left * left
    }

    /// `ρ(e)/v`.
    #[inline(always)]
    pub fn relative_loss(square: f32, precision: f32) -> f32 {
        let left = (1.0 - INVERSE_SQUARE_CUTOFF * square * precision).max(0.0);
        (1.0 - left * left * left) * (1.0 / (6.0 * INVERSE_SQUARE_CUTOFF))
    }
}

/// Median and robust standard deviation of some values: `1.4826 · median |x − median|`. Reorders
/// and overwrites the values; 0, 0 of none.
pub fn median_and_sigma(values: &mut [f32]) -> (f32, f32) {
    let middle = values.len() / 2;
    if values.is_empty() {
        return (0.0, 0.0);
    }
    let median = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    for value in values.iter_mut() {
        *value = (*value - median).abs();
    }
    let deviation = *values.select_nth_unstable_by(middle, f32::total_cmp).1;
    (median, MAD_TO_SIGMA as f32 * deviation)
}

/// Robust correlation of pairs of values, −1 to 1:
/// `(σ²(x + y) − σ²(x − y))/(σ²(x + y) + σ²(x − y))` with x and y scaled to robust σ 1.
///
/// It is the correlation of the majority of the pairs; 0 of values without spread.
///
/// Source: R. Gnanadesikan and J. R. Kettenring, "Robust estimates, residuals, and outlier
/// detection with multiresponse data", Biometrics 28, 1972.
pub fn robust_correlation(pairs: &[(f32, f32)]) -> f64 {
    let sigma = |value: &dyn Fn(&(f32, f32)) -> f32| {
        let mut values: Vec<f32> = pairs.iter().map(value).collect();
        median_and_sigma(&mut values).1
    };
    let (sx, sy) = (sigma(&|p| p.0), sigma(&|p| p.1));
    if sx <= 0.0 || sy <= 0.0 {
        return 0.0;
    }
    let sum = f64::from(sigma(&|p| p.0 / sx + p.1 / sy)).powi(2);
    let difference = f64::from(sigma(&|p| p.0 / sx - p.1 / sy)).powi(2);
    (sum - difference) / (sum + difference).max(f64::MIN_POSITIVE)
}

/// Bins of the gradient: half octaves from 1 grey level per sample.
const GRADIENT_BINS: usize = 14;
/// Bins of the residual: sixteen per octave from [`FIRST_RESIDUAL_GREY`].
const RESIDUAL_BINS: usize = 256;
/// Upper limit of the first bin of the residual, grey levels.
const FIRST_RESIDUAL_GREY: f32 = 0.01;

/// Least number of residuals in a gradient bin for it to enter the fit of the noise model: their
/// variance is then known to a fifth.
const MIN_RESIDUALS_PER_BIN: u64 = 100;
/// Least σ of the noise model, grey levels: rounding to 8 bits, `1/√12` = 0.29, of which bilinear
/// interpolation leaves two thirds.
const MIN_SIGMA_GREY: f64 = 0.2;

/// Counts of residual magnitudes by gradient of the texture, to which the noise model is fitted.
#[derive(Clone, Debug)]
pub struct NoiseHistogram {
    counts: Vec<u64>,
}

impl Default for NoiseHistogram {
    fn default() -> Self {
        Self {
            counts: vec![0; GRADIENT_BINS * RESIDUAL_BINS],
        }
    }
}

impl NoiseHistogram {
    /// Counts a residual (grey levels) where the texture's gradient squared is `gradient_square`.
    pub fn add(&mut self, residual: f32, gradient_square: f32) {
        // A float's exponent is the octave, and the first bits of its mantissa the step.
        let octave = |value: f32| (value.to_bits() >> 23) as i32 - 127;
        let row = (octave(gradient_square) + 1).clamp(0, GRADIENT_BINS as i32 - 1) as usize;
        let size = (residual.abs() / FIRST_RESIDUAL_GREY).max(1.0);
        let steps = (size.to_bits() >> 19) as usize - (127 << 4);
        let column = steps.min(RESIDUAL_BINS - 1);
        self.counts[row * RESIDUAL_BINS + column] += 1;
    }

    /// Adds the counts of another histogram.
    pub fn merge(mut self, other: &Self) -> Self {
        for (a, b) in self.counts.iter_mut().zip(&other.counts) {
            *a += b;
        }
        self
    }

    /// Fits `v(g)` to the robust variance of each gradient bin, by the upper quartile of `|e|`, by
    /// least squares weighted by the counts over the variances squared (their sampling variance).
    pub fn fit(&self) -> NoiseModel {
        // Sums of 1, x, x², y, xy with x = g², y = variance.
        let mut m = [0.0f64; 5];
        for (row, counts) in self.counts.chunks_exact(RESIDUAL_BINS).enumerate() {
            let total: u64 = counts.iter().sum();
            if total < MIN_RESIDUALS_PER_BIN {
                continue;
            }
            let x = gradient_square(row);
            let y = (QUARTILE_TO_SIGMA * upper_quartile(counts, total))
                .max(MIN_SIGMA_GREY)
                .powi(2);
            let w = total as f64 / (y * y);
            for (sum, term) in m.iter_mut().zip([1.0, x, x * x, y, x * y]) {
                *sum += w * term;
            }
        }
        let determinant = m[0] * m[2] - m[1] * m[1];
        let steepness = if determinant > 1e-9 * m[0] * m[2] {
            ((m[0] * m[4] - m[1] * m[3]) / determinant).max(0.0)
        } else {
            0.0
        };
        let floor = if m[0] > 0.0 {
            (m[3] - steepness * m[1]) / m[0]
        } else {
            1.0
        };
        NoiseModel {
            floor: floor.max(MIN_SIGMA_GREY * MIN_SIGMA_GREY) as f32,
            steepness: steepness as f32,
        }
    }
}

impl NoiseHistogram {
    /// Variance of unit weight: the mean of `ω e²` over all residuals, weighted by the information
    /// `ω g²` that each has about a displacement; at least the floor of `model`.
    ///
    /// Where all samples are weighted alike, as if their variance were σ², this is the variance
    /// with which the normal matrix states the information of the pixels as it is. (Steep samples
    /// have larger errors, and the information is theirs.)
    pub fn unit_variance(&self, model: &NoiseModel) -> f64 {
        let (mut sum, mut total) = (0.0, 0.0);
        for (row, counts) in self.counts.chunks_exact(RESIDUAL_BINS).enumerate() {
            let g2 = gradient_square(row);
            let precision = model.precision(g2 as f32);
            for (column, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0) {
                let square = residual(column as f64 + 0.5).powi(2);
                let omega = f64::from(Loss::weight(square as f32, precision));
                sum += *count as f64 * omega * g2 * square;
                total += *count as f64 * omega * g2;
            }
        }
        let floor = f64::from(model.floor);
        if total > 0.0 {
            (sum / total).max(floor)
        } else {
            floor
        }
    }
}

/// Square of the gradient of a bin, grey levels² per sample².
fn gradient_square(row: usize) -> f64 {
    match row {
        0 => 0.3,
        _ => 1.5 * 2f64.powi(row as i32 - 1),
    }
}

/// Residual at a position among the bins of the residual, grey levels.
fn residual(position: f64) -> f64 {
    let octave = (position / 16.0).floor();
    let part = position / 16.0 - octave;
    f64::from(FIRST_RESIDUAL_GREY) * octave.exp2() * (1.0 + part)
}

/// Upper quartile of the residual magnitudes of one gradient bin.
fn upper_quartile(counts: &[u64], total: u64) -> f64 {
    let rank = total * 3 / 4;
    let mut below = 0;
    for (column, count) in counts.iter().enumerate() {
        if below + count > rank {
            let part = (rank - below) as f64 / *count as f64;
            return residual(column as f64 + part);
        }
        below += count;
    }
    0.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Of pictures compressed until neighbours are alike most residuals are zero, and the others as
    /// large as a step of the quantisation.
    #[test]
    fn fit_measures_residuals_most_of_which_are_zero() {
        let mut histogram = NoiseHistogram::default();
        for k in 0..100_000u32 {
            let residual = if k % 100 < 55 {
                0.0
            } else {
                1.0 + 0.01 * (k % 100) as f32
            };
            histogram.add(residual, 0.2);
        }
        let root_mean_square = (0.45f64 * 1.775f64.powi(2)).sqrt();
        let sigma = f64::from(histogram.fit().floor).sqrt();
        assert!((sigma / root_mean_square - 1.0).abs() < 0.3, "{sigma}");
    }

    #[test]
    fn weight_is_the_derivative_of_the_loss_over_the_residual() {
        for e in [0.1f32, 1.0, 5.0, 20.0, 80.0] {
            let precision = 0.25;
            let step = 1e-2 * e.max(1.0);
            let value = |e: f32| Loss::relative_loss(e * e, precision) / precision;
            let slope = (value(e + step) - value(e - step)) / (2.0 * step);
            assert!(
                (slope / e - Loss::weight(e * e, precision)).abs() < 2e-3,
                "{e}"
            );
        }
    }

    #[test]
    fn fit_finds_the_noise_in_spite_of_outliers() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(3);
        let mut histogram = NoiseHistogram::default();
        for k in 0..400_000u32 {
            let g2 = 2f32.powf(10.0 * (k % 1000) as f32 / 1000.0);
            let normal: f32 = StandardNormal.sample(&mut rng);
            let outlier = if k % 20 == 0 { 60.0 } else { 0.0 };
            histogram.add(normal * (4.0 + 0.01 * g2).sqrt() + outlier, g2);
        }
        let model = histogram.fit();
        assert!((model.floor.sqrt() / 2.0 - 1.0).abs() < 0.1, "{model:?}");
        assert!((model.steepness / 0.01 - 1.0).abs() < 0.2, "{model:?}");
        // Weighted by g², the mean of 4 + 0.01 g² over half octaves of g² up to 2¹⁰.
        let ln2 = std::f64::consts::LN_2;
        let mean = 4.0 + 0.01 * (1024.0f64.powi(2) / 2.0) / 1024.0 * (1.0 + 0.0 * ln2);
        let unit = histogram.unit_variance(&model);
        assert!((unit / mean - 1.0).abs() < 0.15, "{unit} {mean}");
    }

    /// Gaussian pairs with correlation 0.8, a tenth of them replaced by outliers.
    #[test]
    fn robust_correlation_is_that_of_the_majority() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut draw = || -> f32 { StandardNormal.sample(&mut rng) };
        let pairs: Vec<(f32, f32)> = (0..20_000)
            .map(|k| {
                let (x, own) = (draw(), draw());
                match k % 10 {
                    0 => (40.0 * own, -60.0 * own),
                    _ => (3.0 * x + 7.0, 0.8 * x + 0.6 * own),
                }
            })
            .collect();
        let correlation = robust_correlation(&pairs);
        assert!((correlation - 0.8).abs() < 0.1, "{correlation}");
        assert_eq!(robust_correlation(&[]), 0.0);
        assert_eq!(robust_correlation(&[(1.0, 2.0); 9]), 0.0);
    }
}
