//! Kalibr's camchain files.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{numbers, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use crate::camera::sweep::Sweep;
use serde_json::Value;

/// True for a file with entries `cam0`, `cam1`, …
pub fn is_camchain(tree: &Value) -> bool {
    cameras(tree).next().is_some()
}

fn cameras(tree: &Value) -> impl Iterator<Item = (String, &Value)> {
    let entries = tree.as_object().into_iter().flatten();
    entries
        .filter(|(name, value)| {
            let number = name.strip_prefix("cam").unwrap_or_default();
            number.parse::<u32>().is_ok() && value.is_object()
        })
        .map(|(name, value)| (name.clone(), value))
}

/// Reads `camera_model: pinhole`, `intrinsics: [fx, fy, cx, cy]`, `distortion_model`,
/// `distortion_coeffs` and `resolution`.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let camera = select_camera(cameras(tree).collect(), name)?;
    let model = text_entry(camera, "camera_model").unwrap_or("pinhole");
    if model != "pinhole" {
        return Err(ParseError::new(format!(
            "the camera model {model:?} is not supported; calibrate with pinhole-radtan or \
             pinhole-equi"
        )));
    }
    let list = |name: &str| match camera.get(name) {
        Some(value) => numbers(value, name),
        None => Err(ParseError::new(format!("the entry `{name}` is missing"))),
    };
    let intrinsics = list("intrinsics")?;
    let [fx, fy, cx, cy] = intrinsics[..] else {
        return Err(ParseError::new(format!(
            "`intrinsics` has {} numbers; a pinhole has fx, fy, cx, cy",
            intrinsics.len()
        )));
    };
    let resolution = list("resolution")?;
    let whole = |value: f64| value.fract() == 0.0 && (1.0..=1e6).contains(&value);
    let (width, height) = match resolution[..] {
        [width, height] if whole(width) && whole(height) => (width as u32, height as u32),
        _ => {
            return Err(ParseError::new(
                "`resolution` must be [width, height] in pixels",
            ));
        }
    };
    let lens = match text_entry(camera, "distortion_model") {
        None | Some("none") => Lens::default(),
        Some("radtan") => brown_conrady(&list("distortion_coeffs")?)?,
        Some("equidistant" | "equi") => kannala_brandt(&list("distortion_coeffs")?)?,
        Some(other) => {
            return Err(ParseError::new(format!(
                "the distortion model {other:?} is not supported; known are radtan, equidistant \
                 and none"
            )));
        }
    };
    Ok(Camera {
        width,
        height,
        fx,
        fy,
        cx,
        cy,
        lens,
        sweep: Sweep::default(),
        max_range_m: f64::INFINITY,
    })
}
