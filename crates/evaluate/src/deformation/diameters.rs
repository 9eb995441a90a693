//! Largest and smallest diameter of a section, their directions, and its second harmonic.
//!
//! The diameter at the angle θ is `D(θ) = 2r + δ(θ) + δ(θ + π)`, free of the position of the
//! centre. Its extremes are taken over whole degrees. To first order the error of an extreme is
//! that of the diameter at its direction, and its direction errs by `σ(D')/|D''|`. An extreme of
//! values that err is extreme by chance as well: of a round section, the largest diameter is too
//! large, and the smallest too small, by about one σ.
//!
//! The second harmonic is `c cos 2(θ − θ_2)` of the displacement, with `c cos 2θ_2`, `c sin 2θ_2`
//! the means of `2 δ cos 2θ`, `2 δ sin 2θ`; an ellipse has diameters `2(r ± c)`.

use super::functional::{Functional, Measured, SectionSamples};
use super::outline::{DEGREES, SectionOutline};
use std::f64::consts::FRAC_PI_4;

/// Half a turn, after which diameters repeat, degrees.
const HALF_TURN: usize = DEGREES / 2;
/// Step of the differences for the derivatives of a diameter by its direction, degrees: less than
/// the distance of nodes of the shape.
const STEP_DEG: usize = 3;
/// Largest 1-σ of a direction, radians: of a uniform direction it is 52°.
const MAX_DIRECTION_SIGMA: f64 = FRAC_PI_4;

/// An extreme diameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extreme {
    /// The diameter, metres.
    pub(super) diameter: Measured,
    /// Its direction from twelve o'clock towards three, 0 to π, radians; no σ if the direction is
    /// not determined.
    pub(super) direction: Measured,
}

/// Diameters of a section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Diameters {
    pub(super) max: Extreme,
    pub(super) min: Extreme,
    /// Largest less smallest diameter, metres.
    pub(super) ovality: Measured,
    /// Amplitude of the second harmonic, metres; None if not all of the section is determined.
    pub(super) second_harmonic: Option<Measured>,
}

impl Diameters {
    /// The diameters of a circular section of the nominal radius `radius_m` over the directions
    /// whose ends are both determined; None if there are fewer than half of them.
    pub(super) fn new(
        radius_m: f64,
        samples: &SectionSamples,
        determined: &[bool],
    ) -> Option<Self> {
        let is_known = |k: &usize| determined[*k] && determined[*k + HALF_TURN];
        let known: Vec<usize> = (0..HALF_TURN).filter(is_known).collect();
        if 2 * known.len() < HALF_TURN {
            return None;
        }
        let value = |k: &usize| samples.delta_m[*k] + samples.delta_m[*k + HALF_TURN];
        let by_value = |a: &usize, b: &usize| value(a).total_cmp(&value(b));
        let max = known.iter().copied().max_by(by_value)?;
        let min = known.iter().copied().min_by(by_value)?;
        let difference = diameter(radius_m, max).combined(1.0, &diameter(radius_m, min), -1.0);
        let is_whole = determined.iter().all(|is_known| *is_known);
        Some(Self {
            max: extreme(radius_m, samples, max),
            min: extreme(radius_m, samples, min),
            ovality: samples.measure(&difference),
            second_harmonic: is_whole.then(|| second_harmonic(samples)),
        })
    }
}

/// The diameter at a direction, degrees.
fn diameter(radius_m: f64, direction: usize) -> Functional {
    let ends = [(direction, 1.0), (direction + HALF_TURN, 1.0)];
    Functional::sparse(DEGREES, 2.0 * radius_m, ends)
}

/// The extreme diameter at a direction, degrees.
fn extreme(radius_m: f64, samples: &SectionSamples, direction: usize) -> Extreme {
    let at = diameter(radius_m, direction);
    let after = diameter(radius_m, direction + STEP_DEG);
    let before = diameter(radius_m, direction + HALF_TURN - STEP_DEG);
    let step = SectionOutline::angle_rad(STEP_DEG);
    let slope = after.combined(0.5 / step, &before, -0.5 / step);
    let mean = after.combined(0.5, &before, 0.5);
    let curvature = mean.combined(2.0 / (step * step), &at, -2.0 / (step * step));
    let curvature = samples.measure(&curvature).value.abs();
    let sigma = samples.measure(&slope).sigma.map(|sigma| sigma / curvature);
    Extreme {
        diameter: samples.measure(&at),
        direction: Measured {
            value: SectionOutline::angle_rad(direction),
            sigma: sigma.filter(|sigma| *sigma < MAX_DIRECTION_SIGMA),
        },
    }
}

/// Amplitude of the second harmonic.
fn second_harmonic(samples: &SectionSamples) -> Measured {
    let part = |phase: fn(f64) -> f64| {
        let weight = |k: usize| {
            let angle = SectionOutline::angle_rad(k);
            (k, 2.0 / DEGREES as f64 * phase(2.0 * angle))
        };
        Functional::sparse(DEGREES, 0.0, (0..DEGREES).map(weight))
    };
    let (cosine, sine) = (part(f64::cos), part(f64::sin));
    let (c, s) = (samples.measure(&cosine).value, samples.measure(&sine).value);
    // Along its own direction the amplitude is linear in both.
    let (sin, cos) = s.atan2(c).sin_cos();
    samples.measure(&cosine.combined(cos, &sine, sin))
}
