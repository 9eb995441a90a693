//! Extrinsic calibration: the pose of the camera in the body (IMU) whose poses a file holds.

use super::error::PoseError;
use super::pose::Pose;
use super::{rigid, row, text};
use std::path::Path;

/// Keys of calibration files with such a matrix; true if the matrix maps camera to body
/// coordinates.
const KEYS: [(&str, bool); 3] = [("T_BS", true), ("T_cam_imu", false), ("T_imu_cam", true)];

/// Reads the pose of the camera in the body, `x_body = T x_camera`.
///
/// The file holds the motion from body to camera, `x_camera = T x_body`, as a 4 × 4 matrix of text,
/// one row per line; or it is EuRoC's `sensor.yaml` (`T_BS`, camera to body) or a camchain of
/// Kalibr with one camera (`T_cam_imu`, body to camera; with `T_imu_cam` the other way), whose keys
/// define the direction of their matrices.
///
/// # Errors
/// An unreadable file; no such matrix, or several; a matrix that is no rigid motion.
pub fn read_camera_in_body(path: &Path) -> Result<Pose, PoseError> {
    let text = text::read(path)?;
    let fail = |what: String| PoseError::file(path, what);
    let mut keyed = Vec::new();
    for (key, from_camera) in KEYS {
        keyed.extend(values_after(&text, key).map(|rest| (key, from_camera, rest)));
    }
    match keyed.as_slice() {
        [] => Ok(read_matrix(path, &text)?.inverse()),
        [(key, from_camera, rest)] => {
            let motion = bracketed(rest)
                .and_then(|rows| rigid::from_rows(&rows))
                .map_err(|what| fail(format!("{key}: {what}")))?;
            Ok(match from_camera {
                true => motion,
                false => motion.inverse(),
            })
        }
        [(first, ..), .., (last, ..)] => Err(fail(format!(
            "holds both {first} and {last}; leave the one camera that took the frames"
        ))),
    }
}

/// Reads a matrix of three or four rows of four numbers, one row per line.
pub(super) fn read_matrix(path: &Path, text: &str) -> Result<Pose, PoseError> {
    let mut rows = Vec::new();
    for (number, line) in text::lines(text) {
        let row = row::numbers(line, "four numbers a row")
            .map_err(|what| PoseError::line(path, number, what))?;
        rows.push(row);
    }
    rigid::from_rows(&rows).map_err(|what| PoseError::file(path, what))
}

/// The text after each `key:` of a YAML text.
fn values_after<'a>(text: &'a str, key: &'a str) -> impl Iterator<Item = &'a str> {
    let mut offset = 0;
    text.split_inclusive('\n').filter_map(move |line| {
        offset += line.len();
        let rest = line
            .trim_start()
            .strip_prefix(key)?
            .trim_start()
            .strip_prefix(':')?;
        text.get(offset - rest.len()..)
    })
}

/// Reads the first sixteen numbers within brackets, of nested or flat lists.
fn bracketed(text: &str) -> Result<Vec<[f64; 4]>, String> {
    let numbers = text
        .split_once('[')
        .map_or("", |(_, rest)| rest)
        .split(|c: char| c.is_whitespace() || "[],".contains(c))
        .filter(|word| !word.is_empty() && *word != "-")
        .take(16)
        .map(|word| text::number(word, "sixteen numbers in brackets"))
        .collect::<Result<Vec<f64>, String>>()?;
    match numbers.len() {
        16 => Ok(numbers
            .chunks_exact(4)
            .map(|row| [row[0], row[1], row[2], row[3]])
            .collect()),
        count => Err(format!("{count} numbers where a 4 × 4 matrix has 16")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::so3;
    use nalgebra::Vector3;

    fn read_text(text: &str) -> Result<Pose, PoseError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("mount");
        std::fs::write(&path, text).unwrap();
        read_camera_in_body(&path)
    }

    /// EuRoC's calibration of its left camera, its inverse, and Kalibr's notation of it.
    #[test]
    fn all_ways_to_say_it_mean_the_same() {
        let t_bs = "[0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,\n      \
                       \
            0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,\n        \
            -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,\n         \
            0.0, 0.0, 0.0, 1.0]";
        let euroc = format!(
            "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: {t_bs}\nrate_hz: 20\n"
        );
        let camera_in_body = read_text(&euroc).unwrap();
        assert!((camera_in_body.t_wc.y + 0.064676986768).abs() < 1e-12);
        let rows = rigid::to_rows(&camera_in_body.inverse());
        let lines = rows.map(|row| row.map(|v| v.to_string()));
        let matrix = lines.each_ref().map(|row| row.join(" ")).join("\n") + "\n0 0 0 1\n";
        let kalibr = format!(
            "cam0:\n  T_cam_imu:\n{}  - [0.0, 0.0, 0.0, 1.0]\n  camera_model: pinhole\n",
            lines
                .map(|row| format!("  - [{}]\n", row.join(", ")))
                .concat()
        );
        for text in [matrix, kalibr] {
            let other = read_text(&text).unwrap();
            assert!(other.local(&camera_in_body).norm() < 1e-9, "{text}");
        }
    }

    #[test]
    fn bad_files_say_what_is_wrong() {
        let identity = "T_BS:\n data: [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n";
        for (text, expected) in [
            ("", "0 rows"),
            ("1 0 0\n0 1 0\n0 0 1\n", ":1: 3 columns"),
            ("1 0 0 0\n0 1 0 0\n0 0 -1 0\n0 0 0 1\n", "a reflection"),
            ("T_BS:\n data: [1, 0, 0]\n", "3 numbers"),
            ("T_BS:\n data: [1, 0, x]\n", "`x` is not a number"),
            (&format!("{identity}{identity}"), "both T_BS and T_BS"),
            ("\u{0}", "is no text of UTF-8"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        let pose = read_text(identity).unwrap();
        assert!(
            pose.local(&Pose::new(so3::exp(&Vector3::zeros()), Vector3::zeros()))
                .norm()
                < 1e-15
        );
    }
}
