//! Calibrations of recordings: the first `sensor_msgs/CameraInfo` of a topic.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::{CalibrationError, ParseError};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use crate::recordings::{CameraInfo, Recording, RecordingError, TopicGroup};
use std::path::Path;

/// Reads the calibration of a topic, or of the only one with calibrations.
///
/// # Errors
/// A recording that cannot be read, no such topic, a message that ends too early.
pub fn read_info(path: &Path, topic: Option<&str>) -> Result<CameraInfo, CalibrationError> {
    let recording = match topic {
        Some(topic) => Recording::open_to_first(path, TopicGroup::Calibrations, topic)?,
        None => Recording::open(path)?,
    };
    let topic = recording.topic(TopicGroup::Calibrations, topic)?;
    let mut reader = recording.reader()?;
    let first = topic.messages.first().zip(topic.content);
    let info = match first {
        Some((message, (_, wire))) => CameraInfo::read(&reader.read(message)?, wire),
        None => Err("no message can be read".to_owned()),
    };
    info.map_err(|what| CalibrationError::Content {
        path: path.to_owned(),
        line: None,
        what: format!("topic {}, message 0: {what}", topic.name),
    })
}

/// The camera of a calibration.
///
/// # Errors
/// A camera that is not calibrated; a lens that is not supported; pictures that are a part of what
/// is calibrated.
pub fn camera(info: &CameraInfo) -> Result<Camera, ParseError> {
    let [fx, skew, cx, _, fy, cy, ..] = info.k;
    if fx == 0.0 {
        return Err(ParseError::new(
            "its CameraInfo is empty: the camera was not calibrated when it was recorded; give a \
             calibration file instead",
        ));
    }
    if info.is_reduced {
        return Err(ParseError::new(
            "its CameraInfo is of the full sensor, and the pictures are binned or a part of it; \
             give a calibration file for the pictures instead",
        ));
    }
    if skew != 0.0 {
        return Err(ParseError::new(format!(
            "K has a skew of {skew}; cameras with skew are not supported"
        )));
    }
    let lens = match info.distortion_model.as_str() {
        "plumb_bob" | "rational_polynomial" => brown_conrady(&info.d)?,
        "equidistant" | "fisheye" => kannala_brandt(&info.d)?,
        "" if info.d.iter().all(|c| *c == 0.0) => Lens::default(),
        other => {
            return Err(ParseError::new(format!(
                "the distortion model {other:?} is not supported; known are plumb_bob, \
                 rational_polynomial and equidistant"
            )));
        }
    };
    let size = [info.width, info.height];
    Ok(Camera::at_rest(size, [fx, fy], [cx, cy], lens))
}

impl From<RecordingError> for CalibrationError {
    fn from(error: RecordingError) -> Self {
        match error {
            RecordingError::Read { path, source } => Self::Read { path, source },
            RecordingError::Content { path, what } => Self::Content {
                path,
                line: None,
                what,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn info(distortion_model: &str, d: &[f64]) -> CameraInfo {
        CameraInfo {
            height: 48,
            width: 64,
            distortion_model: distortion_model.to_owned(),
            d: d.to_vec(),
            k: [50.0, 0.0, 31.0, 0.0, 51.0, 23.0, 0.0, 0.0, 1.0],
            is_reduced: false,
        }
    }

    #[test]
    fn models_are_those_of_opencv() {
        let d = [0.1, -0.02, 0.001, 0.002, 0.003];
        let read = camera(&info("plumb_bob", &d)).unwrap();
        assert_eq!((read.width, read.height), (64, 48));
        assert_eq!(
            [read.fx, read.fy, read.cx, read.cy],
            [50.0, 51.0, 31.0, 23.0]
        );
        assert_eq!(read.lens, brown_conrady(&d).unwrap());
        let read = camera(&info("equidistant", &d[..4])).unwrap();
        assert_eq!(read.lens, kannala_brandt(&d[..4]).unwrap());
        assert_eq!(camera(&info("", &[])).unwrap().lens, Lens::default());
    }

    #[test]
    fn what_is_no_calibration_of_the_pictures_is_refused() {
        let said = |info: &CameraInfo| camera(info).unwrap_err().what;
        let sound = info("plumb_bob", &[0.0; 5]);
        let empty = CameraInfo {
            k: [0.0; 9],
            ..sound.clone()
        };
        assert!(said(&empty).contains("not calibrated"));
        let binned = CameraInfo {
            is_reduced: true,
            ..sound
        };
        assert!(said(&binned).contains("binned"));
        assert!(said(&info("thin_prism", &[0.0; 4])).contains("thin_prism"));
    }

    /// The recordings are those of other people's writers (`fixtures/recordings/make.py`).
    #[test]
    fn calibrations_are_named_by_their_topics() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/recordings");
        for name in ["zstd.mcap", "ros1.mcap", "bz2.bag"] {
            for topic in [None, Some("/camera/camera_info")] {
                let read = camera(&read_info(&folder.join(name), topic).unwrap()).unwrap();
                assert_eq!((read.width, read.height), (24, 16));
                let found = [read.fx, read.fy, read.cx, read.cy];
                assert_eq!(found, [20.0, 21.0, 11.5, 7.5], "{name}");
            }
            let said = read_info(&folder.join(name), Some("/x")).unwrap_err();
            let said = said.to_string();
            for part in ["\"/x\"", "/camera/camera_info ("] {
                assert!(said.contains(part), "{said}");
            }
        }
    }
}
