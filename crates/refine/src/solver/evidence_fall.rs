//! The strength of a scale at which the logarithm of the evidence has fallen by some amount.
//!
//! With n coefficients that the pixels determine by themselves to σ₀ each, a strength σ of a scale
//! that the wall does not have lowers L by
//!
//! `½ n (ln(1 + q) − q/(1 + q))`,  `q = σ²/σ₀²`,
//!
//! which is `n q²/4` for small q: about the fourth power of the strength, and less where others
//! determine them together or L is not at its top. So it is searched for on a line through the
//! logarithms, and ends where that is about straight.
//!
//! Few coefficients may be small by chance whatever their strength, and yet be seen where they are
//! not: those of the mean square `x σ₀²` raise L at the strength that suits them by
//!
//! `½ n (x − ln(1 + x))`,
//!
//! as much as a strength lowers it if n is large, and sooner if it is not ([`seen_size`]).

use tunnelstitch_geometry::numerics::monotone::invert_monotone;

/// Step of the strength's logarithm that is taken without another evaluation.
const NARROW: f64 = 0.17;
/// Evaluations at the most.
const MAX_EVALUATIONS: usize = 8;
/// Powers of the strength that the fall may be.
const POWERS: std::ops::RangeInclusive<f64> = 0.5..=4.0;
/// Share of the interval that a new point keeps from its ends.
const MARGIN: f64 = 0.1;

/// Size of n coefficients that raise L by `change`, over the strength that lowers it by as much.
pub fn seen_size(n: f64, change: f64) -> f64 {
    // Functions with their slopes.
    let raised = |x: f64| (0.5 * n * (x - x.ln_1p()), 0.5 * n * x / (1.0 + x));
    let lowered = |q: f64| {
        let change = 0.5 * n * (q.ln_1p() - q / (1.0 + q));
        (change, 0.5 * n * q / (1.0 + q).powi(2))
    };
    let x = invert_monotone(raised, change, f64::INFINITY);
    let q = invert_monotone(lowered, change, f64::INFINITY);
    // Of so many coefficients that both are lost in rounding, both are the same.
    x.zip(q).map_or(1.0, |(x, q)| (x / q).sqrt())
}

/// Values of the fall that are known.
#[derive(Debug, Default)]
pub struct EvidenceFall {
    /// Logarithm of the strength, and the fall there, in ascending order of the former.
    known: Vec<(f64, f64)>,
}

impl EvidenceFall {
    /// The strength within `[least_m, most_m]` at which the evidence has fallen by `wanted`, or
    /// `most_m`; None if it cannot be evaluated. `fall`: the fall at a strength, metres. Values
    /// that it gave for another amount are not asked for again.
    pub fn strength_m(
        &mut self,
        wanted: f64,
        [least_m, most_m]: [f64; 2],
        fall: impl Fn(f64) -> Option<f64>,
    ) -> Option<f64> {
        let most = most_m.ln();
        for _ in 0..MAX_EVALUATIONS {
            let split = self.known.partition_point(|(_, fall)| *fall < wanted);
            let low = split
                .checked_sub(1)
                .map_or(least_m.ln(), |k| self.known[k].0);
            let high = self.known.get(split).map_or(most, |(at, _)| *at);
            let next = match self.line(wanted) {
                Some(line) if line.is_short() => return Some(line.end().min(most).exp()),
                Some(line) if split == self.known.len() && line.end() >= most => most,
                Some(line) => {
                    let margin = MARGIN * (high - low);
                    line.end().clamp(low + margin, high - margin)
                }
                None => 0.5 * (low + high),
            };
            if high - low < NARROW {
                return Some(high.exp());
            }
            let value = fall(next.exp())?;
            if next == most && value < wanted {
                return Some(most_m);
            }
            let place = self.known.partition_point(|(at, _)| *at < next);
            self.known.insert(place, (next, value));
        }
        let end = self.known.iter().find(|(_, fall)| *fall >= wanted);
        Some(end.map_or(most_m, |(at, _)| at.exp()))
    }

    /// The line from the point whose fall is nearest to the wanted one; None without a fall.
    fn line(&self, wanted: f64) -> Option<Line> {
        let step = |point: &(f64, f64)| (wanted / point.1).ln();
        let mut points: Vec<&(f64, f64)> = self.known.iter().filter(|p| p.1 > 0.0).collect();
        points.sort_by(|a, b| step(a).abs().total_cmp(&step(b).abs()));
        let nearest = *points.first()?;
        let power = points.get(1).map(|other| {
            let power = (nearest.1 / other.1).ln() / (nearest.0 - other.0);
            power.clamp(*POWERS.start(), *POWERS.end())
        });
        Some(Line {
            from: nearest.0,
            step: step(nearest) / power.unwrap_or(*POWERS.end()),
            is_known: power.is_some(),
        })
    }
}

/// A line through the logarithms of strength and fall.
struct Line {
    /// Logarithm of the strength at which it begins.
    from: f64,
    /// Step of that to the wanted fall.
    step: f64,
    /// True if its slope goes through a second point.
    is_known: bool,
}

impl Line {
    fn end(&self) -> f64 {
        self.from + self.step
    }

    fn is_short(&self) -> bool {
        self.is_known && self.step.abs() < NARROW
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// The fall of n coefficients that are determined to 0.2 mm each, less `top`.
    fn fall(n: f64, top: f64) -> impl Fn(f64) -> f64 {
        move |sigma_m: f64| {
            let q = (sigma_m / 2e-4).powi(2);
            0.5 * n * ((1.0 + q).ln() - q / (1.0 + q)) - top
        }
    }

    #[test]
    fn a_fall_is_found_in_a_few_evaluations() {
        for n in [3.0, 100.0, 20_000.0] {
            for top in [0.0, 0.4] {
                let (curve, count) = (fall(n, top), Cell::new(0));
                let counted = |sigma_m: f64| {
                    count.set(count.get() + 1);
                    Some(curve(sigma_m))
                };
                let mut falls = EvidenceFall::default();
                for wanted in [0.5, 4.8] {
                    let found = falls.strength_m(wanted, [1e-6, 0.06], counted).unwrap();
                    // A sixth of the strength on either side.
                    assert!(curve(found / 1.17) < wanted, "{n} {top} {wanted}: {found}");
                    assert!(curve(found * 1.17) > wanted, "{n} {top} {wanted}: {found}");
                }
                assert!(count.get() <= 10, "{n}, {top}: {}", count.get());
            }
        }
    }

    /// The two coefficients of an ovality are seen from 2.6 of their errors on; many are as large
    /// as their strength.
    #[test]
    fn few_coefficients_are_seen_sooner_than_their_strength() {
        assert!((seen_size(1e6, 4.8) - 1.0).abs() < 0.01);
        let (change, size) = (4.8, seen_size(2.0, 4.8));
        let sigma_m = EvidenceFall::default()
            .strength_m(change, [1e-6, 1.0], |sigma_m| Some(fall(2.0, 0.0)(sigma_m)))
            .unwrap();
        assert!((2.2..3.0).contains(&(size * sigma_m / 2e-4)), "{size}");
    }

    #[test]
    fn a_fall_that_is_never_reached_gives_the_largest_strength() {
        let count = Cell::new(0);
        let counted = |_| {
            count.set(count.get() + 1);
            Some(1e-3)
        };
        let found = EvidenceFall::default().strength_m(0.5, [1e-6, 0.06], counted);
        assert_eq!(found, Some(0.06));
        assert!(count.get() <= 6, "{}", count.get());
        let nothing = EvidenceFall::default().strength_m(0.5, [1e-6, 0.06], |_| None);
        assert_eq!(nothing, None);
    }
}
