//! Calibrations of another lens than the one that took the frames.

use crate::support::{simulate, succeed, text};
use serde_json::{Value, json};
use std::path::Path;

/// A survey of frames that a lens took.
fn taken_with(lens: &Value) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let camera = folder.path().join("lens.json");
    std::fs::write(&camera, lens.to_string()).unwrap();
    let survey = folder.path().join("survey");
    let motion = ["--frames", "16", "--turn-deg", "20", "--advance-m", "0.05"];
    simulate(
        &survey,
        &[&["--camera", text(&camera)], &motion[..], &["--force"]].concat(),
    );
    folder
}

/// The readings that `check` names for a calibration, as JSON.
fn readings(survey: &Path, calibration: &Value) -> Value {
    std::fs::write(survey.join("camera.json"), calibration.to_string()).unwrap();
    let said = succeed(&["check", text(survey), "--json"]);
    let mut check: Value = serde_json::from_str(&said).unwrap();
    check["readings"]["readings"].take()
}

/// A calibration of frames of 160 × 120 px.
fn calibration(model: &str, focal_px: f64, coefficients: &Value) -> Value {
    let mut camera = json!({
        "model": model, "width": 160, "height": 120,
        "fx": focal_px, "fy": focal_px, "cx": 79.5, "cy": 59.5,
    });
    for (key, value) in coefficients.as_object().unwrap() {
        camera[key] = value.clone();
    }
    camera
}

/// The right calibration gets no advice; that of another model is named with what mends it.
#[test]
fn a_fisheye_declared_as_a_pinhole_is_named() {
    let by_name = json!({"k1": -0.02, "k2": 0.005, "k3": -0.003, "k4": 0.0005});
    let as_list = json!({"k1": -0.02, "k2": 0.005, "p1": -0.003, "p2": 0.0005});
    let right = calibration("kannala-brandt", 70.0, &by_name);
    let folder = taken_with(&right);
    let survey = folder.path().join("survey");
    assert_eq!(readings(&survey, &right), Value::Null);
    for wrong in [&by_name, &as_list] {
        let named = readings(&survey, &calibration("brown-conrady", 70.0, wrong));
        let expected = "a fisheye with the given coefficients (\"model\": \"kannala-brandt\" with \
                        k1 = -0.02, k2 = 0.005, k3 = -0.003, k4 = 0.0005 in camera.json)";
        assert_eq!(named, json!([expected]));
    }
}

/// A distortion of the other sign, and a lens that is no fisheye.
#[test]
fn a_pinhole_declared_as_another_lens_is_named() {
    let right = calibration("brown-conrady", 100.0, &json!({"k1": -0.28, "k2": 0.07}));
    let folder = taken_with(&right);
    let survey = folder.path().join("survey");
    assert_eq!(readings(&survey, &right), Value::Null);
    let lines = |wrong: &Value| {
        let named = readings(&survey, wrong);
        let lines = named.as_array().unwrap().iter();
        let lines: Vec<String> = lines
            .map(|line| line.as_str().unwrap().to_owned())
            .collect();
        lines
    };
    let sign = calibration("brown-conrady", 100.0, &json!({"k1": 0.28, "k2": -0.07}));
    let expected = "the other sign (k1 = -0.28, k2 = 0.07 in camera.json)";
    let said = lines(&sign);
    assert!(said.iter().any(|line| line.contains(expected)), "{said:?}");
    let fisheye = calibration("kannala-brandt", 100.0, &json!({"k1": -0.28, "k2": 0.07}));
    let expected = "no fisheye with the given coefficients (\"model\": \"brown-conrady\" with k1 = \
                    -0.28, k2 = 0.07 in camera.json)";
    let said = lines(&fisheye);
    assert!(said.iter().any(|line| line.contains(expected)), "{said:?}");
}

/// A list of coefficients in the order of another program.
#[test]
fn coefficients_in_another_order_are_named() {
    let values = json!({"k1": -0.2, "k2": 0.1, "k3": -0.06, "p1": 0.01, "p2": -0.015});
    let right = calibration("brown-conrady", 80.0, &values);
    let folder = taken_with(&right);
    let survey = folder.path().join("survey");
    assert_eq!(readings(&survey, &right), Value::Null);
    for (wrong, expected) in [
        (
            json!({"k1": -0.2, "k2": 0.1, "p1": -0.06, "p2": 0.01, "k3": -0.015}),
            "given as k1 k2 k3 p1 p2 (k1 = -0.2, k2 = 0.1, k3 = -0.06, p1 = 0.01, p2 = -0.015 in \
             camera.json)",
        ),
        (
            json!({"k1": -0.2, "k2": 0.1, "k3": 0.01, "p1": -0.015, "p2": -0.06}),
            "given as OpenCV's k1 k2 p1 p2 k3 (k1 = -0.2, k2 = 0.1, k3 = -0.06, p1 = 0.01, p2 = \
             -0.015 in camera.json)",
        ),
    ] {
        let said = readings(&survey, &calibration("brown-conrady", 80.0, &wrong));
        assert!(said.to_string().contains(expected), "{said}");
    }
}

/// A principal point in the corner, one with its coordinates swapped, and a wrong fy.
#[test]
fn intrinsics_that_do_not_fit_the_picture_are_named() {
    let right = calibration("pinhole", 100.0, &json!({}));
    let folder = taken_with(&right);
    let survey = folder.path().join("survey");
    assert_eq!(readings(&survey, &right), Value::Null);
    for (key, values, expected) in [
        (
            ["cx", "cy"],
            [0.0, 0.0],
            "the principal point near the middle of the picture (cx = 79.5",
        ),
        (
            ["cx", "cy"],
            [59.5, 79.5],
            "the principal point with cx and cy swapped (cx = 79.5",
        ),
        (
            ["fx", "fy"],
            [100.0, 60.0],
            "square pixels (fx = fy = 100 in camera.json)",
        ),
        (
            ["cx", "cy"],
            [159.5, 119.5],
            "a calibration of pictures of 320 × 240 px (as their width and height in camera.json",
        ),
    ] {
        let mut wrong = right.clone();
        for (key, value) in key.iter().zip(values) {
            wrong[key] = value.into();
        }
        if values[0] > 100.0 {
            (wrong["fx"], wrong["fy"]) = (200.0.into(), 200.0.into());
        }
        let said = readings(&survey, &wrong);
        assert!(
            said.to_string().contains(expected),
            "{key:?} {values:?}: {said}"
        );
    }
}
