//! Surveys by rigs of several cameras.

use crate::support::{blur_pictures, edit, fail, json, simulate, succeed, text};
use std::path::Path;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{poses_of, tum};

/// Twelve moments of two cameras that look at opposite walls, small.
fn simulated(dir: &Path) -> std::path::PathBuf {
    let survey = dir.join("survey");
    let options = "--rig 2 --frames 12 --size 160x120 --seed 3";
    simulate(&survey, &options.split_whitespace().collect::<Vec<_>>());
    survey
}

/// All pictures are registered, the camera that is turned against its mount too, and the files
/// of the result are read by the other commands.
#[test]
fn a_rig_is_refined_with_a_mount_that_is_a_little_wrong() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path());
    // 0.03° about the camera's x axis: the rows y and z turn into each other.
    let mount = survey.join("rig/mount1.txt");
    let motion = std::fs::read_to_string(&mount).unwrap();
    let rows: Vec<Vec<f64>> = (motion.lines().skip(1).take(3))
        .map(|row| row.split(' ').map(|x| x.parse().unwrap()).collect())
        .collect();
    let (sin, cos) = 0.03f64.to_radians().sin_cos();
    let turned = |a: f64, b: f64| -> String {
        let numbers = (0..4).map(|k| (a * rows[1][k] + b * rows[2][k]).to_string());
        numbers.collect::<Vec<_>>().join(" ")
    };
    let first: Vec<&str> = motion.lines().collect();
    let turned = [turned(cos, -sin), turned(sin, cos)].join("\n");
    std::fs::write(&mount, format!("{}\n{turned}\n0 0 0 1\n", first[1])).unwrap();

    let out = dir.path().join("out");
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let report = json(&out.join("refine.json"));
    let frames = report["frames"].as_array().unwrap();
    assert_eq!(frames.len(), 24);
    assert_eq!(frames[1]["file"], "camera1/000000.png");
    assert!(frames.iter().all(|frame| frame["flag"] == "photometric"));
    let found = &report["mounts"][0];
    let [x, y, z] = [0, 1, 2].map(|k| found["rotation_deg"][k].as_f64().unwrap());
    let sigma = found["rotation_sigma_deg"].as_f64().unwrap();
    // Its mount is turned by 0.03° against the truth, and found against the mount.
    assert!((x.abs() - 0.03).abs() < 0.01, "{found}");
    assert!(y.hypot(z) < 0.01 && sigma < 0.01, "{found}");

    let opened = Survey::open(&survey).unwrap();
    let refined = opened.read_poses(&out.join("poses.tum")).unwrap();
    // The wrong mount moves the truth of the second camera as well, so it is compared by itself.
    let own = |poses: Vec<_>, camera: usize| -> Vec<_> {
        poses.into_iter().skip(camera).step_by(2).collect()
    };
    let truth = poses_of(opened.truth.as_ref().unwrap());
    let [refined_0, truth_0] = [poses_of(&refined), truth].map(|poses| own(poses, 0));
    let surface = opened.surface.as_ref();
    let error = wall_error(surface, opened.cameras.of(0), &refined_0, &truth_0).unwrap();
    let stated = frames
        .iter()
        .map(|frame| frame["sigma"]["wall_px"].as_f64());
    let stated_px = stated.map(Option::unwrap).sum::<f64>() / 24.0;
    // A single camera leaves 0.9 px in its only turn, and says so.
    assert!(stated_px < 0.2, "{stated_px}");
    assert!(error.px.rms < 1.5 * stated_px, "{}", error.px.rms);

    let bodies = tum::read(&out.join("poses_body.tum")).unwrap();
    assert_eq!((refined.len(), bodies.len()), (24, 12));
    for poses in ["poses.tum", "poses_body.tum"] {
        let panorama = dir.path().join(poses).with_extension("png");
        let poses = out.join(poses);
        let stitch = ["stitch", text(&survey), "--poses", text(&poses)];
        let drawn = ["--px-per-metre", "10", "--out", text(&panorama), "--quiet"];
        succeed(&[&stitch[..], &drawn[..]].concat());
    }
    let compared = dir.path().join("compared");
    let compare = ["compare", text(&survey), "--refined", text(&out), "--quiet"];
    let more = ["--px-per-metre", "10", "--out", text(&compared)];
    succeed(&[&compare[..], &more[..]].concat());
    let errors = json(&compared.join("compare.json"));
    let frames = errors["refined"]["wall"]["frame_rms_px"].as_array();
    assert_eq!(frames.map(Vec::len), Some(24));
    let poses = out.join("poses.tum");
    let located = ["locate", text(&survey), "--poses", text(&poses), "--frame"];
    let located = succeed(&[&located[..], &["camera1/000003.png,80,60"]].concat());
    assert!(located.contains("camera1/000003.png"), "{located}");
    // A table with the names of the pictures.
    let table = dir.path().join("poses.csv");
    let convert = [
        "convert",
        text(&survey),
        "--poses",
        text(&poses),
        "--to",
        "csv",
    ];
    succeed(&[&convert[..], &["--out", text(&table), "--quiet"]].concat());
    let named = opened.read_poses(&table).unwrap();
    let far = (named.iter().zip(&refined)).map(|(a, b)| a.pose.local(&b.pose).norm());
    assert!(far.fold(0.0, f64::max) < 1e-9);
}

#[test]
fn rigs_that_are_incomplete_are_refused_with_the_camera() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path());
    let toml = survey.join("survey.toml");
    let refused = || fail(&["check", text(&survey)], 3);
    edit(&toml, "rig/mount1.txt", "rig/none.txt");
    let message = refused();
    assert!(message.contains("none.txt"), "{message}");
    edit(&toml, "rig/none.txt", "rig/mount1.txt");
    let calibrate = ["refine", text(&survey), "--calibrate", "focal", "--out"];
    let out = dir.path().join("out");
    let message = fail(&[&calibrate[..], &[text(&out)]].concat(), 3);
    assert!(message.contains("as calibrated"), "{message}");
    std::fs::remove_file(survey.join("frames/camera1/000011.png")).unwrap();
    let message = refused();
    assert!(
        message.contains("has 12 pictures") && message.contains("camera 1 (frames/camera1/*.png)"),
        "{message}"
    );
}

/// The frames of the moments that have not been tracked yet are not judged.
#[test]
fn a_rig_of_which_nothing_matches_ends_early() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (simulated(dir.path()), dir.path().join("out"));
    for camera in ["camera0", "camera1"] {
        blur_pictures(&survey.join("frames").join(camera), 10.0);
    }
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 4);
    assert!(message.contains("it was not tried"), "{message}");
}
