//! Numbers as text for readers.

/// Formats a number with about `digits` significant digits, without exponent, with a true minus
/// sign; NaN and infinity are a dash.
pub fn significant(value: f64, digits: i32) -> String {
    if !value.is_finite() {
        return "–".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    let decimals = (digits - 1 - magnitude).clamp(0, 9) as usize;
    minus(format!("{value:.decimals$}"))
}

/// Formats a number with `decimals` decimals.
pub fn fixed(value: f64, decimals: usize) -> String {
    minus(format!("{value:.decimals$}"))
}

/// Formats a number with three significant digits.
pub fn short(value: f64) -> String {
    significant(value, 3)
}

/// Formats a number that may be missing with three significant digits.
pub fn maybe(value: Option<f64>) -> String {
    value.map_or_else(|| "–".to_owned(), short)
}

/// Formats a count with thin spaces between thousands.
pub fn count(value: usize) -> String {
    let digits = value.to_string();
    let mut text = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) && digits.len() > 4 {
            text.push('\u{202f}');
        }
        text.push(digit);
    }
    text
}

fn minus(text: String) -> String {
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("−{rest}"),
        None => text,
    }
}

/// Unit of length for values up to `max_m`, and the factor from metres to it.
pub fn length_unit(max_m: f64) -> (&'static str, f64) {
    match max_m {
        m if m >= 1.0 => ("m", 1.0),
        _ => ("mm", 1e3),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short_and_have_no_exponents() {
        for (value, text) in [
            (0.000123456, "0.000123"),
            (28.713, "28.7"),
            (-731.49, "−731"),
            (12345.6, "12346"),
            (0.0, "0"),
            (f64::NAN, "–"),
        ] {
            assert_eq!(short(value), text);
        }
        assert_eq!(fixed(-0.0004, 2), "0.00");
        assert_eq!(maybe(None), "–");
        assert_eq!(count(1234567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(9999), "9999");
    }

    #[test]
    fn lengths_have_the_unit_that_suits_them() {
        assert_eq!(length_unit(12.0).0, "m");
        assert_eq!(length_unit(0.3), ("mm", 1e3));
    }
}
