//! Numbers that no survey has are refused at once, with the range.

use crate::support::{edit, first_frames, run_within, text};

/// Longest time of a refusal, seconds.
const MAX_REFUSAL_S: u64 = 30;

/// Message of a command on three frames after a change, which must end with `code`.
fn refused(command: &str, code: i32, file: &str, from: &str, to: &str) -> String {
    let survey = first_frames(3);
    edit(&survey.path().join(file), from, to);
    let out = survey.path().join("out");
    let mut arguments = vec![command, text(survey.path())];
    if command == "refine" {
        arguments.extend(["--out", text(&out)]);
    }
    let (ended, message) = run_within(&arguments, MAX_REFUSAL_S);
    assert_eq!(ended, Some(code), "{message}");
    message
}

#[test]
fn focal_lengths_and_sizes_have_bounds() {
    for value in ["1e6", "1e9", "0.5"] {
        let to = format!("\"fx\": {value}, \"was\":");
        let message = refused("check", 3, "camera.json", "\"fx\":", &to);
        assert!(message.contains("fx"), "{message}");
    }
    for radius in ["1e-6", "1e6"] {
        let to = format!("radius_m = {radius} # ");
        let message = refused("check", 3, "survey.toml", "radius_m = ", &to);
        assert!(message.contains("from 0.001 to 100000"), "{message}");
    }
}

#[test]
fn priors_that_cannot_be_searched_are_refused() {
    for (key, value) in [
        ("rotation_sigma_deg = ", "180 #"),
        ("translation_sigma_m = ", "[30, 30, 30] #"),
    ] {
        let to = format!("{key}{value}");
        let message = refused("refine", 3, "survey.toml", key, &to);
        assert!(
            message.contains("too wide") && message.contains("plan"),
            "{message}"
        );
    }
}

#[test]
fn poses_without_motion_are_refused() {
    let survey = first_frames(4);
    let still: String = (0..4).map(|k| format!("{k} 0 0 0 0 0 0 1\n")).collect();
    std::fs::write(survey.path().join("baseline.tum"), still).unwrap();
    let out = survey.path().join("out");
    let refine = ["refine", text(survey.path()), "--out", text(&out)];
    let (code, message) = run_within(&refine, MAX_REFUSAL_S);
    assert_eq!(code, Some(3), "{message}");
    assert!(message.contains("tunnelstitch plan"), "{message}");
    let (_, message) = run_within(&["check", text(survey.path())], MAX_REFUSAL_S);
    assert!(message.contains("all initial poses are equal"), "{message}");
}

/// The wall between would take all memory.
#[test]
fn a_pose_far_from_all_others_is_refused() {
    for far in ["4e3", "1e160", "-1e9"] {
        let survey = first_frames(3);
        let poses = survey.path().join("baseline.tum");
        let text_of = std::fs::read_to_string(&poses).unwrap();
        let mut words: Vec<&str> = text_of.lines().nth(1).unwrap().split(' ').collect();
        words[2] = far;
        let moved: Vec<String> = (text_of.lines().enumerate())
            .map(|(k, line)| {
                if k == 1 {
                    words.join(" ")
                } else {
                    line.to_owned()
                }
            })
            .collect();
        std::fs::write(&poses, moved.join("\n")).unwrap();
        for command in ["check", "refine", "stitch"] {
            let out = survey.path().join("out.png");
            let arguments = match command {
                "check" => vec![command, text(survey.path())],
                _ => vec![command, text(survey.path()), "--out", text(&out)],
            };
            let (code, message) = run_within(&arguments, MAX_REFUSAL_S);
            assert_eq!(code, Some(3), "{command} {far}: {message}");
            assert!(message.contains("no camera is between"), "{message}");
        }
    }
}

/// The prior of a random walk is as wide as the wall after it, and the search is not.
#[test]
fn a_pause_of_years_takes_seconds() {
    let survey = first_frames(4);
    let poses = survey.path().join("baseline.tum");
    let lines = std::fs::read_to_string(&poses).unwrap();
    let (before, last) = lines.trim_end().rsplit_once('\n').unwrap();
    let (_, pose) = last.split_once(' ').unwrap();
    std::fs::write(&poses, format!("{before}\n1e9 {pose}\n")).unwrap();
    let out = survey.path().join("out");
    let refine = ["refine", text(survey.path()), "--out", text(&out)];
    let (code, message) = run_within(&refine, 10 * MAX_REFUSAL_S);
    assert!(matches!(code, Some(0 | 4)), "{code:?}: {message}");
}

#[test]
fn ignored_regions_have_a_number() {
    let region = |k: usize| format!("{{chainage_m=[{k},{}]}},", k + 1);
    let list = |count: usize| {
        let regions: String = (0..count).map(|k| region(k + 1000)).collect();
        format!("[tunnel]\nignore = [{regions}]")
    };
    let message = refused("check", 3, "survey.toml", "[tunnel]", &list(10_001));
    assert!(message.contains("10001 items"), "{message}");
    let survey = first_frames(3);
    edit(
        &survey.path().join("survey.toml"),
        "[tunnel]",
        &list(10_000),
    );
    let (code, message) = run_within(&["check", text(survey.path())], MAX_REFUSAL_S);
    assert_eq!(code, Some(0), "{message}");
}
