//! Times in text: in a given unit, or in that which their digits tell; or dates.

use super::float::float;
use super::iso_time;
use super::time_unit::TimeUnit;

/// Smallest number of digits of a whole number that is nanoseconds since 1970, or of a computer's
/// start: no clock counts that many of another unit.
pub const MIN_NANOSECOND_DIGITS: usize = 17;

/// The unit in which a number is a time since 1970: seconds have 10 digits before the decimal point
/// from 2001 to 2286, milliseconds 13 and microseconds 16; 17 and more are nanoseconds. All other
/// numbers are seconds, of a clock or a counter that started with a recording.
fn unit_since_1970(number: f64) -> TimeUnit {
    match number {
        1e12..1e13 => TimeUnit::Ms,
        1e15..1e16 => TimeUnit::Us,
        1e16.. => TimeUnit::Ns,
        _ => TimeUnit::S,
    }
}

/// Converts a time to seconds: a number in `unit` or, without one, in that which its digits tell;
/// or a date or a time of day of ISO 8601. `None` if it is neither.
pub fn from_word(word: &str, unit: Option<TimeUnit>) -> Option<f64> {
    if let Some(unit) = unit {
        return unit.seconds(word);
    }
    let Some(number) = float(word) else {
        return iso_time::seconds(word);
    };
    let is_time = number.is_finite() && number <= i64::MAX as f64;
    is_time
        .then(|| unit_since_1970(number).seconds(word))
        .flatten()
}

/// The time in a file's name (without its extension): its last number, in `unit`. Without one, that
/// must have a decimal point (seconds) or the digits of a time since 1970: ten (seconds), 13
/// (milliseconds), 16 (microseconds) or more (nanoseconds); other numbers are treated as counters.
pub fn from_name(stem: &str, unit: Option<TimeUnit>) -> Option<f64> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.';
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end].rfind(|c: char| !is_part(c)).map_or(0, |at| {
        at + stem[at..].chars().next().map_or(1, char::len_utf8)
    });
    let word = stem[begin..end].trim_start_matches('.');
    let has_digits = matches!(word.len(), 10 | 13 | 16 | MIN_NANOSECOND_DIGITS..);
    let is_time = unit.is_some() || word.contains('.') || has_digits;
    is_time.then(|| from_word(word, unit)).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::nanoseconds::from_nanoseconds;

    /// One time since 1970 in every unit, and numbers that are none.
    #[test]
    fn the_digits_of_a_time_since_1970_tell_its_unit() {
        for word in [
            "1403636579.75",
            "1403636579750",
            "1403636579750.0",
            "1403636579750000",
            "1.40363657975e15",
            "1403636579750000000",
            "2014-06-24T19:02:59.75Z",
        ] {
            assert_eq!(from_word(word, None), Some(1403636579.75), "{word}");
        }
        for (word, time_s) in [
            ("0.00000125", 0.00000125),
            ("17", 17.0),
            ("-3.5", -3.5),
            ("86399.999", 86399.999),
            ("20261125084738", 20261125084738.0),
            ("999999999999", 999999999999.0),
        ] {
            assert_eq!(from_word(word, None), Some(time_s), "{word}");
        }
        // A computer that has run for four months.
        assert_eq!(from_word("10368000000000000", None), Some(10368000.0));
    }

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
            ("f_1403636579763555", Some(1403636579.763555)),
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
