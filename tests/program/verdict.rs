//! The verdict: whether a result may be used, and what it says where the model is wrong.

use crate::support::{blur_pictures, edit, fail, json, simulate, succeed, text, wall_px};
use std::path::Path;

/// Poses of a TUM file.
fn poses(path: &Path) -> Vec<tunnelstitch::trajectory::StampedPose> {
    tunnelstitch::trajectory::tum::read(path).unwrap().to_vec()
}

/// Simulates twelve frames, of which the sixth is black.
fn simulate_with_a_black_frame(survey: &Path) {
    let options = "--bad-frames 5:black --frames 12 --size 240x180";
    simulate(survey, &options.split(' ').collect::<Vec<_>>());
}

/// A diameter for the radius makes all steps twice as long, which the initial ones contradict: the
/// factor is named, no frame is believed, and the initial poses are kept.
#[test]
fn a_diameter_given_for_the_radius_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(
        &survey,
        &["--frames", "24", "--size", "240x180", "--seed", "3"],
    );
    edit(
        &survey.join("survey.toml"),
        "radius_m = 3.0",
        "radius_m = 6.0",
    );
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 4);
    assert!(message.contains("times the initial ones"), "{message}");
    assert!(message.contains("diameter"), "{message}");
    let report = json(&out.join("refine.json"));
    assert_eq!(report["verdict"]["photometric"], 0);
    // The light is not at fault.
    assert_eq!(report["photometry"], "model");
    let kept = poses(&out.join("poses.tum"));
    for (kept, initial) in kept.iter().zip(poses(&survey.join("baseline.tum"))) {
        assert!(initial.pose.local(&kept.pose).norm() < 1e-8);
    }
}

/// Blurred bricks correlate with the wall of all before them, but not as frames at right poses do,
/// and not with each other.
#[test]
fn a_survey_in_which_nothing_matches_ends_early() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate(
        &survey,
        &["--frames", "20", "--size", "160x120", "--seed", "4"],
    );
    blur_pictures(&survey.join("frames"), 16.0);
    let message = fail(&["refine", text(&survey), "--out", text(&out)], 4);
    assert!(message.contains("it was not tried"), "{message}");
    let report = json(&out.join("refine.json"));
    assert_eq!(report["verdict"]["photometric"], 0);
    assert!(report["levels"].as_array().unwrap().is_empty());
}

/// A principal point 1.5 px off that is not estimated: the poses are a little wrong, and σ says by
/// how much.
#[test]
fn a_lens_that_is_not_exact_enlarges_sigma() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let survey = path("survey");
    simulate(
        &survey,
        &["--frames", "36", "--size", "240x180", "--seed", "2"],
    );
    let camera = survey.join("camera.json");
    let mut calibration = json(&camera);
    for (name, off) in [("cx", 1.5), ("cy", -1.0)] {
        let given = calibration[name].as_f64().unwrap();
        calibration[name] = (given + off).into();
    }
    std::fs::write(&camera, calibration.to_string()).unwrap();
    let out = path("out");
    let refine = ["refine", text(&survey), "--out", text(&out), "--quiet"];
    succeed(&[&refine[..], &["--shape", "fixed"]].concat());
    let report = json(&out.join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    assert!(report["model_error"]["dispersion"].is_number());
    let sigmas = report["frames"].as_array().unwrap().iter();
    let squares = sigmas.map(|frame| frame["sigma"]["wall_px"].as_f64().unwrap().powi(2));
    let stated = (squares.sum::<f64>() / 36.0).sqrt();
    let error = wall_px(&survey, &out.join("poses.tum"));
    assert!(
        (0.5..3.0).contains(&(stated / error)),
        "{stated} stated, {error}"
    );
}

/// The last line says whether the result may be used; a gate that is not met has its exit code.
#[test]
fn the_last_line_says_what_may_be_done_with_the_result() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate_with_a_black_frame(&survey);
    let refine = ["refine", text(&survey), "--out", text(&out)];
    let said = succeed(&refine);
    let last = said.lines().last().unwrap();
    assert!(
        last.starts_with("the result may be used for 11 of 12 frames"),
        "{said}"
    );
    succeed(&[&refine[..], &["--min-photometric", "90%"]].concat());
    let message = fail(&[&refine[..], &["--min-photometric", "100%"]].concat(), 4);
    assert!(message.contains("--min-photometric"), "{message}");
    fail(&[&refine[..], &["--min-photometric", "110%"]].concat(), 2);
}

/// A black frame between others is where the initial steps bridge the gap.
#[test]
fn a_frame_that_shows_nothing_rests_on_the_prior_between_its_neighbours() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    simulate_with_a_black_frame(&survey);
    succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    let refined = poses(&out.join("poses.tum"));
    let initial = poses(&survey.join("baseline.tum"));
    // Both steps of the bridge differ from the initial ones by the same amount, within 3.5 σ.
    let difference = |k: usize| {
        (refined[k].pose.t_wc - refined[k - 1].pose.t_wc)
            - (initial[k].pose.t_wc - initial[k - 1].pose.t_wc)
    };
    let (before, after) = (difference(5), difference(6));
    assert!((before - after).norm() < 1e-3, "{before} {after}");
    assert!(before.amax() < 3.5 * 0.03, "{before}");
}
