//! Messages propose what was tried and helps; where nothing does, they state what was found.

use crate::support::{edit, fail, json, simulate, succeed, text, tunnelstitch};
use std::path::Path;

/// Multiplies the positions of a file of poses.
fn scale_positions(path: &Path, factor: f64) {
    let read = std::fs::read_to_string(path).unwrap();
    let scaled = read.lines().map(|line| {
        let words = line.split(' ').enumerate().map(|(k, word)| match k {
            1..=3 => (factor * word.parse::<f64>().unwrap()).to_string(),
            _ => word.to_owned(),
        });
        words.collect::<Vec<_>>().join(" ") + "\n"
    });
    std::fs::write(path, scaled.collect::<String>()).unwrap();
}

/// Positions in millimetres place all frames far from each other: what mends them is named at once.
#[test]
fn where_nothing_overlaps_the_reading_that_does_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "10", "--size", "160x120"]);
    scale_positions(&survey.join("baseline.tum"), 1e3);
    let out = dir.path().join("out");
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 3);
    assert!(
        message.contains("no two frames overlap") && message.contains("unit_m = 0.001"),
        "{message}"
    );
    assert!(!message.contains("check "), "{message}");
}

/// Pictures in an order that no reading has. No cause is guessed.
#[test]
fn where_no_reading_fits_none_is_proposed() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "10", "--size", "160x120"]);
    let frame = |k: usize| survey.join(format!("frames/{k:06}.png"));
    let pictures: Vec<Vec<u8>> = (0..10).map(|k| std::fs::read(frame(k)).unwrap()).collect();
    for (k, other) in [3, 8, 1, 6, 0, 5, 9, 2, 7, 4].into_iter().enumerate() {
        std::fs::write(frame(k), &pictures[other]).unwrap();
    }
    let out = dir.path().join("out");
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 4);
    assert!(
        message.contains("other readings were tried")
            && message.contains("neighbouring frames agree better with none of them"),
        "{message}"
    );
    for guess in ["possible", "radius_m", "--pose-convention", "check "] {
        assert!(!message.contains(guess), "{guess}: {message}");
    }
}

/// Quaternions that begin with w: what fits is named before anything is solved as it is read.
#[test]
fn a_survey_that_is_read_wrongly_is_not_refined() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "20", "--size", "160x120"]);
    let poses = survey.join("baseline.tum");
    let read = std::fs::read_to_string(&poses).unwrap();
    let rows = read.lines().map(|line| {
        let words: Vec<&str> = line.split(' ').collect();
        [&words[..4], &words[7..], &words[4..7]].concat().join(" ") + "\n"
    });
    std::fs::write(&poses, rows.collect::<String>()).unwrap();
    let out = dir.path().join("out");
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 4);
    assert!(message.contains("quaternion = \"wxyz\""), "{message}");
    let report = json(&out.join("refine.json"));
    let named = report["readings"]["fit"]["readings"].to_string();
    assert!(named.contains("wxyz"), "{named}");
    assert_eq!(report["levels"].as_array().unwrap().len(), 0, "{message}");
    // The remedy is one.
    edit(
        &survey.join("survey.toml"),
        "[poses]",
        "[poses]\nquaternion = \"wxyz\"",
    );
    succeed(&["refine", text(&survey), "--out", text(&out)]);
    let report = json(&out.join("refine.json"));
    assert_eq!(report["verdict"]["photometric"], 20);
    assert!(report.get("readings").is_none(), "{report}");
}

/// A dozen frames of faint concrete, where a tilt of the camera moves the picture almost as a step
/// along the axis does: the pairs tell a diameter from a radius nevertheless, and the right one
/// raises no doubt.
#[test]
fn a_diameter_for_the_radius_of_few_frames_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let tunnel = [
        "--radius-m",
        "2",
        "--wall",
        "concrete",
        "--advance-m",
        "0.07",
    ];
    let errors = ["--translation-sigma-m", "0.013,0.013,0.02"];
    let frames = ["--frames", "12", "--size", "240x180", "--seed", "502"];
    simulate(&survey, &[&tunnel[..], &errors, &frames].concat());
    let check = || {
        let said = succeed(&["check", text(&survey), "--json"]);
        let check: serde_json::Value = serde_json::from_str(&said).unwrap();
        check["readings"]["readings"][0].to_string()
    };
    assert_eq!(check(), "null");
    edit(
        &survey.join("survey.toml"),
        "radius_m = 2.0",
        "radius_m = 4.0",
    );
    let said = check();
    assert!(said.contains("radius_m = 2 under [tunnel]"), "{said}");
}

/// Only pictures tell a camera that looks ahead and rolls from one of a body with other axes.
#[test]
fn cameras_that_look_ahead_and_roll_are_accepted() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let view = ["--view", "forward", "--turn-deg", "20", "--fov-deg", "90"];
    let frames = ["--frames", "12", "--size", "160x120", "--supersample", "2"];
    simulate(&survey, &[&view[..], &frames].concat());
    let check = || {
        let output = tunnelstitch(&["check", text(&survey)]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(0), "{said}");
        said
    };
    let said = check();
    assert!(
        said.contains("turn about it; if that is so, camera_axes = \"opencv\" under [poses]"),
        "{said}"
    );
    let toml = survey.join("survey.toml");
    edit(&toml, "[poses]", "[poses]\ncamera_axes = \"opencv\"");
    let said = check();
    assert!(!said.contains("axes"), "{said}");
}
