//! Simulated surveys and the demo, through the program.

use crate::support::{self, fail, json, succeed, text};
use std::path::Path;
use tunnelstitch::frames::StoredFrame;
use tunnelstitch::survey::Survey;

/// Options of a survey small enough for a test.
const SMALL: [&str; 6] = ["--frames", "4", "--size", "64x48", "--supersample", "2"];

fn simulate(experiment: &str, out: &Path, more: &[&str]) -> String {
    let mut arguments = vec!["simulate", experiment, "--out", text(out)];
    arguments.extend(SMALL);
    arguments.extend(more);
    succeed(&arguments)
}

/// A free survey of any number of small frames.
fn simulate_with(out: &Path, more: &[&str]) -> String {
    let mut arguments = vec!["simulate", "free", "--out", text(out)];
    arguments.extend(&SMALL[2..]);
    arguments.extend(more);
    succeed(&arguments)
}

/// All files of a folder and of its folders with their contents, by name, except the record, which
/// names the folder.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.ends_with("run.toml") {
                let name = path.strip_prefix(folder).unwrap().display().to_string();
                found.push((name, std::fs::read(path).unwrap()));
            }
        }
    }
    found.sort();
    found
}

#[test]
fn every_experiment_is_a_complete_survey() {
    let dir = tempfile::tempdir().unwrap();
    for experiment in ["centred", "off-centre", "free"] {
        let out = dir.path().join(experiment);
        let said = simulate(experiment, &out, &[]);
        let next = if experiment == "free" {
            "refine"
        } else {
            "stitch"
        };
        assert!(
            said.contains(&format!("next: tunnelstitch {next}")),
            "{said}"
        );
        let survey = Survey::open(&out).unwrap();
        assert_eq!(survey.frames.len(), 4);
        assert_eq!(survey.cameras.size(), [64, 48]);
        let truth = survey.truth.unwrap();
        let same = survey.initial == truth;
        assert_eq!(same, experiment == "centred", "{experiment}");
        for frame in &survey.frames {
            let picture = image::open(&frame.path).unwrap().to_luma8();
            assert_eq!(picture.dimensions(), (64, 48));
            let (low, high) = picture.iter().fold((255, 0), |(low, high), value| {
                (low.min(*value), high.max(*value))
            });
            assert!(high - low > 40, "{experiment}: {low} to {high}");
        }
    }
}

#[test]
fn the_seed_decides_every_byte_and_the_threads_none() {
    let dir = tempfile::tempdir().unwrap();
    let survey = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        simulate("free", &out, more);
        contents(&out)
    };
    let first = survey("first", &["--seed", "5", "--threads", "1"]);
    assert_eq!(first.len(), 9);
    assert!(first == survey("second", &["--seed", "5", "--threads", "2"]));
    let other = survey("third", &["--seed", "6"]);
    for name in ["frames/000000.png", "groundtruth.tum"] {
        let of = |files: &[(String, Vec<u8>)]| {
            let file = files.iter().find(|(found, _)| found == name);
            file.map(|(_, bytes)| bytes.clone())
        };
        assert!(of(&first).is_some() && of(&first) != of(&other), "{name}");
    }
}

#[test]
fn a_texture_papers_the_wall() {
    let dir = tempfile::tempdir().unwrap();
    let texture = dir.path().join("texture.png");
    image::GrayImage::from_pixel(8, 8, image::Luma([180]))
        .save(&texture)
        .unwrap();
    let out = dir.path().join("survey");
    simulate(
        "centred",
        &out,
        &[
            "--texture",
            text(&texture),
            "--light",
            "even",
            "--noise",
            "0",
        ],
    );
    let frame = image::open(out.join("frames/000002.png"))
        .unwrap()
        .to_luma8();
    assert!(frame.iter().all(|value| *value == 180));
}

/// The record of a survey without degradations does not mention them, so earlier simulations stay
/// the same.
#[test]
fn degradations_are_recorded_and_reproducible() {
    let dir = tempfile::tempdir().unwrap();
    let survey = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        simulate("free", &out, more);
        contents(&out)
    };
    let record = |files: &[(String, Vec<u8>)]| {
        let file = files.iter().find(|(name, _)| name == "simulation.json");
        let record: serde_json::Value = serde_json::from_slice(&file.unwrap().1).unwrap();
        record["options"].clone()
    };
    let degradations: [(&[&str], &str, serde_json::Value); 6] = [
        (&["--gain-percent", "20"], "gain_percent", 20.0.into()),
        (&["--bias-grey", "6"], "bias_grey", 6.0.into()),
        (&["--lamp-corner", "0.4"], "lamp_corner", 0.4.into()),
        (
            &["--specular-percent", "10"],
            "specular_percent",
            10.0.into(),
        ),
        (&["--moving", "7"], "moving", 7.into()),
        (&["--bits", "16"], "bits", 16.into()),
    ];
    let plain = survey("plain", &[]);
    let frame = |files: &[(String, Vec<u8>)]| {
        let file = files.iter().find(|(name, _)| name == "frames/000002.png");
        file.unwrap().1.clone()
    };
    for (arguments, key, value) in &degradations {
        assert!(record(&plain).get(key).is_none(), "{key}");
        let hard = survey(&format!("one-{key}"), arguments);
        assert_eq!(record(&hard)[key], *value, "{key}");
        assert!(frame(&hard) != frame(&plain), "{key}");
    }
    let mut all: Vec<&str> = degradations
        .iter()
        .flat_map(|(more, ..)| *more)
        .copied()
        .collect();
    all.extend(["--bad-frames", "1:blurred,3:occluded", "--threads", "1"]);
    let first = survey("first", &all);
    assert_eq!(record(&first)["bad_frames"], "1:blurred,3:occluded");
    *all.last_mut().unwrap() = "2";
    assert!(first == survey("second", &all));
}

#[test]
fn sixteen_bit_frames_hold_what_eight_bits_round_away() {
    let dir = tempfile::tempdir().unwrap();
    let grey = |bits: &str| {
        let out = dir.path().join(bits);
        simulate("centred", &out, &["--bits", bits]);
        let survey = Survey::open(&out).unwrap();
        StoredFrame::decode(&survey.frames[1], 64, 48)
            .unwrap()
            .grey()
    };
    let (coarse, fine) = (grey("8"), grey("16"));
    assert!(coarse.data().iter().all(|v| v.fract() == 0.0));
    let between = fine.data().iter().filter(|v| v.fract() != 0.0).count();
    assert!(between > fine.data().len() * 9 / 10, "{between}");
    for (coarse, fine) in coarse.data().iter().zip(fine.data()) {
        assert!((coarse - fine).abs() < 0.503, "{coarse} {fine}");
    }
}

#[test]
fn bad_frames_go_into_the_survey_and_missing_ones_out_of_it() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("bad");
    let spec = "1:black,2:repeated,4-6:missing";
    let said = simulate_with(&out, &["--frames", "8", "--bad-frames", spec]);
    assert!(said.contains("5 frames of"), "{said}");
    let survey = Survey::open(&out).unwrap();
    let names: Vec<_> = survey
        .frames
        .iter()
        .map(|frame| {
            frame
                .path
                .file_stem()
                .unwrap()
                .to_string_lossy()
                .into_owned()
        })
        .collect();
    assert_eq!(names, ["000000", "000001", "000002", "000003", "000007"]);
    let picture = |k: usize| std::fs::read(&survey.frames[k].path).unwrap();
    assert!(picture(1) == picture(2) && picture(0) != picture(1));
    for poses in [&survey.initial, survey.truth.as_ref().unwrap()] {
        let times: Vec<f64> = poses.iter().map(|stamped| stamped.time_s).collect();
        assert_eq!(times, [0.0, 1.0, 2.0, 3.0, 7.0]);
    }
    // The poses advance where the picture is repeated.
    assert!(survey.initial[1].pose != survey.initial[2].pose);
    // And are those of the survey without bad frames.
    let good = dir.path().join("good");
    simulate_with(&good, &["--frames", "8"]);
    let good = Survey::open(&good).unwrap().truth.unwrap();
    assert_eq!(good[7], survey.truth.as_ref().unwrap()[4]);
}

#[test]
fn only_a_survey_is_replaced_and_only_when_asked() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("survey");
    simulate("free", &out, &["--seed", "1"]);
    let before = contents(&out);
    let mut again = vec!["simulate", "free", "--out", text(&out), "--seed", "2"];
    again.extend(SMALL);
    let message = fail(&again, 3);
    assert!(message.contains("--force"), "{message}");
    assert!(contents(&out) == before);
    again.push("--force");
    succeed(&again);
    assert!(contents(&out) != before);

    let precious = dir.path().join("precious");
    std::fs::create_dir(&precious).unwrap();
    std::fs::write(precious.join("thesis.txt"), "years of work").unwrap();
    again[3] = text(&precious);
    let message = fail(&again, 3);
    assert!(message.contains("not just a simulated survey"), "{message}");
    assert!(precious.join("thesis.txt").exists());
    // A survey with something of the user's in it is as precious.
    std::fs::write(out.join("notes.txt"), "mine").unwrap();
    again[3] = text(&out);
    fail(&again, 3);
    std::fs::remove_file(out.join("notes.txt")).unwrap();
    // As is one that was taken in the field: it has no record of a simulation.
    std::fs::remove_file(out.join("simulation.json")).unwrap();
    fail(&again, 3);
    assert!(out.join("survey.toml").exists());
    // Nothing temporary is left beside them.
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
}

/// The folder the program works in is nobody's to replace.
#[test]
fn the_present_folder_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("thesis.txt"), "years of work").unwrap();
    for out in [".", "..", "./"] {
        let output = std::process::Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
            .current_dir(dir.path())
            .args(["simulate", "free", "--force", "--out", out])
            .args(SMALL)
            .output()
            .unwrap();
        assert_eq!(output.status.code(), Some(3), "{out}");
    }
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
}

/// A demo never replaces a survey that is not its own.
#[test]
fn a_demo_over_a_real_survey_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let real = support::first_frames(2);
    std::fs::rename(real.path(), dir.path().join("survey")).unwrap();
    let message = fail(&["demo", "--turns", "1", "--out", text(dir.path())], 3);
    assert!(message.contains("not just a simulated survey"), "{message}");
    assert!(dir.path().join("survey/groundtruth.tum").exists());
}

#[test]
fn impossible_surveys_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("survey");
    let refuse = |more: &[&str], code: i32, part: &str| {
        let mut arguments = vec!["simulate", "free", "--out", text(&out)];
        arguments.extend(more);
        let message = fail(&arguments, code);
        assert!(message.contains(part), "{more:?}: {message}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    };
    refuse(&["--radius-m", "0"], 2, "radius");
    refuse(&["--size", "640"], 2, "640x480");
    refuse(&["--size", "8x8"], 2, "16 to 16384");
    refuse(&["--noise", "-1"], 2, "noise");
    refuse(&["--turns", "1", "--turn-deg", "0"], 2, "--turn-deg");
    refuse(&["--radius-m", "300", "--size", "64x48"], 2, "memory");
    refuse(&["--fov-deg", "200"], 2, "--fov-deg must lie");
    refuse(&["--frames", "0"], 2, "--frames");
    refuse(&["--translation-sigma-m", "1,2"], 2, "3 numbers");
    refuse(&["--translation-sigma-m", "9,9,9"], 3, "off the axis");
    refuse(&["--texture", "no-such.png"], 3, "no-such.png");
    refuse(&["--texture", "a.png", "--wall", "brick"], 2, "--wall");
    refuse(&["--gain-percent", "100"], 2, "gain");
    refuse(&["--bias-grey", "-1"], 2, "bias");
    refuse(&["--lamp-corner", "0"], 2, "corner");
    refuse(&["--specular-percent", "95"], 2, "wet patches");
    refuse(&["--moving", "-1"], 2, "--moving");
    refuse(&["--bits", "12"], 2, "8, 16");
    refuse(&["--bad-frames", "5:black,9:blury"], 2, "`9:blury`");
    refuse(&["--bad-frames", "5:black,120:black"], 2, "`120:black`");
    refuse(&["--bad-frames", "0:repeated"], 2, "`0:repeated`");
}

#[test]
fn an_output_that_cannot_be_written_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    std::fs::write(&file, "in the way").unwrap();
    let out = file.join("survey");
    let mut arguments = vec!["simulate", "free", "--out", text(&out)];
    arguments.extend(SMALL);
    let message = fail(&arguments, 3);
    assert!(message.contains("file"), "{message}");
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "in the way");
}

#[test]
fn the_demo_does_the_whole_job_and_can_be_repeated() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("demo");
    let demo = || succeed(&["demo", "--turns", "1", "--out", text(&out)]);
    let said = demo();
    for part in ["wall error RMS", "PSNR", "before-after.png", "poses.tum"] {
        assert!(said.contains(part), "{said}");
    }
    for name in [
        "survey/survey.toml",
        "refined/poses.tum",
        "refined/refine.json",
        "compare/baseline.png",
        "compare/refined.png",
        "compare/truth.png",
        "compare/before-after.png",
        "compare/compare.json",
    ] {
        assert!(out.join(name).is_file(), "{name}");
    }
    let report = json(&out.join("compare/compare.json"));
    let wall_px = |which: &str| report[which]["wall"]["px"]["rms"].as_f64().unwrap();
    assert!(wall_px("baseline") > 10.0, "{}", wall_px("baseline"));
    assert!(wall_px("refined") < 0.1, "{}", wall_px("refined"));
    demo();
}

/// Ctrl-C in the middle: its exit code, and nothing half-written.
#[cfg(unix)]
#[test]
fn an_interrupted_survey_leaves_nothing_behind() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("survey");
    let mut arguments = vec!["simulate", "centred", "--frames", "5000"];
    arguments.extend(["--size", "320x240", "--out", text(&out)]);
    assert_eq!(support::interrupt(&arguments, dir.path()), Some(130));
    assert_eq!(support::entries(dir.path()), 0);
}
