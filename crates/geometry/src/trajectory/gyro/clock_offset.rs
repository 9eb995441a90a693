//! Estimation of the offset between the log's clock and the frames' clock from the planned
//! rotation.

use super::rates::AngularRates;
use nalgebra::Vector3;

/// The offset between the clocks at which the rates correlate best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockMatch {
    /// The log's time minus the frames', seconds.
    pub offset_s: f64,
    /// Correlation of the two rates at the offset, at most 1.
    pub correlation: f64,
}

/// Smallest correlation of rates of the same motion.
const MIN_CORRELATION: f64 = 0.7;

/// Largest number of offsets to try.
const MAX_OFFSETS: f64 = 1e7;

impl ClockMatch {
    /// Estimates the offset within `range_s` that maximises the correlation of the mean rates about
    /// `axis` (camera coordinates) between frames with those of a plan, with parabolic
    /// interpolation of the maximum.
    ///
    /// `times_s` and `angles_rad`: the plan's angle about the axis at the frames. Steps of the
    /// search are those of the log.
    ///
    /// # Errors
    /// Fewer than four frames, a plan of constant rate, which fits any offset, a log that does not
    /// cover the frames at any offset, no sufficient correlation, or a maximum at an end of the
    /// range.
    pub fn find(
        rates: &AngularRates,
        axis: &Vector3<f64>,
        times_s: &[f64],
        angles_rad: &[f64],
        range_s: [f64; 2],
    ) -> Result<Self, String> {
        let turned = Turned::new(rates, axis);
        let steps: Vec<f64> = times_s.windows(2).map(|t| t[1] - t[0]).collect();
        let planned: Vec<f64> = angles_rad
            .windows(2)
            .zip(&steps)
            .map(|(angle, step)| (angle[1] - angle[0]) / step)
            .collect();
        if planned.len() < 3 {
            return Err("the offset cannot be estimated from fewer than four frames".to_owned());
        }
        let mean = planned.iter().sum::<f64>() / planned.len() as f64;
        let spread = planned.iter().map(|p| (p - mean).abs()).fold(0.0, f64::max);
        if spread <= 1e-6 * mean.abs().max(1e-6) {
            return Err(
                "the plan turns at a constant rate, which fits the log at any offset; give the \
                 offset, or a plan with its stops"
                    .to_owned(),
            );
        }
        let at = |offset_s: f64| {
            let angle = |time_s: &f64| turned.at(time_s + offset_s);
            let angles = times_s.iter().map(angle).collect::<Option<Vec<f64>>>()?;
            let measured: Vec<f64> = angles
                .windows(2)
                .zip(&steps)
                .map(|(angle, step)| (angle[1] - angle[0]) / step)
                .collect();
            correlation(&planned, &measured)
        };
        let [step_s, _] = rates.steps_s();
        let count = ((range_s[1] - range_s[0]) / step_s).ceil().max(0.0);
        if !count.is_finite() || count > MAX_OFFSETS {
            return Err(format!(
                "the range of {:.3} s holds {count:.0} of the log's steps of {step_s:.1e} s; \
                 narrow the range, or correct the log's tscale if it is wrong",
                range_s[1] - range_s[0]
            ));
        }
        let count = count as usize;
        let offset = |k: usize| range_s[0] + k as f64 * step_s;
        let values: Vec<Option<f64>> = (0..=count).map(|k| at(offset(k))).collect();
        let value = |k: usize| values.get(k).copied().flatten();
        let best = (0..=count)
            .filter_map(|k| Some((k, value(k)?)))
            .max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((k, correlation)) = best else {
            return Err("the log covers all frames at no offset in the range".to_owned());
        };
        if correlation < MIN_CORRELATION {
            return Err(format!(
                "the rate about the axis agrees with the plan's nowhere in the range: the \
                 greatest correlation is {correlation:.2}, \
                 at {:.3} s",
                offset(k)
            ));
        }
        let (Some(before), Some(after)) = (k.checked_sub(1).and_then(value), value(k + 1)) else {
            return Err(format!(
                "rates agree best at {:.3} s, at the end of the range or of the log; widen the \
                 range",
                offset(k)
            ));
        };
        // The vertex of the parabola.
        let bend = before - 2.0 * correlation + after;
        let shift = if bend < 0.0 {
            0.5 * (before - after) / bend
        } else {
            0.0
        };
        Ok(Self {
            offset_s: offset(k) + shift * step_s,
            correlation,
        })
    }
}

/// Pearson's correlation coefficient; `None` if one of them is constant.
fn correlation(a: &[f64], b: &[f64]) -> Option<f64> {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (a - mean_a, b - mean_b);
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    let norm = (aa * bb).sqrt();
    (norm > 0.0).then(|| ab / norm)
}

/// The rotation angle about an axis since the log's first sample.
pub(super) struct Turned<'a> {
    times_s: &'a [f64],
    rates: Vec<f64>,
    angles: Vec<f64>,
}

impl<'a> Turned<'a> {
    pub(super) fn new(rates: &'a AngularRates, axis: &Vector3<f64>) -> Self {
        let times_s = rates.times_s();
        let rates: Vec<f64> = rates.rates().iter().map(|rate| rate.dot(axis)).collect();
        let mut angles = Vec::with_capacity(rates.len());
        let mut angle = 0.0;
        angles.push(angle);
        for (t, w) in times_s.windows(2).zip(rates.windows(2)) {
            angle += 0.5 * (w[0] + w[1]) * (t[1] - t[0]);
            angles.push(angle);
        }
        Self {
            times_s,
            rates,
            angles,
        }
    }

    pub(super) fn at(&self, time_s: f64) -> Option<f64> {
        let next = self.times_s.partition_point(|t| *t < time_s);
        let end_s = *self.times_s.get(next)?;
        if end_s == time_s {
            return self.angles.get(next).copied();
        }
        let last = next.checked_sub(1)?;
        let begin_s = *self.times_s.get(last)?;
        let (from, to) = (*self.rates.get(last)?, *self.rates.get(next)?);
        let part_s = time_s - begin_s;
        let then = from + (to - from) * part_s / (end_s - begin_s);
        Some(self.angles.get(last)? + 0.5 * (from + then) * part_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The angle of a plan with stops: 20° within one second, every two seconds.
    fn angle(t: f64) -> f64 {
        let (step, part) = ((t / 2.0).floor(), t.rem_euclid(2.0).min(1.0));
        (step + part - (std::f64::consts::TAU * part).sin() / std::f64::consts::TAU) * 0.35
            + 0.02 * (0.7 * t).sin() * t
    }

    fn log(offset_s: f64, axis: &Vector3<f64>) -> AngularRates {
        let times: Vec<f64> = (0..8000).map(|k| f64::from(k) / 200.0).collect();
        let rate = |t: &f64| (angle(t - offset_s + 1e-4) - angle(t - offset_s - 1e-4)) / 2e-4;
        let rates = times
            .iter()
            .map(|t| axis * rate(t) + Vector3::new(0.01, 0.02, 0.0));
        let rates = rates.collect();
        AngularRates::new(times, rates)
    }

    /// Rates of a log with a wrong tscale.
    #[test]
    fn a_range_of_countless_steps_is_refused() {
        let axis = Vector3::z();
        let times: Vec<f64> = (0..100).map(|k| f64::from(k) * 1e-12).collect();
        let rates = AngularRates::new(times, vec![axis; 100]);
        let at = [0.0, 0.1, 0.2, 0.3, 0.4];
        let angles = at.map(|t| t * t);
        let refused = ClockMatch::find(&rates, &axis, &at, &angles, [-1.0, 1.0]).unwrap_err();
        assert!(refused.contains("tscale"), "{refused}");
    }

    #[test]
    fn the_offset_is_found_to_a_fraction_of_a_sample() {
        let axis = Vector3::new(0.0, 0.6, -0.8);
        for offset_s in [3.1417, 5.0, 7.7431] {
            let rates = log(offset_s, &axis);
            let times: Vec<f64> = (0..90).map(|k| f64::from(k) * 0.3).collect();
            let angles: Vec<f64> = times.iter().map(|t| angle(*t)).collect();
            let found = ClockMatch::find(&rates, &axis, &times, &angles, [0.0, 12.0]).unwrap();
            assert!(
                (found.offset_s - offset_s).abs() < 1e-3,
                "{found:?} {offset_s}"
            );
            assert!(found.correlation > 0.999);
        }
    }

    #[test]
    fn uninformative_plans_are_refused() {
        let axis = Vector3::y();
        let rates = log(4.0, &axis);
        let times: Vec<f64> = (0..60).map(|k| f64::from(k) * 0.3).collect();
        let of = |plan: &dyn Fn(f64) -> f64, range_s| {
            let angles: Vec<f64> = times.iter().map(|t| plan(*t)).collect();
            ClockMatch::find(&rates, &axis, &times, &angles, range_s).unwrap_err()
        };
        for (message, expected) in [
            (of(&|t| 0.5 * t, [0.0, 8.0]), "at a constant rate"),
            (of(&angle, [100.0, 101.0]), "covers all frames at no offset"),
            (of(&angle, [4.0, 8.0]), "end of the range"),
            (
                of(&|t| (37.0 * t * t).sin(), [0.0, 8.0]),
                "agrees with the plan's nowhere",
            ),
        ] {
            assert!(message.contains(expected), "{message}");
        }
    }
}
