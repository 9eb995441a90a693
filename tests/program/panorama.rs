//! Panoramas through the program: their pictures, and that they depend on the input only.

use crate::support::{self, blender_survey, fail, first_frames, succeed, text};
use image::{DynamicImage, GenericImageView};
use std::path::{Path, PathBuf};

/// Resolution of the small panoramas here, pixels per metre.
const PX_PER_METRE: &str = "30";

fn stitch(survey: &Path, out: &Path, more: &[&str]) -> DynamicImage {
    let mut arguments = vec!["stitch", text(survey), "--out", text(out)];
    arguments.extend(["--px-per-metre", PX_PER_METRE, "--quiet"]);
    arguments.extend(more);
    succeed(&arguments);
    image::open(out).unwrap()
}

/// The first turn of the fixture at its true poses against the committed picture, which was looked
/// at: upright signs, straight mortar lines, no seam. A decoder or a rounding may move a grey level
/// here and there; a pixel on the wall may not.
#[test]
fn the_panorama_is_the_golden_picture() {
    let survey = first_frames(12);
    let out = survey.path().join("panorama.png");
    for (name, options) in [
        (
            "free12_truth_30px.png",
            &["--mode", "average", "--no-blend"][..],
        ),
        ("free12_truth_30px_best.png", &[]),
    ] {
        let arguments = [&["--poses", "truth"], options].concat();
        let drawn = stitch(survey.path(), &out, &arguments).to_rgba8();
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/golden");
        let golden = image::open(golden.join(name)).unwrap().to_rgba8();
        assert_eq!(drawn.dimensions(), golden.dimensions());
        let (mut sum, mut worst) = (0u64, 0u8);
        for (a, b) in drawn.pixels().zip(golden.pixels()) {
            assert_eq!(a[3], b[3], "holes are where they were");
            for channel in 0..3 {
                let difference = a[channel].abs_diff(b[channel]);
                sum += u64::from(difference);
                worst = worst.max(difference);
            }
        }
        let mean = sum as f64 / (3 * golden.pixels().count()) as f64;
        assert!(mean < 0.05, "{name}: mean difference {mean} grey levels");
        assert!(worst <= 2, "{name}: largest difference {worst} grey levels");
    }
}

#[test]
fn holes_are_transparent_and_covered_wall_is_opaque() {
    let survey = first_frames(3);
    let out = survey.path().join("panorama.png");
    let picture = stitch(survey.path(), &out, &[]).to_rgba8();
    let alphas = |value| picture.pixels().filter(|p| p[3] == value).count();
    assert_eq!(alphas(0) + alphas(255), picture.pixels().count());
    // Three frames of twelve to the turn see about a quarter of the wall each way.
    assert!(alphas(0) > alphas(255) && alphas(255) > 1000);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let survey = first_frames(12);
    let bytes = |threads: &str| {
        let out = survey.path().join(format!("{threads}.png"));
        stitch(survey.path(), &out, &["--threads", threads]);
        std::fs::read(out).unwrap()
    };
    assert!(bytes("1") == bytes("2"));
}

/// Plain loops and vectors of every width give the same numbers, with every interpolation.
#[test]
fn any_vector_instructions_give_the_same_bytes() {
    let survey = first_frames(4);
    let bytes = |simd: &str, more: &[&str]| {
        let out = survey.path().join(format!("{simd}.png"));
        stitch(survey.path(), &out, &[&["--simd", simd], more].concat());
        std::fs::read(out).unwrap()
    };
    for more in [
        &[][..],
        &["--mode", "average"],
        &["--mode", "median", "--interpolation", "bilinear"],
        &["--interpolation", "lanczos3"],
    ] {
        let widest = bytes("widest", more);
        assert!(widest == bytes("avx2", more), "AVX2, {more:?}");
        assert!(widest == bytes("baseline", more), "no vectors, {more:?}");
    }
}

#[test]
fn chainage_right_is_the_picture_turned() {
    let survey = first_frames(4);
    let path = |name: &str| -> PathBuf { survey.path().join(name) };
    let upright = stitch(survey.path(), &path("a.png"), &[]);
    let turned = stitch(
        survey.path(),
        &path("b.tif"),
        &["--layout", "chainage-right"],
    );
    assert_eq!(upright.rotate270().to_rgba8(), turned.to_rgba8());
}

/// The paper's zoom: a camera 0.71 m off the axis that is treated as standing on it puts all wall
/// at 3 m.
#[test]
fn ignoring_the_offset_puts_the_wall_at_the_radius() {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let mut arguments = vec!["simulate", "off-centre", "--out", text(&survey)];
    arguments.extend(["--size", "96x72", "--supersample", "1"]);
    succeed(&arguments);
    let span = |more: &[&str]| {
        let out = dir.path().join("panorama.png");
        let mut arguments = vec!["stitch", text(&survey), "--poses", "truth", "--json"];
        arguments.extend(["--out", text(&out)]);
        arguments.extend(more);
        let report: serde_json::Value = serde_json::from_str(&succeed(&arguments)).unwrap();
        let chainage = |k: usize| report["chainage_m"][k].as_f64().unwrap();
        chainage(1) - chainage(0)
    };
    // From the outermost pixel centres, 35.5 px from the middle; f = 36 px / tan 30°; to a row of
    // the panorama.
    let slope = 2.0 * 35.5 / 36.0 * 30f64.to_radians().tan();
    let row = 0.05;
    let on_axis = span(&["--ignore-offset"]);
    assert!((0.0..row).contains(&(on_axis - 3.0 * slope)), "{on_axis}");
    // The farthest wall lies at 225°, between the frames at 210° and 240°: 15° beside their
    // middles.
    let farthest = 3.0 + 0.5f64.hypot(0.5);
    let off_axis = span(&[]);
    let least = farthest * 15f64.to_radians().cos() * slope;
    assert!(
        (least..farthest * slope + row).contains(&off_axis),
        "{off_axis}"
    );
}

#[test]
fn the_report_says_where_the_picture_lies() {
    let survey = first_frames(4);
    let out = survey.path().join("panorama.png");
    let json = succeed(&["stitch", text(survey.path()), "--out", text(&out), "--json"]);
    let report: serde_json::Value = serde_json::from_str(&json).unwrap();
    let picture = image::open(&out).unwrap();
    assert_eq!(report["width"], picture.width());
    assert_eq!(report["height"], picture.height());
    // The perimeter of a tunnel of 3 m radius.
    let around = f64::from(picture.width()) / report["px_per_metre"].as_f64().unwrap();
    assert!((around - 6.0 * std::f64::consts::PI).abs() < 1e-9);
    let [start, end] = [0, 1].map(|k| report["chainage_m"][k].as_f64().unwrap());
    let along = f64::from(picture.height()) / report["px_per_metre"].as_f64().unwrap();
    assert!((end - start - along).abs() < 1e-9);
}

#[test]
fn what_cannot_be_drawn_is_refused_with_the_remedy() {
    let survey = first_frames(2);
    let folder = text(survey.path());
    let at = |name: &str| survey.path().join(name);
    let message = fail(&["stitch", folder, "--out", text(&at("a.bmp"))], 2);
    assert!(message.contains(".png"), "{message}");
    // Nothing that is read, and nothing else that is written, is replaced.
    let frame = at("frames/000000.jpg");
    let message = fail(&["stitch", folder, "--out", text(&frame)], 2);
    assert!(message.contains("would replace"), "{message}");
    let (maps, within) = (at("maps"), at("maps/coverage.tif"));
    let both = ["--out", text(&within), "--maps", text(&maps)];
    let message = fail(&[&["stitch", folder][..], &both].concat(), 2);
    assert!(message.contains("would replace"), "{message}");
    let message = fail(&["stitch", folder, "--out", "a.tif", "--dzi", "a.xml"], 2);
    assert!(message.contains(".dzi"), "{message}");
    let message = fail(&["stitch", folder, "--out", "a.tif", "--memory", "1MiB"], 3);
    assert!(message.contains("--memory"), "{message}");
    let message = fail(&["stitch", folder, "--out", "a.tif", "--memory", "much"], 2);
    assert!(message.contains("2GiB"), "{message}");
    let message = fail(
        &["stitch", folder, "--out", "a.png", "--px-per-metre", "1e9"],
        3,
    );
    assert!(message.contains("--px-per-metre"), "{message}");
    let message = fail(
        &["stitch", folder, "--out", "a.png", "--px-per-metre=-3"],
        2,
    );
    assert!(message.contains("positive"), "{message}");
    let message = fail(
        &["stitch", folder, "--out", "a.png", "--poses", "none.tum"],
        3,
    );
    assert!(message.contains("none.tum"), "{message}");
    let message = fail(&["stitch", folder, "--out", folder], 2);
    assert!(message.contains(".png"), "{message}");
    let blocked = at("survey.toml").join("folder/a.png");
    let message = fail(&["stitch", folder, "--out", text(&blocked)], 3);
    assert!(message.contains("survey.toml/folder"), "{message}");
    assert!(!at("a.bmp").exists() && !Path::new("a.png").exists() && !Path::new("a.tif").exists());
}

#[test]
fn a_photo_is_projected_onto_the_cylinder() {
    let survey = first_frames(1);
    let photo = survey.path().join("frames/000000.jpg");
    let out = survey.path().join("cylinder.png");
    let camera = survey.path().join("camera.json");
    succeed(&[
        "project",
        text(&photo),
        "--camera",
        text(&camera),
        "--out",
        text(&out),
    ]);
    let (flat, cylinder) = (
        image::open(&photo).unwrap(),
        image::open(&out).unwrap().to_rgba8(),
    );
    // û = f θ + cx: the sides at ±atan(239.5 / f) instead of ±239.5, f = 180 / tan 30°.
    let f = 180.0 / 30f64.to_radians().tan();
    let half_width = (239.5 / f).atan() * f;
    assert_eq!(
        f64::from(cylinder.width()),
        2.0 * half_width.floor().round()
    );
    // No column lies at θ = 0 exactly, so the outermost rows of the photo reach no whole row.
    assert_eq!(cylinder.height(), flat.height() - 2);
    assert_eq!(cylinder.get_pixel(0, 0)[3], 0);
    // At θ = 0 the photo is unchanged, and the middle column lies between two of either picture.
    let (column, photo_column) = (cylinder.width() / 2, flat.width() / 2);
    let difference: f64 = (0..cylinder.height())
        .map(|row| {
            let (a, b) = (
                cylinder.get_pixel(column, row),
                flat.get_pixel(photo_column, row + 1),
            );
            f64::from(a[0].abs_diff(b[0]))
        })
        .sum::<f64>()
        / f64::from(cylinder.height());
    assert!(difference < 3.0, "{difference} grey levels");
    let message = fail(
        &[
            "project",
            text(&photo),
            "--out",
            "x.png",
            "--fov-deg",
            "180",
        ],
        2,
    );
    assert!(message.contains("between 0 and 180"), "{message}");
}

/// The colours of a picture where it is covered, and how much of it is.
fn covered(picture: &DynamicImage) -> (Vec<f64>, Vec<bool>) {
    let pixels = picture.to_luma_alpha8();
    let grey = pixels.pixels().map(|p| f64::from(p[0])).collect();
    (grey, pixels.pixels().map(|p| p[1] > 0).collect())
}

fn simulate(folder: &Path, more: &[&str]) {
    let size = ["--size", "320x240", "--frames", "24", "--supersample", "4"];
    support::simulate(folder, &[&size, more].concat());
}

/// Correction of a gain of ±30 % and of a lamp, against a wall with uniform light and no noise.
#[test]
fn light_and_exposure_are_undone() {
    let dir = tempfile::tempdir().unwrap();
    for wall in ["brick", "concrete"] {
        let [lit, even] = ["lit", "even"].map(|name| dir.path().join(format!("{wall}-{name}")));
        let light = [
            "--gain-percent",
            "30",
            "--lamp-corner",
            "0.4",
            "--noise",
            "2",
        ];
        simulate(&lit, &[&["--wall", wall][..], &light].concat());
        simulate(&even, &["--wall", wall, "--noise", "0"]);
        let drawn = |survey: &Path, more: &[&str]| {
            let out = survey.join("panorama.png");
            let mut arguments = vec!["stitch", text(survey), "--poses", "truth"];
            arguments.extend(["--out", text(&out)]);
            arguments.extend(more);
            succeed(&arguments);
            covered(&image::open(out).unwrap())
        };
        let (truth, seen) = drawn(&even, &["--no-blend"]);
        let (found, _) = drawn(&lit, &[]);
        let pairs = || {
            let all = truth.iter().zip(&found).zip(&seen);
            all.filter(|(_, seen)| **seen).map(|((a, b), _)| (*a, *b))
        };
        // The overall brightness cannot be known: gains are 1 in the mean.
        let sum = |f: fn((f64, f64)) -> f64| pairs().map(f).sum::<f64>();
        let factor = sum(|(a, b)| a * b) / sum(|(_, b)| b * b);
        assert!((0.85..1.15).contains(&factor), "{factor}");
        let squares: f64 = pairs().map(|(a, b)| (a - factor * b).powi(2)).sum();
        let psnr_db = 10.0 * (255.0 * 255.0 * pairs().count() as f64 / squares).log10();
        assert!(psnr_db > 34.0, "{wall}: {psnr_db} dB");
    }
}

/// Over several bands, with tiles that no frame covers: panoramas with maps record the frames,
/// those without must have the same holes.
#[test]
fn the_panorama_is_the_same_with_maps_and_without() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = [true, false].map(|with_maps| {
        let out = dir.path().join(format!("{with_maps}.png"));
        let maps = dir.path().join("maps");
        let survey = blender_survey();
        let mut arguments = vec!["stitch", text(&survey), "--poses", "truth", "--quiet"];
        arguments.extend(["--out", text(&out)]);
        if with_maps {
            arguments.extend(["--maps", text(&maps)]);
        }
        succeed(&arguments);
        image::open(&out).unwrap().to_rgba8()
    });
    let holes = |picture: &image::RgbaImage| picture.pixels().filter(|p| p[3] == 0).count();
    assert!(pictures[0].height() > 512 && holes(&pictures[0]) > 0);
    assert!(pictures[0] == pictures[1]);
}

#[test]
fn maps_lie_beside_the_panorama() {
    let survey = first_frames(12);
    let at = |name: &str| survey.path().join(name);
    let [out, dzi, maps] = ["p.tif", "p.dzi", "maps"].map(at);
    let mut arguments = vec!["stitch", text(survey.path()), "--poses", "truth", "--json"];
    arguments.extend(["--px-per-metre", PX_PER_METRE, "--out", text(&out)]);
    arguments.extend(["--dzi", text(&dzi), "--maps", text(&maps)]);
    let report: serde_json::Value = serde_json::from_str(&succeed(&arguments)).unwrap();
    let picture = image::open(&out).unwrap().to_rgba8();
    let coverage = image::open(maps.join("coverage.tif")).unwrap().to_luma8();
    assert_eq!(picture.dimensions(), coverage.dimensions());
    for (pixel, covered) in picture.pixels().zip(coverage.pixels()) {
        assert_eq!(pixel[3], covered[0]);
    }
    for name in ["frames.tif", "resolution.tif", "preview.png", "gaps.csv"] {
        assert!(maps.join(name).is_file(), "{name}");
    }
    assert!(!maps.join("uncertainty.tif").exists());
    let preview = image::open(maps.join("preview.png")).unwrap();
    assert!(preview.width().max(preview.height()) <= 4096);
    let gaps = std::fs::read_to_string(maps.join("gaps.csv")).unwrap();
    let listed = report["gaps"].as_array().unwrap().len();
    assert!(listed > 0);
    assert_eq!(gaps.lines().count(), 1 + listed);
    // The whole picture in one tile.
    let levels = std::fs::read_dir(at("p_files")).unwrap().count();
    let whole = image::open(at(&format!("p_files/{}/0_0.jpg", levels - 1))).unwrap();
    assert_eq!(whole.width(), picture.width().min(512));
    assert!(std::fs::read_to_string(&dzi).unwrap().contains("512"));
}

/// Ctrl-C while it is drawn: its exit code, and nothing half-written.
#[cfg(unix)]
#[test]
fn an_interrupted_panorama_leaves_only_its_checkpoint() {
    let survey = first_frames(48);
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("p.tif");
    let mut arguments = vec!["stitch", text(survey.path()), "--px-per-metre", "3000"];
    arguments.extend(["--out", text(&out), "--quiet"]);
    assert_eq!(support::interrupt(&arguments, dir.path()), Some(130));
    let entries = std::fs::read_dir(dir.path()).unwrap();
    let names: Vec<_> = entries.map(|entry| entry.unwrap().file_name()).collect();
    assert_eq!(names, ["p.tif.unfinished"]);
}
