//! Whole numbers of nanoseconds in text.

/// Converts a whole number of nanoseconds to seconds; it may have decimals that are zeros, and an
/// exponent.
///
/// A double holds times since 1970 to a quarter of a microsecond.
pub fn from_nanoseconds(word: &str) -> Result<f64, String> {
    let nanoseconds = whole_number(word)
        .ok_or_else(|| format!("`{word}` is not a whole number of nanoseconds"))?;
    let (seconds, rest) = (
        nanoseconds.div_euclid(1_000_000_000),
        nanoseconds.rem_euclid(1_000_000_000),
    );
    Ok(seconds as f64 + rest as f64 * 1e-9)
}

/// The whole number that a text such as `15`, `15.00` or `1.5e1` has exactly.
fn whole_number(word: &str) -> Option<i64> {
    let (mantissa, exponent) = match word.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i32>().ok()?),
        None => (word, 0),
    };
    let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let has_digits = mantissa.bytes().any(|byte| byte.is_ascii_digit());
    if !(has_digits && decimals.bytes().all(|byte| byte.is_ascii_digit())) {
        return None;
    }
    let decimals = decimals.trim_end_matches('0');
    let zeros = usize::try_from(exponent)
        .ok()?
        .checked_sub(decimals.len())?;
    // More digits than an i64 has.
    if zeros > 19 {
        return None;
    }
    format!("{whole}{decimals}{}", "0".repeat(zeros))
        .parse()
        .ok()
}
