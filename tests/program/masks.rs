//! Masks and ignored regions of the wall, through the program.

use crate::support::{edit, fail, simulate, succeed, text, wall_px};
use image::GrayImage;
use nalgebra::Vector2;
use serde_json::Value;
use std::path::Path;
use tunnelstitch::evaluate::wall_error;
use tunnelstitch::surface::WallPoint;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{Pose, poses_of};

/// Width of the shaft, percent of a frame's width.
const SHAFT: &str = "12";

/// A brick tunnel in small frames, by default two turns of it.
fn simulated(folder: &Path, name: &str, more: &[&str]) -> std::path::PathBuf {
    let out = folder.join(name);
    let mut options = vec!["--size", "240x180"];
    if !more.contains(&"--frames") {
        options.extend(["--turns", "2"]);
    }
    options.extend(more);
    simulate(&out, &options);
    out
}

fn without_its_mask(survey: &Path) {
    edit(
        &survey.join("survey.toml"),
        "mask = \"mask.png\"\n",
        "overlay = \"keep\"\n",
    );
}

/// Refines a survey with its wall as given: what may hide in a deformation that is not seen varies
/// by more than a mask costs. Returns `refine.json` and the error on the wall, pixels.
fn refined(survey: &Path) -> (Value, f64) {
    refined_with(survey, &["--shape", "fixed"])
}

fn refined_with(survey: &Path, options: &[&str]) -> (Value, f64) {
    let out = survey.join("refined");
    let refine = ["refine", text(survey), "--out", text(&out)];
    let json = succeed(&[&refine, options, &["--json", "--quiet"]].concat());
    let error_px = wall_px(survey, &out.join("poses.tum"));
    (serde_json::from_str(&json).unwrap(), error_px)
}

/// The frames' mean 1-σ on the wall, pixels, and the number of uncertain frames.
fn certainty(report: &Value) -> (f64, u64) {
    let frames = report["frames"].as_array().unwrap();
    let sigma = |frame: &Value| frame["sigma"]["wall_px"].as_f64().unwrap();
    let mean = frames.iter().map(sigma).sum::<f64>() / frames.len() as f64;
    (mean, report["frames_on_prior"].as_u64().unwrap())
}

#[test]
fn behind_its_mask_a_shaft_costs_no_more_than_the_wall_it_hides() {
    let dir = tempfile::tempdir().unwrap();
    let clean = simulated(dir.path(), "clean", &[]);
    let masked = simulated(dir.path(), "masked", &["--shaft-percent", SHAFT]);
    let bare = simulated(dir.path(), "bare", &["--shaft-percent", SHAFT]);
    without_its_mask(&bare);
    let share = Survey::open(&masked)
        .unwrap()
        .frames
        .masks()
        .of(0)
        .unwrap()
        .masked_fraction();
    assert!((share - 0.09).abs() < 0.005, "{share}");
    let [(clean, clean_px), (masked, masked_px), (bare, bare_px)] =
        [&clean, &masked, &bare].map(|survey| refined(survey));
    let (clean_sigma, none) = certainty(&clean);
    let (masked_sigma, unsure) = certainty(&masked);
    println!(
        "wall error {clean_px:.4} px, with shaft and mask {masked_px:.4} px; 1-σ \
         {clean_sigma:.4}, {masked_sigma:.4} px"
    );
    assert_eq!((none, unsure), (0, 0));
    // Scales as 1/√n; tiles at the shaft's edge are lost, too.
    let most = (1.0 - 1.5 * share).powf(-0.5);
    assert!(
        masked_sigma < most * clean_sigma,
        "{masked_sigma} {clean_sigma}"
    );
    for (error, sigma) in [(clean_px, clean_sigma), (masked_px, masked_sigma)] {
        assert!(error < 1.5 * sigma, "{error} {sigma}");
    }
    // Without the mask, a frame is either correct or marked uncertain.
    let (bare_sigma, unsure) = certainty(&bare);
    assert!(
        unsure > 0 || bare_px < 1.5 * bare_sigma,
        "{bare_px} {bare_sigma}"
    );
}

/// The panorama of true poses.
fn panorama(survey: &Path, more: &[&str]) -> image::GrayAlphaImage {
    let out = survey.join("panorama.png");
    let mut arguments = vec![
        "stitch",
        text(survey),
        "--poses",
        "truth",
        "--px-per-metre",
        "45",
        "--quiet",
        "--out",
        text(&out),
    ];
    arguments.extend(more);
    succeed(&arguments);
    image::open(&out).unwrap().to_luma_alpha8()
}

/// Root mean square difference where both show the wall, grey levels, and the share of pixels with
/// more than 25.
fn difference(a: &image::GrayAlphaImage, b: &image::GrayAlphaImage) -> (f64, f64) {
    let both = a
        .pixels()
        .zip(b.pixels())
        .filter(|(a, b)| a.0[1] > 0 && b.0[1] > 0);
    let differences: Vec<f64> = both
        .map(|(a, b)| f64::from(a.0[0].abs_diff(b.0[0])))
        .collect();
    let n = differences.len() as f64;
    let squares: f64 = differences.iter().map(|d| d * d).sum();
    let large = differences.iter().filter(|d| **d > 25.0).count() as f64;
    ((squares / n).sqrt(), large / n)
}

#[test]
fn panoramas_show_the_wall_and_nothing_of_the_shaft() {
    let dir = tempfile::tempdir().unwrap();
    let more = ["--light", "even", "--frames", "12"];
    let clean = simulated(dir.path(), "clean", &more);
    let shaft = simulated(
        dir.path(),
        "shaft",
        &[&more[..], &["--shaft-percent", SHAFT]].concat(),
    );
    let bare = dir.path().join("bare");
    simulated(
        dir.path(),
        "bare",
        &[&more[..], &["--shaft-percent", SHAFT]].concat(),
    );
    without_its_mask(&bare);
    for how in [
        &["--mode", "best-view"][..],
        &["--mode", "average"],
        &["--mode", "median"],
        &["--no-blend", "--interpolation", "lanczos3"],
        &["--super-resolve", "2"],
    ] {
        let [clean, shaft, bare] = [&clean, &shaft, &bare].map(|survey| panorama(survey, how));
        let (rms, large) = difference(&clean, &shaft);
        // Other frames, other noise: 2 grey levels each.
        assert!(rms < 4.0 && large < 1e-3, "{how:?}: {rms} {large}");
        let (_, large) = difference(&clean, &bare);
        assert!(
            large > 1e-2,
            "{how:?}: the shaft shows without its mask, {large}"
        );
        // A hole where no other frame sees the wall.
        let holes =
            |picture: &image::GrayAlphaImage| picture.pixels().filter(|p| p.0[1] == 0).count();
        assert!(holes(&shaft) > holes(&clean));
    }
}

#[test]
fn a_masked_pixel_shows_no_point() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(dir.path(), "survey", &["--shaft-percent", SHAFT]);
    let hidden = |pixel: &Value, mask: &GrayImage| {
        let at = |k: usize| pixel[k].as_f64().unwrap().round() as u32;
        mask.get_pixel(at(0), at(1)).0[0] == 0
    };
    let mask = image::open(survey.join("mask.png")).unwrap().to_luma8();
    let frames = |theta_deg: u32| {
        let wall = format!("0.6,{theta_deg}");
        let json = succeed(&[
            "locate",
            text(&survey),
            "--poses",
            "truth",
            "--wall",
            &wall,
            "--json",
        ]);
        let found: Value = serde_json::from_str(&json).unwrap();
        found["frames"].as_array().unwrap().clone()
    };
    let angles: Vec<u32> = (0..24).map(|k| 15 * k).collect();
    let with: Vec<Vec<Value>> = angles.iter().map(|angle| frames(*angle)).collect();
    without_its_mask(&survey);
    let mut left_out = 0;
    for (angle, with) in angles.iter().zip(with) {
        let (gone, kept): (Vec<Value>, Vec<Value>) = frames(*angle)
            .into_iter()
            .partition(|frame| hidden(&frame["pixel"], &mask));
        assert_eq!(kept, with);
        left_out += gone.len();
    }
    assert!(left_out > 3, "{left_out}");
    // A request for the shaft itself.
    edit(
        &survey.join("survey.toml"),
        "[poses]",
        "mask = \"mask.png\"\n[poses]",
    );
    let message = fail(&["locate", text(&survey), "--frame", "3,98,150"], 3);
    assert!(message.contains("frames.mask"), "{message}");
}

#[test]
fn a_mask_is_recognised_reported_recorded_and_kept() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(
        dir.path(),
        "survey",
        &["--shaft-percent", SHAFT, "--jitter", "random-walk"],
    );
    let toml = survey.join("survey.toml");
    std::fs::remove_file(&toml).unwrap();
    let said = succeed(&["init", text(&survey), "--radius-m", "3"]);
    assert!(said.contains("mask.png"), "{said}");
    assert!(
        std::fs::read_to_string(&toml)
            .unwrap()
            .contains("mask = \"mask.png\"")
    );
    edit(
        &toml,
        "# ignore = [{ theta_deg = [150, 210], chainage_m = [2.0, 5.5] }]",
        "ignore = [{ theta_deg = [330, 30] }]",
    );
    let said = succeed(&["check", text(&survey)]);
    let masks = "9.0 % of every frame hidden, 16.7 % of the wall in 1 part ignored";
    assert!(said.contains(masks), "{said}");
    let config = succeed(&["config", text(&survey)]);
    for kept in ["mask = \"mask.png\"", "theta_deg = [330.0, 30.0]"] {
        assert!(config.replace("\n    ", " ").contains(kept), "{config}");
    }
    // The calibrated survey has both, and its record the mask.
    let out = dir.path().join("refined");
    succeed(&[
        "refine",
        text(&survey),
        "--out",
        text(&out),
        "--fast",
        "--calibrate",
        "focal",
        "--quiet",
    ]);
    let run = std::fs::read_to_string(out.join("run.toml")).unwrap();
    assert!(run.contains("mask.png"), "{run}");
    let calibrated = Survey::open(&out).unwrap();
    assert!(calibrated.frames.masks().of(0).is_some());
    assert_eq!(calibrated.ignored, Survey::open(&survey).unwrap().ignored);
}

/// Angles of the water on the invert, degrees.
const WATER_DEG: std::ops::Range<f64> = 145.0..215.0;

/// Paints water into the frames of a tunnel of 3 m radius with true poses: `water` of a frame's
/// index gives the grey level of a pixel (u, v) at its point of the wall, if that is to change.
fn paint_water<P: Fn([u32; 2], WallPoint) -> Option<u8>>(
    survey: &Survey,
    water: impl Fn(usize) -> P,
) {
    let truth = poses_of(survey.truth.as_deref().unwrap());
    for (k, (frame, pose)) in survey.frames.iter().zip(&truth).enumerate() {
        let water = water(k);
        let mut picture = image::open(&frame.path).unwrap().to_luma8();
        for (u, v, pixel) in picture.enumerate_pixels_mut() {
            let ray = pose.r_wc
                * survey
                    .cameras
                    .of(0)
                    .ray(f64::from(u), f64::from(v))
                    .unwrap();
            let wall = survey.surface.hit(&pose.t_wc, &ray).unwrap().wall;
            if WATER_DEG.contains(&(wall.s_m / 3.0).to_degrees()) {
                pixel.0[0] = water([u, v], wall).unwrap_or(pixel.0[0]);
            }
        }
        picture.save(&frame.path).unwrap();
    }
}

/// Water along the invert, at a different place in every frame.
#[test]
fn wall_that_moves_is_ignored_whether_or_not_it_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let path = simulated(dir.path(), "survey", &["--light", "even"]);
    let survey = Survey::open(&path).unwrap();
    let truth = poses_of(survey.truth.as_deref().unwrap());
    paint_water(&survey, |k| {
        let y = truth[k].t_wc.y;
        move |_, wall| {
            // Waves that run along with the camera, half as fast again, a tenth of a metre long.
            let at = Vector2::new(wall.s_m, wall.h_m - 1.5 * y);
            let wave = (63.0 * at.y + 9.0 * at.x).sin() + (41.0 * at.x - 17.0 * at.y).sin();
            let is_pool = (0.5..1.1).contains(&wall.h_m);
            is_pool.then_some((110.0 + 40.0 * wave) as u8)
        }
    });
    let assert_right = |(report, error_px): &(Value, f64)| {
        let (sigma_px, unsure) = certainty(report);
        println!("wall error {error_px:.4} px, 1-σ {sigma_px:.4} px");
        assert_eq!(unsure, 0);
        assert!(*error_px < 1.5 * sigma_px, "{error_px} {sigma_px}");
    };
    let unnamed = refined(&path);
    assert_right(&unnamed);
    edit(
        &path.join("survey.toml"),
        "radius_m = 3.0\n",
        "radius_m = 3.0\nignore = [{ theta_deg = [130, 230], chainage_m = [0.4, 1.2] }]\n",
    );
    let named = refined(&path);
    assert_right(&named);
    // Nothing is compared there any more.
    let points = |report: &Value| {
        let frames = report["frames"].as_array().unwrap().iter();
        frames
            .map(|frame| frame["points"].as_u64().unwrap())
            .sum::<u64>()
    };
    assert!(points(&named.0) < points(&unnamed.0));
}

/// A tunnel with water on 70° of its invert, that mirrors another wall: the frames of a wider
/// tunnel of the same poses show through it.
#[test]
fn water_that_mirrors_is_left_out_as_a_band() {
    let dir = tempfile::tempdir().unwrap();
    let draw = |name: &str, radius_m: &str| {
        let options = ["--frames", "36", "--size", "240x180", "--noise", "1"];
        let more = ["--supersample", "2", "--seed", "4", "--radius-m", radius_m];
        simulate(&dir.path().join(name), &[&options[..], &more].concat());
        dir.path().join(name)
    };
    let (dry, below) = (draw("dry", "3"), draw("below", "4.5"));
    let survey = Survey::open(&dry).unwrap();
    let truth = poses_of(survey.truth.as_deref().unwrap());
    let other = Survey::open(&below).unwrap();
    assert_eq!(truth, poses_of(other.truth.as_deref().unwrap()));
    paint_water(&survey, |k| {
        let mirrored = image::open(&other.frames[k].path).unwrap().to_luma8();
        move |[u, v], _| Some(mirrored.get_pixel(u, v).0[0])
    });
    let (report, _) = refined_with(&dry, &[]);
    let bands = report["hidden_bands"].as_array().unwrap();
    let [band] = &bands[..] else {
        panic!("{bands:?}")
    };
    let angle = |name: &str| band[name].as_f64().unwrap();
    let (from, to) = (angle("angle_from_deg"), angle("angle_to_deg"));
    assert!((from - WATER_DEG.start).abs() <= 5.0, "{band}");
    assert!((to - WATER_DEG.end).abs() <= 5.0, "{band}");
    let poses = poses_of(&survey.read_poses(&dry.join("refined/poses.tum")).unwrap());
    let frames = report["frames"].as_array().unwrap();
    let is_sure = |k: &usize| frames[*k]["flag"] == "photometric";
    let sure: Vec<usize> = (0..frames.len()).filter(is_sure).collect();
    assert!(sure.len() >= 30, "{}", sure.len());
    let of = |poses: &[Pose]| -> Vec<Pose> { sure.iter().map(|k| poses[*k]).collect() };
    let (poses, truth) = (of(&poses), of(&truth));
    let error = wall_error(survey.surface.as_ref(), &survey.cameras, &poses, &truth).unwrap();
    // The wall's shape is estimated, too, so the whole may bend a little: within its σ.
    let square = |k: &usize| frames[*k]["sigma"]["wall_px"].as_f64().unwrap().powi(2);
    let variance_px2 = sure.iter().map(square).sum::<f64>() / sure.len() as f64;
    assert!(error.px.rms < 3.0 * variance_px2.sqrt(), "{:?}", error.px);
    assert!(error.px.rms < 0.5, "{:?}", error.px);
}
