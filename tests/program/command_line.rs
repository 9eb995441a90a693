//! Manners of the command line: JSON, errors, help and colours are alike for all commands.

use crate::support::{fail, first_frames, succeed, text, tunnelstitch, with_input};
use serde_json::Value;
use std::path::Path;
use std::process::Command;

/// The one JSON document that a command prints; nothing may follow it.
#[track_caller]
fn result(arguments: &[&str]) -> Value {
    let printed = succeed(&[arguments, &["--json"]].concat());
    serde_json::from_str(&printed).unwrap_or_else(|error| panic!("{error}: {printed}"))
}

/// The last line of standard error, which is JSON.
#[track_caller]
fn error(arguments: &[&str], code: i32) -> Value {
    let message = fail(arguments, code);
    let last = message.lines().last().unwrap_or_default();
    serde_json::from_str(last).unwrap_or_else(|error| panic!("{error}: {message}"))
}

#[test]
fn every_command_prints_its_result_as_one_json_document() {
    let survey = first_frames(3);
    let dir = survey.path();
    let path = |name: &str| dir.join(name);
    std::fs::remove_file(path("survey.toml")).unwrap();
    let init = result(&["init", text(dir), "--radius-m", "3"]);
    assert_eq!(init["images"], "frames/*.jpg");
    assert_eq!(init["initial_poses"], "baseline.tum");
    assert_eq!(init["missing"], Value::Null);

    let (plan, kitti, wall) = (path("plan.tum"), path("poses.txt"), path("wall.png"));
    let turn = ["--advance-m", "0.1", "--turn-deg", "30"];
    let planned = result(&[&["plan", text(dir), "--out", text(&plan)], &turn[..]].concat());
    assert_eq!(planned["poses"], 3);
    assert_eq!(planned["survey_file"]["poses"]["initial"], "plan.tum");
    let converted = result(&["convert", text(dir), "--to", "kitti", "--out", text(&kitti)]);
    assert_eq!(converted["poses"], 3);
    let stitch = [
        "stitch",
        text(dir),
        "--px-per-metre",
        "20",
        "--out",
        text(&wall),
    ];
    assert_eq!(result(&stitch)["frames"], 3);
    assert_eq!(result(&["check", text(dir)])["frames"], 3);
    assert!(result(&["config", text(dir)])["options"].is_object());

    let (pixels, points) = (path("pixels.csv"), path("points.csv"));
    std::fs::write(&pixels, "frame,u,v\n0,240,180\n1,240,180\n").unwrap();
    let many = ["--points", text(&pixels), "--out", text(&points)];
    let located = result(&[&["locate", text(dir)], &many[..]].concat());
    assert_eq!(located["on_wall"], 2);
    let (photo, cylinder) = (path("frames/000000.jpg"), path("cylinder.png"));
    let projected = result(&["project", text(&photo), "--out", text(&cylinder)]);
    assert_eq!(projected["origin_px"].as_array().map(Vec::len), Some(2));
    let manual = path("man");
    assert_eq!(
        result(&["man", "--out", text(&manual)])["out"],
        text(&manual)
    );
}

#[test]
fn errors_are_json_where_results_are() {
    let missing = error(&["check", "/nonexistent", "--json"], 3);
    assert_eq!(missing["exit_code"], 3);
    let text = missing["error"].as_str().unwrap();
    assert!(
        text.starts_with("/nonexistent: cannot read the survey"),
        "{text}"
    );
    // Arguments that cannot be read ask for it all the same.
    let unknown = error(&["check", "survey", "--jason", "--json"], 2);
    assert_eq!(unknown["exit_code"], 2);
    assert!(
        unknown["error"].as_str().unwrap().contains("--jason"),
        "{unknown}"
    );
    let out = tunnelstitch(&["check", "/nonexistent", "--", "--json"]);
    let message = String::from_utf8_lossy(&out.stderr).into_owned();
    assert!(message.starts_with("error: "), "{message}");
}

#[test]
fn commands_stand_under_headings_and_short_help_is_shorter() {
    let help = succeed(&["--help"]);
    for part in [
        "Prepare a survey:\n  init",
        "Use the result:\n  stitch",
        "Options:",
    ] {
        assert!(help.contains(part), "no {part:?} in {help}");
    }
    assert!(
        help.lines().all(|line| line.chars().count() <= 100),
        "{help}"
    );
    let [short, long] = ["-h", "--help"].map(|flag| succeed(&["refine", flag]));
    assert!(2 * short.lines().count() < long.lines().count());
    // What replaces keys of survey.toml is for the long help.
    assert!(!short.contains("--pose-columns") && long.contains("--pose-columns"));
}

/// Standard error of a command that fails, with an environment variable.
fn message_with(variables: &[(&str, &str)]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(["check", "/nonexistent"])
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn colours_are_for_terminals() {
    assert!(message_with(&[]).starts_with("error: "));
    let forced = message_with(&[("CLICOLOR_FORCE", "1")]);
    assert!(
        forced.contains("\u{1b}[") && forced.contains("error:"),
        "{forced}"
    );
    let plain = message_with(&[("CLICOLOR_FORCE", "1"), ("NO_COLOR", "1")]);
    assert!(plain.starts_with("error: "), "{plain}");
    assert!(!succeed(&["--help"]).contains('\u{1b}'));
}

#[test]
fn poses_may_be_named_by_the_folder_of_refine() {
    let survey = first_frames(6);
    let dir = survey.path();
    let refined = dir.join("refined");
    std::fs::create_dir(&refined).unwrap();
    let compare = |refined: &Path, out: &str| {
        let out = dir.join(out);
        let to = ["--out", text(&out), "--px-per-metre", "20"];
        tunnelstitch(&[&["compare", text(dir), "--refined", text(refined)], &to[..]].concat())
    };
    let refused = compare(&refined, "none");
    assert_eq!(refused.status.code(), Some(3));
    std::fs::copy(dir.join("groundtruth.tum"), refined.join("poses.tum")).unwrap();
    let [by_folder, by_file] = [
        compare(&refined, "a"),
        compare(&refined.join("poses.tum"), "b"),
    ];
    assert!(by_folder.status.success() && by_file.status.success());
    let report = |name: &str| std::fs::read(dir.join(name).join("compare.json")).unwrap();
    assert_eq!(report("a"), report("b"));
}

/// `-` is a stream: poses of `convert` into another program, pixels of `locate` out of one.
#[test]
fn a_hyphen_is_standard_input_or_output() {
    let survey = first_frames(3);
    let dir = survey.path();
    let file = dir.join("poses.txt");
    let convert =
        |out: &str| ["convert", text(dir), "--to", "kitti", "--out", out].map(str::to_owned);
    let of =
        |arguments: &[String]| succeed(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
    of(&convert(text(&file)));
    assert_eq!(of(&convert("-")), std::fs::read_to_string(&file).unwrap());
    let colmap = ["convert", text(dir), "--to", "colmap", "--out", "-"];
    assert!(fail(&colmap, 2).contains("folder"));
    assert!(
        fail(
            &["convert", text(dir), "--to", "tum", "--out", "-", "--json"],
            2
        )
        .contains("--json")
    );

    let plan = |out: &str| {
        let motion = ["--advance-m", "0.1", "--turn-deg", "30", "--out", out];
        succeed(&[&["plan", text(dir)], &motion[..]].concat())
    };
    plan(text(&file));
    assert_eq!(plan("-"), std::fs::read_to_string(&file).unwrap());

    let pixels = "frame,u,v\n0,240,180\n1,100,90\n";
    let (input, output) = (dir.join("pixels.csv"), dir.join("points.csv"));
    std::fs::write(&input, pixels).unwrap();
    let locate = ["locate", text(dir), "--points"];
    succeed(&[&locate[..], &[text(&input), "--out", text(&output)]].concat());
    let printed = with_input(&[&locate[..], &["-", "--out", "-"]].concat(), pixels);
    assert!(printed.status.success());
    assert_eq!(printed.stdout, std::fs::read(&output).unwrap());
}

/// A panorama is a stream, a folder of results is none.
#[test]
fn panoramas_are_printed_and_folders_are_not() {
    let survey = first_frames(3);
    let dir = survey.path();
    let stitch = [
        "stitch",
        text(dir),
        "--poses",
        "truth",
        "--px-per-metre",
        "20",
    ];
    let file = dir.join("wall.png");
    succeed(&[&stitch[..], &["--out", text(&file)]].concat());
    let printed = tunnelstitch(&[&stitch[..], &["--out", "-"]].concat());
    assert!(printed.status.success());
    let [printed, written] = [printed.stdout, std::fs::read(&file).unwrap()]
        .map(|bytes| image::load_from_memory(&bytes).unwrap());
    assert_eq!(printed, written);
    for more in [&["--json"][..], &["--seams"], &["--dry-run"]] {
        let refused = tunnelstitch(&[&stitch[..], &["--out", "-"], more].concat());
        assert_eq!(refused.status.code(), Some(2), "{more:?}");
        assert!(refused.stdout.is_empty());
    }
    for command in ["refine", "report", "compare"] {
        let refined = ["--refined", "truth"];
        let refined = if command == "refine" {
            &[][..]
        } else {
            &refined
        };
        let said = fail(&[&[command, text(dir), "--out", "-"], refined].concat(), 2);
        assert!(said.contains("name a folder"), "{said}");
    }
}
