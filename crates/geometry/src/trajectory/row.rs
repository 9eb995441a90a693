//! Rows of numbers in files without a header.

use super::text;
use std::borrow::Cow;

/// Splits a row into its words, whose numbers have decimal points.
///
/// Semicolons separate, else tabs, else commas, each with or without blanks, else blanks alone.
/// Commas are decimal where semicolons or tabs separate. Words may stand in quotes.
///
/// # Errors
/// Nothing between two separators other than tabs, where numbers would move to the left.
pub(super) fn words(line: &str) -> Result<Vec<Cow<'_, str>>, String> {
    let separators = [b';', b'\t', b','];
    let separator = separators
        .into_iter()
        .find(|separator| line.as_bytes().contains(separator))
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
        ] {
            assert_eq!(numbers(line, "a b c"), Ok([0.5, -1.0, 2e3]), "{line}");
        }
    }

    #[test]
    fn what_is_ambiguous_is_refused() {
        for (line, expected) in [
            ("0,5 -1,0 2,0", "6 columns where `a b c` has 3"),
            ("0.5,,-1,2", "column 2 is empty"),
            (";1;2;3", "column 1 is empty"),
            ("1.00,5;1;2", "`1.00,5` is not a number"),
            ("1,000,5;1;2", "`1,000,5` is not a number"),
        ] {
            let message = numbers::<3>(line, "a b c").unwrap_err();
            assert!(message.contains(expected), "{line}: {message}");
        }
    }
}
