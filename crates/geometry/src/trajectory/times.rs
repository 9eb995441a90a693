//! Times in text: seconds, or nanoseconds as whole numbers.

/// Smallest number of digits of a whole number that is read as nanoseconds: nanoseconds since 1970
/// have 19 digits from 2001 on, and no clock counts that many seconds.
pub const MIN_NANOSECOND_DIGITS: usize = 16;

/// Converts a whole number of nanoseconds to seconds.
///
/// A double holds times since 1970 to a quarter of a microsecond.
pub fn from_nanoseconds(word: &str) -> Result<f64, String> {
    let nanoseconds: i64 = word
        .parse()
        .map_err(|_| format!("`{word}` is not a whole number of nanoseconds"))?;
    let (seconds, rest) = (
        nanoseconds.div_euclid(1_000_000_000),
        nanoseconds.rem_euclid(1_000_000_000),
    );
    Ok(seconds as f64 + rest as f64 * 1e-9)
}

/// Converts a number to seconds: whole numbers of 16 digits and more are nanoseconds, everything
/// else is seconds. `None` if it is not a finite number.
pub fn from_word(word: &str) -> Option<f64> {
    let is_whole = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
    if is_whole && word.len() >= MIN_NANOSECOND_DIGITS {
        return from_nanoseconds(word).ok();
    }
    word.parse::<f64>().ok().filter(|time_s| time_s.is_finite())
}

/// The time in a file's name (without its extension): its last number, if that has a decimal point
/// (seconds), ten digits (seconds since 1970) or 16 and more (nanoseconds). Other numbers are
/// treated as counters.
pub fn from_name(stem: &str) -> Option<f64> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|c: char| !is_part(c)).map_or(0, |at| {
        at + stem[at..].chars().next().map_or(1, char::len_utf8)
    });
    let word = stem[begin..end].trim_start_matches('.');
    let is_time = word.contains('.') || word.len() == 10 || word.len() >= MIN_NANOSECOND_DIGITS;
    is_time.then(|| from_word(word)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_of_many_digits_are_nanoseconds() {
        assert_eq!(from_word("1403636579763555584"), Some(1403636579.7635555));
        assert_eq!(from_word("1305031102.1753"), Some(1305031102.1753));
        assert_eq!(from_word("12"), Some(12.0));
        assert_eq!(from_word("1e3"), Some(1000.0));
        assert_eq!(from_word("inf"), None);
        assert_eq!(from_word("99999999999999999999999"), None);
        assert_eq!(from_nanoseconds("-500000000"), Ok(-0.5));
        assert!(from_nanoseconds("1.5").is_err());
    }

    #[test]
    fn names_tell_times_and_counters_do_not() {
        for (stem, time_s) in [
            ("1403636579763555584", Some(1403636579.7635555)),
            ("cam0_1305031102.175304", Some(1305031102.175304)),
            ("1305031102", Some(1305031102.0)),
            ("left-12.5-rect", Some(12.5)),
            ("000017", None),
            ("ärger", None),
            ("é1305031102", Some(1305031102.0)),
            ("1.2.3", None),
            ("", None),
        ] {
            assert_eq!(from_name(stem), time_s, "{stem}");
        }
    }
}
