//! Simulated surveys with the lamp, lens, sensor and files of real pictures.

use crate::support::{fail, json, simulate, succeed, text, tunnelstitch};
use std::f64::consts::TAU;
use std::path::Path;

/// Options of four small frames with every effect at once.
const ALL: &str = "--frames 4 --size 96x72 --supersample 2 --light even --lamp-offset-m 0.2,-0.1,0 \
    --sheen-percent 30 --interlaced --motion-blur-px 2 --defocus-px 0.7 --dust-percent 2 \
    --flicker-percent 10 --flicker-bands 3 --exposure-step 1.5 --dark --gamma 1.8 --overlay both \
    --jpeg-quality 85 --interval-s 0.4";

fn simulate_with(out: &Path, options: &str, more: &[&str]) {
    let options: Vec<&str> = options
        .split_whitespace()
        .chain(more.iter().copied())
        .collect();
    simulate(out, &options);
}

#[test]
fn all_effects_at_once_are_a_survey_of_the_same_bytes_on_any_threads() {
    let dir = tempfile::tempdir().unwrap();
    let [one, two] = ["1", "2"].map(|threads| {
        let out = dir.path().join(threads);
        simulate_with(&out, ALL, &["--threads", threads]);
        out
    });
    let names = ["simulation.json", "overlay.png", "survey.toml"].map(str::to_owned);
    let frames = (0..4).map(|frame| format!("frames/{frame:06}.jpg"));
    for name in names.into_iter().chain(frames) {
        let bytes = [&one, &two].map(|out| std::fs::read(out.join(&name)).unwrap());
        assert!(bytes[0] == bytes[1], "{name}");
    }
    succeed(&["check", text(&one)]);

    let record = json(&one.join("simulation.json"))["options"].clone();
    let expected = serde_json::json!({
        "lamp_offset_m": [0.2, -0.1, 0.0], "sheen_percent": 30.0, "interlaced": true,
        "motion_blur_px": 2.0, "defocus_px": 0.7, "dust_percent": 2.0, "flicker_percent": 10.0,
        "flicker_bands": 3.0, "exposure_step": 1.5, "dark": true, "gamma": 1.8, "overlay": "both",
        "jpeg_quality": 85,
    });
    for (key, value) in expected.as_object().unwrap() {
        assert_eq!(record[key], *value, "{key}");
    }
    let plain = dir.path().join("plain");
    simulate_with(&plain, "--frames 2 --size 32x24 --supersample 1", &[]);
    let record = json(&plain.join("simulation.json"))["options"].clone();
    for key in expected.as_object().unwrap().keys() {
        assert!(record.get(key).is_none(), "{key}");
    }
    assert!(record.get("view_deg").is_none());
}

/// The frames are dark but for the overlay, which is where its mask is black.
#[test]
fn the_mask_of_the_overlay_is_where_dark_frames_are_bright() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("overlay");
    let options = "--frames 3 --size 320x240 --supersample 1 --dark --noise 0 --overlay both";
    simulate_with(&out, options, &[]);
    let grey = |name: &str| image::open(out.join(name)).unwrap().to_luma8();
    let mask = grey("overlay.png");
    let frames = [0, 1, 2].map(|frame| grey(&format!("frames/{frame:06}.png")));
    for (u, v, shown) in mask.enumerate_pixels() {
        let brightest = frames.iter().map(|frame| frame.get_pixel(u, v).0[0]).max();
        assert!(shown.0[0] == 0 || brightest < Some(60), "{u} {v}");
    }
    let hidden = mask.iter().filter(|shown| **shown == 0).count();
    let bright = frames[1].iter().filter(|value| **value > 180).count();
    assert!(hidden > 3000 && bright > 1000, "{hidden} {bright}");
    let survey = std::fs::read_to_string(out.join("survey.toml")).unwrap();
    assert!(!survey.contains("overlay") && !survey.contains("mask"));
    assert!(frames[0] != frames[1]);
}

/// Rays of a camera on the axis that looks along it, (x, y, 1) right, down and ahead, meet the wall
/// of radius r at the distance r/√(x² + y²) and at the angle atan2(x, −y) from the top.
#[test]
fn a_forward_view_is_a_ring_of_wall_around_fog() {
    const RADIUS_M: f64 = 3.0;
    const TEXTURE_PX: u32 = 512;
    const F_PX: f64 = 100.0;
    let dir = tempfile::tempdir().unwrap();
    // Once around the wall, and as long.
    let grey = |s: f64, h: f64| 128.0 + 50.0 * (TAU * 3.0 * s).sin() + 40.0 * (TAU * 2.0 * h).cos();
    let texture = image::GrayImage::from_fn(TEXTURE_PX, TEXTURE_PX, |u, v| {
        let [s, h] = [u, v].map(|k| (f64::from(k) + 0.5) / f64::from(TEXTURE_PX));
        image::Luma([grey(s, h).round() as u8])
    });
    let file = dir.path().join("texture.png");
    texture.save(&file).unwrap();
    let fov_deg = (2.0 * (60.5 / F_PX).atan()).to_degrees().to_string();
    let around_m = TAU * RADIUS_M;
    let pictures = ["1", "2"].map(|threads| {
        let out = dir.path().join(threads);
        let arguments = [
            "simulate",
            "centred",
            "--quiet",
            "--out",
            text(&out),
            "--threads",
            threads,
            "--view",
            "forward",
            "--frames",
            "3",
            "--advance-m",
            "0.5",
            "--size",
            "161x121",
            "--fov-deg",
            &fov_deg,
            "--texture",
            text(&file),
            "--texture-width-m",
            &around_m.to_string(),
            "--light",
            "even",
            "--noise",
            "0",
            "--supersample",
            "4",
        ];
        succeed(&arguments);
        let frame = |k: u32| std::fs::read(out.join(format!("frames/{k:06}.png"))).unwrap();
        [0, 1, 2].map(frame)
    });
    assert!(pictures[0] == pictures[1]);
    let picture = image::load_from_memory(&pictures[0][2]).unwrap().to_luma8();
    let (mut squares, mut count) = (0.0, 0);
    for (u, v, pixel) in picture.enumerate_pixels() {
        let (x, y) = ((f64::from(u) - 80.0) / F_PX, (f64::from(v) - 60.0) / F_PX);
        let distance_m = RADIUS_M / x.hypot(y);
        let seen = f64::from(pixel.0[0]);
        if distance_m > 60.0 * RADIUS_M {
            assert!(seen < 12.0, "{u} {v}: {seen}");
        } else if distance_m < 5.0 * RADIUS_M {
            // The third frame stands at chainage 1 m.
            let (s, h) = (x.atan2(-y) / TAU, (1.0 + distance_m) / around_m);
            squares += (seen - grey(s, h)).powi(2);
            count += 1;
        }
    }
    assert!(count > 10_000, "{count}");
    let rms = (squares / f64::from(count)).sqrt();
    assert!(rms < 1.5, "{rms}");
}

#[test]
fn impossible_options_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("none");
    for (options, message) in [
        ("--view backwards", "side, forward"),
        ("--sheen-percent 20", "--lamp-offset-m"),
        ("--flicker-bands 2", "--flicker-percent"),
        ("--overlay stars", "text"),
    ] {
        let mut arguments = vec!["simulate", "free", "--out", text(&out)];
        arguments.extend(options.split(' '));
        let said = fail(&arguments, 2);
        assert!(said.contains(message), "{options}: {said}");
    }
    let jpeg = "--jpeg-quality 80 --bits 16 --frames 2";
    let mut arguments = vec!["simulate", "free", "--out", text(&out)];
    arguments.extend(jpeg.split(' '));
    let said = tunnelstitch(&arguments);
    assert!(!said.status.success());
    assert!(String::from_utf8_lossy(&said.stderr).contains("8 bits"));
    assert!(!out.exists());
}
