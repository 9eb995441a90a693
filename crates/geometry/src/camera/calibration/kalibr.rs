//! Kalibr's camchain files.

use super::coefficients::{brown_conrady, double_sphere, eucm, fov, kannala_brandt, mei};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{numbers, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
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

/// Reads `camera_model`, `intrinsics`, `distortion_model`, `distortion_coeffs` and `resolution`.
///
/// The intrinsics are `[fx, fy, cx, cy]` of a pinhole; `omni` has ξ before them, `ds` ξ and α,
/// `eucm` α and β.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let camera = select_camera(cameras(tree).collect(), name)?;
    let model = text_entry(camera, "camera_model").unwrap_or("pinhole");
    let own = match model {
        "pinhole" => 0,
        "omni" => 1,
        "ds" | "eucm" => 2,
        _ => {
            return Err(ParseError::new(format!(
                "the camera model {model:?} is not supported; known are pinhole, omni, ds and eucm"
            )));
        }
    };
    let intrinsics = list(camera, "intrinsics")?;
    let Some((own, [fx, fy, cx, cy])) = intrinsics.split_at_checked(own) else {
        return Err(wrong_count(model, intrinsics.len()));
    };
    let resolution = list(camera, "resolution")?;
    let whole = |value: f64| value.fract() == 0.0 && (1.0..=1e6).contains(&value);
    let (width, height) = match resolution[..] {
        [width, height] if whole(width) && whole(height) => (width as u32, height as u32),
        _ => {
            return Err(ParseError::new(
                "`resolution` must be [width, height] in pixels",
            ));
        }
    };
    Ok(Camera::at_rest(
        [width, height],
        [*fx, *fy],
        [*cx, *cy],
        lens(camera, model, own)?,
    ))
}

fn list(camera: &Value, name: &str) -> Result<Vec<f64>, ParseError> {
    match camera.get(name) {
        Some(value) => numbers(value, name),
        None => Err(ParseError::new(format!("the entry `{name}` is missing"))),
    }
}

fn wrong_count(model: &str, count: usize) -> ParseError {
    let names = match model {
        "omni" => "the model omni has xi, fx, fy, cx, cy",
        "ds" => "the model ds has xi, alpha, fx, fy, cx, cy",
        "eucm" => "the model eucm has alpha, beta, fx, fy, cx, cy",
        _ => "a pinhole has fx, fy, cx, cy",
    };
    ParseError::new(format!("`intrinsics` has {count} numbers; {names}"))
}

/// The lens of a camera model with its `own` parameters and the distortion.
fn lens(camera: &Value, model: &str, own: &[f64]) -> Result<Lens, ParseError> {
    let coefficients = || list(camera, "distortion_coeffs");
    let distortion = text_entry(camera, "distortion_model").unwrap_or("none");
    match (model, distortion) {
        ("pinhole", "none") => Ok(Lens::default()),
        ("pinhole", "radtan") => brown_conrady(&coefficients()?),
        ("pinhole", "equidistant" | "equi") => kannala_brandt(&coefficients()?),
        ("pinhole", "fov") => fov(&coefficients()?),
        ("omni", "none") => mei(own),
        ("omni", "radtan") => mei(&[own, &coefficients()?].concat()),
        ("ds", "none") => double_sphere(own),
        ("eucm", "none") => eucm(own),
        _ => {
            let known = match model {
                "pinhole" => "radtan, equidistant, fov and none",
                "omni" => "radtan and none",
                _ => "none",
            };
            Err(ParseError::new(format!(
                "the distortion model {distortion:?} is not supported with {model}; known: {known}"
            )))
        }
    }
}
