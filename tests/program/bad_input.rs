//! Bad input ends with a clear message, exit code 3 and no output; never with a panic.

use crate::support::{edit, fail, first_frames, text};
use std::path::Path;

/// Damages a copy of the first three frames and returns the message of `refine`.
fn refine_after(damage: impl FnOnce(&Path)) -> String {
    let survey = first_frames(3);
    damage(survey.path());
    let out = survey.path().join("out");
    let message = fail(&["refine", text(survey.path()), "--out", text(&out)], 3);
    assert!(!out.join("poses.tum").exists());
    assert!(!out.join("refine.json").exists());
    message
}

#[track_caller]
fn assert_says(message: &str, parts: &[&str]) {
    for part in parts {
        assert!(message.contains(part), "no {part:?} in: {message}");
    }
}

#[test]
fn a_missing_image() {
    let message = refine_after(|dir| std::fs::remove_file(dir.join("frames/000001.jpg")).unwrap());
    assert_says(&message, &["baseline.tum", "3 poses for 2 frames"]);
}

#[test]
fn no_image_at_all() {
    let message = refine_after(|dir| edit(&dir.join("survey.toml"), "*.jpg", "*.bmp"));
    assert_says(&message, &["frames/*.bmp", "matches no file"]);
}

#[test]
fn an_image_of_another_size() {
    let message = refine_after(|dir| {
        image::GrayImage::new(64, 48)
            .save(dir.join("frames/000002.jpg"))
            .unwrap();
    });
    assert_says(&message, &["frame 2", "000002.jpg", "64 × 48", "480 × 360"]);
}

#[test]
fn a_truncated_jpeg() {
    let message = refine_after(|dir| {
        let path = dir.join("frames/000001.jpg");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    });
    assert_says(&message, &["frame 1", "000001.jpg", "truncated"]);
}

#[test]
fn a_file_that_is_no_picture() {
    let message = refine_after(|dir| std::fs::write(dir.join("frames/000000.jpg"), "x").unwrap());
    assert_says(&message, &["frame 0", "000000.jpg"]);
}

#[test]
fn fewer_poses_than_frames() {
    let message = refine_after(|dir| {
        let path = dir.join("baseline.tum");
        let poses = std::fs::read_to_string(&path).unwrap();
        let two: Vec<&str> = poses.lines().take(2).collect();
        std::fs::write(&path, two.join("\n")).unwrap();
    });
    assert_says(&message, &["baseline.tum", "2 poses for 3 frames"]);
}

#[test]
fn not_a_number_in_a_pose() {
    let message = refine_after(|dir| edit(&dir.join("baseline.tum"), "1.0 0 0.1", "1.0 NaN 0.1"));
    assert_says(&message, &["baseline.tum:2", "not finite"]);
}

#[test]
fn a_zero_quaternion() {
    let message = refine_after(|dir| {
        edit(
            &dir.join("baseline.tum"),
            "0.0 0 0 0 0 0 0 1",
            "0.0 0 0 0 0 0 0 0",
        );
    });
    assert_says(&message, &["baseline.tum:1", "quaternion is zero"]);
}

#[test]
fn a_duplicate_timestamp() {
    let message = refine_after(|dir| edit(&dir.join("baseline.tum"), "2.0 0 0.2", "1.0 0 0.2"));
    assert_says(&message, &["baseline.tum:3", "duplicate timestamp 1"]);
}

#[test]
fn an_impossible_radius() {
    for radius in ["0.0", "-3.0", "nan"] {
        let message = refine_after(|dir| {
            edit(
                &dir.join("survey.toml"),
                "radius_m = 3.0",
                &format!("radius_m = {radius}"),
            );
        });
        assert_says(&message, &["survey.toml", "radius", "positive"]);
    }
}

#[test]
fn a_camera_outside_the_tunnel() {
    let message = refine_after(|dir| edit(&dir.join("baseline.tum"), "1.0 0 0.1 0", "1.0 4 0.1 0"));
    assert_says(
        &message,
        &[
            "baseline.tum",
            "frame 1",
            "outside the tunnel",
            "1 of 3 cameras are",
        ],
    );
}

#[test]
fn an_unknown_key() {
    let message = refine_after(|dir| edit(&dir.join("survey.toml"), "radius_m", "radius"));
    assert_says(&message, &["survey.toml:3:1", "unknown field `radius`"]);
}

#[test]
fn a_missing_survey() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let message = fail(&["refine", text(dir.path()), "--out", text(&out)], 3);
    assert_says(&message, &["survey.toml", "cannot read the survey"]);
}

#[test]
fn a_single_frame() {
    let survey = first_frames(1);
    let out = survey.path().join("out");
    let message = fail(&["refine", text(survey.path()), "--out", text(&out)], 3);
    assert_says(&message, &["single frame", "two or more"]);
}

#[test]
fn frames_without_any_overlap() {
    // The first and the seventh frame of the first turn look opposite ways.
    let survey = first_frames(7);
    for name in ["baseline.tum", "groundtruth.tum"] {
        let path = survey.path().join(name);
        let poses = std::fs::read_to_string(&path).unwrap();
        let lines: Vec<&str> = poses.lines().collect();
        std::fs::write(&path, format!("{}\n{}\n", lines[0], lines[6])).unwrap();
    }
    for k in 1..6 {
        std::fs::remove_file(survey.path().join(format!("frames/{k:06}.jpg"))).unwrap();
    }
    let out = survey.path().join("out");
    let message = fail(&["refine", text(survey.path()), "--out", text(&out)], 3);
    assert_says(&message, &["no two frames overlap"]);
}

#[test]
fn an_output_folder_that_cannot_be_made() {
    let survey = first_frames(3);
    // A file exists in place of the folder.
    let out = survey.path().join("camera.json/out");
    let message = fail(&["refine", text(survey.path()), "--out", text(&out)], 3);
    assert_says(&message, &["camera.json", "cannot write"]);
}

#[test]
fn wrong_usage_is_exit_code_2() {
    fail(&["refine"], 2);
    fail(&["refine", "survey", "--out", "out", "--threads", "0"], 2);
}
