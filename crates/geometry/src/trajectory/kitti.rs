//! KITTI odometry: lines with the twelve numbers of `[R t]`, row by row, camera-to-world, metres;
//! no times. The sixteen numbers of `[R t; 0 0 0 1]` are read, too, on one line or
//! on four, and so are a time before the matrix and the name of the frame.
//!
//! KITTI's own files use the first camera as their world. Files are read in any world and written
//! in the tunnel's frame.

use super::error::PoseError;
use super::pose_entry::PoseEntry;
use super::row::NamedRow;
use super::stamped_pose::StampedPose;
use super::{rigid, text};
use std::path::Path;

pub(super) const FORM: &str = "r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz";

/// Numbers of a 3 × 4 matrix.
const ROWS: usize = 12;
/// Numbers of a 4 × 4 matrix.
const WHOLE_MATRIX: usize = 16;

/// True for the number of words of a row with nothing but a matrix.
pub(super) fn is_matrix(words: usize) -> bool {
    [ROWS, WHOLE_MATRIX].contains(&words)
}

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    let mut names = text::Names::default();
    let mut parse = |line| -> Result<PoseEntry, String> {
        let entry = parse_line(line)?;
        if let Some(name) = &entry.name {
            names.add(name)?;
        }
        Ok(entry)
    };
    text::lines(text)
        .map(|(number, line)| parse(line).map_err(|what| PoseError::line(path, number, what)))
        .collect()
}

pub(super) fn parse_line(line: &str) -> Result<PoseEntry, String> {
    let NamedRow { name, words } = NamedRow::of(line)?;
    let has_time = is_matrix(words.len().saturating_sub(1));
    let (time, matrix) = words.split_at(usize::from(has_time));
    let time = time.first().map(|word| text::time(word, None, FORM));
    let numbers: Result<Vec<f64>, String> =
        matrix.iter().map(|word| text::number(word, FORM)).collect();
    let numbers = numbers?;
    let [a, b, c, d, e, f, g, h, i, j, k, l] = match <[f64; WHOLE_MATRIX]>::try_from(&*numbers) {
        Ok(matrix) => first_rows(matrix)?,
        Err(_) => <[f64; ROWS]>::try_from(&*numbers)
            .map_err(|_| format!("{} columns where `{FORM}` has {ROWS}", numbers.len()))?,
    };
    Ok(PoseEntry {
        camera: None,
        name,
        time_s: time.transpose()?,
        pose: rigid::from_rows(&[[a, b, c, d], [e, f, g, h], [i, j, k, l]])?,
    })
}

/// The first three rows of a 4 × 4 matrix, whose last row is that of a rigid motion.
fn first_rows(matrix: [f64; WHOLE_MATRIX]) -> Result<[f64; 12], String> {
    match matrix {
        [rows @ .., 0.0, 0.0, 0.0, 1.0] => Ok(rows),
        [.., m, n, o, p] => Err(format!(
            "the last row of the 4 × 4 matrix is {m} {n} {o} {p}; that of a pose is 0 0 0 1 (a \
             matrix that is written column by column has to be transposed)"
        )),
    }
}

/// Formats a KITTI file.
pub fn format(trajectory: &[StampedPose]) -> String {
    let line = |stamped: &StampedPose| {
        let numbers = rigid::to_rows(&stamped.pose).concat();
        let words: Vec<String> = numbers.iter().map(f64::to_string).collect();
        words.join(" ") + "\n"
    };
    trajectory.iter().map(line).collect()
}
