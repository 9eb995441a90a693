//! Numbers of calibration files that are tables of words.

use super::error::ParseError;

/// The lines with content and their 1-based numbers.
pub fn filled_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines = text.lines().enumerate();
    lines
        .map(|(index, line)| (index + 1, line.trim()))
        .filter(|(_, line)| !line.is_empty())
}

/// The lines with content that are no comments, which begin with #, and their 1-based numbers.
pub fn data_lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    filled_lines(text).filter(|(_, line)| !line.starts_with('#'))
}

/// The finite number that a word of a line is.
pub fn finite(word: &str, line: usize) -> Result<f64, ParseError> {
    let value = word.parse::<f64>().ok().filter(|value| value.is_finite());
    value.ok_or_else(|| ParseError::at(line, format!("{word:?} is not a number")))
}

/// As many finite numbers as a line must have; `form` describes it for the error message.
pub fn exactly<const N: usize>(
    (line, text): (usize, &str),
    form: &str,
) -> Result<[f64; N], ParseError> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let words = <[&str; N]>::try_from(words).map_err(|words| {
        let what = format!("{} numbers where {form} has {N}", words.len());
        ParseError::at(line, what)
    })?;
    let mut values = [0.0; N];
    for (value, word) in values.iter_mut().zip(words) {
        *value = finite(word, line)?;
    }
    Ok(values)
}
