//! OpenCV's YAML and ROS's `camera_info`, which share a structure.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::picture_size::PictureSize;
use super::unknown::unknown_calibration;
use super::value_tree::{entry, numbers, pixels, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

const MATRIX: [&str; 7] = [
    "camera_matrix",
    "cameraMatrix",
    "Camera_Matrix",
    "K",
    "k",
    "intrinsics",
    "mtx",
];
const DISTORTION: [&str; 9] = [
    "distortion_coefficients",
    "distCoeffs",
    "dist_coeffs",
    "Distortion_Coefficients",
    "D",
    "d",
    "distortion",
    "dist_coeff",
    "dist",
];
const WIDTH: [&str; 3] = ["image_width", "width", "image_Width"];
const HEIGHT: [&str; 3] = ["image_height", "height", "image_Height"];

/// True for a file with a camera matrix.
pub fn has_matrix(tree: &Value) -> bool {
    entry(tree, &MATRIX).is_some()
}

/// Reads `camera_matrix`, `distortion_coefficients`, `image_width` and `image_height` (or their
/// other common names).
///
/// ROS names the lens model in `distortion_model`; OpenCV's files hold a fisheye if `fisheye_model`
/// is 1. Files without a size have that of the pictures.
pub fn read(tree: &Value, picture_size: PictureSize) -> Result<Camera, ParseError> {
    let matrix = entry(tree, &MATRIX)
        .ok_or_else(|| unknown_calibration(" (no `camera_matrix`, `cam0` or `model_type`)"))?;
    let [focal, centre] = focal_and_centre(matrix)?;
    let stated = |names: &[&str]| {
        pixels(tree, names).map_err(|error| {
            let what = error.what + "; add the frames' size as image_width and image_height";
            ParseError::new(what)
        })
    };
    let states_size = entry(tree, &WIDTH).is_some() || entry(tree, &HEIGHT).is_some();
    let [width, height] = match picture_size().filter(|_| !states_size) {
        Some(size) => size,
        None => [stated(&WIDTH)?, stated(&HEIGHT)?],
    };
    let d = match entry(tree, &DISTORTION) {
        Some(list) => numbers(list, "distortion_coefficients")?,
        None => Vec::new(),
    };
    let fisheye = entry(tree, &["fisheye_model", "fisheye"])
        .is_some_and(|flag| flag.as_f64() == Some(1.0) || flag.as_bool() == Some(true));
    let lens = match text_entry(tree, "distortion_model") {
        _ if fisheye => kannala_brandt(&d)?,
        None | Some("plumb_bob" | "rational_polynomial" | "radtan" | "") => brown_conrady(&d)?,
        Some("equidistant" | "fisheye") => kannala_brandt(&d)?,
        Some("none") => Lens::default(),
        Some(other) => {
            return Err(ParseError::new(format!(
                "the distortion model {other:?} is not supported; known are plumb_bob, \
                 rational_polynomial and equidistant"
            )));
        }
    };
    Ok(Camera::at_rest([width, height], focal, centre, lens))
}

/// The focal lengths and the principal point of a camera matrix, pixels.
pub fn focal_and_centre(matrix: &Value) -> Result<[[f64; 2]; 2], ParseError> {
    let k = numbers(matrix, "camera_matrix")?;
    let [fx, skew, cx, _, fy, cy, _, _, _] = k[..] else {
        return Err(ParseError::new(format!(
            "`camera_matrix` has {} numbers; it must have 3 × 3",
            k.len()
        )));
    };
    if skew != 0.0 {
        return Err(ParseError::new(format!(
            "`camera_matrix` has a skew of {skew}; cameras with skew are not supported"
        )));
    }
    Ok([[fx, fy], [cx, cy]])
}
