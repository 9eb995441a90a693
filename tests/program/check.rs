//! `init` and `check` through the program.

use crate::support::{edit, fail, first_frames, simulate, succeed, text, tunnelstitch};

#[test]
fn a_folder_becomes_a_survey_and_is_sound() {
    let survey = first_frames(14);
    let path = survey.path().join("survey.toml");
    std::fs::remove_file(&path).unwrap();
    let said = succeed(&["init", text(survey.path()), "--radius-m", "3"]);
    for part in [
        "frames/*.jpg (14, 480 × 360 px)",
        "camera.json",
        "baseline.tum",
        "groundtruth.tum",
        "next: ",
    ] {
        assert!(said.contains(part), "no {part} in {said}");
    }
    let report = succeed(&["check", text(survey.path()), "--json"]);
    let report: serde_json::Value = serde_json::from_str(&report).unwrap();
    assert_eq!(report["frames"], 14);
    assert_eq!(report["faults"].as_array().unwrap().len(), 0);
    let overlap = report["overlap"]["neighbours"].as_f64().unwrap();
    assert!((0.3..0.8).contains(&overlap), "{report}");
    assert!(
        report["pictures"]["sigma_px"].as_f64().unwrap() < 0.01,
        "{report}"
    );
    // An existing file is not replaced.
    let message = fail(&["init", text(survey.path())], 3);
    assert!(message.contains("--force"), "{message}");
}

#[test]
fn missing_files_are_reported_and_left_to_be_filled_in() {
    let survey = first_frames(3);
    for name in ["survey.toml", "camera.json"] {
        std::fs::remove_file(survey.path().join(name)).unwrap();
    }
    let output = tunnelstitch(&["init", text(survey.path())]);
    assert!(output.status.success());
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(said.contains("radius_m"), "{said}");
    let file = std::fs::read_to_string(survey.path().join("survey.toml")).unwrap();
    assert!(
        file.contains("# radius_m = 3.0") && file.contains("No calibration was found"),
        "{file}"
    );
    let empty = tempfile::tempdir().unwrap();
    let message = fail(&["init", text(empty.path())], 3);
    assert!(message.contains("no pictures"), "{message}");
}

#[test]
fn every_frame_that_does_not_fit_is_named() {
    let survey = first_frames(6);
    let frame = |k: usize| survey.path().join(format!("frames/{k:06}.jpg"));
    image::GrayImage::new(64, 48).save(frame(2)).unwrap();
    std::fs::write(frame(4), "no picture").unwrap();
    let message = fail(&["check", text(survey.path())], 3);
    assert!(
        message.contains("frame 2") && message.contains("64 × 48"),
        "{message}"
    );
    assert!(message.contains("frame 4"), "{message}");
    // `check` reports a survey that cannot be opened with the message of opening it.
    edit(
        &survey.path().join("survey.toml"),
        "radius_m = 3",
        "radius_m = -3",
    );
    let message = fail(&["check", text(survey.path())], 3);
    assert!(message.contains("must be a positive number"), "{message}");
}

/// With `--strict`, what needs attention is an exit code; what makes `refine` fail keeps its own.
#[test]
fn a_strict_check_fails_where_there_is_a_warning() {
    let dir = tempfile::tempdir().unwrap();
    let sound = dir.path().join("sound");
    let small = ["--frames", "25", "--size", "160x120", "--supersample", "2"];
    simulate(&sound, &small);
    succeed(&["check", text(&sound), "--strict"]);
    let dark = dir.path().join("dark");
    simulate(
        &dark,
        &[&small[..], &["--bad-frames", "0-24:black"]].concat(),
    );
    succeed(&["check", text(&dark)]);
    for more in [&[][..], &["--json"]] {
        let message = fail(&[&["check", text(&dark), "--strict"], more].concat(), 4);
        assert!(message.contains("--strict: warnings"), "{message}");
    }
    std::fs::write(dark.join("frames/000003.png"), "no picture").unwrap();
    fail(&["check", text(&dark), "--strict"], 3);
}

/// Noise, wide turns and blur leave directions that no picture measures; readings whose prior is
/// another are not the better for it.
#[test]
fn right_surveys_with_weak_pictures_get_no_advice() {
    let scratch = tempfile::tempdir().unwrap();
    for weak in [
        ["--noise", "8", "--seed", "3"],
        ["--turn-deg", "55", "--seed", "3"],
        ["--motion-blur-px", "8", "--seed", "1"],
    ] {
        let size = ["--frames", "18", "--size", "160x120", "--supersample", "2"];
        let wall = ["--wall", "concrete", "--force"];
        simulate(scratch.path(), &[&size[..], &wall, &weak].concat());
        let said = succeed(&["check", text(scratch.path()), "--json"]);
        let check: serde_json::Value = serde_json::from_str(&said).unwrap();
        assert_eq!(check["readings"], serde_json::Value::Null, "{weak:?}");
    }
}
