//! Interpolation kernels: weights of the pixels around a point.

use super::rounding::ROUNDING_OFFSET;
use super::signal::sinc;
use serde::Serialize;

/// Interpolation between pixel centres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// The nearest pixel, unchanged.
    Nearest,
    /// Weighted mean of the 2 × 2 pixels around; soft.
    Bilinear,
    /// Catmull–Rom cubic through the 4 × 4 pixels around; keeps the frames' sharpness, exact for
    /// quadratics, may overshoot at edges.
    #[default]
    Bicubic,
    /// Sinc with a window of three lobes over 6 × 6 pixels; sharpest, rings a little beside edges.
    Lanczos3,
}

impl Interpolation {
    /// Reach of the kernel to either side, pixels.
    pub fn reach(self) -> f64 {
        match self {
            Self::Nearest => 0.5,
            Self::Bilinear => 1.0,
            Self::Bicubic => 2.0,
            Self::Lanczos3 => 3.0,
        }
    }

    /// The weight of a pixel at distance `x`, pixels.
    pub fn weight(self, x: f64) -> f64 {
        let x = x.abs();
        if x >= self.reach() {
            return 0.0;
        }
        match self {
            Self::Nearest => 1.0,
            Self::Bilinear => 1.0 - x,
            // E. Catmull, R. Rom, "A class of local interpolating splines", 1974 (a = −½ in Keys'
            // kernel).
            Self::Bicubic if x < 1.0 => 1.0 + x * x * (1.5 * x - 2.5),
            Self::Bicubic => 2.0 + x * (x * (2.5 - 0.5 * x) - 4.0),
            Self::Lanczos3 => sinc(x) * sinc(x / 3.0),
        }
    }
}

/// Tabulated positions from one pixel to the next: at most 1/1024 px off. A higher value is more
/// exact and takes more memory.
const PHASES: usize = 512;
/// Bits that hold a phase.
const PHASE_BITS: u32 = 2 * PHASES as u32 - 1;

/// Tabulated weights of an interpolation along one axis, stretched where the picture is finer than
/// the canvas so that no pixel is left out (anti-aliasing).
#[derive(Clone, Debug)]
pub struct Kernel {
    taps: usize,
    /// `PHASES + 1` rows of `taps` weights; each row's sum is 1.
    weights: Vec<f32>,
    /// Weights in units of 2⁻¹⁴, rows padded with zeros to [`Kernel::padded_taps`] weights for
    /// vectors.
    integers: Vec<i16>,
}

/// One in units of the whole-numbered weights.
const ONE: f64 = 16384.0;

impl Kernel {
    /// Tabulates an interpolation, `stretch` (at least 1) times as wide as for a picture that is
    /// sampled at its own resolution.
    ///
    /// Taps are 1 or an even number. Weights are `k((x − t)/stretch)` normalised to a sum of 1, x
    /// the pixels and t the point. The nearest pixel is never stretched: it is for pictures that
    /// must stay what they are.
    pub fn new(interpolation: Interpolation, stretch: f64) -> Self {
        if interpolation == Interpolation::Nearest {
            return Self {
                taps: 1,
                weights: vec![1.0; PHASES + 1],
                integers: [ONE as i16, 0, 0, 0].repeat(PHASES + 1),
            };
        }
        let half = (interpolation.reach() * stretch.max(1.0) - 1e-9).ceil() as usize;
        let taps = 2 * half;
        let mut weights = Vec::with_capacity((PHASES + 1) * taps);
        let mut integers = Vec::with_capacity((PHASES + 1) * Self::padded_taps(taps));
        for phase in 0..=PHASES {
            let t = (half - 1) as f64 + phase as f64 / PHASES as f64;
            let row = (0..taps).map(|x| interpolation.weight((x as f64 - t) / stretch.max(1.0)));
            let row: Vec<f64> = row.collect();
            let sum: f64 = row.iter().sum();
            weights.extend(row.iter().map(|w| (w / sum) as f32));
            integers.extend(integer_weights(&row, sum));
            integers.resize((phase + 1) * Self::padded_taps(taps), 0);
        }
        Self {
            taps,
            weights,
            integers,
        }
    }

    /// Tabulated phases of a pixel.
    pub const PHASES: f32 = PHASES as f32;

    /// Number of weighted pixels along each axis.
    pub fn taps(&self) -> usize {
        self.taps
    }

    /// Largest distance of a weighted pixel from the point along each axis, pixels.
    pub fn reach_px(&self) -> f32 {
        0.5 * self.taps as f32
    }

    /// Number of taps before the point's own pixel.
    pub fn taps_before(&self) -> usize {
        Self::taps_before_of(self.taps)
    }

    /// Taps before the point's own pixel of any kernel with that many taps.
    #[inline(always)]
    pub const fn taps_before_of(taps: usize) -> usize {
        (taps - 1) / 2
    }

    /// Offset of a coordinate before it is truncated to its own pixel: ½ for the nearest one, else
    /// 0.
    pub fn rounding(&self) -> f32 {
        if self.taps == 1 { 0.5 } else { 0.0 }
    }

    /// The tabulated phase of the fraction `t` in `[0, 1]` of a coordinate.
    #[inline(always)]
    pub fn phase(t: f32) -> i32 {
        Self::phase_of(t, Self::PHASES)
    }

    /// Phase of the fraction `t` where a pixel is divided into `phases` (at most as many as are
    /// tabulated).
    #[inline(always)]
    pub fn phase_of(t: f32, phases: f32) -> i32 {
        ((t * phases + ROUNDING_OFFSET).to_bits() & PHASE_BITS) as i32
    }

    /// Phases of a pixel for whole-numbered weights: 128 for two taps, which need no table.
    pub fn integer_phases(&self) -> f32 {
        Self::integer_phases_of(self.taps)
    }

    /// Phases of a pixel for whole-numbered weights of any kernel with that many taps.
    #[inline(always)]
    pub const fn integer_phases_of(taps: usize) -> f32 {
        match taps {
            2 => 128.0,
            _ => Self::PHASES,
        }
    }

    /// Length of a row of [`Kernel::all_integer_weights`] for that many taps: a multiple of 4.
    #[inline(always)]
    pub const fn padded_taps(taps: usize) -> usize {
        taps.next_multiple_of(4)
    }

    /// Weights of all phases, row after row, in units of 2⁻¹⁴.
    #[inline(always)]
    pub fn all_integer_weights(&self) -> &[i16] {
        &self.integers
    }

    /// Weights of a phase in units of 2⁻¹⁴; their sum is exactly one.
    #[inline(always)]
    pub fn integer_weights_at(&self, phase: usize) -> &[i16] {
        &self.integers[phase * Self::padded_taps(self.taps)..][..self.taps]
    }

    /// Weights of a phase.
    #[inline(always)]
    pub fn at(&self, phase: usize) -> &[f32] {
        &self.weights[phase * self.taps..][..self.taps]
    }
}

/// Converts weights whose sum is `sum` to units of 2⁻¹⁴; the rounding error of the sum goes to the
/// largest.
fn integer_weights(row: &[f64], sum: f64) -> Vec<i16> {
    let mut whole: Vec<i16> = row.iter().map(|w| (w / sum * ONE).round() as i16).collect();
    let off = ONE as i16 - whole.iter().sum::<i16>();
    if let Some(largest) = whole.iter_mut().max() {
        *largest += off;
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    const ALL: [Interpolation; 4] = [
        Interpolation::Nearest,
        Interpolation::Bilinear,
        Interpolation::Bicubic,
        Interpolation::Lanczos3,
    ];

    #[test]
    fn weights_sum_to_one_and_are_interpolating_unless_stretched() {
        for interpolation in ALL {
            for stretch in [1.0, 1.3, 2.0] {
                let kernel = Kernel::new(interpolation, stretch);
                for phase in 0..=PHASES {
                    let sum: f32 = kernel.at(phase).iter().sum();
                    assert!((sum - 1.0).abs() < 1e-5);
                }
            }
            let kernel = Kernel::new(interpolation, 1.0);
            for (k, w) in kernel.at(0).iter().enumerate() {
                let own = if k == kernel.taps_before() { 1.0 } else { 0.0 };
                assert!((w - own).abs() < 1e-6, "{interpolation:?}");
            }
        }
        assert_eq!(
            ALL.map(|interpolation| Kernel::new(interpolation, 1.0).taps()),
            [1, 2, 4, 6]
        );
    }

    /// A kernel stretched by s passes waves of s pixels and more, and takes out those that the
    /// canvas cannot show.
    #[test]
    fn stretching_takes_out_what_is_too_fine() {
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            let kernel = Kernel::new(interpolation, 2.0);
            let contrast = |wave_px: f64| {
                let row = kernel.at(0);
                let sum = |f: fn(f64) -> f64| -> f64 {
                    let part = |(x, w): (usize, &f32)| {
                        f64::from(*w)
                            * f(2.0 * PI * (x as f64 - kernel.taps_before() as f64) / wave_px)
                    };
                    row.iter().enumerate().map(part).sum()
                };
                sum(f64::cos).hypot(sum(f64::sin))
            };
            assert!(contrast(2.0) < 0.01, "{}", contrast(2.0));
            assert!(contrast(12.0) > 0.8, "{}", contrast(12.0));
        }
    }
}
