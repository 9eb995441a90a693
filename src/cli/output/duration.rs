//! Durations in words.

/// A duration in the unit that suits it, without false precision: `14 s`, `3 min`, `2.5 h`.
pub fn duration_text(seconds: f64) -> String {
    match seconds {
        s if s < 90.0 => format!("{:.0} s", s.max(1.0)),
        s if s < 5400.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.1} h", s / 3600.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_are_in_the_unit_that_suits_them() {
        let texts = [0.2, 14.4, 89.0, 200.0, 5399.0, 9000.0].map(duration_text);
        assert_eq!(texts, ["1 s", "14 s", "89 s", "3 min", "90 min", "2.5 h"]);
    }
}
