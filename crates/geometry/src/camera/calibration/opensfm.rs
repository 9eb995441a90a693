//! The cameras of OpenSfM's `reconstruction.json`.
//!
//! Focal lengths, principal points and coefficients are those of normalised image coordinates: the
//! middle of the picture is (0, 0), its longer side has length 1. In pixels,
//! `u = max(w, h) x + (w − 1) / 2`. Source: OpenSfM's documentation, "Geometric Models".

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{needed, number, pixels, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// True for a list of reconstructions, each with `cameras`.
pub fn is_reconstruction(tree: &Value) -> bool {
    let parts = tree.as_array().map(Vec::as_slice).unwrap_or_default();
    !parts.is_empty() && parts.iter().all(|part| part.get("cameras").is_some())
}

/// True for cameras by name, each with a `projection_type`: OpenSfM's `camera_models.json`, the
/// `cameras.json` of OpenDroneMap.
pub fn is_camera_models(tree: &Value) -> bool {
    tree.as_object().is_some_and(|cameras| {
        let mut each = cameras.values();
        !cameras.is_empty() && each.all(|camera| camera.get("projection_type").is_some())
    })
}

/// Reads `projection_type`, `width`, `height` and the parameters of a camera. Its name is its key.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let parts = tree.as_array().map(Vec::as_slice).unwrap_or_default();
    let [part] = parts else {
        return Err(ParseError::new(format!(
            "the file holds {} reconstructions, each with its own cameras; leave the one of the \
             survey",
            parts.len()
        )));
    };
    named_camera(needed(part, "cameras")?, name)
}

/// Reads the camera of that name of [`is_camera_models`].
pub fn named_camera(cameras: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let cameras = cameras.as_object().into_iter().flatten();
    let cameras = cameras.map(|(name, camera)| (name.clone(), camera));
    camera(select_camera(cameras.collect(), name)?)
}

fn camera(tree: &Value) -> Result<Camera, ParseError> {
    let coefficients = |names: &[&str]| -> Result<Vec<f64>, ParseError> {
        let value = |name: &&str| tree.get(name).map_or(Ok(0.0), |_| number(tree, &[name]));
        names.iter().map(value).collect()
    };
    let model = text_entry(tree, "projection_type").unwrap_or("perspective");
    let lens: Lens = match model {
        "perspective" | "simple_radial" | "radial" => brown_conrady(&coefficients(&["k1", "k2"])?)?,
        "brown" => brown_conrady(&coefficients(&["k1", "k2", "p1", "p2", "k3"])?)?,
        "fisheye" => kannala_brandt(&coefficients(&["k1", "k2"])?)?,
        "fisheye_opencv" => kannala_brandt(&coefficients(&["k1", "k2", "k3", "k4"])?)?,
        other => {
            return Err(ParseError::new(format!(
                "the projection {other:?} is not supported; known are perspective, simple_radial, \
                 radial, brown, fisheye and fisheye_opencv"
            )));
        }
    };
    let [width, height] = [pixels(tree, &["width"])?, pixels(tree, &["height"])?];
    let longer = f64::from(width.max(height));
    let focal = ["focal_x", "focal_y"].map(|name| number(tree, &[name, "focal"]));
    let [fx, fy] = focal;
    let [x, y] = match coefficients(&["c_x", "c_y"])?[..] {
        [x, y] => [x, y],
        _ => [0.0; 2],
    };
    let centre = |side_px: u32, offset: f64| 0.5 * (f64::from(side_px) - 1.0) + longer * offset;
    Ok(Camera::at_rest(
        [width, height],
        [longer * fx?, longer * fy?],
        [centre(width, x), centre(height, y)],
        lens,
    ))
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_camera;
    use nalgebra::Vector3;

    fn file(camera: &str) -> String {
        format!(
            r#"[{{"cameras": {{"v2 maker": {{"width": 640, "height": 480, {camera}}}}},
                "shots": {{}}}}]"#
        )
    }

    fn pixel(camera: &str, point: [f64; 3]) -> [f64; 2] {
        let camera = read_camera("reconstruction.json", &file(camera), None).unwrap();
        camera.project(&Vector3::from(point)).unwrap().into()
    }

    /// Pixels worked by hand from the documented equations at x_n = 0.5, y_n = 0.25, r² = 0.3125.
    #[test]
    fn normalised_coordinates_become_pixels() {
        let near = |a: [f64; 2], b: [f64; 2]| {
            assert!(
                (a[0] - b[0]).abs() + (a[1] - b[1]).abs() < 1e-9,
                "{a:?} {b:?}"
            );
        };
        let point = [1.0, 0.5, 2.0];
        // d = 1 + 0.1 · 0.3125 + 0.2 · 0.3125² = 1.05078125; 640 · 0.8 · d = 538.
        let perspective = r#""projection_type": "perspective", "focal": 0.8, "k1": 0.1, "k2": 0.2"#;
        near(pixel(perspective, point), [319.5 + 269.0, 239.5 + 134.5]);
        // 2 p1 x y + p2 (r² + 2 x²) = 0.04 · 0.125 + 0.01 · 0.8125 = 0.013125 across,
        // 2 p2 x y + p1 (r² + 2 y²) = 0.02 · 0.125 + 0.02 · 0.4375 = 0.01125 down.
        let brown = r#""projection_type": "brown", "focal_x": 0.8, "focal_y": 0.75, "c_x": 0.01,
            "c_y": -0.02, "k1": 0, "k2": 0, "k3": 0, "p1": 0.02, "p2": 0.01"#;
        near(
            pixel(brown, point),
            [
                319.5 + 6.4 + 512.0 * 0.513125,
                239.5 - 12.8 + 480.0 * 0.26125,
            ],
        );
        // At 45° off the axis θ = π/4.
        let theta = std::f64::consts::FRAC_PI_4;
        let fisheye = r#""projection_type": "fisheye", "focal": 0.5, "k1": 0.1, "k2": 0.0"#;
        let off = 320.0 * theta * (1.0 + 0.1 * theta * theta);
        near(pixel(fisheye, [1.0, 0.0, 1.0]), [319.5 + off, 239.5]);
        let opencv = r#""projection_type": "fisheye_opencv", "focal_x": 0.5, "focal_y": 0.5,
            "c_x": 0, "c_y": 0, "k1": 0.1, "k2": 0, "k3": 0, "k4": 0"#;
        near(pixel(opencv, [0.0, 1.0, 1.0]), [319.5, 239.5 + off]);
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let two = r#"[{"cameras": {}}, {"cameras": {}}]"#;
        for (text, expected) in [
            (
                file(r#""projection_type": "spherical""#),
                "\"spherical\" is not",
            ),
            (file(r#""k1": 0"#), "`focal_x` is missing"),
            (two.to_owned(), "holds 2 reconstructions"),
            (r#"[{"cameras": {}}]"#.to_owned(), "holds no camera"),
        ] {
            let message = read_camera("r.json", &text, None).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
