//! Units of times in files and names.

use super::float::float;
use super::nanoseconds::from_nanoseconds;
use serde::{Deserialize, Serialize};

/// Unit of the times in a file or in names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// All units, the one that is given by mistake most often first.
    pub const ALL: [Self; 4] = [Self::Ms, Self::Us, Self::Ns, Self::S];

    /// The name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
        }
    }

    /// The name in sentences.
    pub fn plural(self) -> &'static str {
        match self {
            Self::S => "seconds",
            Self::Ms => "milliseconds",
            Self::Us => "microseconds",
            Self::Ns => "nanoseconds",
        }
    }

    /// True for a symbol or a name of the unit, in lower case.
    pub fn is_called(self, word: &str) -> bool {
        let symbols: &[&str] = match self {
            Self::S => &["s", "sec", "seconds"],
            Self::Ms => &["ms", "msec", "milliseconds"],
            Self::Us => &["us", "µs", "μs", "usec", "microseconds"],
            Self::Ns => &["ns", "nsec", "nanoseconds"],
        };
        symbols.contains(&word)
    }

    /// Converts a number to seconds; `None` if it is not a finite number.
    pub fn seconds(self, word: &str) -> Option<f64> {
        let number = float(word).filter(|value| value.is_finite())?;
        Some(match self {
            Self::S => number,
            Self::Ms => number / 1e3,
            Self::Us => number / 1e6,
            Self::Ns => from_nanoseconds(word).unwrap_or(number / 1e9),
        })
    }

    /// The unit that the first comment with one in brackets names, as `# timestamp [ns]`; seconds
    /// are no news.
    pub fn of_comments(text: &str) -> Option<Self> {
        let comments = text
            .lines()
            .filter(|line| line.trim_start().starts_with('#'));
        let in_brackets = comments.flat_map(|line| {
            let words = line.split('[').skip(1);
            words.filter_map(|word| word.split_once(']').map(|(unit, _)| unit.trim()))
        });
        let units = [Self::Ms, Self::Us, Self::Ns];
        let of_word = |word: &str| {
            let word = word.to_lowercase();
            units.into_iter().find(|unit| unit.is_called(&word))
        };
        in_brackets.filter_map(of_word).next()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_unit_is_read_in_seconds() {
        for (unit, word) in [
            (TimeUnit::S, "1403636579.75"),
            (TimeUnit::Ms, "1403636579750"),
            (TimeUnit::Us, "1.40363657975e15"),
            (TimeUnit::Ns, "1403636579750000000"),
        ] {
            assert_eq!(unit.seconds(word), Some(1403636579.75), "{word}");
            assert!(unit.is_called(unit.name()) && unit.is_called(unit.plural()));
            assert_eq!(unit.seconds("x"), None);
            assert_eq!(unit.seconds("inf"), None);
        }
    }

    #[test]
    fn comments_name_units_in_brackets() {
        for (text, unit) in [
            ("#timestamp [ns],filename\n1,a.png\n", Some(TimeUnit::Ns)),
            ("1 2\n# t[us] tx [m]\n", Some(TimeUnit::Us)),
            ("# t [m] [µs] [ms]\n", Some(TimeUnit::Us)),
            ("# t [s] [\n1 [ms]\n", None),
            ("", None),
        ] {
            assert_eq!(TimeUnit::of_comments(text), unit, "{text}");
        }
    }
}
