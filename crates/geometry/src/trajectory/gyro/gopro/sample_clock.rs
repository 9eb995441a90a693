//! Times of values that a sensor measures at an even rate and hands over in payloads.
//!
//! A payload has the values that were there when it was written, some more or fewer than its
//! duration asks for. The rate is the slope of the line of least squares through number and time
//! of the first value of each payload, as in gpmf-parser; the first value of all is at the begin of
//! its payload, as in Gyroflow.

/// Times of values by their numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SampleClock {
    /// Time of value 0, seconds.
    start_s: f64,
    /// Time from value to value, seconds.
    step_s: f64,
}

impl SampleClock {
    /// Fits a clock to numbers of values and their times, seconds, at least two.
    ///
    /// # Errors
    /// Times that do not increase with the numbers; one that is farther than `max_deviation_s` from
    /// the clock's.
    pub fn fit(points: &[(f64, f64)], max_deviation_s: f64) -> Result<Self, String> {
        let count = points.len() as f64;
        let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
        let (mean_number, mean_s) = (mean(|point| point.0), mean(|point| point.1));
        let (mut square, mut product) = (0.0, 0.0);
        for (number, time_s) in points {
            square += (number - mean_number).powi(2);
            product += (number - mean_number) * (time_s - mean_s);
        }
        let step_s = product / square;
        if !(step_s > 0.0 && step_s.is_finite()) {
            return Err("its times do not increase; the index is damaged".to_owned());
        }
        let first = points.first().copied().unwrap_or_default();
        let clock = Self {
            start_s: first.1 - step_s * first.0,
            step_s,
        };
        let deviation_s = |(number, time_s): &(f64, f64)| (clock.time_s(*number) - time_s).abs();
        match points.iter().find(|p| deviation_s(p) > max_deviation_s) {
            None => Ok(clock),
            Some((number, time_s)) => Err(format!(
                "its value {number} is at {time_s:.3} s and should be at {:.3} s by the even rate \
                 of all: the sensor paused; cut the video before and after",
                clock.time_s(*number)
            )),
        }
    }

    /// Time of a value, seconds.
    pub fn time_s(&self, number: f64) -> f64 {
        self.start_s + self.step_s * number
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uneven_payloads_of_an_even_rate_are_levelled() {
        let uneven = [0.0, 199.0, 401.0, 602.0, 800.0, 999.0, 1202.0];
        let points: Vec<(f64, f64)> = (0..7).map(|k| (uneven[k], 1.001 * k as f64)).collect();
        let clock = SampleClock::fit(&points, 1.0).unwrap();
        assert!((clock.step_s - 0.005).abs() < 0.005 * 0.003, "{clock:?}");
        assert_eq!(clock.time_s(0.0), 0.0);
        let mut paused = points.clone();
        paused[6].1 += 10.0;
        let message = SampleClock::fit(&paused, 1.0).unwrap_err();
        assert!(message.contains("the sensor paused"), "{message}");
        for points in [[(0.0, 0.0), (1.0, 0.0)], [(0.0, 1.0), (0.0, 2.0)]] {
            assert!(SampleClock::fit(&points, 1.0).is_err());
        }
    }
}
