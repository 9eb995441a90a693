//! Every lens model through the program: simulated, refined, stitched, and compared with the true
//! poses.

use crate::support::{fail, simulate, succeed, text};

const PICTURE: &str = r#""width":320,"height":240,"cx":161.5,"cy":118.2"#;

/// Simulates two turns seen by the camera, refines them, and returns `compare`'s report.
fn repaired(camera: &str, file: &str) -> serde_json::Value {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, out) = (path("survey"), path("refined"));
    let file = path(file);
    std::fs::write(&file, camera).unwrap();
    let size = ["--frames", "24", "--supersample", "4"];
    simulate(&survey, &[&size[..], &["--camera", text(&file)]].concat());
    // The survey has the given camera.
    let own = tunnelstitch::camera::read_calibration(&survey.join("camera.json"), None).unwrap();
    let given = tunnelstitch::camera::read_calibration(&file, None).unwrap();
    assert_eq!(own, given);
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let poses = out.join("poses.tum");
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
