//! Tunnels that are not round or not straight, from the simulator, which has independent equations,
//! to the panorama.

use crate::support::{fail, json, simulate, succeed, text, wall_px};
use std::path::Path;

/// Simulates a survey and refines it: the wall error, pixels RMS, and that of the initial poses.
fn refined(folder: &Path, arguments: &[&str]) -> [f64; 2] {
    let (survey, refined) = (folder.join("survey"), folder.join("refined"));
    simulate(&survey, arguments);
    succeed(&["refine", text(&survey), "--out", text(&refined)]);
    [refined.join("poses.tum"), survey.join("baseline.tum")].map(|poses| wall_px(&survey, &poses))
}

#[test]
fn boxes_horseshoes_and_ellipses_are_refined_as_circles_are() {
    for shape in [
        ["--shape", "box", "--width-m", "4", "--height-m", "3"],
        ["--shape", "horseshoe", "--width-m", "5", "--height-m", "4"],
        ["--shape", "ellipse", "--width-m", "5", "--height-m", "3.5"],
    ] {
        let dir = tempfile::tempdir().unwrap();
        let size = "--frames 24 --size 240x180".split(' ');
        let arguments: Vec<&str> = shape.iter().copied().chain(size).collect();
        let [refined, initial] = refined(dir.path(), &arguments);
        assert!(initial > 10.0, "{shape:?}: {initial} px before");
        assert!(refined <= 0.1, "{shape:?}: {refined} px");
    }
}

/// A bend of radius 2 m, 5 cm of arc from point to point.
fn bend() -> String {
    let point = |k: i32| {
        let (sin, cos) = (f64::from(k) * 0.05 / 2.0).sin_cos();
        format!("{} {} 0\n", 2.0 - 2.0 * cos, 2.0 * sin)
    };
    (-6..66).map(point).collect()
}

/// Turns of 10 m radius with a given rise per radian.
fn circling(pitch_m: f64) -> String {
    let point = |k: i32| {
        let angle = 0.2 * f64::from(k);
        let (sin, cos) = angle.sin_cos();
        format!("{} {} {}\n", 10.0 * cos, 10.0 * sin, pitch_m * angle)
    };
    (0..50).map(point).collect()
}

/// The rotation about a tunnel's centreline is observable in the bend only, and weakly in a short
/// one: the errors match the stated uncertainty.
#[test]
fn a_tight_bend_is_refined_as_exactly_as_is_said() {
    a_narrow_tunnel_is_refined_as_exactly_as_is_said(&bend());
}

/// A winding line in a tunnel of varying width has no gauge freedom.
#[test]
fn a_winding_tunnel_of_changing_radius_is_refined_as_exactly_as_is_said() {
    let point = |k: i32| {
        let y = 0.05 * f64::from(k);
        let x = 0.12 * (1.0 - (2.6 * y).cos());
        format!("{x} {y} 0 {}\n", 0.6 + 0.06 * (3.1 * y).sin())
    };
    let winding: String = (-6..50).map(point).collect();
    a_narrow_tunnel_is_refined_as_exactly_as_is_said(&winding);
}

/// A tunnel of 0.6 m radius along a line.
fn a_narrow_tunnel_is_refined_as_exactly_as_is_said(points: &str) {
    let dir = tempfile::tempdir().unwrap();
    let line = dir.path().join("line.txt");
    std::fs::write(&line, points).unwrap();
    let [refined, initial] = refined(
        dir.path(),
        &[
            "--radius-m",
            "0.6",
            "--centreline",
            text(&line),
            "--frames",
            "20",
            "--size",
            "240x180",
            "--advance-m",
            "0.05",
            "--translation-sigma-m",
            "0.004,0.004,0.006",
        ],
    );
    exact_as_said(dir.path(), refined, initial);
}

/// The wall error, pixels, is at most three times the 1-σ of `refine`, which is at most a fiftieth
/// of the error before: it contains what may hide in a deformation that frames do not see, and with
/// it varies from seed to seed.
fn exact_as_said(folder: &Path, refined: f64, initial: f64) {
    let json = json(&folder.join("refined/refine.json"));
    let frames = json["frames"].as_array().unwrap();
    let sigmas = frames
        .iter()
        .map(|frame| frame["sigma"]["wall_px"].as_f64().unwrap());
    let sigma = sigmas.sum::<f64>() / frames.len() as f64;
    assert!(
        initial > 10.0 && sigma < 0.02 * initial,
        "{initial} px before, 1-σ {sigma} px"
    );
    assert!(refined < 3.0 * sigma, "{refined} px, 1-σ {sigma} px");
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
        (with_line("# none\n"), vec!["line.txt", "no points"]),
        (with_line("0 0 0\n"), vec!["line.txt", "two or more"]),
        (
            with_line("0 0 0\n0 0 0\n0 1 0\n"),
            vec!["line.txt", "points 1 and 2"],
        ),
        (
            with_line("0 0 0\n0 4 0\n2 5 0\n4 4 0\n4 0 0\n"),
            vec!["tighter than the tunnel"],
        ),
        (with_line(&circling(0.3)), vec!["intersects itself"]),
    ] {
        for word in words {
            assert!(message.contains(word), "{message}");
        }
    }
}
