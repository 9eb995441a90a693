//! Calibration files: our own (JSON or TOML), OpenCV's YAML, ROS's camera_info, Kalibr's camchain,
//! COLMAP's cameras.txt and nerfstudio's transforms.json.
//!
//! | file | told by | lens | first pixel |
//! | --- | --- | --- | --- |
//! | own | `.json`, `.toml` | [`own`] | `pixel_centre` |
//! | OpenCV | `.yaml`, `.yml`; a matrix with `rows`, `cols`, `data` named `camera_matrix` or alike | 4, 5 or 8 coefficients; fisheye if it says `fisheye_model: 1` | (0, 0) |
//! | ROS | the same with `distortion_model` | `plumb_bob`, `rational_polynomial`, `equidistant` | (0, 0) |
//! | Kalibr | `.yaml` with `cam0:` | `radtan`, `equidistant`, `none` | (0, 0) |
//! | COLMAP | `.txt` | PINHOLE … FULL_OPENCV, the fisheyes | (½, ½) |
//! | nerfstudio | `.json` with `fl_x` or `frames` | PINHOLE, OPENCV, OPENCV_FISHEYE | (½, ½) |

mod coefficients;
mod colmap;
mod kalibr;
mod nerfstudio;
mod opencv;
mod own;
mod tree;

use super::Camera;
use std::path::{Path, PathBuf};

pub(super) use own::CameraFile;
pub use own::format_calibration;

/// Why a calibration file cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CalibrationError {
    /// The file cannot be read.
    #[error("{}: cannot read the calibration: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file does not hold what it should.
    #[error("{}:{}{what}", path.display(), place(*line))]
    Content {
        /// The file.
        path: PathBuf,
        /// The line, from 1, where it is known.
        line: Option<usize>,
        /// What is wrong, and what to do.
        what: String,
    },
}

fn place(line: Option<usize>) -> String {
    line.map_or(" ".to_owned(), |line| format!("{line}: "))
}

/// What a parser found wrong, and in which line.
#[derive(Debug, PartialEq)]
struct Fault {
    line: Option<usize>,
    what: String,
}

impl Fault {
    fn new(what: impl Into<String>) -> Self {
        Self {
            line: None,
            what: what.into(),
        }
    }

    fn at(line: usize, what: impl Into<String>) -> Self {
        Self {
            line: Some(line),
            what: what.into(),
        }
    }
}

/// Pixels along a side of the smallest picture.
const SMALLEST: u32 = 16;
/// A lens that shows less of the picture than this has other numbers than were meant.
const LEAST_SHOWN: f64 = 0.5;

/// Reads a calibration file; which kind it is follows from its name and content (see the table in
/// the module's documentation). `name`: which camera, where a file has several (`cam1`, a COLMAP
/// id).
///
/// # Errors
/// An unreadable file; an unknown, missing or impossible entry, with its line where it is known; a
/// lens model that is not supported; several cameras and no name.
pub fn read_calibration(path: &Path, name: Option<&str>) -> Result<Camera, CalibrationError> {
    let content = |fault: Fault| CalibrationError::Content {
        path: path.to_owned(),
        line: fault.line,
        what: fault.what,
    };
    let bytes = std::fs::read(path).map_err(|source| CalibrationError::Read {
        path: path.to_owned(),
        source,
    })?;
    let text = String::from_utf8(bytes).map_err(|_| {
        content(Fault::new(
            "this is no text; give the calibration file itself",
        ))
    })?;
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    parse(
        text.trim_start_matches('\u{feff}'),
        &extension.to_lowercase(),
        name,
    )
    .and_then(checked)
    .map_err(content)
}

fn parse(text: &str, extension: &str, name: Option<&str>) -> Result<Camera, Fault> {
    match extension {
        "yaml" | "yml" => {
            let tree = tree::of_yaml(text)?;
            if kalibr::is_camchain(&tree) {
                kalibr::read(&tree, name)
            } else {
                opencv::read(&tree)
            }
        }
        "txt" => colmap::read(text, name),
        "toml" => own::read_toml(text),
        "xml" => Err(Fault::new(
            "OpenCV's XML is not read; save the calibration as YAML (a name that ends in .yml)",
        )),
        _ => match tree::of_json(text) {
            Ok(tree) if nerfstudio::is_transforms(&tree) => nerfstudio::read(&tree, name),
            _ => own::read_json(text),
        },
    }
}

/// Refuses numbers that make no camera.
fn checked(camera: Camera) -> Result<Camera, Fault> {
    if camera.width < SMALLEST || camera.height < SMALLEST {
        return Err(Fault::new(format!(
            "width and height are {} × {}; they must be the frames' size in pixels, {SMALLEST} at the least",
            camera.width, camera.height
        )));
    }
    for (name, value) in [("fx", camera.fx), ("fy", camera.fy)] {
        if !(value.is_finite() && value > 0.0) {
            return Err(Fault::new(format!(
                "{name} is {value}; a focal length in pixels is positive"
            )));
        }
    }
    for (name, value) in [("cx", camera.cx), ("cy", camera.cy)] {
        if !value.is_finite() {
            return Err(Fault::new(format!(
                "{name} is {value}; it must be a number"
            )));
        }
    }
    let shown = camera.shown_share();
    if shown < LEAST_SHOWN {
        return Err(Fault::new(format!(
            "the distortion folds the picture back on itself: only {:.0} % of it is shown; check its coefficients and their \
             order, and that fx and fy are in pixels",
            100.0 * shown
        )));
    }
    Ok(camera)
}

/// The one camera of several that is meant, of those with their names.
fn choose<T>(mut cameras: Vec<(String, T)>, name: Option<&str>) -> Result<T, Fault> {
    let names = || {
        let names: Vec<_> = cameras.iter().map(|(name, _)| name.as_str()).collect();
        names.join(", ")
    };
    let at = match name {
        Some(wanted) => cameras
            .iter()
            .position(|(name, _)| name == wanted)
            .ok_or_else(|| {
                Fault::new(format!("there is no camera {wanted:?}; it has {}", names()))
            })?,
        None if cameras.len() == 1 => 0,
        None if cameras.is_empty() => return Err(Fault::new("it holds no camera")),
        None => {
            return Err(Fault::new(format!(
                "it holds several cameras ({}); say which with `name` under [camera] of survey.toml",
                names()
            )));
        }
    };
    Ok(cameras.swap_remove(at).1)
}

#[cfg(test)]
mod tests;
