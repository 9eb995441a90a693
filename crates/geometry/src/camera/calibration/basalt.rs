//! Basalt's calibration in JSON.

use super::coefficients::{double_sphere, eucm, fov, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{number, numbers, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a file with `value0` and cameras in it.
pub fn is_basalt(tree: &Value) -> bool {
    cameras(tree).is_some()
}

fn cameras(tree: &Value) -> Option<&Vec<Value>> {
    tree.get("value0")?.get("intrinsics")?.as_array()
}

/// Reads `camera_type` and `intrinsics` of a camera and its `resolution`. The cameras are named
/// `cam0`, `cam1` and so on, in their order.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let all = cameras(tree).map(Vec::as_slice).unwrap_or_default();
    let named = all.iter().enumerate();
    let named = named.map(|(k, camera)| (format!("cam{k}"), (k, camera)));
    let (index, camera) = select_camera(named.collect(), name)?;
    let missing = |name: &str| ParseError::new(format!("the entry `{name}` is missing"));
    let sizes = tree.get("value0").and_then(|tree| tree.get("resolution"));
    let size = sizes.and_then(|sizes| sizes.get(index));
    let size = numbers(size.ok_or_else(|| missing("resolution"))?, "resolution")?;
    let whole = |value: f64| value.fract() == 0.0 && (1.0..=1e6).contains(&value);
    let (width, height) = match size[..] {
        [width, height] if whole(width) && whole(height) => (width as u32, height as u32),
        _ => {
            return Err(ParseError::new(
                "`resolution` must hold [width, height] in pixels for every camera",
            ));
        }
    };
    let intrinsics = camera.get("intrinsics");
    let intrinsics = intrinsics.ok_or_else(|| missing("intrinsics"))?;
    let at = |name: &str| number(intrinsics, &[name]);
    Ok(Camera::at_rest(
        [width, height],
        [at("fx")?, at("fy")?],
        [at("cx")?, at("cy")?],
        lens(text_entry(camera, "camera_type").unwrap_or("?"), at)?,
    ))
}

/// The lens of a type of camera with the parameters `at` their names.
fn lens(model: &str, at: impl Fn(&str) -> Result<f64, ParseError>) -> Result<Lens, ParseError> {
    match model {
        "pinhole" => Ok(Lens::default()),
        "ds" => double_sphere(&[at("xi")?, at("alpha")?]),
        "eucm" => eucm(&[at("alpha")?, at("beta")?]),
        "ucm" => eucm(&[at("alpha")?, 1.0]),
        "kb4" => kannala_brandt(&[at("k1")?, at("k2")?, at("k3")?, at("k4")?]),
        "fov" => fov(&[at("w")?]),
        other => Err(ParseError::new(format!(
            "the camera type {other:?} is not supported; known are pinhole, ds, eucm, ucm, kb4 \
             and fov"
        ))),
    }
}
