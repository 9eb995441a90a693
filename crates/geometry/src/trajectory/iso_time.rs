//! Dates and times of day as ISO 8601 writes them.

/// Days from 1970-01-01 to 0000-03-01, negative, of the proleptic Gregorian calendar.
const EPOCH_FROM_MARCH_0_DAYS: i64 = 719_468;
/// Days of 400 years.
const ERA_DAYS: i64 = 146_097;
/// Seconds of a day.
pub const DAY_S: f64 = 86_400.0;

/// The seconds since 1970 of a date with a time of day, as `2026-11-25T08:47:38.123Z`, or since
/// midnight of a time of day alone, as `08:47:38.123`; `None` for everything else.
///
/// A blank or `_` may stand for the `T`, and a zone as `+01:00` for the `Z`; without one it is UTC.
pub fn seconds(word: &str) -> Option<f64> {
    let Some((date, time)) = word.split_once(['T', 't', ' ', '_']) else {
        return time_of_day_s(word);
    };
    let (time, zone_s) = split_zone(time)?;
    let mut parts = date.splitn(3, '-');
    let mut number = |digits: usize| digits_of(parts.next()?, digits);
    let (year, month, day) = (number(4)?, number(2)?, number(2)?);
    let is_date = (1..=12).contains(&month) && (1..=31).contains(&day);
    let days = days_since_1970(year, month, day);
    is_date.then_some(days as f64 * DAY_S - zone_s + time_of_day_s(time)?)
}

/// A time of day and the seconds that its zone is ahead of UTC.
fn split_zone(time: &str) -> Option<(&str, f64)> {
    if let Some(time) = time.strip_suffix(['Z', 'z']) {
        return Some((time, 0.0));
    }
    let Some(at) = time.find(['+', '-']) else {
        return Some((time, 0.0));
    };
    let (time, zone) = time.split_at(at);
    let sign = if zone.starts_with('-') { -1.0 } else { 1.0 };
    let digits: String = zone[1..].chars().filter(|c| *c != ':').collect();
    let (hours, minutes) = digits.split_at_checked(2)?;
    let minutes = if minutes.is_empty() { "00" } else { minutes };
    let (hours, minutes) = (digits_of(hours, 2)?, digits_of(minutes, 2)?);
    Some((time, sign * (hours * 3600 + minutes * 60) as f64))
}

/// Seconds since midnight of `hh:mm:ss`, which may have decimals.
fn time_of_day_s(word: &str) -> Option<f64> {
    let mut parts = word.splitn(3, ':');
    let hours = digits_of(parts.next()?, 2)?;
    let minutes = digits_of(parts.next()?, 2)?;
    let seconds = parts.next()?;
    digits_of(seconds.get(..2)?, 2)?;
    let is_decimal = |c: char| c.is_ascii_digit() || c == '.';
    let seconds = seconds.chars().all(is_decimal).then_some(seconds)?;
    let seconds: f64 = seconds.parse().ok()?;
    // A leap second is the last of its minute.
    let is_time = hours < 24 && minutes < 60 && seconds < 61.0;
    is_time.then_some((hours * 3600 + minutes * 60) as f64 + seconds)
}

/// The number that so many digits are.
fn digits_of(word: &str, digits: usize) -> Option<i64> {
    let is_number = word.len() == digits && word.bytes().all(|byte| byte.is_ascii_digit());
    is_number.then(|| word.parse().ok()).flatten()
}

/// Days from 1970-01-01 to a date. Years begin in March, so that the leap day is their last.
///
/// Source: H. Hinnant, "chrono-compatible low-level date algorithms", `days_from_civil`.
fn days_since_1970(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let (era, of_era) = (year.div_euclid(400), year.rem_euclid(400));
    let of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let day_of_era = of_era * 365 + of_era / 4 - of_era / 100 + of_year;
    era * ERA_DAYS + day_of_era - EPOCH_FROM_MARCH_0_DAYS
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
            ("2024-02-29T12:00:00+00", 1709208000.0),
            ("2000-03-01T00:00:00Z", 951868800.0),
            ("08:47:38.25", 31658.25),
            ("23:59:59", 86399.0),
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
            "26-11-25T00:00:00Z",
            "8:47:38",
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
