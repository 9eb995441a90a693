//! KITTI odometry: lines with the twelve numbers of `[R t]`, row by row, camera-to-world, metres;
//! no times. The sixteen numbers of `[R t; 0 0 0 1]` are read, too, on one line or
//! on four.
//!
//! KITTI's own files use the first camera as their world. Files are read in any world and written
//! in the tunnel's frame.

use super::error::PoseError;
use super::pose_entry::PoseEntry;
use super::stamped_pose::StampedPose;
use super::{rigid, row, text};
use std::path::Path;

pub(super) const FORM: &str = "r11 r12 r13 tx r21 r22 r23 ty r31 r32 r33 tz";

/// Numbers of a 4 × 4 matrix.
pub(super) const WHOLE_MATRIX: usize = 16;

pub(super) fn parse(path: &Path, text: &str) -> Result<Vec<PoseEntry>, PoseError> {
    text::lines(text)
        .map(|(number, line)| parse_line(line).map_err(|what| PoseError::line(path, number, what)))
        .collect()
}

pub(super) fn parse_line(line: &str) -> Result<PoseEntry, String> {
    let count = row::words(line)?.len();
    let [a, b, c, d, e, f, g, h, i, j, k, l] = match count {
        WHOLE_MATRIX => first_rows(row::numbers(line, FORM)?)?,
        _ => row::numbers(line, FORM)?,
    };
    Ok(PoseEntry {
        camera: None,
        name: None,
        time_s: None,
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
