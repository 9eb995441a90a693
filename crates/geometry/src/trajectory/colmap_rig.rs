//! COLMAP's `rigs.bin` and `rigs.txt` (COLMAP 3.12 and later): the poses of cameras in their rigs.
//!
//! A line of the text is `RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID`, then for each other
//! sensor `SENSOR_TYPE SENSOR_ID HAS_POSE` and, if it has one, `QW QX QY QZ TX TY TZ`, **rig to
//! sensor**. The rig's frame is that of the reference sensor. The binary file:
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | number of rigs |
//! | 4, 4 | id of a rig, number of its sensors |
//! | 4, 4 | type of the reference sensor (0: camera), its id; not there without a sensor |
//! | 4, 4, 1 | type and id of another sensor, 1 if it has a pose |
//! | 7 × 8 | its pose |
//!
//! All numbers are little-endian; rows repeat. Source: COLMAP's documentation, "Output Format".

use super::error::PoseError;
use super::pose::Pose;
use super::text;
use crate::files::BinaryFile;
use nalgebra::Vector3;
use std::io;
use std::path::Path;

/// Names of the files in the folder of a model.
pub(super) const RIG_FILES: [&str; 2] = ["rigs.txt", "rigs.bin"];
/// Bytes of a rig without sensors, and of a sensor without a pose.
const MIN_RIG_BYTES: u64 = 8;
const FORM: &str = "RIG_ID NUM_SENSORS REF_SENSOR_TYPE REF_SENSOR_ID …";
/// The number of cameras among the types of sensors.
const CAMERA: i32 = 0;

/// The camera of a rig: its id, and its pose in the rig, camera to rig, if it is known.
pub(super) type RigCamera = (String, Option<Pose>);

/// True for a file of rigs, by its name.
pub fn is_rig_file(path: &Path) -> bool {
    RIG_FILES.iter().any(|name| path.ends_with(name))
}

/// Reads the cameras of each rig.
///
/// # Errors
/// An unreadable or damaged file.
pub(super) fn read(path: &Path) -> Result<Vec<Vec<RigCamera>>, PoseError> {
    if path.ends_with(RIG_FILES[1]) {
        let damaged = |error: io::Error| PoseError::file(path, error.to_string());
        let mut file = BinaryFile::open(path).map_err(damaged)?;
        return read_binary(&mut file).map_err(|what| PoseError::file(path, what));
    }
    let text = text::read(path)?;
    let rig = |(number, line): (usize, &str)| {
        parse_line(line).map_err(|what| PoseError::line(path, number, what))
    };
    text::lines(&text).map(rig).collect()
}

fn parse_line(line: &str) -> Result<Vec<RigCamera>, String> {
    let mut words = line.split_whitespace();
    let mut next = || {
        words
            .next()
            .ok_or_else(|| format!("the line ends within `{FORM}`"))
    };
    let (_rig, count) = (next()?, next()?);
    let count: usize = count
        .parse()
        .map_err(|_| format!("`{count}` is no number of sensors; a line is `{FORM}`"))?;
    let mut cameras = Vec::new();
    for sensor in 0..count {
        let (kind, id) = (next()?, next()?);
        let pose = match sensor {
            0 => Some(Pose::identity()),
            _ if next()? == "1" => {
                let mut values = [0.0; 7];
                for value in &mut values {
                    *value = text::number(next()?, FORM)?;
                }
                Some(camera_to_rig(values)?)
            }
            _ => None,
        };
        if kind == "CAMERA" {
            cameras.push((id.to_owned(), pose));
        }
    }
    Ok(cameras)
}

fn read_binary(file: &mut BinaryFile) -> Result<Vec<Vec<RigCamera>>, String> {
    let text = |error: io::Error| error.to_string();
    let mut rigs = Vec::new();
    for _ in 0..file.count(MIN_RIG_BYTES).map_err(text)? {
        let (_rig, count) = (file.u32().map_err(text)?, file.u32().map_err(text)?);
        let mut cameras = Vec::new();
        for sensor in 0..count {
            let kind = file.i32().map_err(text)?;
            let id = file.u32().map_err(text)?.to_string();
            let pose = match sensor {
                0 => Some(Pose::identity()),
                _ if file.u8().map_err(text)? != 0 => {
                    Some(camera_to_rig(file.f64s().map_err(text)?)?)
                }
                _ => None,
            };
            if kind == CAMERA {
                cameras.push((id, pose));
            }
        }
        rigs.push(cameras);
    }
    file.end().map_err(text)?;
    Ok(rigs)
}

fn camera_to_rig([qw, qx, qy, qz, tx, ty, tz]: [f64; 7]) -> Result<Pose, String> {
    let rotation = text::rotation([qw, qx, qy, qz], "QW QX QY QZ")?;
    let from_rig = Pose::new(rotation, Vector3::new(tx, ty, tz));
    if !from_rig.is_finite() {
        return Err("a pose of a camera in its rig is not finite".to_owned());
    }
    Ok(from_rig.inverse())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Two cameras, and an IMU, as COLMAP writes them.
    pub const TEXT: &str = "# Rig calib list\n1 3 CAMERA 1 CAMERA 2 1 0.6 0 0.8 0 0.5 -1 2.25 \
                            IMU 1 0\n2 1 CAMERA 7\n";

    pub fn bytes() -> Vec<u8> {
        let ints = |values: &[u32]| values.iter().flat_map(|v| v.to_le_bytes()).collect();
        let numbers = [0.6, 0.0, 0.8, 0.0, 0.5, -1.0, 2.25f64];
        let parts: [Vec<u8>; 7] = [
            2u64.to_le_bytes().to_vec(),
            ints(&[1, 3, 0, 1, 0, 2]),
            vec![1],
            numbers.iter().flat_map(|v| v.to_le_bytes()).collect(),
            ints(&[1, 1]),
            vec![0],
            ints(&[2, 1, 0, 7]),
        ];
        parts.concat()
    }

    #[test]
    fn text_and_binary_are_the_same_rigs() {
        let dir = tempfile::tempdir().unwrap();
        let [text, binary] = RIG_FILES.map(|name| dir.path().join(name));
        std::fs::write(&text, TEXT).unwrap();
        std::fs::write(&binary, bytes()).unwrap();
        let rigs = read(&text).unwrap();
        assert_eq!(read(&binary).unwrap(), rigs);
        assert_eq!((rigs[0].len(), rigs[1].len()), (2, 1));
        let (id, pose) = &rigs[0][1];
        let back = pose.as_ref().unwrap().inverse();
        assert_eq!(id, "2");
        assert!((back.t_wc - Vector3::new(0.5, -1.0, 2.25)).norm() < 1e-12);
        assert!(is_rig_file(&text) && !is_rig_file(&dir.path().join("cameras.txt")));
    }

    #[test]
    fn damaged_files_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let [text, binary] = RIG_FILES.map(|name| dir.path().join(name));
        let whole = bytes();
        for length in 0..whole.len() {
            std::fs::write(&binary, &whole[..length]).unwrap();
            assert!(read(&binary).is_err(), "{length}");
        }
        for bad in [
            "1",
            "1 x CAMERA 1",
            "1 2 CAMERA 1",
            "1 2 CAMERA 1 CAMERA 2 1 0 0 0 0 0 0 0",
        ] {
            std::fs::write(&text, bad).unwrap();
            let said = read(&text).unwrap_err().to_string();
            assert!(said.contains("rigs.txt:1: "), "{said}");
        }
    }
}
