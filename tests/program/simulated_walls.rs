//! Simulated walls that are not as drawn: segments, a shape.json, cables and lamps.

use crate::support::{fail, json, succeed, text};
use image::GrayImage;
use std::path::Path;

/// A free survey of a few small frames without noise.
fn simulate(out: &Path, more: &str) {
    let survey = "--frames 4 --size 96x72 --supersample 4 --noise 0 --seed 3";
    let mut arguments = vec!["simulate", "free", "--out", text(out)];
    arguments.extend(survey.split(' ').chain(more.split(' ')));
    succeed(&arguments);
}

fn frames(survey: &Path) -> Vec<GrayImage> {
    let frame = |k: usize| image::open(survey.join(format!("frames/00000{k}.png")));
    (0..4).map(|k| frame(k).unwrap().to_luma8()).collect()
}

/// The true deviation: arc length, chainage (metres) and δ (millimetres).
fn true_shape(survey: &Path) -> Vec<[f64; 3]> {
    let table = std::fs::read_to_string(survey.join("groundtruth_shape.csv")).unwrap();
    let mut lines = table.lines();
    assert_eq!(lines.next(), Some("s_m,h_m,delta_m"));
    lines
        .map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            [cells[0], cells[1], 1e3 * cells[2]]
        })
        .collect()
}

#[test]
fn the_seed_decides_segments_and_fittings_and_the_threads_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let options = "--segments 6 --ring-length-m 1.2 --step-mm 4 --cables 6 --lamps 3";
    let survey = |name: &str, more: &str| {
        let out = dir.path().join(name);
        simulate(&out, &format!("{options} {more}"));
        (frames(&out), true_shape(&out), out)
    };
    let first = survey("first", "--threads 1");
    let second = survey("second", "--threads 2");
    assert!(first.0 == second.0 && first.1 == second.1);
    let record = json(&first.2.join("simulation.json"))["options"].clone();
    let segments = &record["as_built"]["segments"];
    assert_eq!(segments["count"], 6);
    assert_eq!(segments["ring_length_m"], 1.2);
    assert_eq!(segments["step_mm"], 4.0);
    assert_eq!(record["fittings"]["cables"], 6);
    assert_eq!(record["fittings"]["lamps"], 3);
    let plain = dir.path().join("plain");
    simulate(&plain, "--light downward");
    let record = json(&plain.join("simulation.json"))["options"].clone();
    assert!(record.get("as_built").is_none() && record.get("fittings").is_none());
    assert!(!plain.join("groundtruth_shape.csv").exists());
}

/// One value of δ a segment, with the σ asked for, and joints that can be seen.
#[test]
fn segments_have_steps_and_joints() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let rings = "--segments 24 --ring-length-m 0.5 --step-mm 5";
    simulate(&path("steps"), &format!("{rings} --joint-mm 0"));
    let shape = true_shape(&path("steps"));
    let mut steps_mm: Vec<i64> = shape
        .iter()
        .map(|at| (1e3 * at[2]).round() as i64)
        .collect();
    steps_mm.sort_unstable();
    steps_mm.dedup();
    let n = steps_mm.len() as f64;
    assert!(n > 150.0, "{n}");
    let squares = steps_mm.iter().map(|step| (*step as f64 * 1e-3).powi(2));
    let sigma_mm = (squares.sum::<f64>() / n).sqrt();
    assert!(
        (sigma_mm / 5.0 - 1.0).abs() < 3.5 / (2.0 * n).sqrt(),
        "{sigma_mm}"
    );
    // Without steps a segmented lining is the round one, but for its joints.
    simulate(&path("plain"), "--light downward");
    simulate(&path("flat"), "--segments 6 --step-mm 0 --joint-mm 0");
    simulate(&path("joints"), "--segments 24 --step-mm 0 --joint-mm 20");
    let plain = frames(&path("plain"));
    for (flat, plain) in frames(&path("flat")).iter().zip(&plain) {
        let differ = flat
            .iter()
            .zip(plain.iter())
            .filter(|(a, b)| a.abs_diff(**b) > 1);
        assert_eq!(differ.count(), 0);
    }
    for (jointed, plain) in frames(&path("joints")).iter().zip(&plain) {
        let pixels = || jointed.iter().zip(plain.iter());
        assert!(pixels().all(|(a, b)| *a <= *b + 1 || *b < 40));
        let darker = pixels().filter(|(a, b)| **a + 15 < **b).count();
        assert!((100..2000).contains(&darker), "{darker}");
    }
}

#[test]
fn the_wall_of_a_shape_file_is_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let shape = |coefficient: f64| {
        let shape = serde_json::json!({
            "format": "wall-shape-1",
            "perimeter_m": 3.0 * std::f64::consts::TAU,
            "columns": 8,
            "origin": { "s_m": 0.0, "h_m": 0.0 },
            "first_row": -4,
            "coefficients_m": vec![coefficient; 8 * 10],
        });
        std::fs::write(path("shape.json"), shape.to_string()).unwrap();
    };
    let file = path("shape.json");
    let option = format!("--shape-file {}", text(&file));
    shape(0.02);
    simulate(&path("wide"), &option);
    assert!(
        true_shape(&path("wide"))
            .iter()
            .all(|at| (at[2] - 20.0).abs() < 1e-6)
    );
    assert!(json(&path("wide/simulation.json"))["options"]["as_built"]["shape_file"].is_string());
    let run = std::fs::read_to_string(path("wide/run.toml")).unwrap();
    assert!(run.contains("shape.json"), "{run}");
    simulate(&path("plain"), "--light downward");
    assert!(frames(&path("wide")) != frames(&path("plain")));
    // Added to the other deviations.
    simulate(&path("both"), &format!("{option} --ovality-mm 5"));
    let farthest_mm = true_shape(&path("both"))
        .iter()
        .map(|at| at[2])
        .fold(0.0, f64::max);
    assert!((farthest_mm - 25.0).abs() < 0.01, "{farthest_mm}");
    let refuse = |more: &str, code: i32, part: &str| {
        let out = path("refused");
        let mut arguments = vec!["simulate", "free", "--out", text(&out)];
        arguments.extend(["--shape-file", text(&file)]);
        arguments.extend(more.split(' '));
        let message = fail(&arguments, code);
        assert!(message.contains(part), "{more}: {message}");
    };
    refuse("--radius-m 2", 3, "another tunnel");
    refuse(
        "--shape box --width-m 6 --height-m 5",
        2,
        "straight round tunnel",
    );
    shape(f64::MAX);
    refuse("--frames 4", 3, "displacements");
    std::fs::remove_file(&file).unwrap();
    refuse("--frames 4", 3, "shape.json");
}

/// Cables and lamps hide some of the wall and leave the rest, the poses and the prior alone.
#[test]
fn cables_and_lamps_hide_some_of_the_wall() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    simulate(&path("plain"), "--light even");
    simulate(&path("cables"), "--light even --cables 8");
    simulate(
        &path("lamps"),
        "--light even --lamps 10 --lamp-spacing-m 1.5",
    );
    let plain = frames(&path("plain"));
    let count = |name: &str, is_hidden: fn(u8, u8) -> bool| {
        let both = frames(&path(name));
        let pixels = both
            .iter()
            .zip(&plain)
            .flat_map(|(a, b)| a.iter().zip(b.iter()));
        let (mut hidden, mut changed) = (0, 0);
        for (with, without) in pixels {
            hidden += usize::from(is_hidden(*with, *without));
            changed += usize::from(with != without);
        }
        let all = 4 * 96 * 72;
        assert!(changed < all / 5, "{name}: {changed}");
        hidden
    };
    // A cable of 2 to 5 cm is half a pixel to a pixel wide here, on a dozen frames' heights.
    let darker = count("cables", |with, without| with + 30 < without);
    assert!(darker > 100, "{darker}");
    let brighter = count("lamps", |with, without| with > 180 && without < 150);
    assert!(brighter > 30, "{brighter}");
    for name in ["cables", "lamps"] {
        for file in [
            "groundtruth.tum",
            "baseline.tum",
            "survey.toml",
            "camera.json",
        ] {
            let read = |survey: &str| std::fs::read(path(survey).join(file)).unwrap();
            assert!(read(name) == read("plain"), "{name}/{file}");
        }
    }
}

#[test]
fn impossible_walls_are_refused_with_the_reason() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("survey");
    let refuse = |more: &str, part: &str| {
        let mut arguments = vec!["simulate", "free", "--out", text(&out)];
        arguments.extend(more.split(' '));
        let message = fail(&arguments, 2);
        assert!(message.contains(part), "{more}: {message}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    };
    refuse("--segments 0", "1 to 64");
    refuse("--segments 6 --ring-length-m 0", "ring");
    refuse("--segments 6 --step-mm NaN", "steps");
    refuse("--segments 6 --step-mm -1", "steps");
    refuse("--segments 6 --joint-mm 400", "joints");
    refuse("--step-mm 3", "--segments");
    refuse(
        "--segments 6 --shape box --width-m 5 --height-m 4",
        "straight round",
    );
    refuse("--cables 101", "100 cables");
    refuse("--lamps 2 --lamp-spacing-m inf", "spacing");
    refuse("--lamps 21", "20 rows");
    refuse("--cables 2 --radius-m 0.5", "0.8 m");
}
