//! OCamCalib's `calib_results.txt`.

use super::error::ParseError;
use super::words::data_lines;
use crate::camera::lens::Lens;
use crate::camera::ocam::{OCAM_COEFFICIENTS, Ocam};
use crate::camera::projection::Camera;

/// Lines of numbers: polynomial, inverse polynomial, centre, affine part, size.
const LINES: usize = 5;

/// True for five lines of numbers of which the first begins with the count of its others.
pub fn is_ocamcalib(text: &str) -> bool {
    let mut all = data_lines(text);
    let Some((_, first)) = all.next() else {
        return false;
    };
    let mut words = first.split_whitespace();
    let count = words.next().and_then(|word| word.parse::<usize>().ok());
    let is_number = |word: &str| word.parse::<f64>().is_ok();
    count.is_some_and(|count| count > 0 && count == words.filter(|w| is_number(w)).count())
        && all.count() == LINES - 1
}

/// Reads the direct polynomial, the centre (row and column), the affine part and the size (height
/// and width). The inverse polynomial is ignored: the projection inverts the direct one.
///
/// The centre of the first pixel is (0, 0). The polynomial is stored in focal lengths, `f = −a0`:
/// `g = −(a0 + a2 r² + a3 r³ + …)/f`, `r = f ρ`.
pub fn read(text: &str) -> Result<Camera, ParseError> {
    let lines: Vec<(usize, &str)> = data_lines(text).collect();
    let [direct, _, centre, affine, size] = lines[..] else {
        return Err(ParseError::new(format!(
            "a calibration of OCamCalib has {LINES} lines of numbers, not {}",
            lines.len()
        )));
    };
    let [row, column] = exactly(centre, "the centre is `row column`")?;
    let affine = exactly(affine, "the affine part is `c d e`")?;
    let sides: [f64; 2] = exactly(size, "the size is `height width`")?;
    let whole = |value: f64| value.fract() == 0.0 && (1.0..=1e6).contains(&value);
    if !sides.into_iter().all(whole) {
        return Err(ParseError::at(
            size.0,
            "the size is `height width` in pixels",
        ));
    }
    let [height, width] = sides.map(|side| side as u32);
    let (focal_px, polynomial) = polynomial(direct)?;
    Ok(Camera::at_rest(
        [width, height],
        [focal_px, focal_px],
        [column, row],
        Lens::Ocam(Ocam::new(polynomial, affine)?),
    ))
}

/// The focal length and the polynomial in focal lengths.
fn polynomial(
    (number, line): (usize, &str),
) -> Result<(f64, [f64; OCAM_COEFFICIENTS]), ParseError> {
    let fail = |what: String| ParseError::at(number, what);
    let all = numbers((number, line))?;
    let [_, a0, a1, higher @ ..] = &all[..] else {
        return Err(fail("the polynomial needs a0, a1 and a2".to_owned()));
    };
    if *a0 >= 0.0 {
        return Err(fail(format!(
            "the polynomial begins with {a0}; it must be negative (pixels)"
        )));
    }
    if *a1 != 0.0 {
        return Err(fail(format!(
            "the linear coefficient is {a1}; it must be 0, as in every calibration by OCamCalib"
        )));
    }
    if higher.len() > OCAM_COEFFICIENTS {
        return Err(fail(format!(
            "the polynomial has the degree {}; it may have up to {}",
            higher.len() + 1,
            OCAM_COEFFICIENTS + 1
        )));
    }
    let focal_px = -a0;
    let mut polynomial = [0.0; OCAM_COEFFICIENTS];
    for (k, a) in higher.iter().enumerate() {
        polynomial[k] = -a * focal_px.powi(k as i32 + 1);
    }
    Ok((focal_px, polynomial))
}

fn exactly<const N: usize>(line: (usize, &str), rule: &str) -> Result<[f64; N], ParseError> {
    let fail = |_| ParseError::at(line.0, rule);
    numbers(line)?.try_into().map_err(fail)
}

fn numbers((number, line): (usize, &str)) -> Result<Vec<f64>, ParseError> {
    let words = line.split_whitespace();
    words
        .map(|word| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(ParseError::at(number, format!("{word:?} is not a number"))),
        })
        .collect()
}
