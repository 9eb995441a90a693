//! Angular rates over time.

use nalgebra::Vector3;

/// Angular rates in camera coordinates, rad/s, at increasing times, interpolated linearly.
#[derive(Clone, Debug)]
pub struct AngularRates {
    times_s: Vec<f64>,
    rates: Vec<Vector3<f64>>,
}

impl AngularRates {
    /// Creates rates from as many times.
    ///
    /// # Panics
    /// If their numbers differ.
    pub fn new(times_s: Vec<f64>, rates: Vec<Vector3<f64>>) -> Self {
        assert_eq!(times_s.len(), rates.len(), "a rate for each time");
        Self { times_s, rates }
    }

    /// Times, seconds.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Angular rates, rad/s.
    pub fn rates(&self) -> &[Vector3<f64>] {
        &self.rates
    }

    /// The first and the last time, seconds.
    pub fn span_s(&self) -> [f64; 2] {
        let end = |time: Option<&f64>| time.copied().unwrap_or(f64::NAN);
        [end(self.times_s.first()), end(self.times_s.last())]
    }

    /// The median and the longest step between samples, seconds.
    pub fn steps_s(&self) -> [f64; 2] {
        let mut steps: Vec<f64> = self.times_s.windows(2).map(|t| t[1] - t[0]).collect();
        steps.sort_unstable_by(f64::total_cmp);
        let median = steps.get(steps.len() / 2).copied();
        [median, steps.last().copied()].map(|step| step.unwrap_or(f64::NAN))
    }

    /// The rates with a bias, rad/s, subtracted.
    pub fn without(&self, bias: &Vector3<f64>) -> Self {
        Self {
            times_s: self.times_s.clone(),
            rates: self.rates.iter().map(|rate| rate - bias).collect(),
        }
    }
}
