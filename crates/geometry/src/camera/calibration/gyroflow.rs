//! Gyroflow's lens profiles: JSON with OpenCV's camera matrix and coefficients.
//!
//! Gyroflow itself moves the principal point of profiles without `asymmetrical` to the middle of
//! the picture; here it is the one that belongs to the coefficients. Source: Gyroflow 1.6,
//! `lens_profile.rs`; the lens model of its calibrator is OpenCV's `cv::fisheye`.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::opencv::focal_and_centre;
use super::value_tree::{needed, numbers, pixels, text_entry};
use crate::camera::projection::Camera;
use serde_json::Value;

/// Names of a sensor that is read from the last row to the first.
const BOTTOM_TO_TOP: [&str; 2] = ["BottomToTop", "1"];
/// Names of a sensor that is read from the first row to the last.
const TOP_TO_BOTTOM: [&str; 2] = ["TopToBottom", "0"];

/// True for a file with `fisheye_params` and `calib_dimension`.
pub fn is_profile(tree: &Value) -> bool {
    ["fisheye_params", "calib_dimension"]
        .iter()
        .all(|name| tree.get(name).is_some())
}

/// Reads `calib_dimension`, `fisheye_params` and `distortion_model`, which is OpenCV's fisheye if
/// there is none.
///
/// Lenses that the camera warps once more, stretches or crops are refused.
pub fn read(tree: &Value) -> Result<Camera, ParseError> {
    reject_warped(tree)?;
    let size = needed(tree, "calib_dimension")?;
    let parameters = needed(tree, "fisheye_params")?;
    let [focal, centre] = focal_and_centre(needed(parameters, "camera_matrix")?)?;
    let d = numbers(
        needed(parameters, "distortion_coeffs")?,
        "distortion_coeffs",
    )?;
    let lens = match text_entry(tree, "distortion_model") {
        None | Some("" | "opencv_fisheye") => kannala_brandt(&d)?,
        Some("opencv_standard") => brown_conrady(&d)?,
        Some(other) => {
            return Err(ParseError::new(format!(
                "the distortion model {other:?} is not supported; known are opencv_fisheye and \
                 opencv_standard"
            )));
        }
    };
    let size = [pixels(size, &["w"])?, pixels(size, &["h"])?];
    Ok(Camera::at_rest(size, focal, centre, lens))
}

/// The readout time of the sensor, milliseconds, negative from the last row to the first; `None` if
/// the profile states none, or one from column to column.
pub fn readout_ms(tree: &Value) -> Option<f64> {
    let is_global = tree.get("global_shutter").and_then(Value::as_bool) == Some(true);
    let time_ms = tree.get("frame_readout_time")?.as_f64()?;
    let direction = match tree.get("frame_readout_direction") {
        None | Some(Value::Null) => TOP_TO_BOTTOM[0].to_owned(),
        Some(Value::String(name)) => name.clone(),
        Some(other) => other.to_string(),
    };
    let upwards = BOTTOM_TO_TOP.contains(&direction.as_str());
    let downwards = TOP_TO_BOTTOM.contains(&direction.as_str());
    let is_stated = time_ms != 0.0 && !is_global && (upwards || downwards);
    is_stated.then_some(if upwards { -time_ms.abs() } else { time_ms })
}

/// Refuses profiles of pictures that no lens model here describes.
fn reject_warped(tree: &Value) -> Result<(), ParseError> {
    if let Some(name) = text_entry(tree, "digital_lens").filter(|name| !name.is_empty()) {
        return Err(ParseError::new(format!(
            "the camera warps its pictures further (digital_lens is {name:?}), which is not \
             supported; record with a linear or wide field of view, and take that profile"
        )));
    }
    let changed = ["input_horizontal_stretch", "input_vertical_stretch", "crop"];
    for name in changed {
        // Gyroflow takes a stretch of zero for none.
        let factor = tree.get(name).and_then(Value::as_f64).unwrap_or(1.0);
        if factor != 1.0 && factor > 0.01 {
            return Err(ParseError::new(format!(
                "`{name}` is {factor}; stretched and cropped pictures are not supported: \
                 calibrate with the frames as they are"
            )));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::{calibrated, read_camera};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::lens::Lens;
    use crate::camera::stated_readout_ms;

    /// A profile as Gyroflow writes it, with more entries in place of `note`.
    fn profile(entries: &str) -> String {
        format!(
            r#"{{"name": "Maker_Camera_Wide_640x480-30fps", {entries} "camera_brand": "Maker",
            "calib_dimension": {{"w": 640, "h": 480}}, "orig_dimension": {{"w": 640, "h": 480}},
            "input_horizontal_stretch": 1.0, "input_vertical_stretch": 1.0, "num_images": 15,
            "fps": 30.0, "crop": null, "asymmetrical": false, "fisheye_params": {{
            "RMS_error": 0.5, "camera_matrix": [[415.0, 0.0, 318.0], [0.0, 417.0, 241.0],
            [0.0, 0.0, 1.0]], "distortion_coeffs": [-0.01, 0.005, -0.004, 0.0007],
            "radial_distortion_limit": null}}, "calibrator_version": "1.5.3"}}"#
        )
    }

    #[test]
    fn a_lens_profile_is_opencvs_fisheye() {
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        let expected = calibrated(Lens::KannalaBrandt(fisheye));
        for entries in [
            "",
            r#""distortion_model": "opencv_fisheye","#,
            r#""distortion_model": null, "digital_lens": null,"#,
        ] {
            let camera = read_camera("lens.json", &profile(entries), None).unwrap();
            assert_eq!(camera, expected, "{entries}");
        }
        let standard = profile(r#""distortion_model": "opencv_standard","#);
        let camera = read_camera("lens.json", &standard, None).unwrap();
        assert_eq!(camera.lens.name(), "brown-conrady");
    }

    #[test]
    fn what_is_no_such_lens_is_refused() {
        for (entries, expected) in [
            (r#""distortion_model": "poly5","#, "\"poly5\" is not"),
            (r#""digital_lens": "gopro_superview","#, "digital_lens is"),
            (r#""crop": 1.2,"#, "`crop` is 1.2"),
        ] {
            let text = profile(entries).replace(r#""crop": null,"#, "");
            let message = read_camera("lens.json", &text, None).unwrap_err();
            assert!(message.to_string().contains(expected), "{message}");
        }
        let text = profile("").replace("distortion_coeffs", "coefficients");
        let message = read_camera("lens.json", &text, None).unwrap_err();
        assert!(
            message
                .to_string()
                .contains("`distortion_coeffs` is missing"),
            "{message}"
        );
    }

    #[test]
    fn the_readout_time_has_the_sign_of_its_direction() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("lens.json");
        let stated = |entries: &str| {
            std::fs::write(&path, profile(entries)).unwrap();
            stated_readout_ms(&path)
        };
        let time = r#""frame_readout_time": 15.25,"#;
        let with = |direction: &str| {
            stated(&format!(
                r#"{time} "frame_readout_direction": {direction},"#
            ))
        };
        assert_eq!(stated(time), Some(15.25));
        assert_eq!(with("null"), Some(15.25));
        assert_eq!(with(r#""TopToBottom""#), Some(15.25));
        assert_eq!(with(r#""BottomToTop""#), Some(-15.25));
        assert_eq!(with("1"), Some(-15.25));
        assert_eq!(with(r#""LeftToRight""#), None);
        assert_eq!(stated(r#""frame_readout_time": null,"#), None);
        assert_eq!(stated(&format!(r#"{time} "global_shutter": true,"#)), None);
        std::fs::write(&path, "{").unwrap();
        assert_eq!(stated_readout_ms(&path), None);
    }
}
