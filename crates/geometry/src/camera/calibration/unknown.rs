//! The answer to files that hold no calibration known here.

use super::error::{ParseError, ParseErrorKind};

/// The files that can be read.
const KNOWN: &str = "known are camera.json and camera.toml of this program, YAML of ROS \
                     (camera_info), Kalibr (camchain), camodocal and ORB-SLAM, YAML, XML and JSON \
                     of OpenCV, any of these with fx, fy, cx and cy, COLMAP's cameras.txt and \
                     cameras.bin, nerfstudio's transforms.json, the files of OpenSfM, OpenMVG, \
                     Meshroom, Metashape, Bundler, RealityCapture and Pix4D, Basalt's JSON, \
                     Gyroflow's lens profiles and OCamCalib's calib_results.txt; or \
                     write a camera.json";

/// The error that names the known files; `missing`: an explanation in brackets, or nothing.
pub fn unknown_calibration(missing: &str) -> ParseError {
    let what = format!("this is not a calibration known here{missing}; {KNOWN}");
    ParseError {
        kind: ParseErrorKind::OtherKind,
        ..ParseError::new(what)
    }
}
