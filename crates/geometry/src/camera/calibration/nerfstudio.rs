//! The camera in nerfstudio's `transforms.json`.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{number, pixels, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a file with `fl_x` or `frames`.
pub fn is_transforms(tree: &Value) -> bool {
    ["fl_x", "frames", "camera_angle_x"]
        .iter()
        .any(|name| tree.get(name).is_some())
}

/// Reads `fl_x`, `fl_y`, `cx`, `cy`, `w`, `h`, `camera_model` and the coefficients, given at the
/// top level or, if every frame has its own, in each frame (then `name` is a frame's `file_path`).
/// Pixel coordinates are counted from the corner of the first pixel and converted.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    if tree.get("fl_x").is_some() {
        return camera(tree, tree);
    }
    let frames = tree.get("frames").and_then(Value::as_array);
    let own: Vec<_> = frames
        .into_iter()
        .flatten()
        .filter(|frame| frame.get("fl_x").is_some())
        .map(|frame| {
            let path = text_entry(frame, "file_path").unwrap_or("?");
            (path.to_owned(), frame)
        })
        .collect();
    if own.is_empty() {
        return Err(ParseError::new(
            "there is no `fl_x`; the focal lengths in pixels must be given as fl_x and fl_y",
        ));
    }
    // Identical cameras of all frames count as one.
    let (_, first) = &own[0];
    let intrinsics = [
        "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2",
    ];
    let alike = |frame: &Value| {
        intrinsics
            .iter()
            .all(|name| frame.get(name) == first.get(name))
    };
    if own.iter().all(|(_, frame)| alike(frame)) {
        return camera(first, tree);
    }
    camera(select_camera(own, name)?, tree)
}

fn camera(own: &Value, tree: &Value) -> Result<Camera, ParseError> {
    let coefficient = |name: &str| match own.get(name) {
        None => Ok(0.0),
        Some(_) => number(own, &[name]),
    };
    let [k1, k2, k3, k4] = [
        coefficient("k1")?,
        coefficient("k2")?,
        coefficient("k3")?,
        coefficient("k4")?,
    ];
    let model = text_entry(own, "camera_model").or_else(|| text_entry(tree, "camera_model"));
    let lens = match model.unwrap_or("OPENCV") {
        "OPENCV_FISHEYE" => kannala_brandt(&[k1, k2, k3, k4])?,
        "PINHOLE" | "SIMPLE_PINHOLE" => Lens::default(),
        "OPENCV" | "SIMPLE_RADIAL" | "RADIAL" => {
            if k4 != 0.0 {
                return Err(ParseError::new(
                    "k4 is the eighth power of the radius in nerfstudio's model and is not \
                     supported; it must be 0",
                ));
            }
            brown_conrady(&[k1, k2, coefficient("p1")?, coefficient("p2")?, k3])?
        }
        other => {
            return Err(ParseError::new(format!(
                "the camera model {other} is not supported; known are PINHOLE, OPENCV and \
                 OPENCV_FISHEYE"
            )));
        }
    };
    let fx = number(own, &["fl_x"])?;
    Ok(Camera::at_rest(
        [pixels(own, &["w"])?, pixels(own, &["h"])?],
        [
            fx,
            own.get("fl_y").map_or(Ok(fx), |_| number(own, &["fl_y"]))?,
        ],
        [number(own, &["cx"])? - 0.5, number(own, &["cy"])? - 0.5],
        lens,
    ))
}
