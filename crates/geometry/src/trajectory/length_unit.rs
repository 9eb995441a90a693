//! Units that lengths of poses and tunnels are given in.

/// A unit of length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LengthUnit {
    /// Name in a sentence, plural: `millimetres`.
    pub name: &'static str,
    /// Its length, metres.
    pub length_m: f64,
    /// Other words for it in titles of columns, in lower case.
    words: &'static [&'static str],
}

impl LengthUnit {
    const METRES: Self = Self::new("metres", 1.0, &["m", "metre"]);

    /// Units that are found in place of metres.
    pub const OTHERS: [Self; 5] = [
        Self::new("millimetres", 0.001, &["mm"]),
        Self::new("centimetres", 0.01, &["cm"]),
        Self::new("inches", 0.0254, &["in", "inch"]),
        Self::new("feet", 0.3048, &["ft", "foot"]),
        Self::new("kilometres", 1000.0, &["km"]),
    ];

    /// The unit of a name, in British or American spelling, or of an abbreviation, in upper or
    /// lower case.
    pub fn of_word(word: &str) -> Option<Self> {
        let word = word.to_lowercase().replace("meter", "metre");
        let mut units = [Self::METRES].into_iter().chain(Self::OTHERS);
        units.find(|unit| unit.name == word || unit.words.contains(&word.as_str()))
    }

    const fn new(name: &'static str, length_m: f64, words: &'static [&'static str]) -> Self {
        Self {
            name,
            length_m,
            words,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_have_units() {
        for (word, length_m) in [
            ("m", Some(1.0)),
            ("Meters", Some(1.0)),
            ("MM", Some(0.001)),
            ("inches", Some(0.0254)),
            ("deg", None),
            ("", None),
        ] {
            let unit = LengthUnit::of_word(word);
            assert_eq!(unit.map(|unit| unit.length_m), length_m, "{word}");
        }
    }
}
