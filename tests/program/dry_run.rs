//! `--dry-run`: says what a command would do, with the errors of the run, and writes nothing.

use crate::support::{entries, fail, first_frames, succeed, text};
use serde_json::Value;
use std::path::Path;

/// Everything below a folder, with sizes of files.
fn content(folder: &Path) -> Vec<(String, u64)> {
    let mut all = Vec::new();
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let size = std::fs::metadata(&path).unwrap().len();
        all.push((text(&path).to_owned(), size));
        if path.is_dir() {
            all.extend(content(&path));
        }
    }
    all.sort();
    all
}

/// The job that `command` with an output below `dir` prints; nothing is written there.
#[track_caller]
fn job(command: &[&str], dir: &Path) -> Value {
    let before = content(dir);
    let said = succeed(&[command, &["--dry-run"]].concat());
    assert!(said.contains("dry run: nothing is written\n"), "{said}");
    let printed = succeed(&[command, &["--dry-run", "--json"]].concat());
    assert_eq!(content(dir), before, "{command:?}");
    let job: Value = serde_json::from_str(&printed).unwrap();
    assert_eq!(job["dry_run"], true);
    job
}

#[test]
fn jobs_are_described_and_nothing_is_written() {
    let survey = first_frames(4);
    let dir = survey.path();
    let out = dir.join("new").join("out");
    let file = |name: &str| out.join(name);
    let writes = |job: &Value, name: &str| {
        let list = job["writes"].as_array().unwrap();
        list.iter().any(|path| path == text(&file(name)))
    };
    let refine = job(&["refine", text(dir), "--out", text(&out)], dir);
    assert!(writes(&refine, "poses.tum") && writes(&refine, "run.toml"));
    assert_eq!(refine["frames"], 4);
    assert!(refine["time_s"].as_f64().unwrap() > 0.0);

    let wall = file("wall.png");
    let size = ["--px-per-metre", "20"];
    let stitch = job(
        &[&["stitch", text(dir), "--out", text(&wall)], &size[..]].concat(),
        dir,
    );
    assert!(writes(&stitch, "wall.png.run.toml"));
    assert!(stitch["memory_bytes"].as_u64().unwrap() > 0);
    let glb = file("wall.glb");
    let export = job(
        &[&["export", text(dir), "--glb", text(&glb)], &size[..]].concat(),
        dir,
    );
    assert!(writes(&export, "wall.glb"));
    let truth = dir.join("groundtruth.tum");
    let compare = [
        "compare",
        text(dir),
        "--refined",
        text(&truth),
        "--out",
        text(&out),
    ];
    let compare = job(&[&compare, &size[..]].concat(), dir);
    assert!(writes(&compare, "truth.png"));
    let report = [
        "report",
        text(dir),
        "--refined",
        text(&truth),
        "--out",
        text(&out),
    ];
    let report = job(&report, dir);
    assert!(writes(&report, "report.html") && writes(&report, "report.json"));
    assert_eq!(report["frames"], 4);
    let view = job(&["view", text(dir), "--port", "0"], dir);
    assert_eq!(view["may_write"][0], text(&dir.join("marks.geojson")));
    assert_eq!(view["amount"], "2 layers to draw");
    assert!(view["memory_bytes"].as_u64().unwrap() > 0);
    let demo = job(&["demo", "--turns", "2", "--out", text(&out)], dir);
    assert!(writes(&demo, "survey") && writes(&demo, "report"));
    assert_eq!(
        demo["amount"],
        "24 frames to simulate, refine, compare and report"
    );
    // The panoramas have the sizes that are announced.
    let drawn = ["stitch", text(dir), "--out", text(&wall), "--json"];
    let drawn: Value = serde_json::from_str(&succeed(&[&drawn, &size[..]].concat())).unwrap();
    assert_eq!(stitch["panorama_px"][0], drawn["width"]);
    assert_eq!(stitch["panorama_px"][1], drawn["height"]);
}

#[test]
fn simulations_are_described_and_an_unfinished_sweep_is_counted() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let simulate = job(&["simulate", "free", "--out", text(&out)], dir.path());
    assert_eq!(simulate["amount"], "120 frames of 640 × 480 px to simulate");

    let small = [
        "--rotation-deg",
        "2",
        "--jitter",
        "independent",
        "--frames",
        "4",
    ];
    let size = ["--size", "64x48", "--out", text(&out)];
    let sweep = [&["converge"], &small[..], &size[..]].concat();
    succeed(&[&sweep[..], &["--seeds", "1", "--quiet"]].concat());
    let more = job(&[&sweep[..], &["--seeds", "3"]].concat(), dir.path());
    assert_eq!(more["amount"], "2 runs to do, 1 found in runs.jsonl");
}

/// Errors and exit codes of the dry run are those of the run.
#[test]
fn errors_are_those_of_the_run() {
    let survey = first_frames(3);
    let dir = survey.path();
    let (file, other) = (dir.join("baseline.tum"), dir.join("out"));
    let below = file.join("out");
    let frame = dir.join("frames").join("000000.jpg");
    let commands = [
        (vec!["refine", text(dir), "--out", text(dir)], 3),
        (vec!["refine", text(dir), "--out", text(&below)], 3),
        (vec!["refine", "/nonexistent", "--out", text(&other)], 3),
        (vec!["stitch", text(dir), "--out", "wall.bmp"], 2),
        (vec!["stitch", text(dir), "--out", text(&frame)], 2),
        (vec!["export", text(dir), "--3dtiles", text(dir)], 2),
        (vec!["simulate", "free", "--out", text(dir)], 3),
        (vec!["converge", "--out", text(&file)], 3),
        (vec!["view", text(&other)], 3),
    ];
    let there = entries(dir);
    for (command, code) in commands {
        let dry = fail(&[&command[..], &["--dry-run"]].concat(), code);
        assert_eq!(dry, fail(&command, code), "{command:?}");
    }
    // A camera that does not move, which only the estimator refuses.
    std::fs::write(&file, "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n").unwrap();
    let motionless = ["refine", text(dir), "--out", text(&other)];
    let dry = fail(&[&motionless[..], &["--dry-run"]].concat(), 3);
    assert!(dry.contains("poses"), "{dry}");
    assert_eq!(entries(dir), there);
}
