//! converge.png: the success map.
//!
//! One panel for each noise model, wall and turn, below each other; in it a row for each
//! translation scale and a column for each rotation sigma; in each cell the success rate, the runs
//! it is of, and the false successes if any.

use super::cell::{jitter_name, unit};
use super::{CellSummary, Convergence, TranslationScale};
use crate::bitmap_text::{self, LETTER};
use image::{Rgb, RgbImage};

/// Scale of the lettering; of the fine print it is 1.
const SCALE: u32 = 2;
/// Height of a line of text with the space below, pixels.
const LINE: u32 = LETTER * SCALE + 10;
/// Space around everything, pixels.
const MARGIN: u32 = 20;
/// Room for the names of rows, pixels.
const NAMES: u32 = 7 * LETTER * SCALE;
/// Width and height of a cell with the line to the next, pixels.
const CELL: [u32; 2] = [112, 64];

const PAPER: Rgb<u8> = Rgb([255, 255, 255]);
const INK: Rgb<u8> = Rgb([20, 20, 20]);
const NOTHING: Rgb<u8> = Rgb([205, 205, 205]);

/// Draws the success map.
pub fn draw(result: &Convergence) -> RgbImage {
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
            NAMES + columns as u32 * CELL[0],
            NAMES + bitmap_text::width(axis, SCALE),
        ])
        .max()
        .unwrap_or_default();
    let panel_height = LINE + rows as u32 * CELL[1] + LINE / 2;
    // The heading, the panels, the columns' names and the name of their axis.
    let height = 4 * LINE + panels.len() as u32 * panel_height + 2 * MARGIN;
    let mut image = RgbImage::from_pixel(widest + 2 * MARGIN, height, PAPER);

    let mut y = MARGIN;
    for line in &heading {
        bitmap_text::draw(&mut image, [MARGIN, y], line, SCALE, INK);
        y += LINE;
    }
    for (panel, title) in panels.iter().zip(&titles) {
        bitmap_text::draw(&mut image, [MARGIN, y], title, SCALE, INK);
        y += LINE;
        for (row, cells) in panel.chunks(columns).enumerate() {
            let name = row_name(&options.translation, row);
            let middle = y + (CELL[1] - LETTER * SCALE) / 2;
            bitmap_text::draw(&mut image, [MARGIN, middle], &name, SCALE, INK);
            for (column, cell) in cells.iter().enumerate() {
                let x = MARGIN + NAMES + column as u32 * CELL[0];
                draw_cell(&mut image, [x, y], cell);
            }
            y += CELL[1];
        }
        y += LINE / 2;
    }
    for (column, rotation_deg) in options.rotations_deg.iter().enumerate() {
        let left = MARGIN + NAMES + column as u32 * CELL[0];
        centred(&mut image, [left, y], &format!("{rotation_deg}°"), SCALE);
    }
    y += LINE;
    bitmap_text::draw(&mut image, [MARGIN + NAMES, y], axis, SCALE, INK);
    image
}

fn title(cell: &CellSummary) -> String {
    let cell = &cell.cell;
    format!(
        "{}, {}, turn {}°",
        jitter_name(cell.jitter),
        cell.wall.name(),
        cell.turn_deg
    )
}

/// What the rows' names mean, or what goes with the rotation.
fn translation_line(translation: &TranslationScale) -> String {
    let unit = unit();
    let cm = |factor: f64| {
        // Tenths of a millimetre, without the tail of binary fractions.
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

fn row_name(translation: &TranslationScale, row: usize) -> String {
    match translation {
        TranslationScale::Auto => String::new(),
        TranslationScale::Factors(factors) => format!("×{}", factors[row]),
    }
}

fn draw_cell(image: &mut RgbImage, [x, y]: [u32; 2], cell: &CellSummary) {
    let colour = cell.success_rate.map_or(NOTHING, colour);
    for v in 0..CELL[1] - 2 {
        for u in 0..CELL[0] - 2 {
            image.put_pixel(x + u, y + v, colour);
        }
    }
    match cell.success_rate {
        None => centred(image, [x, y + 22], "-", SCALE),
        Some(rate) => {
            centred(image, [x, y + 8], &format!("{:.0} %", 100.0 * rate), SCALE);
            let runs = format!("{}/{}", cell.successes, cell.runs);
            centred(image, [x, y + 30], &runs, SCALE);
            if cell.false_successes > 0 {
                let text = format!("{} false", cell.false_successes);
                centred(image, [x, y + 51], &text, 1);
            }
        }
    }
}

/// Draws a text in the middle of a cell's width, smaller if it is too long for it.
fn centred(image: &mut RgbImage, [x, y]: [u32; 2], text: &str, scale: u32) {
    let scale = if bitmap_text::width(text, scale) <= CELL[0] {
        scale
    } else {
        1
    };
    let indent = CELL[0].saturating_sub(bitmap_text::width(text, scale)) / 2;
    bitmap_text::draw(image, [x + indent, y], text, scale, INK);
}

/// From red over yellow to green, light enough for black letters.
fn colour(rate: f64) -> Rgb<u8> {
    const STOPS: [[f64; 3]; 3] = [
        [238.0, 125.0, 110.0],
        [250.0, 232.0, 140.0],
        [125.0, 200.0, 130.0],
    ];
    let place = 2.0 * rate.clamp(0.0, 1.0);
    let stop = if place < 1.0 { 0 } else { 1 };
    let share = place - stop as f64;
    Rgb(std::array::from_fn(|k| {
        ((1.0 - share) * STOPS[stop][k] + share * STOPS[stop + 1][k]).round() as u8
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluate::converge::ConvergeOptions;
    use crate::evaluate::converge::run_record::tests::record;

    /// Two panels of two rows and three columns; the runs of the middle column fail.
    #[test]
    fn every_cell_has_its_place_and_colour() {
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
        let image = draw(&result);
        let heading = "share of runs with all frames < 0.5 px".len() as u32;
        assert_eq!(image.width(), 2 * MARGIN + heading * LETTER * SCALE);
        assert_eq!(
            image.height(),
            2 * MARGIN + 4 * LINE + 2 * (LINE + 2 * CELL[1] + LINE / 2)
        );
        let panel_height = LINE + 2 * CELL[1] + LINE / 2;
        for (index, cell) in result.cells.iter().enumerate() {
            let (panel, row, column) = (index / 6, index / 3 % 2, index % 3);
            let x = MARGIN + NAMES + column as u32 * CELL[0];
            let y = MARGIN + 3 * LINE + panel as u32 * panel_height + row as u32 * CELL[1];
            let expected = colour(cell.success_rate.unwrap());
            assert_eq!(*image.get_pixel(x + 2, y + 2), expected, "{index}");
        }
        assert_ne!(colour(0.0), colour(1.0));
        assert_eq!(colour(0.5), Rgb([250, 232, 140]));
    }
}
