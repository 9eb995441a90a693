//! Text table of a sweep, converge.txt.

use crate::converge::summary::{CellSummary, Convergence};
use crate::converge::sweep_cell::jitter_name;
use std::fmt;

/// Heading of a column and function that formats its value.
type TableColumn = (&'static str, fn(&CellSummary) -> String);

/// Columns from left to right; the first two are words, the others numbers.
const COLUMNS: [TableColumn; 14] = [
    ("jitter", |c| jitter_name(c.cell.jitter).to_owned()),
    ("wall", |c| c.cell.wall.name().to_owned()),
    ("turn °", |c| c.cell.turn_deg.to_string()),
    ("rot. σ °", |c| c.cell.rotation_sigma_deg.to_string()),
    ("transl. σ cm", |c| {
        let cm: Vec<String> = c
            .cell
            .translation_sigma_m
            .iter()
            .map(|m| format_short(100.0 * m))
            .collect();
        cm.join(",")
    }),
    ("runs", |c| c.runs.to_string()),
    ("success", |c| {
        c.success_rate
            .map_or_else(missing, |rate| format!("{:.0} %", 100.0 * rate))
    }),
    ("refused", |c| c.refused.to_string()),
    ("false", |c| c.false_successes.to_string()),
    ("flagged", |c| c.flagged_frames.to_string()),
    ("median px", |c| format_pixels(c.median_worst_frame_px)),
    ("worst px", |c| format_pixels(c.worst_frame_px)),
    ("redraws", |c| c.redraws.to_string()),
    ("median s", |c| {
        c.median_seconds.map_or_else(missing, |s| format!("{s:.1}"))
    }),
];

/// Number of left-aligned columns.
const WORD_COLUMNS: usize = 2;

/// Text of a missing value.
fn missing() -> String {
    "–".to_owned()
}

/// Formats a value with at most three digits after the point, without trailing zeros.
fn format_short(value: f64) -> String {
    let text = format!("{value:.3}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

/// Formats an error in pixels.
fn format_pixels(value: Option<f64>) -> String {
    match value {
        None => missing(),
        Some(px) if px < 10.0 => format!("{px:.3}"),
        Some(px) => format!("{px:.1}"),
    }
}

impl fmt::Display for Convergence {
    /// The table with aligned columns and a legend, without a line break at its end.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let headings: Vec<String> = COLUMNS.iter().map(|(name, _)| (*name).to_owned()).collect();
        let rows: Vec<Vec<String>> = std::iter::once(headings)
            .chain(
                self.cells
                    .iter()
                    .map(|cell| COLUMNS.iter().map(|(_, value)| value(cell)).collect()),
            )
            .collect();
        let widths: Vec<usize> = (0..COLUMNS.len())
            .map(|k| {
                rows.iter()
                    .map(|row| row[k].chars().count())
                    .max()
                    .unwrap_or(0)
            })
            .collect();
        for row in &rows {
            for (k, (text, &width)) in row.iter().zip(&widths).enumerate() {
                let gap = if k == 0 { "" } else { "  " };
                if k < WORD_COLUMNS {
                    write!(f, "{gap}{text:<width$}")?
                } else {
                    write!(f, "{gap}{text:>width$}")?
                }
            }
            writeln!(f)?;
        }
        write!(
            f,
            "success: every frame within {} px of its place on the wall. \
             false: frames called photometric that are\n\
             not. flagged: frames called unsure. \
             px: the worst frame of a run, median and worst of the runs; – if a\n\
             frame has no place. redraws: surveys that nobody could fly, drawn again.",
            self.good_px
        )?;
        let infeasible_seeds: usize = self.cells.iter().map(|cell| cell.infeasible_seeds).sum();
        match infeasible_seeds {
            0 => Ok(()),
            count => write!(
                f,
                "\nwithout any survey that could be flown: {count} seeds; they are no runs."
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::options::ConvergeOptions;
    use crate::converge::run_record::tests::record;

    #[test]
    fn columns_are_aligned() {
        let runs = [record(2.0, 1), record(12.0, 1)];
        let cells = runs
            .iter()
            .map(|run| CellSummary::of(&run.cell, &[run]))
            .collect();
        let text = Convergence::new(&ConvergeOptions::default(), cells).to_string();
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].starts_with("jitter ") && lines[3].starts_with("success:"));
        assert!(
            lines[1].contains("2,2,3") && lines[1].contains("100 %"),
            "{text}"
        );
        assert!(lines[2].contains("12,12,18"), "{text}");
        let width = lines[0].chars().count();
        assert!(lines[..3].iter().all(|line| line.chars().count() == width));
    }
}
