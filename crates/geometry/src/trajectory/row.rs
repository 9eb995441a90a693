//! Rows of numbers in files without a header.

use super::csv::is_picture_name;
use super::float::float;
use super::text;
use std::borrow::Cow;

/// The words of a row but for the name of a picture, if one of them is one.
pub(super) struct NamedRow<'a> {
    /// The name of the frame.
    pub name: Option<String>,
    /// The other words.
    pub words: Vec<Cow<'a, str>>,
}

impl<'a> NamedRow<'a> {
    /// Splits a row as [`words`] does.
    ///
    /// # Errors
    /// Those of [`words`].
    pub fn of(line: &'a str) -> Result<Self, String> {
        let mut words = words(line)?;
        let is_name = |word: &Cow<'_, str>| float(word).is_none() && is_picture_name(word);
        let place = words.iter().position(is_name);
        let name = place.map(|place| words.remove(place).into_owned());
        Ok(Self { name, words })
    }
}

/// Splits a row into its words, whose numbers have decimal points.
///
/// Semicolons separate, else tabs, else commas, each with or without blanks, else blanks alone.
/// Commas are decimal where semicolons or tabs separate, and where blanks do because there is one
/// within each number. Words may stand in quotes. What follows a blank and # is a comment.
///
/// # Errors
/// Nothing between two separators other than tabs, where numbers would move to the left.
pub(super) fn words(line: &str) -> Result<Vec<Cow<'_, str>>, String> {
    let line = [" #", "\t#"].iter().fold(line, |line, mark| {
        line.split_once(mark).map_or(line, |(row, _)| row)
    });
    let separators = [b';', b'\t', b','];
    let separator = separators
        .into_iter()
        .find(|separator| line.as_bytes().contains(separator))
        .filter(|separator| *separator != b',' || !has_decimal_commas(line))
        .unwrap_or(b' ');
    let columns: Vec<&str> = line.split(char::from(separator)).collect();
    let is_gap = |(index, column): (usize, &&str)| {
        column.trim().is_empty() && index + 1 < columns.len() && !b"\t ".contains(&separator)
    };
    if let Some(gap) = columns.iter().enumerate().position(is_gap) {
        return Err(format!(
            "column {} is empty; every row has all numbers, and rows above a table or below it, as \
             titles and sums, are to be deleted",
            gap + 1
        ));
    }
    let words = columns.into_iter().flat_map(str::split_whitespace);
    let words = words.map(unquoted);
    Ok(words
        .map(|word| text::with_decimal_point(word, separator))
        .collect())
}

/// True if blanks separate numbers that all have a decimal comma.
fn has_decimal_commas(line: &str) -> bool {
    let is_decimal = |word: &str| {
        let number = text::with_decimal_point(word, b' ');
        word.matches(',').count() == 1 && float(&number).is_some()
    };
    let mut words = line.split_whitespace();
    line.contains(char::is_whitespace) && words.all(is_decimal)
}

/// A word without the quotes around it.
fn unquoted(word: &str) -> &str {
    let inner = word
        .strip_prefix('"')
        .and_then(|rest| rest.strip_suffix('"'));
    inner.unwrap_or(word)
}

/// Splits a row into exactly N words; `form` describes them for the error message.
pub(super) fn exact_words<'a, const N: usize>(
    line: &'a str,
    form: &str,
) -> Result<[Cow<'a, str>; N], String> {
    let words = words(line)?;
    let count = words.len();
    <[Cow<'a, str>; N]>::try_from(words)
        .map_err(|_| format!("{count} columns where `{form}` has {N}"))
}

/// Parses exactly N numbers; `form` describes them for the error message.
pub(super) fn numbers<const N: usize>(line: &str, form: &str) -> Result<[f64; N], String> {
    let words: [Cow<'_, str>; N] = exact_words(line, form)?;
    let mut values = [0.0; N];
    for (value, word) in values.iter_mut().zip(&words) {
        *value = text::number(word, form)?;
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_have_any_separator() {
        for line in [
            "0.5 -1 2e3",
            "0.5\t-1\t\t2e3",
            "0.5 \t-1 2e3",
            "0.5,-1,2e3",
            "0.5, -1 , 2e3,",
            "0.5;-1;2e3",
            "0,5; -1; 2e3;",
            "0,5\t-1\t2e3",
            "0,5;−1;2.000,0",
            "0.5 -1 2D3",
            "\"0.5\",\"-1\",\"2e3\"",
            "0,5 -1,0 2000,0",
            "0.5 -1 2e3 # a note, with 1 number",
        ] {
            assert_eq!(numbers(line, "a b c"), Ok([0.5, -1.0, 2e3]), "{line}");
        }
    }

    #[test]
    fn what_is_ambiguous_is_refused() {
        for (line, expected) in [
            ("0,5 -1 2,0", "5 columns where `a b c` has 3"),
            ("0.5,,-1,2", "column 2 is empty"),
            (";1;2;3", "column 1 is empty"),
            ("1.00,5;1;2", "`1.00,5` is not a number"),
            ("1,000,5;1;2", "`1,000,5` is not a number"),
        ] {
            let message = numbers::<3>(line, "a b c").unwrap_err();
            assert!(message.contains(expected), "{line}: {message}");
        }
    }

    #[test]
    fn the_name_of_a_picture_is_no_number() {
        for line in ["a 1.png 0 1", "0,a.JPG,1", "0;1;b/a.tif"] {
            let row = NamedRow::of(line).unwrap();
            assert!(row.name.is_some(), "{line}");
        }
        for line in ["0 1 2", "0 1.5 x", "0 1 x.txt"] {
            assert_eq!(NamedRow::of(line).unwrap().name, None, "{line}");
        }
    }
}
