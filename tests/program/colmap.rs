//! COLMAP's models as COLMAP writes them: binary, and with poses of some of the frames only.

use crate::support::{edit, fail, first_frames, simulate, succeed, text};
use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use serde_json::Value;
use std::path::Path;
use tempfile::TempDir;

/// Bytes of a number of entries.
fn count(entries: usize) -> Vec<u8> {
    (entries as u64).to_le_bytes().to_vec()
}

/// Numbers of a line of a text model from the column `first` on.
fn numbers(words: &[&str], first: usize) -> Vec<u8> {
    let values = words[first..]
        .iter()
        .map(|word| word.parse::<f64>().unwrap());
    values.flat_map(f64::to_le_bytes).collect()
}

/// Rewrites the text model of a folder, of one PINHOLE or OPENCV camera, as a binary one.
fn to_binary(folder: &Path) {
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let is_content = |line: &&str| !line.is_empty() && !line.starts_with('#');
    let cameras = read("cameras.txt");
    let line = cameras.lines().find(is_content).unwrap();
    let words: Vec<&str> = line.split(' ').collect();
    let model: i32 = if words[1] == "PINHOLE" { 1 } else { 4 };
    let mut bytes = [count(1), 1u32.to_le_bytes().to_vec()].concat();
    bytes.extend(model.to_le_bytes());
    bytes.extend(
        words[2..4]
            .iter()
            .flat_map(|side| count(side.parse().unwrap())),
    );
    bytes.extend(numbers(&words, 4));
    std::fs::write(folder.join("cameras.bin"), bytes).unwrap();
    let images = read("images.txt");
    let lines: Vec<&str> = images.lines().filter(is_content).collect();
    let mut bytes = count(lines.len());
    for line in lines {
        let words: Vec<&str> = line.split(' ').collect();
        bytes.extend(words[0].parse::<u32>().unwrap().to_le_bytes());
        bytes.extend(numbers(&words[..8], 1));
        bytes.extend(1u32.to_le_bytes());
        bytes.extend([words[9].as_bytes(), &[0]].concat());
        bytes.extend(count(0));
    }
    std::fs::write(folder.join("images.bin"), bytes).unwrap();
    for name in ["cameras.txt", "images.txt", "points3D.txt"] {
        std::fs::remove_file(folder.join(name)).unwrap();
    }
}

/// A survey whose initial poses are a COLMAP model in `sparse/0`, as text.
fn survey_of_colmap(frames: usize) -> TempDir {
    let survey = first_frames(frames);
    let dir = survey.path();
    std::fs::create_dir(dir.join("sparse")).unwrap();
    let out = dir.join("sparse/0");
    succeed(&["convert", text(dir), "--to", "colmap", "--out", text(&out)]);
    survey
}

fn json(path: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap()
}

/// `init` finds a binary model, and what it writes passes `check`; a damaged one is refused with
/// its byte.
#[test]
fn a_binary_model_is_found_and_used() {
    let survey = survey_of_colmap(6);
    let dir = survey.path();
    to_binary(&dir.join("sparse/0"));
    for name in ["survey.toml", "camera.json", "baseline.tum"] {
        std::fs::remove_file(dir.join(name)).unwrap();
    }
    succeed(&["init", text(dir), "--radius-m", "3"]);
    let written = std::fs::read_to_string(dir.join("survey.toml")).unwrap();
    for expected in ["sparse/0/cameras.bin", "sparse/0/images.bin"] {
        assert!(written.contains(expected), "{written}");
    }
    succeed(&["check", text(dir)]);
    edit(&dir.join("survey.toml"), "sparse/0/images.bin", "sparse/0");
    succeed(&["check", text(dir)]);
    let images = dir.join("sparse/0/images.bin");
    let bytes = std::fs::read(&images).unwrap();
    std::fs::write(&images, &bytes[..bytes.len() - 1]).unwrap();
    let message = fail(&["check", text(dir)], 3);
    assert!(message.contains("images.bin: byte "), "{message}");
}

/// Frames without a pose are named and start between their neighbours; too many are refused.
#[test]
fn a_model_of_some_frames_is_completed() {
    let survey = survey_of_colmap(8);
    let dir = survey.path();
    edit(&dir.join("survey.toml"), "baseline.tum", "sparse/0");
    let images = dir.join("sparse/0/images.txt");
    let whole = std::fs::read_to_string(&images).unwrap();
    let leave_out = |frames: &[usize]| {
        let is_kept = |line: &&str| !frames.iter().any(|k| line.contains(&format!("{k:06}.jpg")));
        let kept: Vec<&str> = whole
            .lines()
            .filter(|l| !l.is_empty())
            .filter(is_kept)
            .collect();
        let (head, lines): (Vec<&str>, Vec<&str>) = kept.iter().partition(|l| l.starts_with('#'));
        std::fs::write(
            &images,
            [head.join("\n"), lines.join("\n\n")].join("\n") + "\n\n",
        )
        .unwrap();
    };
    leave_out(&[3, 7]);
    let run = |arguments: &[&str]| {
        let output = crate::support::tunnelstitch(arguments);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.success(), "{said}");
        assert!(
            said.contains("no pose of frame 3 (") && said.contains("2 of 8 frames"),
            "{said}"
        );
    };
    run(&["check", text(dir)]);
    let out = dir.join("refined");
    run(&["refine", text(dir), "--out", text(&out), "--quiet"]);
    let report = json(&out.join("refine.json"));
    let is_interpolated = |frame: &&Value| frame["initial_interpolated"] == true;
    let frames = report["frames"].as_array().unwrap().iter();
    let found: Vec<&Value> = frames
        .filter(is_interpolated)
        .map(|f| &f["index"])
        .collect();
    assert_eq!(found, [3, 7]);
    let panorama = dir.join("panorama.png");
    let scale = ["--px-per-metre", "20", "--out", text(&panorama)];
    run(&[&["stitch", text(dir)][..], &scale].concat());
    leave_out(&[1, 2, 3, 4, 5]);
    let message = fail(&["check", text(dir)], 3);
    assert!(
        message.contains("5 of 8 frames; at least half"),
        "{message}"
    );
}

/// COLMAP writes a camera for each picture unless it is told to share one: equal ones are one, and
/// of others `init` selects one by name.
#[test]
fn a_camera_for_each_picture_is_shared_or_selected() {
    let survey = survey_of_colmap(14);
    let dir = survey.path();
    let cameras = dir.join("sparse/0/cameras.txt");
    let written = std::fs::read_to_string(&cameras).unwrap();
    let line = written.lines().find(|line| line.starts_with("1 ")).unwrap();
    let second = line.replacen("1 ", "2 ", 1);
    std::fs::write(&cameras, format!("{line}\n{second}\n")).unwrap();
    std::fs::remove_file(dir.join("camera.json")).unwrap();
    let init = [
        "init",
        text(dir),
        "--radius-m",
        "3",
        "--unit-m",
        "1",
        "--force",
    ];
    let said = succeed(&init);
    assert!(
        said.contains("next: ") && !said.contains("name under"),
        "{said}"
    );
    let focal = line.split(' ').nth(4).unwrap();
    let second = second.replacen(focal, "431.5", 1);
    std::fs::write(&cameras, format!("{line}\n{second}\n")).unwrap();
    let said = succeed(&init);
    assert!(said.contains("camera 1, one of 2 that differ"), "{said}");
    let toml = std::fs::read_to_string(dir.join("survey.toml")).unwrap();
    assert!(toml.contains("\nname = \"1\""), "{toml}");
    succeed(&["check", text(dir)]);
}

/// Moves the poses of a text model into another world, whose unit is `unit_m` metres.
fn move_model(images: &Path, rotation: &UnitQuaternion<f64>, origin: &Vector3<f64>, unit_m: f64) {
    let text = std::fs::read_to_string(images).unwrap();
    let moved = |line: &str| {
        let words: Vec<&str> = line.split(' ').collect();
        if line.starts_with('#') || words.len() < 10 {
            return line.to_owned();
        }
        let v: Vec<f64> = words[1..8]
            .iter()
            .map(|word| word.parse().unwrap())
            .collect();
        let r_cw = UnitQuaternion::from_quaternion(Quaternion::new(v[0], v[1], v[2], v[3]));
        let r_cw = r_cw * rotation.inverse();
        let t = Vector3::new(v[4], v[5], v[6]) / unit_m - r_cw * origin;
        let q = r_cw.quaternion();
        let numbers = [q.w, q.i, q.j, q.k, t.x, t.y, t.z].map(|number| number.to_string());
        [
            &[words[0].to_owned()],
            &numbers[..],
            &words[8..]
                .iter()
                .map(|w| (*w).to_owned())
                .collect::<Vec<_>>(),
        ]
        .concat()
        .join(" ")
    };
    let lines: Vec<String> = text.lines().map(moved).collect();
    std::fs::write(images, lines.join("\n") + "\n").unwrap();
}

/// A binary model in a world and a unit of its own, with its pictures: the commands that `init` and
/// `check` name lead to a panorama, and no file is edited by hand.
#[test]
fn a_model_of_any_axis_and_unit_becomes_a_panorama() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    simulate(&survey, &["--frames", "16", "--size", "240x180"]);
    let sparse = survey.join("sparse/0");
    let convert = [
        "convert",
        text(&survey),
        "--poses",
        "truth",
        "--to",
        "colmap",
    ];
    succeed(&[&convert[..], &["--out", text(&sparse)]].concat());
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
    let origin = Vector3::new(3.0, -7.0, 1.5);
    move_model(&sparse.join("images.txt"), &rotation, &origin, 1.6);
    to_binary(&sparse);
    for name in [
        "survey.toml",
        "camera.json",
        "baseline.tum",
        "groundtruth.tum",
    ] {
        std::fs::remove_file(survey.join(name)).unwrap();
    }
    let said = succeed(&["init", text(&survey), "--radius-m", "3"]);
    assert!(said.contains("axis.json"), "{said}");
    // The pictures tell the unit, to a tenth of a decade.
    let checked = succeed(&["check", text(&survey), "--json"]);
    let checked: Value = serde_json::from_str(&checked).unwrap();
    let reading = checked["readings"]["readings"][0].as_str().unwrap();
    let command = reading.split("tunnelstitch ").nth(1).unwrap();
    let command = command.split(" writes").next().unwrap();
    assert!(command.contains("--unit-m 1.58"), "{reading}");
    let words: Vec<&str> = command.split(' ').chain([text(&survey)]).collect();
    succeed(&words);
    succeed(&["check", text(&survey)]);
    let refined = dir.path().join("refined");
    let said = succeed(&["refine", text(&survey), "--out", text(&refined)]);
    assert!(said.contains("all 16 frames"), "{said}");
    let wall = dir.path().join("wall.png");
    let poses = refined.join("poses.tum");
    succeed(&[
        "stitch",
        text(&survey),
        "--poses",
        text(&poses),
        "--out",
        text(&wall),
    ]);
    assert!(wall.exists());
}
