//! Every lens model through the program: simulated, refined, stitched, and compared with the true
//! poses.

use crate::support::{fail, simulate, succeed, text, wall_px};
use tempfile::TempDir;

const PICTURE: &str = r#""width":320,"height":240,"cx":161.5,"cy":118.2"#;

const SMALL_PICTURE: &str = r#""width":160,"height":120,"cx":80.5,"cy":58.9"#;

/// Simulates frames seen by the camera of a file and refines their poses with a mode of `--shape`;
/// returns the folder with `survey` and `refined`.
fn refined(camera: &str, file: &str, frames: &str, shape: &str) -> TempDir {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, out) = (path("survey"), path("refined"));
    let file = path(file);
    std::fs::write(&file, camera).unwrap();
    simulate(&survey, &["--frames", frames, "--camera", text(&file)]);
    // The survey has the given camera.
    let own = tunnelstitch::camera::read_calibration(&survey.join("camera.json"), None).unwrap();
    let given = tunnelstitch::camera::read_calibration(&file, None).unwrap();
    assert_eq!(own, given);
    let refine = ["refine", text(&survey), "--out", text(&out), "--quiet"];
    succeed(&[&refine[..], &["--shape", shape]].concat());
    dir
}

/// Refines two turns seen by the camera and returns `compare`'s report.
fn repaired(camera: &str, file: &str) -> serde_json::Value {
    let dir = refined(camera, file, "24", "auto");
    let path = |name: &str| dir.path().join(name);
    let (survey, poses) = (path("survey"), path("refined/poses.tum"));
    let report = succeed(&[
        "compare",
        text(&survey),
        "--refined",
        text(&poses),
        "--out",
        text(&path("compared")),
        "--json",
        "--px-per-metre",
        "40",
    ]);
    serde_json::from_str(&report).unwrap()
}

fn assert_repaired(report: &serde_json::Value) {
    let wall_px = |which: &str| report[which]["wall"]["px"]["rms"].as_f64().unwrap();
    assert!(wall_px("baseline") > 10.0, "{report}");
    assert!(wall_px("refined") < 0.05, "{report}");
    // The warp agrees with the simulator: the frames show the same wall, nearly that of the true
    // poses.
    assert!(
        report["refined"]["image"]["psnr_db"].as_f64().unwrap() > 35.0,
        "{report}"
    );
}

#[test]
fn a_fisheye_is_repaired() {
    let camera = format!(
        r#"{{"model":"kannala-brandt",{PICTURE},"fx":150,"fy":150.5,
            "k1":-0.01,"k2":0.005,"k3":-0.004,"k4":0.0007}}"#
    );
    assert_repaired(&repaired(&camera, "camera.json"));
}

#[test]
fn a_lens_with_tangential_distortion_is_repaired() {
    let camera = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.28, 0.07, 0.001, \
                  -0.002]\n  distortion_model: radtan\n  \
                  intrinsics: [207.5, 208.0, 161.5, 118.2]\n  resolution: [320, 240]\n";
    assert_repaired(&repaired(camera, "camchain.yaml"));
}

/// Models with their parameters and focal lengths, for the same angle of view.
const MODELS: [(&str, &str, f64); 6] = [
    (
        "mei",
        r#""xi":1.2,"k1":-0.2,"k2":0.05,"p1":0.001,"p2":-0.002"#,
        165.0,
    ),
    ("double-sphere", r#""xi":-0.25,"alpha":0.57"#, 56.25),
    ("eucm", r#""alpha":0.63,"beta":1.04"#, 75.0),
    ("fov", r#""omega":0.93"#, 69.0),
    (
        "thin-prism-fisheye",
        r#""k1":-0.01,"k2":0.005,"k3":-0.004,"k4":0.0007,"p1":0.001,"p2":-0.002,"sx1":0.001"#,
        75.0,
    ),
    (
        "ocam",
        r#""polynomial":[-0.31,-0.02,0.0,0.01],"c":1.001,"d":0.002,"e":-0.003"#,
        75.0,
    ),
];

/// A camera.json of a model.
fn own_file((model, parameters, focal): (&str, &str, f64)) -> String {
    format!(r#"{{"model":"{model}",{SMALL_PICTURE},"fx":{focal},"fy":{focal},{parameters}}}"#)
}

#[test]
fn every_wide_angle_lens_is_repaired() {
    for model in MODELS {
        let dir = refined(&own_file(model), "camera.json", "14", "fixed");
        let survey = dir.path().join("survey");
        let [before, after] = ["survey/baseline.tum", "refined/poses.tum"]
            .map(|poses| wall_px(&survey, &dir.path().join(poses)));
        assert!(before > 5.0, "{model:?}: {before} px");
        assert!(after < 0.2, "{model:?}: {after} px");
    }
}

/// COLMAP has three of the models; the others are refused by name.
#[test]
fn models_are_exported_or_refused_by_name() {
    for model in MODELS {
        let dir = tempfile::tempdir().unwrap();
        let path = |name: &str| dir.path().join(name);
        std::fs::write(path("camera.json"), own_file(model)).unwrap();
        let (survey, file) = (path("survey"), path("camera.json"));
        let size = ["--frames", "2", "--camera", text(&file)];
        simulate(&survey, &size);
        let convert = |format, out| {
            let out = path(out);
            let poses = survey.join("groundtruth.tum");
            let arguments = [
                "convert",
                text(&survey),
                "--poses",
                text(&poses),
                "--to",
                format,
                "--out",
                text(&out),
            ];
            arguments.map(str::to_owned)
        };
        let colmap = convert("colmap", "sparse");
        let colmap = colmap.each_ref().map(String::as_str);
        if matches!(model.0, "eucm" | "fov" | "thin-prism-fisheye") {
            succeed(&colmap);
            let written = path("sparse").join("cameras.txt");
            let read = |path| tunnelstitch::camera::read_calibration(path, None).unwrap();
            assert_eq!(read(&written), read(&file));
        } else {
            let message = fail(&colmap, 3);
            let expected = format!("COLMAP has no lens model {}", model.0);
            assert!(message.contains(&expected), "{message}");
        }
        let nerfstudio = convert("nerfstudio", "transforms.json");
        let message = fail(&nerfstudio.each_ref().map(String::as_str), 3);
        assert!(message.contains("has no lens model"), "{message}");
        succeed(&convert("tum", "poses.tum").each_ref().map(String::as_str));
    }
}

#[test]
fn a_camera_of_several_must_be_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("cameras.txt");
    std::fs::write(
        &path,
        "1 PINHOLE 320 240 207 207 160 120\n2 PINHOLE 320 240 200 200 160 120\n",
    )
    .unwrap();
    let out = dir.path().join("survey");
    let message = fail(
        &[
            "simulate",
            "free",
            "--camera",
            text(&path),
            "--out",
            text(&out),
        ],
        3,
    );
    assert!(message.contains("several cameras (1, 2)"), "{message}");
    assert!(!out.exists());
}
