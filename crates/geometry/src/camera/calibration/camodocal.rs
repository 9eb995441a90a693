//! The YAML of camodocal and VINS-Fusion.

use super::coefficients::{brown_conrady, kannala_brandt, mei};
use super::error::ParseError;
use super::value_tree::{entry, number, pixels, text_entry};
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a file with `model_type`.
pub fn is_camodocal(tree: &Value) -> bool {
    tree.get("model_type").is_some()
}

/// Reads `model_type` (`PINHOLE`, `MEI` or `KANNALA_BRANDT`), `image_width`, `image_height`,
/// `projection_parameters`, `distortion_parameters` and `mirror_parameters`.
pub fn read(tree: &Value) -> Result<Camera, ParseError> {
    let part = |name: &str| {
        entry(tree, &[name])
            .ok_or_else(|| ParseError::new(format!("the entry `{name}` is missing")))
    };
    let projection = part("projection_parameters")?;
    let all = |tree: &Value, names: &[&str]| -> Result<Vec<f64>, ParseError> {
        names.iter().map(|name| number(tree, &[name])).collect()
    };
    let distortion = || all(part("distortion_parameters")?, &["k1", "k2", "p1", "p2"]);
    let model = text_entry(tree, "model_type").unwrap_or_default();
    let (names, lens) = match model {
        "PINHOLE" => (["fx", "fy", "cx", "cy"], brown_conrady(&distortion()?)?),
        "MEI" => {
            let xi = number(part("mirror_parameters")?, &["xi"])?;
            let names = ["gamma1", "gamma2", "u0", "v0"];
            (names, mei(&[&[xi][..], &distortion()?].concat())?)
        }
        // Its k1 is 1.
        "KANNALA_BRANDT" => {
            let k = all(projection, &["k2", "k3", "k4", "k5"])?;
            (["mu", "mv", "u0", "v0"], kannala_brandt(&k)?)
        }
        "SCARAMUZZA" => {
            return Err(ParseError::new(
                "the model SCARAMUZZA is not read from YAML; give the calib_results.txt of \
                 OCamCalib",
            ));
        }
        other => {
            return Err(ParseError::new(format!(
                "the model {other:?} is not supported; known are PINHOLE, MEI and KANNALA_BRANDT"
            )));
        }
    };
    let [fx, fy, cx, cy] = names.map(|name| number(projection, &[name]));
    Ok(Camera::at_rest(
        [
            pixels(tree, &["image_width"])?,
            pixels(tree, &["image_height"])?,
        ],
        [fx?, fy?],
        [cx?, cy?],
        lens,
    ))
}
