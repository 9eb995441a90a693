//! Refinement of the Blender-rendered fixture through the program, judged against the true poses.

mod support;

use std::path::Path;
use support::{blender_survey, succeed, text};

/// Refines the fixture into `out`.
fn refine(out: &Path, threads: &str) {
    let survey = blender_survey();
    succeed(&[
        "refine",
        text(&survey),
        "--out",
        text(out),
        "--threads",
        threads,
        "--quiet",
    ]);
}

#[test]
fn the_fixture_is_repaired_and_any_number_of_threads_gives_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let (one, two) = (dir.path().join("1"), dir.path().join("2"));
    refine(&one, "1");
    refine(&two, "2");
    let poses = std::fs::read(one.join("poses.tum")).unwrap();
    assert_eq!(poses, std::fs::read(two.join("poses.tum")).unwrap());

    // What evo reads: eight columns, single spaces, no space at the end.
    let poses = String::from_utf8(poses).unwrap();
    assert_eq!(poses.lines().count(), 48);
    for line in poses.lines() {
        assert_eq!(line.split(' ').count(), 8, "{line:?}");
        assert!(line.split(' ').all(|word| word.parse::<f64>().is_ok()));
    }

    let report: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(one.join("refine.json")).unwrap()).unwrap();
    assert_eq!(report["frames"].as_array().unwrap().len(), 48);
    assert_eq!(report["frames_on_prior"], 0);
    for level in report["levels"].as_array().unwrap() {
        assert!(level["cost_end"].as_f64().unwrap() <= level["cost_start"].as_f64().unwrap());
        assert!(level["observations"].as_u64().unwrap() > 0);
    }
    for frame in report["frames"].as_array().unwrap() {
        assert_eq!(frame["flag"], "photometric");
        // No exposure was varied when the frames were rendered.
        assert!(
            (frame["gain"].as_f64().unwrap() - 1.0).abs() < 0.02,
            "{frame}"
        );
        assert!(frame["sigma"]["wall_px"].as_f64().unwrap() < 0.1);
    }
}
