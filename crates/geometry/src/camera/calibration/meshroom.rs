//! The intrinsics of Meshroom's `cameras.sfm`, AliceVision's SfMData in JSON.
//!
//! Numbers are written as texts. Focal lengths are pixels before version 1.2.2, later millimetres
//! of a sensor as wide as `sensorWidth`; the principal point is given from the middle of the
//! picture since version 1.2.1. The centre of the first pixel is (0, 0).
//!
//! Source: AliceVision (SfMData 1.2.11), `jsonIO.cpp`, `IntrinsicScaleOffset.cpp`,
//! `Distortion*.cpp`.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::selection::select_camera;
use super::value_tree::{needed, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use crate::files::json;
use serde_json::Value;

/// True for a file with `version` and `intrinsics`.
pub fn is_sfm(tree: &Value) -> bool {
    ["version", "intrinsics"]
        .iter()
        .all(|name| tree.get(name).is_some_and(Value::is_array))
}

/// Reads an entry of `intrinsics`, whose name is its `intrinsicId`.
pub fn read(tree: &Value, name: Option<&str>) -> Result<Camera, ParseError> {
    let version = list(tree, "version")?;
    let [1.0, 2.0, revision] = version[..] else {
        return Err(ParseError::new(format!(
            "this is version {version:?} of the format; 1.2 is known"
        )));
    };
    let all = needed(tree, "intrinsics")?.as_array().into_iter().flatten();
    let id = |entry: &Value| match entry.get("intrinsicId") {
        Some(Value::String(id)) => id.clone(),
        other => other.map(Value::to_string).unwrap_or_default(),
    };
    let cameras = all.map(|entry| (id(entry), entry)).collect();
    camera(select_camera(cameras, name)?, revision)
}

fn camera(entry: &Value, revision: f64) -> Result<Camera, ParseError> {
    let size = [pixels(entry, "width")?, pixels(entry, "height")?];
    let point = list(entry, "principalPoint")?;
    let [x, y] = point[..] else {
        return Err(ParseError::new("`principalPoint` must be two numbers"));
    };
    let middle = size.map(|side| 0.5 * f64::from(side));
    let centre = if revision < 1.0 {
        [x, y]
    } else {
        [middle[0] + x, middle[1] + y]
    };
    let focal = focal_px(entry, size, revision)?;
    Ok(Camera::at_rest(size, focal, centre, lens(entry)?))
}

/// The focal lengths, pixels, in the form of the revision of the format.
fn focal_px(entry: &Value, size: [u32; 2], revision: f64) -> Result<[f64; 2], ParseError> {
    if revision < 2.0 {
        return match list(entry, "pxFocalLength")?[..] {
            [fx, fy] => Ok([fx, fy]),
            _ => Err(ParseError::new("`pxFocalLength` must be two numbers")),
        };
    }
    let [width, height] = size.map(f64::from);
    if width < height {
        return Err(ParseError::new(
            "the pictures are higher than wide, of which AliceVision writes and reads focal \
             lengths differently; write a camera.json",
        ));
    }
    let focal = number(entry, "focalLength")? / number(entry, "sensorWidth")? * width;
    let ratio = entry
        .get("pixelRatio")
        .map_or(Ok(1.0), |_| number(entry, "pixelRatio"))?;
    Ok(match revision {
        ..5.0 => [focal, focal / ratio],
        ..11.0 => [focal, focal * ratio],
        _ => [focal / ratio, focal],
    })
}

fn lens(entry: &Value) -> Result<Lens, ParseError> {
    let model = text_entry(entry, "type").unwrap_or_default();
    // Before version 1.2.8 the type names the distortion, too.
    let distortion = text_entry(entry, "distortionType").unwrap_or(model);
    let undistortion = text_entry(entry, "undistortionType").unwrap_or("none");
    let d = match entry.get("distortionParams") {
        Some(_) => list(entry, "distortionParams")?,
        None => Vec::new(),
    };
    if model.starts_with("equidistant") || undistortion != "none" {
        return Err(ParseError::new(format!(
            "the camera {model:?} with the undistortion {undistortion:?} is not supported; known \
             are pinholes with radialk1, radialk3, brown or fisheye"
        )));
    }
    match (distortion, &d[..]) {
        ("none" | "pinhole", _) => Ok(Lens::default()),
        ("radialk1" | "radial1", [k1]) => brown_conrady(&[*k1, 0.0]),
        ("radialk3" | "radial3", [k1, k2, k3]) => brown_conrady(&[*k1, *k2, 0.0, 0.0, *k3]),
        ("brown", [k1, k2, k3, t1, t2]) => brown_conrady(&[*k1, *k2, *t1, *t2, *k3]),
        ("fisheye" | "fisheye4", [_, _, _, _]) => kannala_brandt(&d),
        _ => Err(ParseError::new(format!(
            "the distortion {distortion:?} with {} numbers is not supported; known are none, \
             radialk1, radialk3, brown and fisheye",
            d.len()
        ))),
    }
}

/// The entry of that name as a number.
fn number(tree: &Value, name: &str) -> Result<f64, ParseError> {
    let value = needed(tree, name)?;
    json::number(value)
        .ok_or_else(|| ParseError::new(format!("`{name}` is {value}; it must be a number")))
}

/// The entry of that name as a number of pixels.
fn pixels(tree: &Value, name: &str) -> Result<u32, ParseError> {
    let value = number(tree, name)?;
    if value.fract() == 0.0 && (1.0..=1e6).contains(&value) {
        return Ok(value as u32);
    }
    Err(ParseError::new(format!(
        "`{name}` is {value}; it must be a whole number of pixels"
    )))
}

/// The entry of that name as a list of numbers.
fn list(tree: &Value, name: &str) -> Result<Vec<f64>, ParseError> {
    let entries = needed(tree, name)?.as_array().into_iter().flatten();
    let numbers: Option<Vec<f64>> = entries.map(json::number).collect();
    numbers.ok_or_else(|| ParseError::new(format!("`{name}` must be a list of numbers")))
}

#[cfg(test)]
mod tests {
    use crate::camera::Camera;
    use crate::camera::calibration::tests::{calibrated, read_camera};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::lens::Lens;

    fn read(revision: u32, entries: &str) -> Result<Camera, String> {
        let text = format!(
            r#"{{"version": ["1", "2", "{revision}"], "views": [], "intrinsics": [{{
                "intrinsicId": "77", "width": "640", "height": "480", "sensorWidth": "36",
                {entries}}}]}}"#
        );
        read_camera("cameras.sfm", &text, None).map_err(|error| error.to_string())
    }

    /// fx = 415, fy = 417, the principal point 2 px to the left and 1 px below the middle.
    #[test]
    fn every_version_has_its_own_focal_length() {
        let expected = calibrated(Lens::default());
        let [mm_x, mm_y] = [415.0 * 36.0 / 640.0, 417.0 * 36.0 / 640.0];
        let from_middle = r#""principalPoint": ["-2", "1"]"#;
        for (revision, entries) in [
            (
                0,
                r#""type": "pinhole", "pxFocalLength": ["415", "417"], "principalPoint":
                    ["318", "241"]"#
                    .to_owned(),
            ),
            (
                1,
                format!(r#""type": "pinhole", "pxFocalLength": ["415", "417"], {from_middle}"#),
            ),
            (
                4,
                format!(
                    r#""type": "pinhole", "focalLength": "{mm_x}", "pixelRatio": "{}",
                        {from_middle}"#,
                    415.0 / 417.0
                ),
            ),
            (
                6,
                format!(
                    r#""type": "pinhole", "focalLength": {mm_x}, "pixelRatio": {},
                        "distortionParams": "", {from_middle}"#,
                    417.0 / 415.0
                ),
            ),
            (
                11,
                format!(
                    r#""type": "pinhole", "distortionType": "none", "undistortionType": "none",
                        "focalLength": "{mm_y}", "pixelRatio": "{}", {from_middle}"#,
                    417.0 / 415.0
                ),
            ),
        ] {
            let camera = read(revision, &entries).unwrap();
            let off = [camera.fx - expected.fx, camera.fy - expected.fy];
            assert!(
                off.iter().all(|off| off.abs() < 1e-9),
                "{revision}: {off:?}"
            );
            assert_eq!((camera.cx, camera.cy), (expected.cx, expected.cy));
        }
    }

    const FOCAL: &str = r#""focalLength": "24", "principalPoint": ["0", "0"]"#;

    #[test]
    fn distortions_are_named_by_type() {
        let lens = |revision, entries: &str| {
            let camera = read(revision, &format!("{entries}, {FOCAL}"));
            camera.map(|camera| camera.lens)
        };
        let radial = Lens::radial(-0.1, 0.01);
        let old = r#""type": "radial3", "distortionParams": ["-0.1", "0.01", "0"]"#;
        let new = r#""type": "pinhole", "distortionType": "radialk3", "undistortionType": "none",
            "distortionParams": ["-0.1", "0.01", "0"]"#;
        assert_eq!((lens(6, old), lens(11, new)), (Ok(radial), Ok(radial)));
        let fisheye = r#""type": "fisheye4", "distortionParams": ["-0.01", "0.005", "0", "0"]"#;
        let expected = KannalaBrandt::new([-0.01, 0.005, 0.0, 0.0]);
        assert_eq!(lens(6, fisheye), Ok(Lens::KannalaBrandt(expected)));
        for (entries, expected) in [
            (r#""type": "equidistant_r3""#, "\"equidistant_r3\" with"),
            (
                r#""type": "fisheye1", "distortionParams": ["1"]"#,
                "\"fisheye1\" with 1",
            ),
            (
                r#""type": "radial3", "distortionParams": ["1"]"#,
                "\"radial3\" with 1",
            ),
            (
                r#""type": "pinhole", "undistortionType": "3declassicld""#,
                "undistortion \"3declassicld\"",
            ),
        ] {
            let message = lens(6, entries).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        let focal = format!(r#""type": "pinhole", {FOCAL}"#);
        for (entries, expected) in [
            (focal.replace("24", "x"), "`focalLength` is \"x\""),
            (
                focal.replace(r#"["0", "0"]"#, r#"["0"]"#),
                "must be two numbers",
            ),
            (
                focal.replace("focalLength", "focal"),
                "`focalLength` is missing",
            ),
            (format!(r#"{focal}, "width": "400""#), "higher than wide"),
        ] {
            let message = read(6, &entries).unwrap_err();
            assert!(message.contains(expected), "{message}");
        }
        let text = r#"{"version": ["1", "3", "0"], "intrinsics": []}"#;
        let message = read_camera("cameras.sfm", text, None)
            .unwrap_err()
            .to_string();
        assert!(message.contains("1.2 is known"), "{message}");
    }
}
