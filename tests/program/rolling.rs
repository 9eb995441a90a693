//! Rolling shutter through the program: rows read over 20 ms while the camera rotates at 90 degrees
//! per second.

use crate::support::{self, edit, fail, json, succeed, text, tunnelstitch};
use serde_json::Value;
use std::path::Path;

const READOUT: &str = "readout_ms = 20.0\n";

const SIZE: &str = "200x150";

fn simulate(out: &Path, size: &str, more: &[&str]) {
    let size = ["--turns", "2", "--size", size, "--noise", "1"];
    // 12 frames of one turn in 4 s.
    let speed = ["--interval-s", "0.33333333"];
    support::simulate(out, &[&size[..], &speed, more].concat());
}

/// Refines a survey; returns the result of the rolling-shutter test and the warnings.
fn refine(survey: &Path, out: &Path) -> (Value, String) {
    let output = tunnelstitch(&["refine", text(survey), "--out", text(out)]);
    let warned = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{warned}");
    let report = json(&out.join("refine.json"));
    (report["rolling_shutter"].clone(), warned)
}

fn compare(survey: &Path, refined: &Path, out: &Path) -> Value {
    let poses = refined.join("poses.tum");
    let printed = succeed(&[
        "compare",
        text(survey),
        "--refined",
        text(&poses),
        "--out",
        text(out),
        "--px-per-metre",
        "40",
        "--json",
    ]);
    serde_json::from_str(&printed).unwrap()
}

fn number(value: &Value, pointer: &str) -> f64 {
    let found = value.pointer(pointer).and_then(Value::as_f64);
    found.unwrap_or_else(|| panic!("no {pointer} in {value}"))
}

const WARNING: &str = "the same systematic residual along the rows";

#[test]
fn rows_get_their_own_poses_and_where_they_do_not_the_program_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, out, compared) = (path("survey"), path("out"), path("compared"));
    simulate(&survey, SIZE, &["--readout-ms", "20", "--supersample", "8"]);

    let (rows, warned) = refine(&survey, &out);
    assert!(!warned.contains(WARNING), "{warned}");
    assert_eq!(rows["systematic"], false);
    let given = compare(&survey, &out, &compared);
    assert!(number(&given, "/refined/wall/px/rms") <= 0.1, "{given}");

    edit(&survey.join("survey.toml"), READOUT, "");
    let (rows, warned) = refine(&survey, &out);
    assert!(warned.contains(WARNING), "{warned}");
    assert!(warned.contains("readout_ms"), "{warned}");
    assert_eq!(rows["systematic"], true);
    let off_ms = (number(&rows, "/estimate_ms") - 20.0).abs();
    assert!(off_ms < 4.0 * number(&rows, "/sigma_ms"), "{rows}");
    // 1.8 degrees at 130 px per radian.
    let shift_px = number(&rows, "/shift_px");
    assert!((shift_px - 4.1).abs() < 0.33, "{rows}");

    // With true poses the images agree up to noise only if every row has its own pose.
    let ignored = compare(&survey, &out, &compared);
    let seam = |of: &Value| number(of, "/truth/seam/rms_grey");
    assert!(seam(&ignored) > 1.5 * seam(&given));
    assert!(number(&given, "/refined/seam/rms_grey") < 1.02 * seam(&given));
    assert!(number(&ignored, "/refined/wall/px/rms") > 1.0);
}

#[test]
fn rows_may_be_read_bottom_up_and_each_frame_may_err_by_itself() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, out) = (path("survey"), path("out"));
    simulate(
        &survey,
        "160x120",
        &[
            "--readout-ms",
            "-20",
            "--jitter",
            "independent",
            "--seed",
            "3",
        ],
    );
    let (rows, warned) = refine(&survey, &out);
    assert!(!warned.contains(WARNING), "{warned}");
    assert_eq!(number(&rows, "/given_ms"), -20.0);
    let compared = compare(&survey, &out, &path("compared"));
    assert!(number(&compared, "/refined/wall/px/rms") <= 0.1);
    // The wrong readout direction.
    edit(
        &survey.join("survey.toml"),
        "readout_ms = -20.0",
        "readout_ms = 20.0",
    );
    let (rows, warned) = refine(&survey, &out);
    assert!(warned.contains("not 20 ms as given"), "{warned}");
    assert!(number(&rows, "/estimate_ms") < -15.0, "{rows}");
}

#[test]
fn a_global_shutter_is_not_suspected() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(&survey, SIZE, &["--wall", "concrete"]);
    let file = std::fs::read_to_string(survey.join("survey.toml")).unwrap();
    assert!(!file.contains("readout"), "{file}");
    let (rows, warned) = refine(&survey, &out);
    assert!(!warned.contains(WARNING), "{warned}");
    assert_eq!(rows["systematic"], false);
}

/// A pixel mapped to the wall and back gives the same pixel of the same frame.
#[test]
fn locating_minds_the_rows() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, SIZE, &["--readout-ms", "20", "--supersample", "1"]);
    let locate = |what: [&str; 2]| -> Value {
        let arguments = ["locate", text(&survey), "--poses", "truth", "--json"];
        serde_json::from_str(&succeed(&[&arguments[..], &what[..]].concat())).unwrap()
    };
    for (u, v) in [(3.0, 1.0), (190.0, 12.0), (20.0, 146.0)] {
        let there = locate(["--frame", &format!("000007.png,{u},{v}")]);
        let wall = format!("{},{}", there["chainage_m"], there["theta_deg"]);
        let back = locate(["--wall", &wall]);
        let frames = back["frames"].as_array().unwrap();
        let own = frames.iter().find(|frame| frame["frame"] == 7).unwrap();
        let (du, dv) = (number(own, "/pixel/0") - u, number(own, "/pixel/1") - v);
        assert!(du.hypot(dv) < 1e-6, "{own}");
    }
}

#[test]
fn a_readout_longer_than_the_time_between_frames_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let too_long = [
        "simulate",
        "free",
        "--readout-ms",
        "1500",
        "--out",
        text(&survey),
    ];
    let message = fail(&too_long, 2);
    assert!(
        message.contains("less time than the interval between frames"),
        "{message}"
    );
    simulate(&survey, SIZE, &["--readout-ms", "20", "--supersample", "1"]);
    edit(
        &survey.join("survey.toml"),
        READOUT,
        "readout_ms = 20000.0\n",
    );
    let message = fail(
        &[
            "refine",
            text(&survey),
            "--out",
            text(&dir.path().join("out")),
        ],
        3,
    );
    assert!(
        message.contains("camera.readout_ms is 20000") && message.contains("333.333 ms"),
        "{message}"
    );
}
