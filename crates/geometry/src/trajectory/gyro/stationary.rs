//! Intervals of a log at rest, which give the sensor's bias and noise density.

use super::rates::AngularRates;
use nalgebra::Vector3;

/// Largest mean rate of a sensor at rest, rad/s: 3°/s, beyond the turn-on bias of consumer
/// gyroscopes.
pub const MAX_BIAS_RAD_S: f64 = 3.0 * std::f64::consts::PI / 180.0;

/// Windows with up to this multiple of the least variance count as quiet.
const MAX_VARIANCE_RATIO: f64 = 1.5;

/// Mean rates within this difference count as equal, rad/s: 0.5°/s.
const RATE_TOLERANCE_RAD_S: f64 = 0.5 * std::f64::consts::PI / 180.0;

/// An interval at rest with the sensor's bias and noise density.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StationaryInterval {
    /// Begin and end, seconds of the log's clock.
    pub span_s: [f64; 2],
    /// Mean rate, rad/s.
    pub bias_rad_s: Vector3<f64>,
    /// White noise density N, rad/√s (that is rad/s/√Hz): the rate's mean over τ seconds has the
    /// standard deviation N/√τ.
    pub density_rad_sqrt_s: f64,
}

impl StationaryInterval {
    /// Finds the interval of `length_s` at which the sensor was at rest: among the windows with at
    /// most 1.5 times the least variance, those with the least mean rate (to 0.5°/s), and among
    /// these the one with the least variance.
    ///
    /// Variance alone cannot distinguish rest from a uniform rotation; the mean alone would prefer
    /// windows whose end contains a rotation against the bias.
    ///
    /// # Errors
    /// A shorter log; no quiet window with a mean rate below [`MAX_BIAS_RAD_S`], i.e. the carrier
    /// was never at rest.
    pub fn find(rates: &AngularRates, length_s: f64) -> Result<Self, String> {
        let times = rates.times_s();
        let [first_s, last_s] = rates.span_s();
        let mut sum = Vector3::zeros();
        let mut squares = 0.0;
        let mut windows: Vec<(f64, f64, usize)> = Vec::new();
        let mut begin = 0;
        for (end, (time_s, rate)) in times.iter().zip(rates.rates()).enumerate() {
            sum += rate;
            squares += rate.norm_squared();
            // The longest window that does not exceed the given length.
            while times.get(begin).is_some_and(|t| time_s - t > length_s)
                && let Some(gone) = rates.rates().get(begin)
            {
                sum -= gone;
                squares -= gone.norm_squared();
                begin += 1;
            }
            let count = (end + 1 - begin) as f64;
            let is_full = time_s - first_s >= length_s && count >= 20.0;
            if is_full {
                let mean = (sum / count).norm();
                windows.push((squares / count - mean * mean, mean, begin));
            }
        }
        // Running sums accumulate rounding errors; no variance below them is meaningful.
        let rounding = squares_scale(rates) * 1e-12;
        let least = windows
            .iter()
            .map(|w| w.0.max(rounding))
            .fold(f64::INFINITY, f64::min);
        let quiet = windows.iter().filter(|w| w.0 <= MAX_VARIANCE_RATIO * least);
        let slowest = quiet.clone().map(|w| w.1).fold(f64::INFINITY, f64::min);
        let resting = quiet.filter(|w| w.1 <= slowest + RATE_TOLERANCE_RAD_S);
        let Some((_, mean, begin)) = resting.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return Err(format!(
                "there is no stretch of {length_s} s in a log of {:.3} s with 20 samples and more \
                 in it",
                last_s - first_s
            ));
        };
        if *mean > MAX_BIAS_RAD_S {
            return Err(format!(
                "the sensor never rested for {length_s} s: where its rate is steadiest, it is \
                 {:.2}°/s, more than any bias (if its values are degrees per second, its header \
                 needs a gscale of π/180)",
                mean.to_degrees()
            ));
        }
        let begin_s = times.get(*begin).copied().unwrap_or(first_s);
        Self::of(rates, [begin_s, begin_s + length_s])
    }

    /// Bias and noise density of an interval, assuming that the sensor was at rest.
    ///
    /// The density is the larger of those of single samples and of means over a twentieth of the
    /// interval, both by the Allan variance `N² = ½ τ ⟨(ω̄ₖ₊₁ − ω̄ₖ)²⟩`, which is insensitive to
    /// slow drift. A logger's low-pass filter reduces the noise of single samples but not that of
    /// the means.
    ///
    /// # Errors
    /// Fewer than 20 samples.
    ///
    /// Source: IEEE Std 952-1997, annex C.
    pub fn of(rates: &AngularRates, span_s: [f64; 2]) -> Result<Self, String> {
        let within = |t: &f64| (span_s[0]..=span_s[1]).contains(t);
        let begin = rates.times_s().iter().position(within).unwrap_or(0);
        let count = rates.times_s().iter().filter(|t| within(t)).count();
        let part = rates.rates().get(begin..begin + count).unwrap_or_default();
        let times = rates
            .times_s()
            .get(begin..begin + count)
            .unwrap_or_default();
        let (Some(first_s), Some(last_s), true) = (times.first(), times.last(), count >= 20) else {
            return Err(format!(
                "only {count} samples from {} s to {} s; at least 20 are needed",
                span_s[0], span_s[1]
            ));
        };
        let step_s = (last_s - first_s) / (count - 1) as f64;
        let sum: Vector3<f64> = part.iter().sum();
        let squared = |run: usize| allan_density_squared(part, run, step_s);
        Ok(Self {
            span_s: [*first_s, *last_s],
            bias_rad_s: sum / count as f64,
            density_rad_sqrt_s: squared(1).max(squared(count / 20)).sqrt(),
        })
    }

    /// Length of the interval, seconds.
    pub fn length_s(&self) -> f64 {
        self.span_s[1] - self.span_s[0]
    }
}

fn squares_scale(rates: &AngularRates) -> f64 {
    let squares = rates.rates().iter().map(Vector3::norm_squared);
    squares.fold(0.0, f64::max)
}

/// Squared noise density `N²` by the Allan variance of means over `run` samples, of the three axes
/// together, (rad/s)² s.
fn allan_density_squared(rates: &[Vector3<f64>], run: usize, step_s: f64) -> f64 {
    let run = run.max(1);
    let means: Vec<Vector3<f64>> = rates
        .chunks_exact(run)
        .map(|part| part.iter().sum::<Vector3<f64>>() / run as f64)
        .collect();
    let squares: f64 = means.windows(2).map(|m| (m[1] - m[0]).norm_squared()).sum();
    let axes = 3.0 * (means.len().max(2) - 1) as f64;
    0.5 * squares / axes * run as f64 * step_s
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const BIAS: Vector3<f64> = Vector3::new(0.01, -0.02, 0.005);

    /// A log at 200 Hz: four seconds of uniform rotation, three at rest, three of non-uniform
    /// rotation; noise of 0.01 rad/s per sample.
    fn log(rest: bool) -> AngularRates {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let times: Vec<f64> = (0..2000).map(|k| f64::from(k) / 200.0).collect();
        let rates = times.iter().map(|t| {
            let turn = match *t {
                t if t < 4.0 => 0.5,
                t if t < 7.0 && rest => 0.0,
                t => 0.5 + 0.1 * (3.0 * t).sin(),
            };
            let noise = Vector3::from_fn(|_, _| 0.01 * normal());
            Vector3::y() * turn + BIAS + noise
        });
        let rates = rates.collect();
        AngularRates::new(times, rates)
    }

    #[test]
    fn rest_is_found_beside_an_even_turn_of_the_same_noise() {
        let rest = StationaryInterval::find(&log(true), 2.0).unwrap();
        assert!(rest.span_s[0] >= 4.0 && rest.span_s[1] <= 7.0, "{rest:?}");
        // Noise of the mean of 400 samples.
        assert!((rest.bias_rad_s - BIAS).norm() < 4.0 * 0.01 / 20.0);
        let density = 0.01 * (1f64 / 200.0).sqrt();
        let ratio = rest.density_rad_sqrt_s / density;
        assert!((0.9..1.5).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_carrier_that_never_rests_is_reported() {
        let message = StationaryInterval::find(&log(false), 2.0).unwrap_err();
        assert!(message.contains("never rested"), "{message}");
        let message = StationaryInterval::find(&log(true), 20.0).unwrap_err();
        assert!(message.contains("no stretch of 20 s"), "{message}");
        assert!(StationaryInterval::of(&log(true), [4.0, 4.05]).is_err());
    }

    /// A log smoothed over ten samples has a third of the standard deviation and the same density.
    #[test]
    fn a_low_pass_does_not_hide_the_noise() {
        let raw = log(true);
        let smooth: Vec<Vector3<f64>> = (0..raw.rates().len())
            .map(|k| {
                let part = &raw.rates()[k.saturating_sub(9)..=k];
                part.iter().sum::<Vector3<f64>>() / part.len() as f64
            })
            .collect();
        let smooth = AngularRates::new(raw.times_s().to_vec(), smooth);
        let density = |rates: &AngularRates| {
            StationaryInterval::of(rates, [4.1, 6.9])
                .unwrap()
                .density_rad_sqrt_s
        };
        let ratio = density(&smooth) / (0.01 * (1f64 / 200.0).sqrt());
        assert!((0.6..1.5).contains(&ratio), "{ratio}");
    }
}
