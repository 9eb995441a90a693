//! The viewer's page in a browser, driven as a person would.

use crate::support::server::Running;
use crate::support::{chromium, json, npm, succeed, text};
use serde_json::Value;
use std::path::Path;
use tunnelstitch::inspect::Marks;

/// A wall once around with bright dots 1000 px of 6283 apart, along the axis and around: a metre,
/// where the perimeter is 6.283 m.
fn target(path: &Path) -> f64 {
    let (width, height) = (6283u32, 2400u32);
    let mut picture = image::GrayImage::from_fn(width, height, |x, y| {
        // Some texture, dark.
        image::Luma([60 + (((x / 90) * 7 + (y / 60) * 13) % 31) as u8])
    });
    let quarter = width / 4;
    for [cx, cy] in [
        [quarter, 700],
        [quarter, 1700],
        [3 * quarter, 700],
        [3 * quarter + 1000, 700],
    ] {
        for y in cy - 22..cy + 22 {
            for x in cx - 22..cx + 22 {
                // Pixels' centres are half a pixel from their corners.
                let (dx, dy) = (
                    f64::from(x) + 0.5 - f64::from(cx),
                    f64::from(y) + 0.5 - f64::from(cy),
                );
                if dx.hypot(dy) < 20.0 {
                    picture.put_pixel(x, y, image::Luma([250]));
                }
            }
        }
    }
    picture.save(path).unwrap();
    std::f64::consts::TAU / f64::from(width) * 1000.0
}

fn run(browser: &Path, modules: &Path, scenario: &str, place: &str, picture: &Path) -> Value {
    let said = npm::node(
        "viewer.mjs",
        &[text(modules), text(browser), scenario, place, text(picture)],
    );
    let seen: Value = serde_json::from_str(&said).unwrap_or_else(|_| panic!("{said}"));
    assert!(seen.get("failed").is_none(), "{seen:#}");
    assert_eq!(seen["problems"].as_array().unwrap().len(), 0, "{seen:#}");
    seen
}

#[test]
fn an_inspector_walks_measures_marks_and_comes_back() {
    if npm::is_viewer_missing() {
        return;
    }
    let (Some(browser), Some(modules)) = (chromium::find(), npm::find()) else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let [paper, survey, site, picture] =
        ["paper.png", "survey", "site", "target.png"].map(|name| dir.path().join(name));
    let metre_m = target(&paper);
    succeed(&[
        "simulate",
        "free",
        "--frames",
        "48",
        "--advance-m",
        "0.05",
        "--size",
        "320x240",
        "--supersample",
        "2",
        "--radius-m",
        "1",
        "--noise",
        "0",
        "--light",
        "even",
        "--texture",
        text(&paper),
        "--texture-width-m",
        "6.2832",
        "--out",
        text(&survey),
    ]);
    let poses = survey.join("groundtruth.tum");
    let given = [text(&survey), "--poses", text(&poses)];
    let server = Running::start(&given);
    let seen = run(&browser, &modules, "inspect", &server.address(), &picture);
    let number = |state: &str, name: &str| seen[state][name].as_f64().unwrap_or(f64::NAN);

    // Forwards along the axis.
    assert!(
        number("ahead", "h") > number("start", "h") + 0.1,
        "{seen:#}"
    );
    assert!(number("wall", "h") == 1.2 && (number("wall", "fromWall") - 1.0).abs() < 0.02);
    assert_eq!(seen["wall"]["hash"], "#h=1.20&clock=3:00");
    // To the wall, and not through it.
    assert!(
        (0.0..0.1).contains(&number("against", "fromWall")),
        "{seen:#}"
    );
    // A quarter of the whole length.
    let manifest: Value = serde_json::from_str(&server.ask("GET /tunnel.json", "", "").1).unwrap();
    let [from, to] = [0, 1].map(|k| manifest["chainage_m"][k].as_f64().unwrap());
    let quarter = from + 0.25 * (to - from);
    assert!(
        (number("jumped", "h") - quarter).abs() < 0.03,
        "{quarter}: {seen:#}"
    );
    assert!(number("ridden", "h") > quarter + 0.1);

    // The metre, from dots found in the picture.
    assert_eq!(seen["dots"].as_array().unwrap().len(), 2, "{seen:#}");
    let length = seen["length"]
        .as_str()
        .unwrap()
        .strip_suffix(" m")
        .unwrap()
        .parse::<f64>()
        .unwrap();
    assert!((length - metre_m).abs() < 0.005, "{length}");
    // The frame shows the dot where the page says.
    assert!(seen["middle"].as_f64().unwrap() > 180.0, "{seen:#}");

    assert_eq!(seen["marks"].as_array().unwrap().len(), 2);
    assert_eq!(seen["kept"], seen["marks"]);
    let table = std::fs::read_to_string(survey.join("marks.csv")).unwrap();
    assert!(
        table.contains("BAB crack")
            && table.contains("\"wet, \"\"open\"\"\"")
            && table.contains(",3:00,"),
        "{table}"
    );

    for state in ["start", "wall", "against", "jumped", "baseline", "reloaded"] {
        let (triangles, mib) = (number(state, "triangles"), number(state, "textureMiB"));
        println!("{state}: {triangles} triangles, {mib} MiB of textures");
        assert!(
            (2.0..20_000.0).contains(&triangles) && mib > 0.0 && mib < 64.0,
            "{seen:#}"
        );
    }

    // The server is killed; another one finds the marks.
    drop(server);
    let server = Running::start(&[&given[..], &["--layers", "refined"]].concat());
    let again = run(&browser, &modules, "again", &server.address(), &picture);
    assert_eq!(again["kept"], seen["marks"]);
    let marks = json(&survey.join("marks.geojson"));
    assert_eq!(marks["features"].as_array().unwrap().len(), 1);
    drop(server);

    succeed(&[
        "export",
        given[0],
        given[1],
        given[2],
        "--layers",
        "refined",
        "--web",
        text(&site),
    ]);
    let alone = run(&browser, &modules, "static", text(&site), &picture);
    assert_eq!(alone["frames"], false);
    a_tablet_will_do(&alone);
    // The page saves the same bytes as the server.
    let [geojson, csv] = ["geojson", "csv"].map(|kind| alone[kind].as_str().unwrap());
    std::fs::write(site.join("marks.geojson"), geojson).unwrap();
    let kept: Value = serde_json::from_str(geojson).unwrap();
    let mut marks = Marks::open(&site).unwrap();
    marks
        .put(serde_json::from_value(kept["features"][0].clone()).unwrap())
        .unwrap();
    assert_eq!(
        std::fs::read_to_string(site.join("marks.csv")).unwrap(),
        csv
    );
}

/// A finger turns the view, two go ahead, the arrows as far as the wall, and taps measure and mark.
fn a_tablet_will_do(seen: &Value) {
    let number = |state: &str, name: &str| seen[state][name].as_f64().unwrap_or(f64::NAN);
    // 200 px at 0.003 rad/px from one metre away, but for what tells a tap from a move.
    let turned_m = number("turned", "seen") - number("start", "seen");
    assert!((0.5..0.75).contains(&turned_m.abs()), "{seen:#}");
    // Five times as far apart.
    assert!(number("pinched", "fromWall") < 0.1, "{seen:#}");
    assert!(
        (0.0..0.1).contains(&number("against", "fromWall")),
        "{seen:#}"
    );
    assert!(seen["length"].as_str().unwrap().ends_with(" m"), "{seen:#}");
    assert_eq!(seen["kept"].as_array().unwrap().len(), 2, "{seen:#}");
}

/// A box that bends: points found by the page lie where the tiles are, and the eye stays inside.
#[test]
fn a_bend_is_walked_through() {
    if npm::is_viewer_missing() {
        return;
    }
    let (Some(browser), Some(modules)) = (chromium::find(), npm::find()) else {
        return;
    };
    let dir = tempfile::tempdir().unwrap();
    let [line, survey, site, picture] =
        ["bend.txt", "survey", "site", "bend.png"].map(|name| dir.path().join(name));
    let points: Vec<String> = (0..=20)
        .map(|k| {
            let (sin, cos) = (0.05 * f64::from(k)).sin_cos();
            format!("{} {} 0", 20.0 - 20.0 * cos, 20.0 * sin)
        })
        .collect();
    std::fs::write(&line, points.join("\n")).unwrap();
    succeed(&[
        "simulate",
        "free",
        "--frames",
        "36",
        "--advance-m",
        "0.25",
        "--size",
        "160x120",
        "--supersample",
        "2",
        "--shape",
        "box",
        "--width-m",
        "4",
        "--height-m",
        "3",
        "--centreline",
        text(&line),
        "--out",
        text(&survey),
    ]);
    succeed(&[
        "export",
        text(&survey),
        "--poses",
        "truth",
        "--layers",
        "truth",
        "--web",
        text(&site),
    ]);
    let seen = run(&browser, &modules, "bend", text(&site), &picture);
    let number = |state: &str, name: &str| seen[state][name].as_f64().unwrap_or(f64::NAN);
    assert!((number("start", "seen") - 6.0).abs() < 0.01, "{seen:#}");
    assert_eq!(seen["start"]["clock"], "3:00");
    assert!(
        (0.0..0.15).contains(&number("against", "fromWall")),
        "{seen:#}"
    );
    assert!((number("against", "seen") - 6.0).abs() < 0.1, "{seen:#}");
    assert!(number("ridden", "h") > 1.1, "{seen:#}");
}

/// Jumps over a kilometre and a ride along it: what the page holds stays bounded.
#[test]
#[ignore = "a kilometre takes some minutes"]
fn a_kilometre_streams() {
    let (browser, modules) = (
        chromium::find().expect("Chromium"),
        npm::find().expect("npm"),
    );
    let dir = tempfile::tempdir().unwrap();
    let [survey, site, picture] = ["survey", "site", "last.png"].map(|name| dir.path().join(name));
    let frames = "--frames 4000 --advance-m 0.25 --size 160x120 --supersample 2 --seed 1";
    let mut simulate = vec!["simulate", "free", "--out", text(&survey)];
    simulate.extend(frames.split(' '));
    succeed(&simulate);
    let export = "--poses truth --layers truth --px-per-metre 100 --web";
    let mut arguments = vec!["export", text(&survey)];
    arguments.extend(export.split(' '));
    arguments.push(text(&site));
    succeed(&arguments);
    let seen = run(&browser, &modules, "kilometre", text(&site), &picture);
    let places = seen["places"].as_array().unwrap();
    let most = |name: &str| {
        places
            .iter()
            .filter_map(|p| p[name].as_f64())
            .fold(0.0, f64::max)
    };
    let (triangles, mib) = (most("triangles"), most("textureMiB"));
    println!(
        "{} views: at most {triangles} triangles, {mib} MiB of textures",
        places.len()
    );
    assert!(triangles < 100_000.0 && (1.0..512.0).contains(&mib));
}
