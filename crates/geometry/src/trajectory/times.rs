//! Times in text: seconds, or nanoseconds as whole numbers, unless another unit is given.

use super::nanoseconds::from_nanoseconds;
use super::time_unit::TimeUnit;

/// Smallest number of digits of a whole number that is read as nanoseconds: nanoseconds since 1970
/// have 19 digits from 2001 on, and no clock counts that many seconds.
pub const MIN_NANOSECOND_DIGITS: usize = 16;

/// Number of digits of milliseconds since 1970, from 2001 to 2286; counters of frames have fewer.
const MILLISECOND_DIGITS: usize = 13;

/// Smallest number with so many digits.
const MIN_NANOSECONDS: f64 = 1e15;

/// Converts a number to seconds: it is in `unit`; without one, numbers of 16 digits and more before
/// the decimal point are nanoseconds, everything else is seconds. `None` if it is not a finite
/// number.
pub fn from_word(word: &str, unit: Option<TimeUnit>) -> Option<f64> {
    if let Some(unit) = unit {
        return unit.seconds(word);
    }
    let is_whole = !word.is_empty() && word.bytes().all(|byte| byte.is_ascii_digit());
    if is_whole && word.len() >= MIN_NANOSECOND_DIGITS {
        return from_nanoseconds(word).ok();
    }
    let number = word.parse::<f64>().ok().filter(|value| value.is_finite())?;
    if number < MIN_NANOSECONDS {
        return Some(number);
    }
    let is_countable = number <= i64::MAX as f64;
    let rounded = is_countable.then_some(number * 1e-9);
    from_nanoseconds(word).ok().or(rounded)
}

/// The time in a file's name (without its extension): its last number, in `unit`. Without one, that
/// must have a decimal point (seconds), ten digits (seconds since 1970), 13 (milliseconds since
/// 1970) or 16 and more (nanoseconds); other numbers are treated as counters.
pub fn from_name(stem: &str, unit: Option<TimeUnit>) -> Option<f64> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|c: char| !is_part(c)).map_or(0, |at| {
        at + stem[at..].chars().next().map_or(1, char::len_utf8)
    });
    let word = stem[begin..end].trim_start_matches('.');
    let unit = match (unit, word.len()) {
        (None, MILLISECOND_DIGITS) if !word.contains('.') => Some(TimeUnit::Ms),
        _ => unit,
    };
    let is_time = unit.is_some()
        || word.contains('.')
        || word.len() == 10
        || word.len() >= MIN_NANOSECOND_DIGITS;
    is_time.then(|| from_word(word, unit)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_numbers_of_many_digits_are_nanoseconds() {
        assert_eq!(
            from_word("1403636579763555584", None),
            Some(1403636579.7635555)
        );
        assert_eq!(from_word("1305031102.1753", None), Some(1305031102.1753));
        assert_eq!(from_word("12", None), Some(12.0));
        assert_eq!(from_word("1e3", None), Some(1000.0));
        assert_eq!(from_word("inf", None), None);
        assert_eq!(from_word("99999999999999999999999", None), None);
        assert_eq!(from_nanoseconds("-500000000"), Ok(-0.5));
        assert!(from_nanoseconds("1.5").is_err());
        assert!(from_nanoseconds("e5").is_err());
    }

    #[test]
    fn nanoseconds_may_have_decimals_and_an_exponent() {
        let time_s = from_word("1403636579763555584", None);
        for word in [
            "1403636579763555584.000000",
            "1.403636579763555584e+18",
            "1.403636579763555584000000E18",
        ] {
            assert_eq!(from_word(word, None), time_s, "{word}");
            assert_eq!(from_nanoseconds(word).ok(), time_s, "{word}");
        }
        let near_s = from_word("1403636579763555584.25", None).unwrap();
        assert!((near_s - time_s.unwrap()).abs() < 1e-6);
        assert_eq!(from_word("1.5e30", None), None);
        assert_eq!(from_word("1e999999999", None), None);
    }

    #[test]
    fn names_tell_times_and_counters_do_not() {
        for (stem, time_s) in [
            ("1403636579763555584", Some(1403636579.7635555)),
            ("cam0_1305031102.175304", Some(1305031102.175304)),
            ("1305031102", Some(1305031102.0)),
            ("left-12.5-rect", Some(12.5)),
            ("IMG_1403636579763", Some(1403636579.763)),
            ("20140624210259", None),
            ("000017", None),
            ("ärger", None),
            ("é1305031102", Some(1305031102.0)),
            ("1.2.3", None),
            ("", None),
        ] {
            assert_eq!(from_name(stem, None), time_s, "{stem}");
        }
        let of_unit = |stem, unit| from_name(stem, Some(unit));
        assert_eq!(of_unit("f_000250", TimeUnit::Ms), Some(0.25));
        assert_eq!(
            of_unit("1418381798086398", TimeUnit::Us),
            Some(1418381798.086398)
        );
        assert_eq!(of_unit("frame", TimeUnit::Us), None);
    }
}
