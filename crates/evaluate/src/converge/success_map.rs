//! Success map of a sweep, converge.png.
//!
//! There is one panel for each noise model, wall and turn, with a row for each translation scale
//! and a column for each rotation sigma. Each cell shows its success rate, successes and runs, and
//! false successes if there are any.

use crate::converge::options::TranslationScale;
use crate::converge::summary::{CellSummary, Convergence};
use crate::converge::sweep_cell::{jitter_name, unit_sigmas};
use image::{Rgb, RgbImage};
use tunnelstitch_core::bitmap_text::{self, LETTER};

/// Scale of the text; small text has scale 1.
const SCALE: u32 = 2;
/// Height of a line of text with the space below, pixels.
const LINE_PX: u32 = LETTER * SCALE + 10;
/// Margin around the map, pixels.
const MARGIN_PX: u32 = 20;
/// Width of the column of row names, pixels.
const NAMES_PX: u32 = 7 * LETTER * SCALE;
/// Width and height of a cell with the line to the next, pixels.
const CELL_PX: [u32; 2] = [112, 64];

/// Colour of the background.
const BACKGROUND: Rgb<u8> = Rgb([255, 255, 255]);
/// Colour of the text.
const TEXT: Rgb<u8> = Rgb([20, 20, 20]);
/// Colour of a cell without runs.
const EMPTY: Rgb<u8> = Rgb([205, 205, 205]);

/// Draws the success map.
pub fn draw_success_map(result: &Convergence) -> RgbImage {
    let options = &result.options;
    let (columns, rows) = (options.rotations_deg.len(), options.translation_rows());
    let heading = [
        format!("share of runs with all frames < {} px", result.good_px),
        translation_line(&options.translation),
    ];
    let axis = "rotation sigma about each axis";
    let panels: Vec<&[CellSummary]> = result.cells.chunks(columns * rows).collect();
    let titles: Vec<String> = panels.iter().map(|panel| title(&panel[0])).collect();
    let widest = heading
        .iter()
        .chain(&titles)
        .map(|line| bitmap_text::width(line, SCALE))
        .chain([
            NAMES_PX + columns as u32 * CELL_PX[0],
            NAMES_PX + bitmap_text::width(axis, SCALE),
        ])
        .max()
        .unwrap_or_default();
    let panel_height = LINE_PX + rows as u32 * CELL_PX[1] + LINE_PX / 2;
    // Heading, panels, names of the columns and name of their axis.
    let height = 4 * LINE_PX + panels.len() as u32 * panel_height + 2 * MARGIN_PX;
    let mut image = RgbImage::from_pixel(widest + 2 * MARGIN_PX, height, BACKGROUND);

    let mut y = MARGIN_PX;
    for line in &heading {
        bitmap_text::draw(&mut image, [MARGIN_PX, y], line, SCALE, TEXT);
        y += LINE_PX;
    }
    for (panel, title) in panels.iter().zip(&titles) {
        bitmap_text::draw(&mut image, [MARGIN_PX, y], title, SCALE, TEXT);
        y += LINE_PX;
        for (row, cells) in panel.chunks(columns).enumerate() {
            let name = row_name(&options.translation, row);
            let middle = y + (CELL_PX[1] - LETTER * SCALE) / 2;
            bitmap_text::draw(&mut image, [MARGIN_PX, middle], &name, SCALE, TEXT);
            for (column, cell) in cells.iter().enumerate() {
                let x = MARGIN_PX + NAMES_PX + column as u32 * CELL_PX[0];
                draw_cell(&mut image, [x, y], cell);
            }
            y += CELL_PX[1];
        }
        y += LINE_PX / 2;
    }
    for (column, rotation_deg) in options.rotations_deg.iter().enumerate() {
        let left = MARGIN_PX + NAMES_PX + column as u32 * CELL_PX[0];
        draw_centred(&mut image, [left, y], &format!("{rotation_deg}°"), SCALE);
    }
    y += LINE_PX;
    bitmap_text::draw(&mut image, [MARGIN_PX + NAMES_PX, y], axis, SCALE, TEXT);
    image
}

/// Title of a panel.
fn title(cell: &CellSummary) -> String {
    let cell = &cell.cell;
    format!(
        "{}, {}, turn {}°",
        jitter_name(cell.jitter),
        cell.wall.name(),
        cell.turn_deg
    )
}

/// Describes the translation sigmas of the rows, or in proportion to the rotation.
fn translation_line(translation: &TranslationScale) -> String {
    let unit = unit_sigmas();
    let cm = |factor: f64| {
        // Rounded to tenths of a millimetre.
        let values = unit
            .translation_sigma_m
            .map(|m| ((1e4 * m * factor).round() / 100.0).to_string());
        values.join(", ")
    };
    match translation {
        TranslationScale::Auto => format!(
            "translation sigma: {} cm per °",
            cm(1.0 / unit.rotation_sigma_deg)
        ),
        TranslationScale::Factors(_) => format!("translation sigma: ×1 = {} cm", cm(1.0)),
    }
}

/// Name of a row.
fn row_name(translation: &TranslationScale, row: usize) -> String {
    match translation {
        TranslationScale::Auto => String::new(),
        TranslationScale::Factors(factors) => format!("×{}", factors[row]),
    }
}

/// Draws a cell with its top left corner at (x, y), pixels.
fn draw_cell(image: &mut RgbImage, [x, y]: [u32; 2], cell: &CellSummary) {
    let colour = cell.success_rate.map_or(EMPTY, rate_colour);
    for v in 0..CELL_PX[1] - 2 {
        for u in 0..CELL_PX[0] - 2 {
            image.put_pixel(x + u, y + v, colour);
        }
    }
    match cell.success_rate {
        None => draw_centred(image, [x, y + 22], "-", SCALE),
        Some(rate) => {
            draw_centred(image, [x, y + 8], &format!("{:.0} %", 100.0 * rate), SCALE);
            let runs = format!("{}/{}", cell.successes, cell.runs);
            draw_centred(image, [x, y + 30], &runs, SCALE);
            if cell.false_successes > 0 {
                let text = format!("{} false", cell.false_successes);
                draw_centred(image, [x, y + 51], &text, 1);
            }
        }
    }
}

/// Draws a text centred in a cell's width, smaller if it is too long.
fn draw_centred(image: &mut RgbImage, [x, y]: [u32; 2], text: &str, scale: u32) {
    let scale = if bitmap_text::width(text, scale) <= CELL_PX[0] {
        scale
    } else {
        1
    };
    let indent = CELL_PX[0].saturating_sub(bitmap_text::width(text, scale)) / 2;
    bitmap_text::draw(image, [x + indent, y], text, scale, TEXT);
}

/// Colour of a success rate: red, yellow, green, light enough for black text.
fn rate_colour(rate: f64) -> Rgb<u8> {
    const STOPS: [[f64; 3]; 3] = [
        [238.0, 125.0, 110.0],
        [250.0, 232.0, 140.0],
        [125.0, 200.0, 130.0],
    ];
    let position = 2.0 * rate.clamp(0.0, 1.0);
    let stop = if position < 1.0 { 0 } else { 1 };
    let share = position - stop as f64;
    Rgb(std::array::from_fn(|k| {
        ((1.0 - share) * STOPS[stop][k] + share * STOPS[stop + 1][k]).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::converge::options::ConvergeOptions;
    use crate::converge::run_record::tests::record;

    /// Two panels of two rows and three columns; the runs of the middle column fail.
    #[test]
    fn every_cell_has_its_position_and_colour() {
        let options = ConvergeOptions {
            rotations_deg: vec![2.0, 4.0, 6.0],
            translation: TranslationScale::Factors(vec![1.0, 2.0]),
            ..ConvergeOptions::default()
        };
        let cells = options.cells().into_iter().map(|cell| {
            let mut run = record(2.0, 1);
            run.success = cell.rotation_sigma_deg != 4.0;
            CellSummary::of(&cell, &[&run])
        });
        let result = Convergence::new(&options, cells.collect());
        let image = draw_success_map(&result);
        let heading = "share of runs with all frames < 0.5 px".len() as u32;
        assert_eq!(image.width(), 2 * MARGIN_PX + heading * LETTER * SCALE);
        assert_eq!(
            image.height(),
            2 * MARGIN_PX + 4 * LINE_PX + 2 * (LINE_PX + 2 * CELL_PX[1] + LINE_PX / 2)
        );
        let panel_height = LINE_PX + 2 * CELL_PX[1] + LINE_PX / 2;
        for (index, cell) in result.cells.iter().enumerate() {
            let (panel, row, column) = (index / 6, index / 3 % 2, index % 3);
            let x = MARGIN_PX + NAMES_PX + column as u32 * CELL_PX[0];
            let y = MARGIN_PX + 3 * LINE_PX + panel as u32 * panel_height + row as u32 * CELL_PX[1];
            let expected = rate_colour(cell.success_rate.unwrap());
            assert_eq!(*image.get_pixel(x + 2, y + 2), expected, "{index}");
        }
        assert_ne!(rate_colour(0.0), rate_colour(1.0));
        assert_eq!(rate_colour(0.5), Rgb([250, 232, 140]));
    }
}
