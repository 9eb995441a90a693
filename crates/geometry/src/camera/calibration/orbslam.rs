//! The settings of ORB-SLAM2 and ORB-SLAM3 (YAML).
//!
//! Source: `Settings.cc` and `Tracking.cc` of ORB-SLAM3: `Camera1.fx` and so on in its present
//! files, `Camera.fx` in those before and in ORB-SLAM2.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::picture_size::{PictureSize, needed};
use super::selection::select_camera;
use super::value_tree::{number, pixels, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

/// The beginnings of the names of a camera's entries.
const PREFIXES: [&str; 3] = ["Camera1", "Camera2", "Camera"];

/// True for a file with entries such as `Camera1.fx`.
pub fn is_settings(tree: &Value) -> bool {
    PREFIXES.iter().any(|prefix| has_camera(tree, prefix))
}

fn has_camera(tree: &Value, prefix: &str) -> bool {
    tree.get(format!("{prefix}.fx")).is_some()
}

/// Reads the camera `name` (`Camera1`, `Camera2` or `Camera`); files without the size of the
/// pictures have that of the frames.
pub fn read(tree: &Value, name: Option<&str>, size: PictureSize) -> Result<Camera, ParseError> {
    let present = PREFIXES.iter().filter(|prefix| has_camera(tree, prefix));
    let cameras: Result<Vec<_>, ParseError> = present
        .map(|prefix| Ok(((*prefix).to_owned(), camera(tree, prefix, size)?)))
        .collect();
    select_camera(cameras?, name)
}

fn camera(tree: &Value, prefix: &str, size: PictureSize) -> Result<Camera, ParseError> {
    let value = |key: &str| number(tree, &[&format!("{prefix}.{key}")]);
    let has = |key: &str| tree.get(format!("{prefix}.{key}")).is_some();
    let all = |keys: &[&str]| -> Result<Vec<f64>, ParseError> {
        keys.iter().map(|key| value(key)).collect()
    };
    let lens = match text_entry(tree, "Camera.type") {
        Some("KannalaBrandt8") => kannala_brandt(&all(&["k1", "k2", "k3", "k4"])?)?,
        Some("Rectified") => Lens::default(),
        None | Some("PinHole") if !has("k1") => Lens::default(),
        None | Some("PinHole") => {
            let mut coefficients = all(&["k1", "k2"])?;
            coefficients.extend(match has("p1") {
                true => all(&["p1", "p2"])?,
                false => vec![0.0; 2],
            });
            if has("k3") {
                coefficients.push(value("k3")?);
            }
            brown_conrady(&coefficients)?
        }
        Some(other) => {
            return Err(ParseError::new(format!(
                "the camera type {other:?} is not supported; known are PinHole, KannalaBrandt8 and \
                 Rectified"
            )));
        }
    };
    let [width, height] = match tree.get("Camera.width") {
        Some(_) => [
            pixels(tree, &["Camera.width"])?,
            pixels(tree, &["Camera.height"])?,
        ],
        None => needed(size)?,
    };
    Ok(Camera::at_rest(
        [width, height],
        [value("fx")?, value("fy")?],
        [value("cx")?, value("cy")?],
        lens,
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::calibration::tests::read_sized;
    use crate::camera::kannala_brandt::KannalaBrandt;

    const PRESENT: &str = "%YAML:1.0\nFile.version: \"1.0\"\nCamera.type: \"PinHole\"\n\
        Camera1.fx: 458.654\nCamera1.fy: 457.296\nCamera1.cx: 367.215\nCamera1.cy: 248.375\n\
        Camera1.k1: -0.28340811\nCamera1.k2: 0.07395907\nCamera1.p1: 0.00019359\n\
        Camera1.p2: 1.76187114e-05\nCamera.width: 752\nCamera.height: 480\n";

    fn read(text: &str, name: Option<&str>) -> Result<Camera, String> {
        let size = Some([320, 240]);
        read_sized("settings.yaml", text, name, size).map_err(|error| error.to_string())
    }

    #[test]
    fn settings_of_both_programs_are_read() {
        let camera = read(PRESENT, None).unwrap();
        assert_eq!([camera.width, camera.height], [752, 480]);
        assert_eq!([camera.fx, camera.cy], [458.654, 248.375]);
        let coefficients = [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05];
        assert_eq!(camera.lens, brown_conrady(&coefficients).unwrap());
        // ORB-SLAM2: other names, and no size.
        let before = PRESENT.replace("Camera1", "Camera");
        let before = before.split("Camera.width").next().unwrap();
        let camera = read(before, None).unwrap();
        assert_eq!([camera.width, camera.height], [320, 240]);
        let fisheye = PRESENT
            .replace("PinHole", "KannalaBrandt8")
            .replace("p1", "k3")
            .replace("p2", "k4");
        let k = KannalaBrandt::new(coefficients);
        assert_eq!(read(&fisheye, None).unwrap().lens, Lens::KannalaBrandt(k));
    }

    #[test]
    fn one_of_two_cameras_is_selected() {
        let second = "Camera2.fx: 300\nCamera2.fy: 300\nCamera2.cx: 300\nCamera2.cy: 200\n";
        let both = format!("{PRESENT}{second}");
        assert!(read(&both, None).unwrap_err().contains("Camera1, Camera2"));
        assert_eq!(read(&both, Some("Camera2")).unwrap().fx, 300.0);
        let said = read(&PRESENT.replace("Camera1.cy", "cy"), None).unwrap_err();
        assert!(said.contains("`Camera1.cy` is missing"), "{said}");
        let said = read(&PRESENT.replace("PinHole", "Mei"), None).unwrap_err();
        assert!(said.contains("\"Mei\" is not supported"), "{said}");
    }
}
