//! Matrices over several lines, as programs print them.

use super::float::float;
use std::borrow::Cow;

/// Rows of a 4 × 4 matrix.
const ROWS: usize = 4;

/// A text of nothing but several 4 × 4 matrices whose rows are lines of their own, with each matrix
/// on the line of its first row; numbers in brackets without these. A line of three integers may
/// precede each matrix, as in trajectories of Open3D (`.log`). Other texts, and the numbers of
/// lines, stay.
pub(super) fn on_one_line(text: &str) -> Cow<'_, str> {
    let text = without_brackets(text);
    let Some(rows) = rows(&text) else {
        return text;
    };
    let mut lines: Vec<String> = text.lines().map(|_| String::new()).collect();
    for matrix in rows.chunks(ROWS) {
        if let [(first, _), ..] = matrix {
            let words: Vec<&str> = matrix.iter().flat_map(|(_, words)| words.clone()).collect();
            lines[*first] = words.join(" ");
        }
    }
    Cow::Owned(lines.join("\n") + "\n")
}

/// The words of all lines that are not empty, with the places of these, if they are rows of 4 × 4
/// matrices of rigid motions.
fn rows(text: &str) -> Option<Vec<(usize, Vec<&str>)>> {
    let lines = text.lines().enumerate();
    let filled = lines.filter(|(_, line)| !line.trim().is_empty());
    let filled = filled.map(|(place, line)| (place, line.split_whitespace().collect()));
    let mut filled: Vec<(usize, Vec<&str>)> = filled.collect();
    let is_counter = |(_, words): &(usize, Vec<&str>)| {
        words.len() == 3 && words.iter().all(|word| word.parse::<usize>().is_ok())
    };
    if filled.iter().step_by(ROWS + 1).all(is_counter) {
        let mut place = 0..;
        filled.retain(|_| place.next().is_some_and(|place| place % (ROWS + 1) != 0));
    }
    let count = filled.len();
    let rows: Vec<(usize, Vec<&str>)> = filled
        .into_iter()
        .take_while(|(_, words)| words.len() == ROWS)
        .collect();
    let is_last = |words: &[&str]| {
        let numbers = words.iter().map(|word| float(word));
        numbers.eq([0.0, 0.0, 0.0, 1.0].map(Some))
    };
    let mut matrices = rows.chunks(ROWS);
    let are_matrices = rows.len() == count
        // A single matrix is one of a folder of such files, or a mount.
        && count > ROWS
        && matrices.all(|matrix| matrix.len() == ROWS && is_last(&matrix[ROWS - 1].1));
    are_matrices.then_some(rows)
}

/// A text of numbers in square brackets, each line of which begins with one, without brackets and
/// commas.
fn without_brackets(text: &str) -> Cow<'_, str> {
    let mut filled = text.lines().map(str::trim).filter(|line| !line.is_empty());
    let is_number = |c: char| c.is_ascii_digit() || "+-.eE, \t[]".contains(c);
    let is_list = filled.clone().next().is_some()
        && filled.all(|line| line.starts_with('[') && line.chars().all(is_number));
    if is_list {
        Cow::Owned(text.replace(['[', ']', ','], " "))
    } else {
        Cow::Borrowed(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BLOCK: &str = "1 0 0 5\n0 1 0 6\n0 0 1 7\n0 0 0 1\n";
    const LINE: &str = "1 0 0 5 0 1 0 6 0 0 1 7 0 0 0 1";

    #[test]
    fn a_matrix_stands_where_its_first_row_did() {
        let expected = format!("{LINE}\n\n\n\n\n{LINE}\n\n\n\n");
        assert_eq!(on_one_line(&format!("{BLOCK}\n{BLOCK}")), expected);
        let printed = "[[1. 0. 0. 5.]\n [0. 1. 0. 6.]\n [0. 0. 1. 7.]\n [0. 0. 0. 1.]]\n";
        let expected = format!("{}\n\n\n\n", LINE.replace(' ', ". ") + ".");
        assert_eq!(on_one_line(&printed.repeat(2)), expected.repeat(2));
    }

    #[test]
    fn counters_before_matrices_are_left_out() {
        let text = format!("0 0 1\n{BLOCK}1 1 2\n{BLOCK}");
        let expected = format!("\n{LINE}\n\n\n\n\n{LINE}\n\n\n\n");
        assert_eq!(on_one_line(&text), expected);
        let other = text.replace("1 1 2", "1 1 2.5");
        assert_eq!(on_one_line(&other), other);
    }

    #[test]
    fn other_texts_stay() {
        for text in [
            "",
            "1 0 0 5\n0 1 0 6\n",
            "0 0 0 0 0 0 0 1\n",
            BLOCK,
            "1 2 3 4\n1 2 3 4\n1 2 3 4\n1 2 3 4\n",
            "[{\"shots\": {}}]",
        ] {
            assert_eq!(on_one_line(text), text);
        }
        let list = "[0.0, 1.5, -2e-3]\n";
        let words: Vec<String> = on_one_line(list)
            .split_whitespace()
            .map(str::to_owned)
            .collect();
        assert_eq!(words, ["0.0", "1.5", "-2e-3"]);
    }
}
