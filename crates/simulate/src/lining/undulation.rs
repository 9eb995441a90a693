//! Ovality and undulation of a lining.
//!
//! The deviation at the angle θ and the chainage h is `a cos 2(θ − θ_0) + u(θ, h)`, with the
//! undulation u a sum of [`WAVES`] cosines of random phase. Their wave numbers are drawn from the
//! spectrum of a Gaussian correlation `exp(−x²/2ℓ²)`, of which u is a sample. They are whole
//! numbers of waves around the section and in [`PERIOD_LENGTHS`] ℓ along the axis, so u is
//! tabulated once and has no ends.
//!
//! Source: M. Shinozuka, C.-M. Jan, "Digital simulation of random processes and its applications",
//! Journal of Sound and Vibration 25(1), 1972.

use crate::as_built::AsBuilt;
use crate::lining::periodic_table::PeriodicTable;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::f64::consts::TAU;

/// Number of cosines.
const WAVES: usize = 240;
/// Period of the undulation along the axis, correlation lengths.
const PERIOD_LENGTHS: usize = 64;

/// An oval with undulations.
#[derive(Clone, Debug)]
pub(super) struct Undulation {
    ovality_m: f64,
    ovality_at_rad: f64,
    /// u, metres; None without undulation.
    table: Option<PeriodicTable>,
}

/// One cosine.
#[derive(Clone, Copy, Debug)]
struct Wave {
    /// Waves around the section, a whole number.
    around: f64,
    /// Waves in a period along the axis, a whole number.
    along: f64,
    phase: f64,
}

impl Undulation {
    /// Draws ovality and undulation for a tunnel of the given radius.
    pub fn new(radius_m: f64, as_built: &AsBuilt, seed: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let length_m = as_built.undulation_length_m;
        let period_m = PERIOD_LENGTHS as f64 * length_m;
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut waves: Vec<Wave> = (0..WAVES)
            .map(|_| Wave {
                around: (normal() * radius_m / length_m).round(),
                along: (normal() * PERIOD_LENGTHS as f64 / TAU).round(),
                phase: 0.0,
            })
            .collect();
        for wave in &mut waves {
            wave.phase = rng.random_range(0.0..TAU);
        }
        let amplitude_m = 1e-3 * as_built.undulation_mm * (2.0 / WAVES as f64).sqrt();
        let undulation_m = |theta: f64, h_m: f64| {
            let cosine = |wave: &Wave| {
                let turns = wave.along * h_m / period_m;
                (wave.around * theta + TAU * turns + wave.phase).cos()
            };
            amplitude_m * waves.iter().map(cosine).sum::<f64>()
        };
        Self {
            ovality_m: 1e-3 * as_built.ovality_mm,
            ovality_at_rad: rng.random_range(0.0..TAU),
            table: (as_built.undulation_mm > 0.0)
                .then(|| PeriodicTable::new(TAU * radius_m, period_m, length_m, undulation_m)),
        }
    }

    /// Deviation from the radius, metres.
    pub fn deviation_m(&self, theta: f64, h_m: f64) -> f64 {
        let oval = self.ovality_m * (2.0 * (theta - self.ovality_at_rad)).cos();
        oval + self
            .table
            .as_ref()
            .map_or(0.0, |table| table.at(theta, h_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_undulation_has_its_size_and_length() {
        let as_built = AsBuilt {
            undulation_mm: 3.0,
            undulation_length_m: 0.5,
            ..AsBuilt::default()
        };
        let (mut square, mut product, mut count) = (0.0, 0.0, 0.0);
        for seed in 0..6 {
            let undulation = Undulation::new(3.0, &as_built, seed);
            for k in 0..4000 {
                let (theta, h_m) = (0.37 * f64::from(k), 0.011 * f64::from(k));
                let here = undulation.deviation_m(theta, h_m);
                square += here * here;
                product += here * undulation.deviation_m(theta, h_m + 0.5);
                count += 1.0;
            }
        }
        let rms_m = f64::sqrt(square / count);
        assert!((rms_m / 0.003 - 1.0).abs() < 0.1, "{rms_m}");
        assert!((product / square - (-0.5f64).exp()).abs() < 0.1);
    }

    #[test]
    fn the_ovality_is_a_second_harmonic_without_seam() {
        let as_built = AsBuilt {
            ovality_mm: 10.0,
            ..AsBuilt::default()
        };
        let undulation = Undulation::new(3.0, &as_built, 1);
        let at = |theta: f64| undulation.deviation_m(theta, 1.0);
        assert!((at(0.4) + at(0.4 + 0.25 * TAU)).abs() < 1e-12);
        assert!((at(0.4) - at(0.4 + TAU)).abs() < 1e-12);
        let largest = (0..360)
            .map(|k| at(f64::from(k).to_radians()))
            .fold(0.0, f64::max);
        assert!((largest - 0.01).abs() < 1e-5);
    }
}
