//! Extrinsic calibration: the pose of the camera in the body (IMU) whose poses a file holds.

use super::colmap_rig::{self, is_rig_file};
use super::error::PoseError;
use super::pose::Pose;
use super::{rigid, row, text};
use std::collections::BTreeSet;
use std::path::Path;

/// Keys of calibration files with such a matrix; true if the matrix maps camera to body
/// coordinates.
const KEYS: [(&str, bool); 3] = [("T_BS", true), ("T_cam_imu", false), ("T_imu_cam", true)];

/// Reads the pose of the camera in the body, `x_body = T x_camera`.
///
/// The file holds the motion from body to camera, `x_camera = T x_body`, as a 4 × 4 matrix of text,
/// one row per line; or it is EuRoC's `sensor.yaml` (`T_BS`, camera to body) or a camchain of
/// Kalibr (`T_cam_imu`, body to camera; with `T_imu_cam` the other way), whose keys define the
/// direction of their matrices; or COLMAP's `rigs.bin` or `rigs.txt`, in the unit of the model.
/// `name` selects one of several cameras of such a file.
///
/// # Errors
/// An unreadable file; no such matrix, or several of one camera; several cameras and none of them
/// called `name`; a matrix that is no rigid motion.
pub fn read_camera_in_body(path: &Path, name: Option<&str>) -> Result<Pose, PoseError> {
    let fail = |what: String| PoseError::file(path, what);
    if is_rig_file(path) {
        let cameras: Vec<_> = colmap_rig::read(path)?.into_iter().flatten().collect();
        let names = cameras.iter().map(|(camera, _)| camera.as_str()).collect();
        let selected = select(&names, name).map_err(fail)?;
        let of_name = cameras
            .iter()
            .find(|(camera, _)| Some(camera.as_str()) == selected);
        return of_name.and_then(|(_, pose)| *pose).ok_or_else(|| {
            fail("holds no pose of the camera in its rig; let COLMAP estimate it".to_owned())
        });
    }
    let text = text::read(path)?;
    let mut keyed = Vec::new();
    for (key, from_camera) in KEYS {
        keyed.extend(matrices(&text, key).map(|(camera, rest)| (camera, key, from_camera, rest)));
    }
    let names = keyed.iter().filter_map(|(camera, ..)| *camera).collect();
    let selected = select(&names, name).map_err(fail)?;
    keyed.retain(|(camera, ..)| *camera == selected);
    match keyed.as_slice() {
        [] => Ok(read_matrix(path, &text)?.inverse()),
        [(_, key, from_camera, rest)] => {
            let motion = bracketed(rest)
                .and_then(|rows| rigid::from_rows(&rows))
                .map_err(|what| fail(format!("{key}: {what}")))?;
            Ok(match from_camera {
                true => motion,
                false => motion.inverse(),
            })
        }
        [(_, first, ..), .., (_, last, ..)] => Err(fail(format!(
            "holds both {first} and {last} of one camera; leave one"
        ))),
    }
}

/// The names of the cameras of each rig in a file of COLMAP whose poses in their rig are known;
/// [`is_rig_file`] tells such files.
///
/// # Errors
/// An unreadable or damaged file.
pub fn cameras_of_rigs(path: &Path) -> Result<Vec<Vec<String>>, PoseError> {
    let known = |rig: Vec<colmap_rig::RigCamera>| {
        let cameras = rig.into_iter().filter(|(_, pose)| pose.is_some());
        cameras.map(|(name, _)| name).collect()
    };
    Ok(colmap_rig::read(path)?.into_iter().map(known).collect())
}

/// Selects the camera of a file with mounts of the cameras `names`; none where the file names
/// none. A single one need not be called `name`, since calibrations may have other names.
fn select<'a>(names: &BTreeSet<&'a str>, name: Option<&str>) -> Result<Option<&'a str>, String> {
    if names.len() < 2 {
        return Ok(names.first().copied());
    }
    let wanted = name.and_then(|name| names.get(name).copied());
    wanted.map(Some).ok_or_else(|| {
        let names: Vec<&str> = names.iter().copied().collect();
        format!(
            "holds the mounts of several cameras ({}); select one with `name` under [camera] of \
             survey.toml, or leave the one that took the frames",
            names.join(", ")
        )
    })
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

/// The text after each `key:` of a YAML text, with the camera (`cam0:`) whose block it is in.
fn matrices<'a>(text: &'a str, key: &'a str) -> impl Iterator<Item = (Option<&'a str>, &'a str)> {
    let (mut offset, mut camera) = (0, None);
    text.split_inclusive('\n').filter_map(move |line| {
        offset += line.len();
        let block = line.split_once(':').map(|(block, _)| block);
        camera = block.filter(|block| block.starts_with("cam")).or(camera);
        let rest = line
            .trim_start()
            .strip_prefix(key)?
            .trim_start()
            .strip_prefix(':')?;
        Some((camera, text.get(offset - rest.len()..)?))
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
        read_camera_in_body(&path, None)
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

    /// One of two cameras by its name; a single one has any.
    #[test]
    fn a_camera_of_several_is_selected_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let [yaml, rigs] = ["camchain.yaml", "rigs.txt"].map(|name| dir.path().join(name));
        let camera = |k: usize| {
            let rows = format!("[1,0,0,{k}], [0,1,0,0], [0,0,1,0], [0,0,0,1]");
            format!("cam{k}:\n  T_imu_cam: [{rows}]\n  camera_model: pinhole\n")
        };
        let x_of = |path: &Path, name| {
            read_camera_in_body(path, name)
                .map(|pose: Pose| pose.t_wc.x)
                .map_err(|e| e.to_string())
        };
        std::fs::write(&yaml, camera(0) + &camera(1)).unwrap();
        assert_eq!(x_of(&yaml, Some("cam0")), Ok(0.0));
        assert_eq!(x_of(&yaml, Some("cam1")), Ok(1.0));
        for name in [None, Some("1")] {
            let said = x_of(&yaml, name).unwrap_err();
            assert!(
                said.contains("(cam0, cam1); select one with `name`"),
                "{said}"
            );
        }
        std::fs::write(&yaml, camera(1)).unwrap();
        assert_eq!(x_of(&yaml, Some("left")), Ok(1.0));
        std::fs::write(&rigs, "1 3 CAMERA 1 CAMERA 2 1 1 0 0 0 -4 0 0 CAMERA 3 0\n").unwrap();
        assert_eq!(x_of(&rigs, Some("1")), Ok(0.0));
        assert_eq!(x_of(&rigs, Some("2")), Ok(4.0));
        assert!(
            x_of(&rigs, Some("3"))
                .unwrap_err()
                .contains("no pose of the camera")
        );
        assert_eq!(cameras_of_rigs(&rigs).unwrap(), [["1", "2"]]);
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
            (
                &format!("{identity}{identity}"),
                "both T_BS and T_BS of one",
            ),
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
