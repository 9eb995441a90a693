//! Measured points of the wall: `refine --points`.

use crate::support::{fail, json, simulate, succeed, text};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::path::{Path, PathBuf};
use std::sync::LazyLock;
use tempfile::TempDir;

/// Noise of a point, metres.
const NOISE_M: f64 = 0.003;
/// Points in each cell of the table of the true wall.
const POINTS_PER_CELL: usize = 2;

/// An oval tunnel of which the survey says that it is round, with points of its wall.
static OVAL: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let survey = dir.path().join("survey");
    let options = "--frames 26 --size 160x120 --seed 5 --noise 1 --ovality-mm 20";
    simulate(&survey, &options.split(' ').collect::<Vec<_>>());
    std::fs::write(dir.path().join("scan.ply"), scan(&survey, 0.0)).unwrap();
    std::fs::write(dir.path().join("larger.ply"), scan(&survey, 0.005)).unwrap();
    let points = dir.path().join("scan.ply");
    let scan = ["--points", text(&points)];
    refine(&survey, &dir.path().join("plain"), &["--shape", "fixed"]);
    refine(&survey, &dir.path().join("scanned"), &scan);
    refine(
        &survey,
        &dir.path().join("held"),
        &[&scan[..], &["--shape", "fixed"]].concat(),
    );
    dir
});

fn refine(survey: &Path, out: &Path, options: &[&str]) -> String {
    let arguments = ["refine", text(survey), "--out", text(out)];
    succeed(&[&arguments[..], options].concat())
}

fn path(name: &str) -> PathBuf {
    OVAL.path().join(name)
}

/// A binary PLY with points of the simulated wall, on a tunnel that is larger by `larger_m`: with
/// noise, and 10 % of them up to 0.3 m inside.
fn scan(survey: &Path, larger_m: f64) -> Vec<u8> {
    let table = std::fs::read_to_string(survey.join("groundtruth_shape.csv")).unwrap();
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let mut points: Vec<[f64; 3]> = Vec::new();
    for line in table.lines().skip(1) {
        let cell: Vec<f64> = line
            .split(',')
            .map(|value| value.parse().unwrap())
            .collect();
        for _ in 0..POINTS_PER_CELL {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let mut radius_m = 3.0 + larger_m + cell[2] + NOISE_M * noise;
            if rng.random_bool(0.1) {
                radius_m -= rng.random_range(0.03..0.3);
            }
            let theta = cell[0] / 3.0;
            points.push([radius_m * theta.sin(), cell[1], radius_m * theta.cos()]);
        }
    }
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {}\nproperty double x\n\
         property double y\nproperty double z\nend_header\n",
        points.len()
    )
    .into_bytes();
    bytes.extend(
        points
            .iter()
            .flatten()
            .flat_map(|value| value.to_le_bytes()),
    );
    bytes
}

/// Wall error of refined poses, pixels.
fn wall_px(name: &str) -> f64 {
    let dir = tempfile::tempdir().unwrap();
    let (survey, poses) = (path("survey"), path(name).join("poses.tum"));
    let arguments = ["compare", text(&survey), "--refined", text(&poses), "--out"];
    let coarse = [text(dir.path()), "--px-per-metre", "20", "--quiet"];
    succeed(&[&arguments[..], &coarse].concat());
    let refined = json(&dir.path().join("compare.json"))["refined"].clone();
    refined["wall"]["px"]["rms"].as_f64().unwrap()
}

#[test]
fn points_make_the_poses_right() {
    let (plain, scanned, held) = (wall_px("plain"), wall_px("scanned"), wall_px("held"));
    assert!(scanned < 0.6 * plain, "{plain} → {scanned} px");
    assert!(held < 0.6 * plain, "{plain} → {held} px");
}

#[test]
fn the_fit_is_reported() {
    for name in ["scanned", "held"] {
        let report = json(&path(name).join("refine.json"));
        let points = &report["points"];
        let value = |key: &str| points[key].as_f64().unwrap();
        let near = value("used") + value("outliers");
        let sum = near + value("beyond") + value("off_wall") + value("thinned");
        assert_eq!(sum, value("read"));
        let share = value("outliers") / near;
        assert!((0.08..0.12).contains(&share), "{share}");
        assert!((2.7..3.3).contains(&value("rms_mm")), "{points}");
        assert!((2.7..3.3).contains(&value("sigma_mm")), "{points}");
        // 20 mm cos 2θ.
        assert!((13.5..14.8).contains(&value("shape_mm")), "{points}");
        let radius = value("radius_change_mm") / value("radius_change_sigma_mm");
        assert!(radius.abs() < 4.0, "{points}");
        let rms_mm = report["shape"]["rms_mm"].as_f64().unwrap();
        assert!((11.0..16.0).contains(&rms_mm), "{}", report["shape"]);
        let shape = json(&path(name).join("shape.json"));
        assert!(!shape["sigma_m"].as_array().unwrap().is_empty());
        assert!(path(name).join("sections.csv").exists());
    }
}

/// Frames do not see the radius, points do.
#[test]
fn points_tell_the_radius() {
    let points = path("larger.ply");
    let out = path("larger");
    let printed = refine(
        &path("survey"),
        &out,
        &["--points", text(&points), "--fast"],
    );
    assert!(printed.contains("radius is +5."), "{printed}");
    let report = json(&out.join("refine.json"));
    let change = report["points"]["radius_change_mm"].as_f64().unwrap();
    assert!((change - 5.0).abs() < 0.3, "{change}");
    let html = path("html");
    succeed(&[
        "report",
        text(&path("survey")),
        "--refined",
        text(&out),
        "--out",
        text(&html),
    ]);
    let page = std::fs::read_to_string(html.join("report.html")).unwrap();
    assert!(page.contains("are outliers; by them the radius is"));
}

/// The record of a run has the file of points with its hash, so that an interrupted run is not
/// continued with another.
#[test]
fn the_points_are_an_input_of_the_run() {
    let record = std::fs::read_to_string(path("scanned").join("run.toml")).unwrap();
    assert!(record.contains("scan.ply"), "{record}");
    let plain = std::fs::read_to_string(path("plain").join("run.toml")).unwrap();
    assert!(!plain.contains("scan.ply"), "{plain}");
}

#[test]
fn points_that_cannot_be_used_are_refused_with_a_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let refused = |points: &Path, more: &[&str], named: &[&str]| {
        let survey = path("survey");
        let arguments = ["refine", text(&survey), "--out", text(&out), "--points"];
        let error = fail(&[&arguments[..], &[text(points)], more].concat(), 3);
        for named in named {
            assert!(error.contains(named), "{error}");
        }
    };
    let file = |name: &str, content: &[u8]| {
        let path = dir.path().join(name);
        std::fs::write(&path, content).unwrap();
        path
    };
    let whole = std::fs::read(path("scan.ply")).unwrap();
    let cut = file("cut.ply", &whole[..whole.len() - 5]);
    refused(&cut, &[], &["cut.ply", "copy it again"]);
    refused(&file("scan.e57", b""), &[], &["scan.e57", ".laz"]);
    refused(
        &file("nan.xyz", b"1 2 NaN\n"),
        &[],
        &["nan.xyz:1", "finite"],
    );
    refused(&dir.path().join("missing.pcd"), &[], &["missing.pcd"]);
    refused(
        &file("far.xyz", b"1000 2 3\n"),
        &[],
        &["far.xyz", "too few"],
    );
    let scan = path("scan.ply");
    refused(
        &scan,
        &["--calibrate", "radius"],
        &["the radius", "--calibrate"],
    );
    refused(
        &scan,
        &["--calibrate", "axis"],
        &["the axis", "--calibrate"],
    );
}
