//! Numbers as programs and people write them.

/// Parses a number, also with the sign of word processors (−) and with exponents of Fortran
/// (`1D-3`).
pub fn float(word: &str) -> Option<f64> {
    let parsed = word.parse().ok();
    parsed.or_else(|| {
        let is_fortran = word.contains(|c: char| c.is_ascii_digit());
        let exponent = |c: char| is_fortran && matches!(c, 'd' | 'D');
        word.replace('−', "-").replace(exponent, "e").parse().ok()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signs_and_exponents_of_other_programs_are_read() {
        for (word, value) in [
            ("-1.5", Some(-1.5)),
            ("−1.5", Some(-1.5)),
            ("1.5D-3", Some(0.0015)),
            ("2d2", Some(200.0)),
            ("d", None),
            ("1.5x", None),
            ("", None),
        ] {
            assert_eq!(float(word), value, "{word}");
        }
    }
}
