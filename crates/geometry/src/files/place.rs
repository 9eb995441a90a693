//! Places in texts.

/// The line and the column of byte `at` of a text, both from 1; columns are bytes.
pub fn line_and_column(text: &str, at: usize) -> [usize; 2] {
    let before = &text.as_bytes()[..at.min(text.len())];
    let lines = before.iter().filter(|byte| **byte == b'\n').count();
    let line_start = before.iter().rposition(|byte| *byte == b'\n');
    let start = line_start.map_or(0, |newline| newline + 1);
    [1 + lines, 1 + before.len() - start]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_columns_begin_at_one() {
        let text = "ab\n\ncd";
        let places = [0, 1, 2, 3, 4, 5, 99].map(|at| line_and_column(text, at));
        let expected = [[1, 1], [1, 2], [1, 3], [2, 1], [3, 1], [3, 2], [3, 3]];
        assert_eq!(places, expected);
    }
}
