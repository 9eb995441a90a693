//! Frames that cannot be read: named as an error, or left out by `--skip-bad`.

use crate::support::{fail, json, simulate, succeed, text, tunnelstitch};
use std::path::Path;

/// A survey of which frame 3 is truncated, frame 8 no picture, and frame 13 too small.
fn damaged_survey(survey: &Path) {
    let options = ["--frames", "26", "--size", "160x120", "--supersample", "2"];
    simulate(survey, &options);
    truncate(&frame(survey, 3));
    std::fs::write(frame(survey, 8), "no picture").unwrap();
    let small = image::GrayImage::new(32, 24);
    small.save(frame(survey, 13)).unwrap();
}

fn frame(survey: &Path, index: usize) -> std::path::PathBuf {
    survey.join(format!("frames/{index:06}.png"))
}

fn truncate(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    std::fs::write(path, &bytes[..bytes.len() - 20]).unwrap();
}

#[track_caller]
fn assert_names_bad_frames(message: &str) {
    for part in [
        "000003.png",
        "truncated",
        "000008.png",
        "000013.png",
        "32 × 24",
    ] {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

#[test]
fn frames_that_cannot_be_read_are_left_out_on_request() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, refined) = (path("s"), path("refined"));
    damaged_survey(&survey);
    let refine = ["refine", text(&survey), "--out", text(&refined)];
    assert!(fail(&refine, 3).contains("--skip-bad"));
    let message = fail(&["check", text(&survey)], 3);
    assert_names_bad_frames(&message);
    assert!(message.contains("--skip-bad"), "{message}");

    let checked = tunnelstitch(&["check", text(&survey), "--skip-bad"]);
    assert!(checked.status.success());
    assert_names_bad_frames(&String::from_utf8_lossy(&checked.stderr));
    succeed(&[&refine[..], &["--skip-bad", "--quiet"]].concat());
    let report = json(&refined.join("refine.json"));
    let skipped = report["skipped_frames"].as_array().unwrap();
    let indices: Vec<u64> = skipped
        .iter()
        .map(|s| s["index"].as_u64().unwrap())
        .collect();
    assert_eq!(indices, [3, 8, 13]);
    assert_eq!(report["frames"].as_array().unwrap().len(), 23);
    let poses = refined.join("poses.tum");
    let lines = std::fs::read_to_string(&poses).unwrap();
    assert_eq!(
        lines.lines().filter(|line| !line.starts_with('#')).count(),
        23
    );

    // Poses of such a run are those of the frames that could be read, without the option.
    let (wall, page) = (path("wall.png"), path("report"));
    let poses = [
        "--poses",
        text(&poses),
        "--px-per-metre",
        "20",
        "--out",
        text(&wall),
    ];
    let stitched = tunnelstitch(&[&["stitch", text(&survey)], &poses[..]].concat());
    let said = String::from_utf8_lossy(&stitched.stderr);
    assert!(stitched.status.success(), "{said}");
    assert_names_bad_frames(&said);
    succeed(&[
        "report",
        text(&survey),
        "--refined",
        text(&refined),
        "--out",
        text(&page),
    ]);
    let report = json(&page.join("report.json"));
    assert_eq!(
        report["refinement"]["skipped_frames"]
            .as_array()
            .unwrap()
            .len(),
        3
    );
    assert_names_bad_frames(&report["notes"].to_string());
    // The folder of results is a survey.
    succeed(&["check", text(&refined), "--quiet"]);
}

/// A survey of more frames than `check` decodes: each is looked at all the same.
#[test]
fn check_finds_every_truncated_frame() {
    let dir = tempfile::tempdir().unwrap();
    let options = ["--frames", "150", "--size", "64x48", "--supersample", "1"];
    simulate(dir.path(), &[&options[..], &["--force"]].concat());
    for index in [76, 77, 79] {
        truncate(&frame(dir.path(), index));
    }
    let message = fail(&["check", text(dir.path())], 3);
    for index in [76, 77, 79] {
        assert!(message.contains(&format!("frame {index} (")), "{message}");
    }
}
