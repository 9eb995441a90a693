//! Tunnels that are not round or not straight, from the simulator, which has equations of its own, to the panorama.

mod support;

use std::path::Path;
use support::{fail, succeed, text};

/// Simulates a survey, refines it and compares: the wall error, pixels RMS, and that of the initial poses.
fn refined(folder: &Path, arguments: &[&str]) -> [f64; 2] {
    let path = |name: &str| folder.join(name);
    let (survey, refined, out) = (path("survey"), path("refined"), path("compared"));
    let simulate = [
        "simulate",
        "free",
        "--size",
        "320x240",
        "--out",
        text(&survey),
    ];
    succeed(&[&simulate[..], arguments].concat());
    succeed(&["refine", text(&survey), "--out", text(&refined)]);
    let poses = refined.join("poses.tum");
    succeed(&[
        "compare",
        text(&survey),
        "--refined",
        text(&poses),
        "--out",
        text(&out),
    ]);
    let json = std::fs::read_to_string(out.join("compare.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    ["refined", "baseline"].map(|which| json[which]["wall"]["px"]["rms"].as_f64().unwrap())
}

#[test]
fn boxes_horseshoes_and_ellipses_are_refined_as_circles_are() {
    for shape in [
        ["--shape", "box", "--width-m", "4", "--height-m", "3"],
        ["--shape", "horseshoe", "--width-m", "5", "--height-m", "4"],
        ["--shape", "ellipse", "--width-m", "5", "--height-m", "3.5"],
    ] {
        let dir = tempfile::tempdir().unwrap();
        let arguments = [&shape[..], &["--frames", "24"]].concat();
        let [refined, initial] = refined(dir.path(), &arguments);
        assert!(initial > 10.0, "{shape:?}: {initial} px before");
        assert!(refined <= 0.1, "{shape:?}: {refined} px");
    }
}

/// A bend of radius 60 m, half a metre of arc from point to point.
fn bend() -> String {
    let point = |k: i32| {
        let (sin, cos) = (f64::from(k) * 0.5 / 60.0).sin_cos();
        format!("{} {} 0\n", 60.0 - 60.0 * cos, 60.0 * sin)
    };
    (-6..40).map(point).collect()
}

#[test]
fn a_tight_bend_is_refined_and_unrolled() {
    let dir = tempfile::tempdir().unwrap();
    let line = dir.path().join("bend.txt");
    // Of a tenth the size, a bend of six metres in a pipe of 30 cm: its turn about its own axis shows in a few frames.
    let small: String = bend()
        .lines()
        .map(|line| {
            let numbers = line.split(' ').map(|n| 0.1 * n.parse::<f64>().unwrap());
            let numbers: Vec<String> = numbers.map(|n| n.to_string()).collect();
            numbers.join(" ") + "\n"
        })
        .collect();
    std::fs::write(&line, small).unwrap();
    let [refined, initial] = refined(
        dir.path(),
        &[
            "--radius-m",
            "0.6",
            "--centreline",
            text(&line),
            "--frames",
            "36",
            "--advance-m",
            "0.04",
            "--translation-sigma-m",
            "0.004,0.004,0.006",
        ],
    );
    assert!(initial > 10.0, "{initial} px before");
    assert!(refined <= 0.1, "{refined} px");
}

#[test]
fn shapes_and_lines_that_cannot_be_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("survey");
    let simulate = |arguments: &[&str]| {
        let all = ["simulate", "free", "--frames", "2", "--out", text(&out)];
        fail(&[&all[..], arguments].concat(), 2)
    };
    let line = dir.path().join("line.txt");
    let with_line = |content: &str| {
        std::fs::write(&line, content).unwrap();
        simulate(&["--centreline", text(&line)])
    };
    for (message, words) in [
        (
            simulate(&["--shape", "box", "--width-m", "4"]),
            vec!["height_m", "missing"],
        ),
        (simulate(&["--width-m", "4"]), vec!["width_m", "not a size"]),
        (
            simulate(&["--shape", "horseshoe", "--width-m", "4", "--height-m", "2"]),
            vec!["height", "more than half"],
        ),
        (with_line("0 0 0\n0 x 0\n"), vec!["line.txt:2", "x y z"]),
        (with_line("0 0 0\n"), vec!["two or more"]),
        (with_line("0 0 0\n0 0 0\n0 1 0\n"), vec!["points 1 and 2"]),
        (
            with_line("0 0 0\n0 4 0\n2 5 0\n4 4 0\n4 0 0\n"),
            vec!["tighter than the tunnel"],
        ),
    ] {
        for word in words {
            assert!(message.contains(word), "{message}");
        }
    }
}
