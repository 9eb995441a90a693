//! Cameras that look along the tunnel, and light that no common shading explains.

use crate::support::{json, simulate, succeed, text};
use serde_json::Value;
use std::path::Path;

/// Refines a survey with its wall as given; returns `refine.json`, and the wall error before and
/// after, pixels.
fn refined(folder: &Path, survey: &Path) -> (Value, [f64; 2]) {
    let out = folder.join("refined");
    succeed(&[
        "refine",
        text(survey),
        "--shape",
        "fixed",
        "--out",
        text(&out),
    ]);
    let poses = out.join("poses.tum");
    let compared = folder.join("compared");
    let mut compare = vec!["compare", text(survey), "--refined", text(&poses)];
    compare.extend(["--out", text(&compared), "--json"]);
    let compared: Value = serde_json::from_str(&succeed(&compare)).unwrap();
    let error = |poses: &str| {
        let number = compared.pointer(&format!("/{poses}/wall/px/rms"));
        number.and_then(Value::as_f64).unwrap()
    };
    let errors_px = [error("baseline"), error("refined")];
    (json(&out.join("refine.json")), errors_px)
}

#[test]
fn frames_that_look_along_the_tunnel_are_refined_by_their_ring_of_wall() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let view = "--frames 12 --view forward --advance-m 0.1 --fov-deg 90 --size 240x180";
    let errors = "--rotation-sigma-deg 1 --translation-sigma-m 0.01,0.01,0.01 --noise 1 --seed 3";
    let options = format!("{view} {errors} --supersample 2");
    simulate(&survey, &options.split(' ').collect::<Vec<_>>());
    let (report, [before_px, after_px]) = refined(dir.path(), &survey);
    assert_eq!(report["frames_on_prior"], 0);
    assert_eq!(report["photometry"], "model");
    assert!(before_px > 5.0 && after_px < 0.1, "{before_px} {after_px}");
}

/// In its first frames none matches as right ones do, but they show the same wall.
#[test]
fn flicker_of_the_mains_is_normalised_away() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let light = "--frames 24 --wall concrete --flicker-percent 25 --flicker-bands 3.1";
    let options = format!("{light} --noise 1 --seed 4 --size 240x180 --supersample 2");
    simulate(&survey, &options.split(' ').collect::<Vec<_>>());
    let (report, [before_px, after_px]) = refined(dir.path(), &survey);
    assert_eq!(report["photometry"], "normalised");
    assert_eq!(report["frames_on_prior"], 0);
    assert!(before_px > 10.0 && after_px < 0.3, "{before_px} {after_px}");
}
