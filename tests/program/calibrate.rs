//! Self-calibration through the program: wrong calibrations are found, or refused with the reason.

use crate::support::{
    blender_survey, edit, fail, first_frames, json, simulate, succeed, text, tunnelstitch,
};
use nalgebra::{UnitQuaternion, Vector3};
use std::path::Path;
use tunnelstitch::trajectory::{Pose, tum};

/// Changes a number of camera.json.
fn change_camera(survey: &Path, change: impl Fn(&mut serde_json::Map<String, serde_json::Value>)) {
    let path = survey.join("camera.json");
    let mut camera: serde_json::Value = json(&path);
    change(camera.as_object_mut().unwrap());
    std::fs::write(&path, camera.to_string()).unwrap();
}

/// Multiplies both focal lengths.
fn scale_focal(survey: &Path, factor: f64) {
    change_camera(survey, |camera| {
        for name in ["fx", "fy"] {
            camera[name] = (factor * camera[name].as_f64().unwrap()).into();
        }
    });
}

/// Refines with `--calibrate` and returns the report's unknowns by name.
fn calibrate(survey: &Path, out: &Path, unknowns: &str) -> impl Fn(&str) -> serde_json::Value {
    let arguments = ["refine", text(survey), "--out", text(out), "--quiet"];
    succeed(&[&arguments[..], &["--fast", "--calibrate", unknowns]].concat());
    reported_unknowns(out)
}

/// The unknowns of a report by name.
fn reported_unknowns(out: &Path) -> impl Fn(&str) -> serde_json::Value {
    let report = json(&out.join("refine.json"));
    move |name| {
        let unknowns = report["calibration"]["unknowns"].as_array().unwrap();
        let found = unknowns.iter().find(|unknown| unknown["name"] == name);
        found.unwrap_or_else(|| panic!("no {name}")).clone()
    }
}

/// Fails unless the unknown is refused with a reason, or right within 4 of its σ.
#[track_caller]
fn assert_honest(unknown: &serde_json::Value, truth: f64) {
    if unknown["observed"] == true {
        let error = unknown["estimate"].as_f64().unwrap() - truth;
        let sigma = unknown["sigma"].as_f64().unwrap();
        assert!(error.abs() < 4.0 * sigma, "{error} off in {unknown}");
    } else {
        assert_eq!(unknown["estimate"], unknown["initial"]);
        assert!(unknown["reason"].as_str().unwrap().len() > 20);
    }
}

/// The fixture with a focal length 2 % too long: found to 0.05 %, and the refined survey goes with
/// the refined poses.
#[test]
fn a_wrong_focal_length_is_found_and_the_result_is_a_survey() {
    let dir = first_frames(16);
    let out = dir.path().join("out");
    scale_focal(dir.path(), 1.02);
    let focal = calibrate(dir.path(), &out, "focal")("focal");
    assert_eq!(focal["observed"], true);
    let estimate = focal["estimate"].as_f64().unwrap();
    let truth = focal["initial"].as_f64().unwrap() / 1.02;
    assert!((estimate / truth - 1.0).abs() < 5e-4, "{focal}");
    assert_honest(&focal, truth);

    let (poses, compared) = (out.join("poses.tum"), dir.path().join("compared"));
    let arguments = ["compare", text(&out), "--refined", text(&poses), "--quiet"];
    let more = ["--out", text(&compared), "--max-wall-px", "0.1"];
    succeed(&[&arguments[..], &more, &["--px-per-metre", "40"]].concat());
}

/// Pictures and poses without a calibration: `init` guesses a camera, `refine` finds its focal
/// length and distortion. With a calibration that is as wrong, `check` names the line that asks for
/// that.
#[test]
fn a_survey_without_calibration_is_refined() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let options = ["--frames", "30", "--size", "200x150", "--k1", "-0.1"];
    simulate(&survey, &options);
    let truth = tunnelstitch::camera::read_calibration(&survey.join("camera.json"), None).unwrap();
    scale_focal(&survey, 1.3);
    let said = tunnelstitch(&["check", text(&survey)]).stderr;
    let said = String::from_utf8_lossy(&said);
    let remedy = "focal length of about 0.79 times the given one (unknowns = [\"focal\"]";
    assert!(said.contains(remedy), "{said}");

    for name in ["survey.toml", "camera.json"] {
        std::fs::remove_file(survey.join(name)).unwrap();
    }
    let said = succeed(&["init", text(&survey), "--radius-m", "3"]);
    assert!(said.contains("a pinhole is guessed"), "{said}");
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let unknown = reported_unknowns(&out);
    for (name, truth) in [("focal", truth.fx), ("k1", -0.1)] {
        assert_eq!(unknown(name)["observed"], true, "{}", unknown(name));
        assert_honest(&unknown(name), truth);
    }
    let frames = json(&out.join("refine.json"))["frames"].clone();
    let mut frames = frames.as_array().unwrap().iter();
    assert!(frames.all(|frame| frame["flag"] == "photometric"));
}

/// Everything wrong at once: observable parameters are right, the others have a reason.
#[test]
fn everything_wrong_at_once_is_found_or_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(
        &survey,
        &["--frames", "20", "--size", "240x180", "--k1", "-0.05"],
    );
    let truth = tunnelstitch::camera::read_calibration(&survey.join("camera.json"), None).unwrap();
    change_camera(&survey, |camera| {
        for name in ["fx", "fy"] {
            camera[name] = (0.98 * camera[name].as_f64().unwrap()).into();
        }
        camera["cx"] = (2.0 + camera["cx"].as_f64().unwrap()).into();
        camera["k1"] = 0.0.into();
    });
    edit(
        &survey.join("survey.toml"),
        "radius_m = 3.0",
        "radius_m = 3.03",
    );
    let unknown = calibrate(&survey, &out, "all");
    for (name, truth) in [
        ("focal", truth.fx),
        ("cx", truth.cx),
        ("cy", truth.cy),
        ("k1", truth.lens.k1_k2()[0]),
        ("k2", truth.lens.k1_k2()[1]),
    ] {
        assert_eq!(unknown(name)["observed"], true, "{}", unknown(name));
        assert_honest(&unknown(name), truth);
    }
    assert_honest(&unknown("radius"), 3.0);
    for name in [
        "axis_tilt_x",
        "axis_tilt_z",
        "axis_offset_x",
        "axis_offset_z",
    ] {
        assert_honest(&unknown(name), 0.0);
    }
    // Steps of centimetres cannot determine the radius to half a percent.
    assert_eq!(unknown("radius")["observed"], false);
}

/// Initial poses that are accurate in metres, in a frame with a tilted and shifted axis, determine
/// the radius and the axis.
#[test]
fn accurate_positions_determine_radius_and_axis() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let noise = ["--translation-sigma-m", "0.004,0.004,0.004"];
    let options = [
        "--frames",
        "36",
        "--size",
        "240x180",
        "--jitter",
        "independent",
    ];
    simulate(&survey, &[&options[..], &noise].concat());
    edit(
        &survey.join("survey.toml"),
        "radius_m = 3.0",
        "radius_m = 3.03",
    );
    let path = survey.join("baseline.tum");
    let mut baseline = tum::read(&path).unwrap();
    let tilt = UnitQuaternion::from_scaled_axis(Vector3::new(0.5f64.to_radians(), 0.0, 0.0));
    for stamped in &mut baseline {
        let pose = &stamped.pose;
        let t_wc = tilt * pose.t_wc + Vector3::new(0.0, 0.0, 0.03);
        stamped.pose = Pose::new(tilt * pose.r_wc, t_wc);
    }
    std::fs::write(&path, tum::format(&baseline)).unwrap();
    let unknown = calibrate(&survey, &out, "radius,axis");
    for name in [
        "radius",
        "axis_tilt_x",
        "axis_tilt_z",
        "axis_offset_x",
        "axis_offset_z",
    ] {
        assert_eq!(unknown(name)["observed"], true, "{}", unknown(name));
    }
    assert_honest(&unknown("radius"), 3.0);
    assert_honest(&unknown("axis_tilt_x"), 0.5);
    assert_honest(&unknown("axis_tilt_z"), 0.0);
}

/// Two frames determine little: no wrong parameter may count as observable.
#[test]
fn two_frames_are_honest() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(&survey, &["--frames", "2", "--size", "240x180"]);
    let truth = tunnelstitch::camera::read_calibration(&survey.join("camera.json"), None).unwrap();
    scale_focal(&survey, 1.02);
    let unknowns = ["--fast", "--calibrate", "focal,centre,distortion"];
    let arguments = ["refine", text(&survey), "--out", text(&out), "--quiet"];
    // So little may also end in the initial poses and an exit code that says so.
    tunnelstitch(&[&arguments[..], &unknowns].concat());
    let unknown = reported_unknowns(&out);
    assert_honest(&unknown("focal"), truth.fx);
    assert_honest(&unknown("cx"), truth.cx);
    assert_honest(&unknown("cy"), truth.cy);
    assert_honest(&unknown("k1"), 0.0);
    assert_honest(&unknown("k2"), 0.0);
}

#[test]
fn unknown_unknowns_are_named_with_what_is_possible() {
    let survey = blender_survey();
    let message = fail(
        &[
            "refine",
            text(&survey),
            "--out",
            "never",
            "--calibrate",
            "focus",
        ],
        2,
    );
    for name in [
        "focus",
        "focal",
        "centre",
        "distortion",
        "radius",
        "axis",
        "all",
    ] {
        assert!(message.contains(name), "{message}");
    }
    let dir = first_frames(2);
    let toml = dir.path().join("survey.toml");
    let mut written = std::fs::read_to_string(&toml).unwrap();
    written += "\n[calibrate]\nunknowns = [\"focus\"]\n";
    std::fs::write(&toml, written).unwrap();
    let out = dir.path().join("out");
    let message = fail(&["refine", text(dir.path()), "--out", text(&out)], 3);
    assert!(
        message.contains("focus") && message.contains("distortion"),
        "{message}"
    );
}

/// The survey's own calibration is not replaced.
#[test]
fn the_surveys_own_folder_is_refused() {
    let dir = first_frames(2);
    let folder = text(dir.path());
    let message = fail(
        &["refine", folder, "--out", folder, "--calibrate", "focal"],
        3,
    );
    assert!(message.contains("--out"), "{message}");
}
