//! Integration of angular rates to rotations.

use super::rates::AngularRates;
use crate::trajectory::so3;
use nalgebra::{UnitQuaternion, Vector3};

/// Rotations at any time within a log, integrated from the rates.
#[derive(Clone, Debug)]
pub struct IntegratedRotation {
    rates: AngularRates,
    /// Rotation from the camera at each sample to the camera at the first.
    since_first: Vec<UnitQuaternion<f64>>,
}

/// The rotation over `step_s` during which the rate, in body axes, changes linearly from `from` to
/// `to`: `Exp(h (ω₀ + ω₁)/2 + h²/12 ω₀ × ω₁)`, exact up to terms of fifth order in h.
///
/// Source: Bortz, "A new mathematical formulation for strapdown inertial navigation", 1971; the
/// fourth-order Magnus expansion.
fn step(from: &Vector3<f64>, to: &Vector3<f64>, step_s: f64) -> UnitQuaternion<f64> {
    so3::exp(&((from + to) * (0.5 * step_s) + from.cross(to) * (step_s * step_s / 12.0)))
}

impl IntegratedRotation {
    /// Integrates rates.
    pub fn new(rates: AngularRates) -> Self {
        let mut since_first = Vec::with_capacity(rates.times_s().len());
        let mut attitude = UnitQuaternion::identity();
        since_first.push(attitude);
        for (times, pair) in rates.times_s().windows(2).zip(rates.rates().windows(2)) {
            if let ([begin_s, end_s], [from, to]) = (times, pair) {
                attitude *= step(from, to, end_s - begin_s);
                // Renormalised, so that rounding does not accumulate.
                attitude.renormalize_fast();
                since_first.push(attitude);
            }
        }
        Self { rates, since_first }
    }

    /// The rotation from the camera at a time to the camera at the log's first sample; `None`
    /// outside the log.
    pub fn at(&self, time_s: f64) -> Option<UnitQuaternion<f64>> {
        let times = self.rates.times_s();
        let next = times.partition_point(|t| *t < time_s);
        if *times.get(next)? == time_s {
            return self.since_first.get(next).copied();
        }
        let last = next.checked_sub(1)?;
        let (begin_s, end_s) = (*times.get(last)?, *times.get(next)?);
        let rates = self.rates.rates();
        let (from, to) = (rates.get(last)?, rates.get(next)?);
        let then = from + (to - from) * ((time_s - begin_s) / (end_s - begin_s));
        Some(self.since_first.get(last)? * step(from, &then, time_s - begin_s))
    }

    /// The rotation from one time to another, `R(from)ᵀ R(to)`.
    pub fn between(&self, from_s: f64, to_s: f64) -> Option<UnitQuaternion<f64>> {
        Some(self.at(from_s)?.inverse() * self.at(to_s)?)
    }

    /// The rates that are integrated.
    pub fn rates(&self) -> &AngularRates {
        &self.rates
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A rotation known in closed form, and its rate in body axes: precession about y at `w` while
    /// spinning about z at `s`, tilted by 0.3 rad.
    fn truth(w: f64, s: f64, t: f64) -> (UnitQuaternion<f64>, Vector3<f64>) {
        let tilt = so3::exp(&(Vector3::x() * 0.3));
        let r = so3::exp(&(Vector3::y() * (w * t))) * tilt * so3::exp(&(Vector3::z() * (s * t)));
        (r, r.inverse() * (Vector3::y() * w) + Vector3::z() * s)
    }

    fn turning(w: f64, s: f64, hz: f64) -> IntegratedRotation {
        let times: Vec<f64> = (0..=(4.0 * hz) as usize).map(|k| k as f64 / hz).collect();
        let rates = times.iter().map(|t| truth(w, s, *t).1).collect();
        IntegratedRotation::new(AngularRates::new(times, rates))
    }

    proptest! {
        #[test]
        fn a_known_motion_is_met_between_samples_too(
            w in -3f64..3.0, s in -2f64..2.0, from in 0f64..4.0, to in 0f64..4.0,
        ) {
            let found = turning(w, s, 200.0).between(from, to).unwrap();
            let expected = truth(w, s, from).0.inverse() * truth(w, s, to).0;
            // Rates are not straight between samples: that is of the second order in 5 ms.
            prop_assert!(found.angle_to(&expected) < 1e-4, "{}", found.angle_to(&expected));
        }
    }

    /// With the coning term the error falls by sixteen for four times the samples.
    #[test]
    fn it_converges_with_the_second_power_and_is_exact_for_even_turns() {
        let off = |hz: f64| {
            let found = turning(2.0, 1.5, hz).between(0.0, 4.0).unwrap();
            found.angle_to(&(truth(2.0, 1.5, 0.0).0.inverse() * truth(2.0, 1.5, 4.0).0))
        };
        assert!(
            off(25.0) > 14.0 * off(100.0),
            "{} {}",
            off(25.0),
            off(100.0)
        );
        let even = turning(2.0, 0.0, 7.0).between(0.33, 3.9).unwrap();
        let expected = truth(2.0, 0.0, 0.33).0.inverse() * truth(2.0, 0.0, 3.9).0;
        assert!(even.angle_to(&expected) < 1e-12);
    }

    /// Compares one long step of linearly changing rate with a thousand short ones.
    #[test]
    fn one_step_is_as_good_as_many() {
        let (from, to) = (Vector3::new(0.4, -0.1, 0.3), Vector3::new(-0.2, 0.5, 0.1));
        let mut many = UnitQuaternion::identity();
        for k in 0..1000 {
            let middle = from + (to - from) * ((f64::from(k) + 0.5) / 1000.0);
            many *= so3::exp(&(middle * 1e-3));
        }
        let without = so3::exp(&((from + to) * 0.5));
        let off = step(&from, &to, 1.0).angle_to(&many);
        assert!(off < 0.1 * without.angle_to(&many), "{off}");
    }

    #[test]
    fn there_are_no_rotations_beyond_the_log() {
        let turning = turning(1.0, 0.0, 10.0);
        assert!(turning.at(-0.01).is_none() && turning.at(4.01).is_none());
        assert!(turning.at(0.0).is_some() && turning.at(4.0).is_some());
    }
}
