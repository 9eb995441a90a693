//! Walls that are not as drawn: their shape is estimated with the poses, and used by all commands.

use crate::support::{edit, fail, json, read_map, simulate, succeed, text};
use std::f64::consts::{PI, TAU};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;
use tunnelstitch::evaluate::deformation::{SectionDeformation, read_sections};
use tunnelstitch::simulate::{AsBuilt, Scene, SimulateOptions};

/// An oval, undulating tunnel of which the survey says that it is round, refined.
static OVAL: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let lining = "--ovality-mm 10 --undulation-mm 2 --undulation-length-m 1.5";
    let options = format!("--frames 40 --size 200x150 --seed 5 --noise 1 {lining}");
    simulate(&survey, &options.split(' ').collect::<Vec<_>>());
    for (mode, out) in [("auto", "auto"), ("fixed", "fixed")] {
        let out = dir.path().join(out);
        succeed(&[
            "refine",
            text(&survey),
            "--out",
            text(&out),
            "--shape",
            mode,
        ]);
    }
    dir
});

fn survey() -> PathBuf {
    OVAL.path().join("survey")
}

fn refined(mode: &str) -> PathBuf {
    OVAL.path().join(mode)
}

/// Differences of the same wall point between frames, pixels: seam residual and wall error.
fn compared(mode: &str, out: &Path) -> serde_json::Value {
    let poses = refined(mode).join("poses.tum");
    let survey = survey();
    let arguments = ["compare", text(&survey), "--refined", text(&poses), "--out"];
    succeed(&[&arguments[..], &[text(out), "--quiet"]].concat());
    json(&out.join("compare.json"))["refined"].clone()
}

#[test]
fn the_shape_makes_the_poses_right() {
    let dir = tempfile::tempdir().unwrap();
    let wall_px = |mode: &str| {
        let refined = compared(mode, &dir.path().join(mode));
        refined["wall"]["px"]["rms"].as_f64().unwrap()
    };
    let (auto, fixed) = (wall_px("auto"), wall_px("fixed"));
    assert!(auto < 0.4 * fixed, "{auto} and {fixed} px");
    let report = json(&refined("auto").join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    let shape = &report["shape"];
    // 10 mm cos 2θ and 2 mm of undulation are 7.3 mm RMS.
    let rms_mm = shape["rms_mm"].as_f64().unwrap();
    assert!((5.0..9.0).contains(&rms_mm), "{rms_mm}");
    assert!(json(&refined("fixed").join("refine.json"))["shape"].is_null());
    assert!(!refined("fixed").join("shape.json").exists());
}

/// A refinement that starts from a shape finds little more, and a shape of another tunnel is
/// refused by name.
#[test]
fn a_shape_is_taken_up_from_a_file() {
    let dir = tempfile::tempdir().unwrap();
    let found = refined("auto");
    let again = dir.path().join("again");
    let known = found.join("survey.toml");
    let arguments = ["refine", text(&known), "--out", text(&again), "--shape"];
    succeed(&[&arguments[..], &["fixed"]].concat());
    let report = json(&again.join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    let other = dir.path().join("other.toml");
    std::fs::copy(&known, &other).unwrap();
    std::fs::copy(found.join("shape.json"), dir.path().join("shape.json")).unwrap();
    if found.join("camera.json").exists() {
        std::fs::copy(found.join("camera.json"), dir.path().join("camera.json")).unwrap();
    }
    edit(&other, "radius_m = 3.0", "radius_m = 2.5");
    let message = fail(&["check", text(&other)], 3);
    assert!(message.contains("shape.json"), "{message}");
    assert!(message.contains("another tunnel"), "{message}");
}

/// The lining of [`OVAL`], as simulated.
fn lining() -> Scene {
    let as_built = AsBuilt {
        ovality_mm: 10.0,
        undulation_mm: 2.0,
        undulation_length_m: 1.5,
        ..AsBuilt::default()
    };
    let options = SimulateOptions {
        frames: 2,
        as_built,
        seed: 5,
        ..SimulateOptions::free()
    };
    Scene::new(&options).unwrap()
}

/// `sections.csv` of the refined survey.
fn sections() -> Vec<SectionDeformation> {
    let table = std::fs::read_to_string(refined("auto").join("sections.csv")).unwrap();
    read_sections(&table).unwrap()
}

/// Figures of every section against those of the simulated lining, in units of the stated σ. The
/// angle of the result is that of the initial poses, so only what does not depend on it is
/// compared.
#[test]
fn sections_are_those_of_the_lining_within_their_sigma() {
    let (lining, sections) = (lining(), sections());
    assert!(sections.len() >= 5, "{} sections", sections.len());
    assert!(!refined("fixed").join("sections.csv").exists());
    let mut normalised: Vec<[f64; 3]> = Vec::new();
    for section in &sections {
        let h_m = section.chainage_m.unwrap();
        let angle = |k: i32| TAU * f64::from(k) / 720.0;
        let delta_mm = |theta: f64| 1e3 * lining.lining_deviation_m(theta, h_m);
        let diameters: Vec<f64> = (0..360)
            .map(|k| delta_mm(angle(k)) + delta_mm(angle(k) + PI))
            .collect();
        let max_mm = diameters.iter().copied().fold(f64::MIN, f64::max);
        let min_mm = diameters.iter().copied().fold(f64::MAX, f64::min);
        let mean = |weight: &dyn Fn(f64) -> f64| {
            let terms = (0..720).map(|k| weight(angle(k)) * delta_mm(angle(k)));
            terms.sum::<f64>() / 720.0
        };
        let cosine = 2.0 * mean(&|theta| (2.0 * theta).cos());
        let sine = 2.0 * mean(&|theta| (2.0 * theta).sin());
        let errors = [
            (
                section.ovality_mm,
                max_mm - min_mm,
                section.ovality_sigma_mm,
            ),
            (
                section.second_harmonic_mm,
                cosine.hypot(sine),
                section.second_harmonic_sigma_mm,
            ),
            (
                section.radius_change_mm,
                mean(&|_| 1.0),
                section.radius_sigma_mm,
            ),
        ];
        normalised
            .push(errors.map(|(found, truth, sigma)| (found.unwrap() - truth) / sigma.unwrap()));
    }
    for (k, figure) in ["ovality", "second harmonic", "radius"]
        .into_iter()
        .enumerate()
    {
        let largest = normalised.iter().map(|n| n[k].abs()).fold(0.0, f64::max);
        // Of 45 normal errors one is larger with the probability 10⁻³.
        assert!(largest < 4.2, "{figure}: {largest} σ, of {normalised:?}");
    }
}

/// `deformation.tif` has the deviation from the best-fit circle on the axes of the other maps, and
/// the report shows it.
#[test]
fn the_deformation_is_a_map_and_a_part_of_the_report() {
    let dir = tempfile::tempdir().unwrap();
    let (maps, report) = (dir.path().join("maps"), dir.path().join("report"));
    let (panorama, survey) = (dir.path().join("wall.tif"), survey());
    let poses = refined("auto").join("poses.tum");
    let arguments = ["stitch", text(&survey), "--poses", text(&poses), "--out"];
    let files = [
        text(&panorama),
        "--maps",
        text(&maps),
        "--px-per-metre",
        "20",
    ];
    succeed(&[&arguments[..], &files].concat());
    let (size, deviations_mm) = read_map(&maps.join("deformation.tif"));
    let (sigma_size, sigmas_mm) = read_map(&maps.join("deformation_sigma.tif"));
    assert_eq!(size, read_map(&maps.join("resolution.tif")).0);
    assert_eq!(size, sigma_size);
    let known: Vec<f64> = deviations_mm
        .iter()
        .copied()
        .filter(|d| d.is_finite())
        .collect();
    assert!(2 * known.len() > deviations_mm.len());
    assert!(
        sigmas_mm
            .iter()
            .zip(&deviations_mm)
            .all(|(s, d)| s.is_nan() == d.is_nan())
    );
    let rms_mm = |of: &[f64]| (of.iter().map(|d| d * d).sum::<f64>() / of.len() as f64).sqrt();
    // 10 mm cos 2θ and 2 mm of undulation are 7.3 mm RMS.
    assert!((6.3..8.3).contains(&rms_mm(&known)), "{}", rms_mm(&known));
    // The mean around the section is part of the circle. The rows of the middle are known whole.
    let [width, height] = size;
    let row = &deviations_mm[height / 2 * width..][..width];
    let mean_mm = row.iter().sum::<f64>() / width as f64;
    assert!(mean_mm.abs() < 0.05, "{mean_mm}");
    let refined = refined("auto");
    succeed(&[
        "report",
        text(&survey),
        "--refined",
        text(&refined),
        "--out",
        text(&report),
    ]);
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    for part in [
        "id=\"deformation\"",
        "best-fit circle",
        "ovality",
        "times exaggerated",
    ] {
        assert!(page.contains(part), "no {part}");
    }
    let found = &json(&report.join("report.json"))["deformation"];
    assert_eq!(
        found["sections"].as_array().unwrap().len(),
        sections().len()
    );
}

/// Pixels of a frame, located with the shape beside the poses, and pixels that show no wall.
#[test]
fn many_points_are_located_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (points, out) = (path("points.csv"), path("out.csv"));
    std::fs::write(&points, "frame,u,v,note\n3,10,20,a\n000004.png,5000,2,b\n").unwrap();
    let poses = refined("auto").join("poses.tum");
    let survey = survey();
    let arguments = ["locate", text(&survey), "--poses", text(&poses)];
    let files = ["--points", text(&points), "--out", text(&out)];
    succeed(&[&arguments[..], &files].concat());
    let table = std::fs::read_to_string(&out).unwrap();
    let lines: Vec<Vec<&str>> = table
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(lines[0][4..], ["theta_rad", "h_m", "range_m"]);
    let one = succeed(&[&arguments[..], &["--frame", "3,10,20", "--json"]].concat());
    let one: serde_json::Value = serde_json::from_str(&one).unwrap();
    let theta_rad: f64 = lines[1][4].parse().unwrap();
    let theta_deg = one["theta_deg"].as_f64().unwrap();
    assert!((theta_rad.to_degrees() - theta_deg).abs() < 1e-6);
    assert!((1.0..6.0).contains(&lines[1][6].parse::<f64>().unwrap()));
    assert_eq!(lines[2][4..], ["", "", ""]);
    std::fs::write(&points, "frame,u\n3,10\n").unwrap();
    let message = fail(&[&arguments[..], &files].concat(), 3);
    assert!(message.contains("no column v"), "{message}");
}

/// A tunnel along an arc of 150 m of which the survey says that it is straight: the bend is found
/// within 3 σ, no deformation is made of it, and pixels are located along the bend.
#[test]
fn a_bend_that_is_declared_straight_is_found() {
    let dir = tempfile::tempdir().unwrap();
    let (survey, out) = (dir.path().join("survey"), dir.path().join("out"));
    let line = dir.path().join("arc.txt");
    let radius_m = 150.0;
    let point = |k: i32| {
        let angle = 0.5 * f64::from(k) / radius_m;
        let (x, y) = (radius_m * (1.0 - angle.cos()), radius_m * angle.sin());
        format!("{x:.9} {y:.9} 0\n")
    };
    std::fs::write(&line, (-10..40).map(point).collect::<String>()).unwrap();
    let options = "--frames 40 --size 200x150 --seed 5 --noise 1 --centreline";
    let options = options.split(' ').chain([text(&line)]);
    simulate(&survey, &options.collect::<Vec<_>>());
    let toml = survey.join("survey.toml");
    let declared = std::fs::read_to_string(&toml).unwrap();
    let straight = declared.lines().filter(|l| !l.starts_with("centreline"));
    std::fs::write(&toml, straight.collect::<Vec<_>>().join("\n")).unwrap();
    let refine = ["refine", text(&survey), "--out", text(&out), "--quiet"];
    succeed(&refine);
    let report = json(&out.join("refine.json"));
    assert_eq!(report["frames_on_prior"], 0);
    assert_eq!(report["shape"]["scales"], serde_json::json!([]));
    assert_eq!(report["scale"]["radius"], "given");
    let unseen = report["shape"]["unseen"].as_array().unwrap();
    assert_eq!(unseen.len(), 5, "{unseen:?}");
    for scale in unseen {
        let below_mm = scale["below_mm"].as_f64().unwrap();
        assert!((0.01..5.0).contains(&below_mm), "{scale}");
    }
    let number = |name: &str| report["bend"][name].as_f64().unwrap();
    let sigma_m = number("radius_sigma_m");
    assert!(sigma_m < 0.05 * radius_m, "{sigma_m}");
    assert!((number("radius_m") - radius_m).abs() < 3.0 * sigma_m);
    let (poses, again) = (out.join("poses.tum"), dir.path().join("again"));
    let (panorama, maps) = (dir.path().join("wall.tif"), dir.path().join("maps"));
    let stitch = ["stitch", text(&out), "--poses", text(&poses), "--out"];
    let files = [text(&panorama), "--maps", text(&maps)];
    let coarse = ["--px-per-metre", "20", "--quiet"];
    succeed(&[&stitch[..], &files, &coarse].concat());
    assert!(maps.join("resolution.tif").exists() && !maps.join("deformation.tif").exists());
    // What is found is used, and is where a second refinement starts.
    let locate = ["locate", text(&survey), "--poses", text(&poses)];
    let said = succeed(&[&locate[..], &["--frame", "20,100,75"]].concat());
    assert!(said.contains("chainage"), "{said}");
    succeed(&["refine", text(&out), "--out", text(&again), "--quiet"]);
    let [shape, kept] = [&out, &again].map(|folder| json(&folder.join("shape.json")));
    assert_eq!(shape["bend"], kept["bend"]);
}
