//! Walls that are not as drawn: their shape is estimated with the poses, and used by all commands.

use crate::support::{edit, fail, json, simulate, succeed, text};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;

/// An oval, undulating tunnel of which the survey says that it is round, refined.
static OVAL: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let lining = "--ovality-mm 10 --undulation-mm 2 --undulation-length-m 1.5";
    let options = format!("--frames 40 --size 200x150 --seed 5 --noise 1 {lining}");
    simulate(&survey, &options.split(' ').collect::<Vec<_>>());
    for (mode, out) in [("auto", "auto"), ("fixed", "fixed")] {
        let out = dir.path().join(out);
        succeed(&[
            "refine",
            text(&survey),
            "--out",
            text(&out),
            "--shape",
            mode,
        ]);
    }
    dir
});

fn survey() -> PathBuf {
    OVAL.path().join("survey")
}

fn refined(mode: &str) -> PathBuf {
    OVAL.path().join(mode)
}

/// Differences of the same wall point between frames, pixels: seam residual and wall error.
fn compared(mode: &str, out: &Path) -> serde_json::Value {
    let poses = refined(mode).join("poses.tum");
    let survey = survey();
    let arguments = ["compare", text(&survey), "--refined", text(&poses), "--out"];
    succeed(&[&arguments[..], &[text(out), "--quiet"]].concat());
    json(&out.join("compare.json"))["refined"].clone()
}

#[test]
fn the_shape_makes_the_poses_right() {
    let dir = tempfile::tempdir().unwrap();
    let wall_px = |mode: &str| {
        let refined = compared(mode, &dir.path().join(mode));
        refined["wall"]["px"]["rms"].as_f64().unwrap()
    };
    let (auto, fixed) = (wall_px("auto"), wall_px("fixed"));
    assert!(auto < 0.4 * fixed, "{auto} and {fixed} px");
    let report = json(&refined("auto").join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    let shape = &report["shape"];
    // 10 mm cos 2θ and 2 mm of undulation are 7.3 mm RMS.
    let rms_mm = shape["rms_mm"].as_f64().unwrap();
    assert!((5.0..9.0).contains(&rms_mm), "{rms_mm}");
    assert!(json(&refined("fixed").join("refine.json"))["shape"].is_null());
    assert!(!refined("fixed").join("shape.json").exists());
}

/// A refinement that starts from a shape finds little more, and a shape of another tunnel is
/// refused by name.
#[test]
fn a_shape_is_taken_up_from_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let found = refined("auto");
    let again = dir.path().join("again");
    let known = found.join("survey.toml");
    let arguments = ["refine", text(&known), "--out", text(&again), "--shape"];
    succeed(&[&arguments[..], &["fixed"]].concat());
    let report = json(&again.join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    let other = dir.path().join("other.toml");
    std::fs::copy(&known, &other).unwrap();
    std::fs::copy(found.join("shape.json"), dir.path().join("shape.json")).unwrap();
    if found.join("camera.json").exists() {
        std::fs::copy(found.join("camera.json"), dir.path().join("camera.json")).unwrap();
    }
    edit(&other, "radius_m = 3.0", "radius_m = 2.5");
    let message = fail(&["check", text(&other)], 3);
    assert!(message.contains("shape.json"), "{message}");
    assert!(message.contains("another tunnel"), "{message}");
}

/// Pixels of a frame, located with the shape beside the poses, and pixels that show no wall.
#[test]
fn many_points_are_located_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (points, out) = (path("points.csv"), path("out.csv"));
    std::fs::write(&points, "frame,u,v,note\n3,10,20,a\n000004.png,5000,2,b\n").unwrap();
    let poses = refined("auto").join("poses.tum");
    let survey = survey();
    let arguments = ["locate", text(&survey), "--poses", text(&poses)];
    let files = ["--points", text(&points), "--out", text(&out)];
    succeed(&[&arguments[..], &files].concat());
    let table = std::fs::read_to_string(&out).unwrap();
    let lines: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(lines[0][4..], ["theta_rad", "h_m", "range_m"]);
    let one = succeed(&[&arguments[..], &["--frame", "3,10,20", "--json"]].concat());
    let one: serde_json::Value = serde_json::from_str(&one).unwrap();
    let theta_rad: f64 = lines[1][4].parse().unwrap();
    let theta_deg = one["theta_deg"].as_f64().unwrap();
    assert!((theta_rad.to_degrees() - theta_deg).abs() < 1e-6);
    assert!((1.0..6.0).contains(&lines[1][6].parse::<f64>().unwrap()));
    assert_eq!(lines[2][4..], ["", "", ""]);
    std::fs::write(&points, "frame,u\n3,10\n").unwrap();
    let message = fail(&[&arguments[..], &files].concat(), 3);
    assert!(message.contains("no column v"), "{message}");
}
