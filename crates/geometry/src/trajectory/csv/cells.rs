//! Cells of tables: names and texts that no spreadsheet runs as a formula.

use std::borrow::Cow;

/// A text as a cell of a table: one that a spreadsheet would run as a formula gets an apostrophe in
/// front, and so does one that has it already; [`from_cell`] takes it away.
pub fn to_cell(text: &str) -> Cow<'_, str> {
    if is_formula(text.trim_start_matches('\'')) {
        Cow::Owned(format!("'{text}"))
    } else {
        Cow::Borrowed(text)
    }
}

/// The text of a cell that [`to_cell`] has made.
pub fn from_cell(cell: &str) -> &str {
    match cell.strip_prefix('\'') {
        Some(text) if is_formula(text.trim_start_matches('\'')) => text,
        _ => cell,
    }
}

/// True for a text that spreadsheets take for a formula.
fn is_formula(text: &str) -> bool {
    text.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

/// The name of a frame as a cell. One with blanks at an end, which readers of tables take away,
/// gets an apostrophe at both, and so does one that has them already; [`name_from_cell`] takes them
/// away.
pub(super) fn name_to_cell(name: &str) -> Cow<'_, str> {
    if has_outer_blanks(name) {
        Cow::Owned(format!("'{name}'"))
    } else {
        to_cell(name)
    }
}

/// The name of a cell that [`name_to_cell`] has made.
pub(super) fn name_from_cell(cell: &str) -> &str {
    let inner = cell
        .strip_prefix('\'')
        .and_then(|rest| rest.strip_suffix('\''));
    match inner {
        Some(name) if has_outer_blanks(name) => name,
        _ => from_cell(cell),
    }
}

/// True for a name with blanks at an end, within any apostrophes.
fn has_outer_blanks(name: &str) -> bool {
    let name = name.trim_matches('\'');
    name.trim() != name
}
