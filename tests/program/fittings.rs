//! Cables and lamps before the wall: they are left out, drawn in a map and counted in the report.

use crate::support::{json, read_map, simulate, succeed, text};
use nalgebra::UnitQuaternion;
use std::path::Path;
use std::sync::LazyLock;
use tempfile::TempDir;
use tunnelstitch::simulate::{Fittings, Scene, SimulateOptions};
use tunnelstitch::surface::WallPoint;
use tunnelstitch::survey::{MaskedWall, Survey};
use tunnelstitch::trajectory::{Pose, poses_of};

const FITTINGS: Fittings = Fittings {
    cables: 3,
    lamps: 1,
    lamp_spacing_m: 3.0,
};
const FRAMES: usize = 26;
const ADVANCE_M: f64 = 0.05;
const SEED: u64 = 5;

/// A tunnel with cables and lamps, refined into the folder `out`; and one of concrete without them,
/// into `plain-out`.
static SURVEYS: LazyLock<TempDir> = LazyLock::new(|| {
    let dir = tempfile::tempdir().unwrap();
    let common = format!(
        "--frames {FRAMES} --size 240x180 --seed {SEED} --noise 1 --supersample 4 --radius-m 1.5 \
         --advance-m {ADVANCE_M}"
    );
    for (name, more) in [
        ("survey", "--wall brick --cables 3 --lamps 1"),
        ("plain", "--wall concrete"),
    ] {
        let (survey, options) = (dir.path().join(name), format!("{common} {more}"));
        simulate(&survey, &options.split(' ').collect::<Vec<_>>());
        let out = dir.path().join(match name {
            "survey" => "out".to_owned(),
            name => format!("{name}-out"),
        });
        succeed(&["refine", text(&survey), "--out", text(&out), "--quiet"]);
    }
    dir
});

/// The masked wall of a result.
fn masked_wall(survey: &Survey, out: &Path) -> MaskedWall {
    MaskedWall::read(&out.join("masked.json"), survey.nominal.perimeter_m()).unwrap()
}

/// In most tiles at whose middle a frame sees a fitting, frames are left out, in half of them at
/// least half of the frames: a bare front or cable has no parallax. Of the tiles that are left out,
/// most are there or beside (the others at edges of bricks); and next to nothing of a smooth wall
/// without fittings is.
#[test]
fn what_is_left_out_is_what_the_fittings_hide() {
    let dir = SURVEYS.path();
    let (survey, out) = (Survey::open(&dir.join("survey")).unwrap(), dir.join("out"));
    let masked = masked_wall(&survey, &out);
    let scene = Scene::new(&SimulateOptions {
        frames: FRAMES,
        advance_m: ADVANCE_M,
        tunnel: survey.file.tunnel.clone(),
        fittings: FITTINGS,
        seed: SEED,
        ..SimulateOptions::free()
    })
    .unwrap();
    // From the refined tunnel into the true one, along the gauge.
    let refined = poses_of(&survey.read_poses(&out.join("poses.tum")).unwrap());
    let motion = (survey.nominal.gauge()).align(&refined, scene.truth());
    let size_m = masked.tile_size_m();
    // True if any frame that sees a place of the wall sees a fitting there.
    let is_behind = |row: f64, column: f64| {
        let corner = masked.corner(0, 0);
        let wall = WallPoint {
            s_m: corner.s_m + column * size_m[0],
            h_m: corner.h_m + row * size_m[1],
        };
        let x_w = survey.nominal.frame(wall).x_w;
        let x_w = motion
            .apply(&Pose::new(UnitQuaternion::identity(), x_w))
            .t_wc;
        (0..FRAMES).any(|frame| {
            let camera = survey.cameras.of(frame);
            let pixel = camera.project(&scene.truth()[frame].to_camera(&x_w));
            pixel.is_some_and(|pixel| camera.is_in_image(&pixel, 0.0))
                && scene.is_hidden(frame, &x_w)
        })
    };
    let is_left_out = |row: i64, column: i64| {
        let tile = masked.index(row, column).map(|k| masked.tiles()[k]);
        tile.is_some_and(|tile| tile.is_hidden())
    };
    let (mut behind, mut found, mut touched) = (0u32, 0u32, 0u32);
    for (row, from, to) in masked.seen() {
        for column in (*from..*to).step_by(3) {
            if is_behind(*row as f64 + 0.5, column as f64 + 0.5) {
                behind += 1;
                found += u32::from(is_left_out(*row, column));
                touched += u32::from(masked.index(*row, column).is_some());
            }
        }
    }
    println!("{touched} of {behind} with a frame left out, {found} with half of them");
    assert!(behind > 50, "{behind}");
    assert!(
        f64::from(touched) > 0.7 * f64::from(behind),
        "{touched} of {behind}"
    );
    assert!(2 * found > behind, "{found} of {behind}");
    let hidden = masked.tiles().iter().filter(|tile| tile.is_hidden());
    let hidden: Vec<_> = hidden.collect();
    let beside = hidden.iter().filter(|tile| {
        let steps = [-0.5, 0.5, 1.5];
        let around = steps
            .into_iter()
            .flat_map(|down| steps.map(|across| (down, across)));
        let (row, column) = (tile.row as f64, tile.column as f64);
        !around
            .clone()
            .any(|(down, across)| is_behind(row + down, column + across))
    });
    let beside = beside.count();
    let all = hidden.len();
    assert!(2 * beside < all, "{beside} of {all}");
    let report = json(&out.join("refine.json"));
    let number = |value: &serde_json::Value| value.as_f64().unwrap();
    let area_m2 = number(&report["masked"]["area_m2"]);
    assert!((area_m2 - all as f64 * masked.tile_m2()).abs() < 1e-9);
    let places = report["masked"]["places"].as_array().unwrap();
    assert!(
        places
            .windows(2)
            .all(|p| number(&p[0]["area_m2"]) >= number(&p[1]["area_m2"]))
    );
    let plain = json(&dir.join("plain-out").join("refine.json"));
    let share = number(&plain["masked"]["share"]);
    println!(
        "share {share} of the plain wall, {}",
        report["masked"]["share"]
    );
    assert!(share < 0.001, "{share}");
}

/// `masked.tif` is on the axes of the other maps, and the report shows it.
#[test]
fn what_is_left_out_is_a_map_and_a_section_of_the_report() {
    let (dir, work) = (SURVEYS.path(), tempfile::tempdir().unwrap());
    let (survey, out) = (dir.join("survey"), dir.join("out"));
    let (maps, report) = (work.path().join("maps"), work.path().join("report"));
    let (panorama, poses) = (work.path().join("wall.tif"), out.join("poses.tum"));
    let arguments = ["stitch", text(&survey), "--poses", text(&poses), "--out"];
    let files = [text(&panorama), "--maps", text(&maps)];
    succeed(&[&arguments[..], &files].concat());
    let (size, shares) = read_map(&maps.join("masked.tif"));
    assert_eq!(size, read_map(&maps.join("resolution.tif")).0);
    let known: Vec<f64> = shares
        .iter()
        .copied()
        .filter(|share| share.is_finite())
        .collect();
    assert!(known.iter().all(|share| (0.0..=1.0).contains(share)));
    let hidden = known.iter().filter(|share| **share >= 0.5).count();
    assert!(hidden > 20, "{hidden}");
    assert!(known.iter().filter(|share| **share == 0.0).count() > known.len() / 2);
    let refined = ["--refined", text(&out), "--out", text(&report)];
    succeed(&[&["report", text(&survey)][..], &refined].concat());
    let page = std::fs::read_to_string(report.join("report.html")).unwrap();
    for part in ["id=\"left-out\"", "Frames left out", "The largest places"] {
        assert!(page.contains(part), "no {part}");
    }
    let numbers = json(&report.join("report.json"));
    assert!(numbers["masked"]["share"].as_array().is_some());
    assert!(numbers["refinement"]["masked"]["area_m2"].as_f64().unwrap() > 0.0);
    // Poses that refine has not written have no map of what it left out.
    let arguments = ["stitch", text(&survey), "--poses", "truth", "--out"];
    succeed(&[&arguments[..], &files, &["--px-per-metre", "20"]].concat());
    assert!(!maps.join("masked.tif").exists());
}
