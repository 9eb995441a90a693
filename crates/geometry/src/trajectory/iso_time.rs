//! Dates and times of day as ISO 8601 writes them.

use chrono::{DateTime, NaiveDateTime, NaiveTime, Timelike};

/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// Length of `2026-11-25`; a year of two digits would be one of antiquity.
const DATE_DIGITS: usize = 10;
const TIME_OF_DAY: &str = "%H:%M:%S%.f";
const DATE_AND_TIME: &str = "%Y-%m-%dT%H:%M:%S%.f";
const WITH_ZONE: &str = "%Y-%m-%dT%H:%M:%S%.f%#z";

/// The seconds since 1970 of a date with a time of day, as `2026-11-25T08:47:38.123Z`, or since
/// midnight of a time of day alone, as `08:47:38.123`; `None` for everything else.
///
/// A blank or `_` may stand for the `T`, and a zone as `+01:00` for the `Z`; without one it is UTC.
pub fn seconds(word: &str) -> Option<f64> {
    let with_slashes = slashed_date(word);
    let parts = with_slashes.as_ref().map(|(date, time)| (&**date, *time));
    let Some((date, time)) = parts.or_else(|| word.split_once(['T', 't', ' ', '_'])) else {
        let time = NaiveTime::parse_from_str(word, TIME_OF_DAY).ok()?;
        return Some(f64::from(time.num_seconds_from_midnight()) + decimals(time.nanosecond()));
    };
    if date.len() != DATE_DIGITS {
        return None;
    }
    let word = format!("{date}T{time}");
    let without_zone = || NaiveDateTime::parse_from_str(&word, DATE_AND_TIME);
    let utc = match DateTime::parse_from_str(&word, WITH_ZONE) {
        Ok(zoned) => zoned.to_utc(),
        Err(_) => without_zone().ok()?.and_utc(),
    };
    Some(utc.timestamp() as f64 + decimals(utc.timestamp_subsec_nanos()))
}

/// Date and time of `2026/11/25/08:47:38.123`, as rosbag_to_csv writes it, or with a blank between.
fn slashed_date(word: &str) -> Option<(String, &str)> {
    let (date, time) = word.split_at_checked(DATE_DIGITS)?;
    let time = time.strip_prefix(['/', ' ', 'T', '_'])?;
    (date.matches('/').count() == 2).then(|| (date.replace('/', "-"), time))
}

/// Nanoseconds in seconds: more than one in a leap second, which is the last of its minute.
fn decimals(nanoseconds: u32) -> f64 {
    f64::from(nanoseconds) / 1e9
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Seconds as `date --date=… +%s` prints them.
    #[test]
    fn dates_are_seconds_since_1970() {
        for (word, expected_s) in [
            ("1970-01-01T00:00:00Z", 0.0),
            ("2026-11-25T08:47:38.123Z", 1795596458.123),
            ("2026-11-25T08:47:38.123", 1795596458.123),
            ("2026-11-25 09:47:38.5+01:00", 1795596458.5),
            ("2026-11-25_05:47:38-0300", 1795596458.0),
            ("2026/11/25/08:47:38.123", 1795596458.123),
            ("2026/11/25 08:47:38.5", 1795596458.5),
            ("2024-02-29T12:00:00+00", 1709208000.0),
            ("2000-03-01T00:00:00Z", 951868800.0),
            ("08:47:38.25", 31658.25),
            ("23:59:59", 86399.0),
            ("8:47:38", 31658.0),
            ("2016-12-31T23:59:60.5Z", 1483228800.5),
        ] {
            assert_eq!(seconds(word), Some(expected_s), "{word}");
        }
    }

    #[test]
    fn everything_else_is_no_date() {
        for word in [
            "",
            "12",
            "1.5",
            "2026-11-25",
            "2026-13-25T00:00:00Z",
            "2026-02-30T00:00:00Z",
            "26-11-25T00:00:00Z",
            "25/11/2026 08:47:38",
            "08:47",
            "24:00:00",
            "08:61:00",
            "08:47:38.1.2",
            "08:47:-8",
            "2026-11-25T08:47:38+1",
            "08:47:é8",
            "inf",
            "a:b:c",
        ] {
            assert_eq!(seconds(word), None, "{word}");
        }
    }
}
