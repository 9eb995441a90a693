//! Monotone functions of one variable: the end of the interval in which they rise, and their
//! inverse.

/// Iterations of the inverse; bisection alone reaches rounding within them.
const MAX_INVERSION_ITERATIONS: usize = 80;
/// Steps of the scan for the end of the rise, each larger than the last by [`SCAN_GROWTH`].
const MAX_SCAN_STEPS: usize = 1200;
const SCAN_START: f64 = 1e-3;
const SCAN_GROWTH: f64 = 1.01;

/// The smallest argument up to `end` at which `slope` is no longer positive; infinity if there is
/// none.
///
/// The scan starts at 0.001 and proceeds in steps of one per cent, then bisects to rounding. A dip
/// narrower than one per cent is missed.
pub fn monotone_limit(slope: impl Fn(f64) -> f64, end: f64) -> f64 {
    let rises = |at: f64| slope(at) > 0.0;
    let (mut low, mut high) = (0.0, SCAN_START);
    for _ in 0..MAX_SCAN_STEPS {
        if low >= end {
            return f64::INFINITY;
        }
        if !rises(high.min(end)) {
            high = high.min(end);
            while 0.5 * (low + high) > low && 0.5 * (low + high) < high {
                let middle = 0.5 * (low + high);
                if rises(middle) {
                    low = middle;
                } else {
                    high = middle;
                }
            }
            return low;
        }
        (low, high) = (high, high * SCAN_GROWTH);
    }
    f64::INFINITY
}

/// Solves `f(x) = target ≥ 0` for `x` in `[0, end]`, where `f` returns value and slope and rises;
/// None if f(end) is less than the target.
///
/// Newton's method, safeguarded by a bracket around the root; bisection of the bracket if Newton's
/// method goes in circles.
pub fn invert_monotone(f: impl Fn(f64) -> (f64, f64), target: f64, end: f64) -> Option<f64> {
    if target == 0.0 {
        return Some(0.0);
    }
    if !target.is_finite() || (end.is_finite() && f(end).0 < target) {
        return None;
    }
    let (mut low, mut high) = (0.0, end);
    let mut x = target.min(end);
    for _ in 0..MAX_INVERSION_ITERATIONS {
        let (value, slope) = f(x);
        let error = value - target;
        let newton = x - error / slope;
        // Before the bracket is looked at: next to the root, rounding may put it on its end.
        if (newton - x).abs() <= 1e-15 * x {
            return Some(newton.min(end));
        }
        if error > 0.0 {
            high = x;
        } else {
            low = x;
        }
        x = if newton > low && newton < high {
            newton
        } else if high.is_finite() {
            0.5 * (low + high)
        } else {
            2.0 * x
        };
    }
    let is_root = |x: f64| (f(x).0 - target).abs() <= 1e-12 * target;
    // The last bit alternates.
    if is_root(x) {
        return Some(x);
    }
    for _ in 0..MAX_INVERSION_ITERATIONS {
        let middle = 0.5 * (low + high);
        if f(middle).0 > target {
            high = middle;
        } else {
            low = middle;
        }
    }
    is_root(low).then_some(low)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    #[test]
    fn the_end_is_where_the_slope_vanishes() {
        // x − x³ rises to 1/√3.
        let end = monotone_limit(|x| 1.0 - 3.0 * x * x, 10.0);
        assert!((end - 3f64.sqrt().recip()).abs() < 1e-12);
        assert_eq!(monotone_limit(|x| 1.0 + x, 10.0), f64::INFINITY);
        assert_eq!(
            monotone_limit(|x| 1.0 - 3.0 * x * x, 0.5),
            f64::INFINITY,
            "beyond what is asked for"
        );
    }

    #[test]
    fn the_inverse_is_found_up_to_the_end_and_not_beyond() {
        let f = |x: f64| (x - x * x * x, 1.0 - 3.0 * x * x);
        let end = 3f64.sqrt().recip();
        for k in 0..100 {
            let x = end * f64::from(k) / 100.0;
            let back = invert_monotone(f, f(x).0, end).unwrap();
            assert!((back - x).abs() < 1e-8, "{x}: {back}");
        }
        assert!(invert_monotone(f, 0.4, end).is_none());
        // Newton's method lands on the root itself, and stays there.
        let evaluations = Cell::new(0);
        let counted = |x: f64| {
            evaluations.set(evaluations.get() + 1);
            f(x)
        };
        for k in 1..100 {
            invert_monotone(counted, f(0.005 * f64::from(k)).0, end).unwrap();
        }
        assert!(evaluations.get() < 800, "{}", evaluations.get());
        assert!(invert_monotone(f, f64::NAN, end).is_none());
        // Newton's method goes in a circle of two within the bracket.
        let wavy = |x: f64| (x + 0.99 * (x - 2.0).sin() + 0.99 * 2f64.sin(), 1.0);
        let back = invert_monotone(wavy, wavy(2.0).0, 4.0).unwrap();
        assert!((wavy(back).0 - wavy(2.0).0).abs() < 1e-11);
        let steep = invert_monotone(|x| (x * x * x, 3.0 * x * x), 1e6, f64::INFINITY).unwrap();
        assert!((steep - 100.0).abs() < 1e-9);
    }
}
