//! Points of panorama, wall and frames, converted by the program.

use crate::support::{fail, first_frames, succeed, text};
use image::GenericImageView;
use serde_json::Value;
use std::path::Path;

fn locate(survey: &Path, point: &[&str]) -> Value {
    let mut arguments = vec!["locate", text(survey), "--poses", "truth", "--json"];
    arguments.extend(point);
    serde_json::from_str(&succeed(&arguments)).unwrap()
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap()
}

fn pair(value: &Value) -> [f64; 2] {
    [number(&value[0]), number(&value[1])]
}

fn near(a: [f64; 2], b: [f64; 2], tolerance: f64) -> bool {
    (a[0] - b[0]).abs() < tolerance && (a[1] - b[1]).abs() < tolerance
}

/// A pixel of the panorama, its wall point and the pixel of a frame convert into each other.
#[test]
fn every_way_leads_to_the_same_point() {
    let survey = first_frames(6);
    for layout in ["theta-right", "chainage-right"] {
        let with_layout = |point: &[&str]| {
            let more = ["--px-per-metre", "30", "--layout", layout];
            locate(survey.path(), &[point, &more].concat())
        };
        let [x, y] = pair(&with_layout(&["--wall", "0.3,15"])["panorama_px"]);
        let asked = [x.round() + 0.25, y.round()];
        let from_picture = with_layout(&["--panorama", &format!("{},{}", asked[0], asked[1])]);
        let there = pair(&from_picture["panorama_px"]);
        assert!(near(there, asked, 1e-9));
        let (chainage, theta) = (&from_picture["chainage_m"], &from_picture["theta_deg"]);
        let on_wall = format!("{chainage},{theta}");
        let from_wall = with_layout(&["--wall", &on_wall]);
        assert!(near(pair(&from_wall["panorama_px"]), there, 1e-6));
        let frames = from_picture["frames"].as_array().unwrap();
        assert!(frames.len() > 1);
        for frame in frames {
            let [u, v] = pair(&frame["pixel"]);
            let file = frame["file"].as_str().unwrap();
            assert_eq!(file, format!("{:06}.jpg", number(&frame["frame"])));
            let from_frame = with_layout(&["--frame", &format!("{file},{u},{v}")]);
            assert!(near(pair(&from_frame["panorama_px"]), there, 1e-6));
            let count = |found: &Value| found["frames"].as_array().unwrap().len();
            assert_eq!(count(&from_frame), count(&from_picture));
        }
        let size = pair(&from_picture["panorama_size_px"]);
        let out = survey.path().join("panorama.png");
        succeed(&[
            "stitch",
            text(survey.path()),
            "--out",
            text(&out),
            "--poses",
            "truth",
            "--px-per-metre",
            "30",
            "--layout",
            layout,
            "--quiet",
        ]);
        let (width, height) = image::open(&out).unwrap().dimensions();
        assert_eq!(size, [f64::from(width), f64::from(height)]);
    }
}

/// The answer for a frame's pixel includes this frame, up to its outermost pixels.
#[test]
fn a_frame_is_in_its_own_answer() {
    let survey = first_frames(2);
    for pixel in ["0,0", "479,359", "0,100", "200,359", "239.5,180"] {
        let found = locate(survey.path(), &["--frame", &format!("1,{pixel}")]);
        let frames = found["frames"].as_array().unwrap();
        assert!(frames.iter().any(|frame| frame["frame"] == 1), "{pixel}");
    }
}

/// A picture's value between its pixels, bilinear.
fn between(picture: &image::RgbImage, [u, v]: [f64; 2], channel: usize) -> f64 {
    let (x, y) = (u as u32, v as u32);
    let (fx, fy) = (u - f64::from(x), v - f64::from(y));
    let at = |x: u32, y: u32| {
        let (x, y) = (x.min(picture.width() - 1), y.min(picture.height() - 1));
        f64::from(picture.get_pixel(x, y).0[channel])
    };
    let row = |y: u32| at(x, y) * (1.0 - fx) + at(x + 1, y) * fx;
    row(y) * (1.0 - fy) + row(y + 1) * fy
}

/// The frames show the panorama's colours at the located pixels. Another program has rendered the
/// frames.
#[test]
fn the_frames_show_there_what_the_panorama_shows() {
    let survey = first_frames(4);
    let out = survey.path().join("panorama.png");
    let mut arguments = vec!["stitch", text(survey.path()), "--out", text(&out)];
    arguments.extend(["--poses", "truth", "--quiet"]);
    arguments.extend(["--mode", "average", "--no-blend"]);
    succeed(&arguments);
    let panorama = image::open(&out).unwrap().to_rgba8();
    let (width, height) = panorama.dimensions();
    let (mut sum, mut beside, mut count) = (0.0, 0.0, 0);
    for (x, y) in (1..12).map(|k| (width * k / 60, height * (k % 3 + 1) / 4)) {
        let shown = panorama.get_pixel(x, y).0;
        let found = locate(survey.path(), &["--panorama", &format!("{x},{y}")]);
        let frames = found["frames"].as_array().unwrap();
        assert_eq!(shown[3] == 0, frames.is_empty(), "at {x},{y}");
        for frame in frames {
            let [u, v] = pair(&frame["pixel"]);
            let file = survey
                .path()
                .join("frames")
                .join(frame["file"].as_str().unwrap());
            let picture = image::open(file).unwrap().to_rgb8();
            for (channel, shown) in shown.iter().enumerate().take(3) {
                let off =
                    |u: f64, v: f64| (between(&picture, [u, v], channel) - f64::from(*shown)).abs();
                sum += off(u, v);
                beside += off((u + 1.0).min(478.0), (v + 1.0).min(358.0));
                count += 1;
            }
        }
    }
    assert!(count > 20, "{count}");
    // The panorama is the mean of what the frames show, with their noise and compression.
    let mean = sum / f64::from(count);
    assert!(mean < 3.0, "mean difference {mean} grey levels");
    assert!(beside > 1.5 * sum, "{beside} a pixel beside, {sum} there");
}

#[test]
fn the_clock_is_the_angle_by_another_name() {
    let survey = first_frames(3);
    let noon = locate(survey.path(), &["--wall", "0.1,15"]);
    assert_eq!(noon["clock"], "12:30");
    let by_clock = locate(survey.path(), &["--clock", "0.1,12:30"]);
    assert_eq!(by_clock["panorama_px"], noon["panorama_px"]);
    let turned = locate(
        survey.path(),
        &["--clock", "0.1,3:00", "--twelve-at", "-75"],
    );
    assert!((number(&turned["theta_deg"]) - 15.0).abs() < 1e-9);
    assert_eq!(turned["clock"], "3:00");
    let mut arguments = vec!["locate", text(survey.path()), "--wall", "90,15"];
    let told = succeed(&arguments);
    assert!(told.contains("outside of it") && told.contains("none of the 3 frames"));
    arguments[3] = "0.1,15";
    let told = succeed(&arguments);
    for part in ["12:30 o'clock", "000000.jpg", "mm/px"] {
        assert!(told.contains(part), "{told}");
    }
}

#[test]
fn points_that_are_nowhere_are_refused_with_the_remedy() {
    let survey = first_frames(2);
    let cases: [(&[&str], &[&str]); 8] = [
        (
            &["--panorama", "100000,3"],
            &["100000,3", "px", "--px-per-metre"],
        ),
        (&["--panorama", "nan,3"], &["not a number"]),
        (&["--wall", "1e300,3"], &["not a number within"]),
        (&["--wall", "1,3", "--twelve-at", "inf"], &["not a number"]),
        (&["--clock", "1,25:00"], &["12.30,4:30"]),
        (
            &["--frame", "000007.jpg,1,1"],
            &["000007.jpg", "000000.jpg", "0 to 1"],
        ),
        (&["--frame", "1,1000,1"], &["0 to 479 and 0 to 359"]),
        (&["--wall", "1,2", "--clock", "1,2:00"], &["cannot be used"]),
    ];
    for (point, parts) in cases {
        let message = fail(&[&["locate", text(survey.path())], point].concat(), 2);
        for part in parts {
            assert!(message.contains(part), "{point:?}: {message}");
        }
    }
    fail(&["locate", text(survey.path())], 2);
}
