//! The calibration file `camera.json`.

use super::{Pinhole, Radial};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("{}: cannot read the calibration: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not the JSON expected.
    #[error("{}: {source}", path.display())]
    Parse {
        /// The file.
        path: PathBuf,
        /// Line, column and what was expected there.
        source: serde_json::Error,
    },
    /// The numbers make no camera.
    #[error("{}: {what}", path.display())]
    Value {
        /// The file.
        path: PathBuf,
        /// Which value, and what it should be.
        what: String,
    },
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Model {
    Pinhole,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PixelCentre {
    /// The centre of the first pixel is (0, 0).
    #[default]
    Integer,
    /// The centre of the first pixel is (½, ½).
    Half,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CalibrationFile {
    model: Model,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k1: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k2: f64,
    #[serde(default)]
    pixel_centre: PixelCentre,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Reads `camera.json`: `model` ("pinhole"), `width`, `height`, `fx`, `fy`, `cx`, `cy` in pixels, `k1`, `k2` (radial
/// distortion, 0 if missing), and `pixel_centre` ("integer", the default, or "half").
///
/// # Errors
/// An unreadable file, an unknown or missing key (with line and column), or numbers that make no camera.
pub fn read_calibration(path: &Path) -> Result<Pinhole, CalibrationError> {
    let text = std::fs::read_to_string(path).map_err(|source| CalibrationError::Read {
        path: path.to_owned(),
        source,
    })?;
    let file: CalibrationFile =
        serde_json::from_str(text.trim_start_matches('\u{feff}')).map_err(|source| {
            CalibrationError::Parse {
                path: path.to_owned(),
                source,
            }
        })?;
    let fail = |what: String| CalibrationError::Value {
        path: path.to_owned(),
        what,
    };
    if file.width < 16 || file.height < 16 {
        return Err(fail(format!(
            "width and height are {} × {}; they must be the frames' size in pixels, 16 at the least",
            file.width, file.height
        )));
    }
    for (name, value) in [("fx", file.fx), ("fy", file.fy)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(fail(format!(
                "{name} is {value}; a focal length in pixels is positive"
            )));
        }
    }
    for (name, value) in [
        ("cx", file.cx),
        ("cy", file.cy),
        ("k1", file.k1),
        ("k2", file.k2),
    ] {
        if !value.is_finite() {
            return Err(fail(format!("{name} is {value}; it must be a number")));
        }
    }
    let shift = match file.pixel_centre {
        PixelCentre::Integer => 0.0,
        PixelCentre::Half => 0.5,
    };
    let camera = Pinhole {
        width: file.width,
        height: file.height,
        fx: file.fx,
        fy: file.fy,
        cx: file.cx - shift,
        cy: file.cy - shift,
        radial: Radial {
            k1: file.k1,
            k2: file.k2,
        },
    };
    if camera.field().is_none() {
        return Err(fail(format!(
            "k1 = {} and k2 = {} fold the picture back on itself before its corners; check them, and that fx and fy are in pixels",
            file.k1, file.k2
        )));
    }
    Ok(camera)
}

/// The text of a `camera.json` that [`read_calibration`] restores exactly.
pub fn format_calibration(camera: &Pinhole) -> String {
    let file = CalibrationFile {
        model: Model::Pinhole,
        width: camera.width,
        height: camera.height,
        fx: camera.fx,
        fy: camera.fy,
        cx: camera.cx,
        cy: camera.cy,
        k1: camera.radial.k1,
        k2: camera.radial.k2,
        pixel_centre: PixelCentre::Integer,
    };
    // Numbers and plain names always serialise.
    serde_json::to_string_pretty(&file).unwrap_or_default() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Pinhole, CalibrationError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("camera.json");
        std::fs::write(&path, text).unwrap();
        read_calibration(&path)
    }

    #[test]
    fn round_trip_is_exact() {
        let camera = Pinhole::from_vertical_fov(640, 480, 1.0471975511965976);
        assert_eq!(read_text(&format_calibration(&camera)).unwrap(), camera);
        let radial = Radial {
            k1: -0.0512345678901,
            k2: 0.003,
        };
        let camera = Pinhole { radial, ..camera };
        assert_eq!(read_text(&format_calibration(&camera)).unwrap(), camera);
    }

    #[test]
    fn half_pixel_centres_are_converted() {
        let text = r#"{"model":"pinhole","width": 40, "height": 20,"fx":3,"fy":3,"cx":2,"cy":1,"pixel_centre":"half"}"#;
        let camera = read_text(text).unwrap();
        assert_eq!((camera.cx, camera.cy), (1.5, 0.5));
    }

    #[test]
    fn bad_files_say_where_and_what() {
        for (text, expected) in [
            (
                r#"{"model":"pinhole","width": 40, "height": 20,"fx":3,"fy":3,"cx":2,"cy":1,"k3":0}"#,
                "unknown field `k3`",
            ),
            (
                r#"{"model":"pinhole","width": 40, "height": 20,"fx":30,"fy":30,"cx":20,"cy":10,"k1":-2}"#,
                "fold the picture",
            ),
            (
                r#"{"model":"pinhole","width": 40, "height": 20,"fx":-3,"fy":3,"cx":2,"cy":1}"#,
                "fx is -3",
            ),
            (
                r#"{"model":"fisheye","width": 40, "height": 20,"fx":3,"fy":3,"cx":2,"cy":1}"#,
                "unknown variant `fisheye`",
            ),
            (r#"{"model":"pinhole","width":4}"#, "missing field"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
