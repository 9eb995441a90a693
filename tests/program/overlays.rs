//! Overlays that move with the picture and not with the wall, and interlaced frames, through the
//! program.

use crate::support::{edit, fail, json, simulate, succeed, text, tunnelstitch};
use image::GrayImage;
use std::path::{Path, PathBuf};

const SAID: &str = "% of the picture does not move with the wall: left out";

/// Two turns of small frames.
fn simulated(folder: &Path, name: &str, size: &str, more: &str) -> PathBuf {
    let out = folder.join(name);
    let options = format!("--frames 24 --size {size} --supersample 2 {more}");
    simulate(&out, &options.split_whitespace().collect::<Vec<_>>());
    out
}

/// Share of the pixels hidden by `truth` that `mask` hides, and share of the picture that it hides
/// besides.
fn shares(mask: &GrayImage, truth: &GrayImage) -> [f64; 2] {
    let pairs = || mask.pixels().zip(truth.pixels());
    let count = |hides: fn(u8, u8) -> bool| {
        pairs()
            .filter(|(mask, truth)| hides(mask.0[0], truth.0[0]))
            .count() as f64
    };
    [
        count(|mask, truth| mask == 0 && truth == 0) / count(|_, truth| truth == 0),
        count(|mask, truth| mask == 0 && truth > 0) / count(|_, _| true),
    ]
}

#[test]
fn an_overlay_is_proposed_as_a_mask_that_is_not_replaced() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(
        dir.path(),
        "survey",
        "240x180",
        "--wall concrete --overlay both",
    );
    let mask = survey.join("mask.png");
    let check = ["check", text(&survey), "--write-mask", text(&mask)];
    let said = succeed(&check);
    assert!(
        said.contains(SAID) && said.contains("mask.png, which hides"),
        "{said}"
    );
    let grey = |path: &Path| image::open(path).unwrap().to_luma8();
    let [found, besides] = shares(&grey(&mask), &grey(&survey.join("overlay.png")));
    println!("found {found:.4}, besides {besides:.4}");
    assert!(found > 0.97 && besides < 0.07, "{found} {besides}");
    assert!(fail(&check, 3).contains("--force"));
    succeed(&[&check[..], &["--force"]].concat());
    assert!(fail(&["check", text(&survey), "--write-mask", "mask.jpg"], 2).contains(".png"));
    // With the mask, nothing is left to be found.
    edit(
        &survey.join("survey.toml"),
        "[poses]",
        "mask = \"mask.png\"\n[poses]",
    );
    let said = succeed(&["check", text(&survey)]);
    assert!(
        !said.contains("does not move") && said.contains("of every frame hidden"),
        "{said}"
    );
}

#[test]
fn refine_compare_and_report_leave_an_overlay_out_and_say_so() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(
        dir.path(),
        "survey",
        "240x180",
        "--wall concrete --overlay text",
    );
    let [out, report] = ["refined", "report"].map(|name| dir.path().join(name));
    let refine = ["refine", text(&survey), "--out", text(&out)];
    let said = succeed(&refine);
    assert!(said.contains(SAID), "{said}");
    let overlay = json(&out.join("refine.json"))["overlay"].clone();
    assert!(
        (0.04..0.14).contains(&overlay["share"].as_f64().unwrap()),
        "{overlay}"
    );
    assert!(overlay["left_out"] == true && overlay["interlaced"] == false);
    assert!(out.join("overlay.png").is_file());
    let with = ["--refined", text(&out), "--out", text(&report)];
    let said = succeed(&[&["report", text(&survey)][..], &with].concat());
    assert!(said.contains(SAID), "{said}");
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    assert!(page.contains(SAID) && page.contains("data:image/png"));
    let poses = out.join("poses.tum");
    let compared = dir.path().join("compared");
    let compare = [
        "compare",
        text(&survey),
        "--refined",
        text(&poses),
        "--out",
        text(&compared),
        "--px-per-metre",
        "20",
    ];
    assert!(succeed(&compare).contains(SAID));
    let error = json(&compared.join("compare.json"))["refined"]["wall"]["px"]["rms"].clone();
    // With the text, it is some pixels.
    assert!(error.as_f64().unwrap() < 0.8, "{error}");
}

/// Root mean square difference of two panoramas where both show the wall, grey levels.
fn difference(a: &Path, b: &Path) -> f64 {
    let [a, b] = [a, b].map(|path| image::open(path).unwrap().to_luma_alpha8());
    let both = a
        .pixels()
        .zip(b.pixels())
        .filter(|(a, b)| a.0[1] > 0 && b.0[1] > 0);
    let squares: Vec<f64> = both
        .map(|(a, b)| (f64::from(a.0[0]) - f64::from(b.0[0])).powi(2))
        .collect();
    (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
}

#[test]
fn a_panorama_shows_the_wall_unless_the_overlay_is_kept() {
    let dir = tempfile::tempdir().unwrap();
    let clean = simulated(dir.path(), "clean", "240x180", "");
    let burnt = simulated(dir.path(), "burnt", "240x180", "--overlay text");
    let stitch = |survey: &Path, name: &str| {
        let out = dir.path().join(name);
        let said = succeed(&[
            "stitch",
            text(survey),
            "--poses",
            "truth",
            "--out",
            text(&out),
        ]);
        (said, out)
    };
    let (said, wall) = stitch(&clean, "clean.png");
    assert!(!said.contains("move with the wall"), "{said}");
    let (said, left_out) = stitch(&burnt, "left_out.png");
    assert!(said.contains(SAID), "{said}");
    edit(
        &burnt.join("survey.toml"),
        "[poses]",
        "overlay = \"keep\"\n[poses]",
    );
    let (said, kept) = stitch(&burnt, "kept.png");
    assert!(!said.contains("move with the wall"), "{said}");
    let [left_out, kept] = [left_out, kept].map(|picture| difference(&wall, &picture));
    println!("difference from the wall {left_out:.2}, with the overlay {kept:.2} grey levels");
    // 38 dB are 3.2 grey levels.
    assert!(left_out < 3.2 && kept > 10.0, "{left_out} {kept}");
}

#[test]
fn a_survey_that_hardly_moves_is_not_examined() {
    let dir = tempfile::tempdir().unwrap();
    let survey = simulated(
        dir.path(),
        "survey",
        "160x120",
        "--turn-deg 0.2 --advance-m 0.0005",
    );
    let mask = dir.path().join("mask.png");
    let said = succeed(&["check", text(&survey), "--write-mask", text(&mask)]);
    assert!(
        said.contains("were not sought") && said.contains("no mask was written"),
        "{said}"
    );
    assert!(!mask.exists());
}

#[test]
fn interlaced_frames_are_named_with_the_remedy() {
    let dir = tempfile::tempdir().unwrap();
    for (wall, combs) in [("brick", true), ("concrete", true), ("brick", false)] {
        let effects = if combs {
            " --interlaced --interval-s 0.4"
        } else {
            ""
        };
        let options = format!("--wall {wall}{effects} --force");
        let survey = simulated(dir.path(), "survey", "160x120", &options);
        let said = tunnelstitch(&["check", text(&survey)]).stderr;
        let said = String::from_utf8_lossy(&said).into_owned();
        assert_eq!(
            said.contains("interlaced") && said.contains("ffmpeg"),
            combs,
            "{said}"
        );
    }
    // The points of a dithered picture comb between rows, and between columns as well.
    let survey = dir.path().join("survey");
    for entry in std::fs::read_dir(survey.join("frames")).unwrap() {
        let path = entry.unwrap().path();
        let mut picture = image::open(&path).unwrap().into_luma8();
        image::imageops::dither(&mut picture, &image::imageops::BiLevel);
        picture.save(&path).unwrap();
    }
    let said = tunnelstitch(&["check", text(&survey)]).stderr;
    let said = String::from_utf8_lossy(&said).into_owned();
    assert!(!said.contains("interlaced"), "{said}");
}
