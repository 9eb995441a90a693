//! A network of surveys as a job: planned, run, and run again.

use crate::support::{self, edit, fail, succeed, text, tunnelstitch};
use serde_json::Value;
use std::path::Path;

/// Two small surveys, and the job of their network.
fn plan(dir: &Path) {
    for (name, seed) in [("s1", "1"), ("s2", "2")] {
        let options = ["--frames", "12", "--size", "128x96", "--seed", seed];
        support::simulate(&dir.join(name), &options);
    }
    let network = "[[section]]\nid = \"K1\"\nsurvey = \"s1\"\n\
                   [[section]]\nid = \"K2\"\nsurvey = \"s2\"\n";
    let file = dir.join("network.toml");
    std::fs::write(&file, network).unwrap();
    let job = dir.join("job");
    let steps = ["--steps", "refine,stitch"];
    succeed(&[&["plan-job", text(&file), "--out", text(&job)], &steps[..]].concat());
}

/// The tasks that would run.
fn due(job: &Path) -> Vec<String> {
    let printed = succeed(&["run-job", text(job), "--dry-run", "--json"]);
    let tasks: Value = serde_json::from_str(&printed).unwrap();
    let tasks = tasks.as_array().unwrap().iter();
    let due = tasks.filter(|task| task["is_done"] == false);
    due.map(|task| task["id"].as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn a_network_is_done_as_by_single_commands_and_only_what_changed_is_done_again() {
    let dir = tempfile::tempdir().unwrap();
    plan(dir.path());
    let job = dir.path().join("job");
    assert_eq!(
        due(&job),
        ["K1.refine", "K1.stitch", "K2.refine", "K2.stitch"]
    );
    succeed(&["run-job", text(&job)]);
    assert_eq!(due(&job), [""; 0]);

    let panorama = || std::fs::read(job.join("K1/panorama.tif")).unwrap();
    let [refined, out] = ["refined", "out.tif"].map(|name| dir.path().join(name));
    let survey = dir.path().join("s1");
    succeed(&["refine", text(&survey), "--out", text(&refined)]);
    let poses = refined.join("poses.tum");
    let files = ["--poses", text(&poses), "--out", text(&out)];
    succeed(&[&["stitch", text(&survey)], &files[..]].concat());
    assert_eq!(panorama(), std::fs::read(&out).unwrap());

    edit(&dir.path().join("s2/survey.toml"), "2.0", "2.1");
    assert_eq!(due(&job), ["K2.refine", "K2.stitch"]);
    let early = fail(&["run-task", text(&job), "K2.stitch"], 75);
    assert!(early.contains("comes after K2.refine"), "{early}");
    let before = panorama();
    let printed = succeed(&["run-job", text(&job)]);
    assert!(
        printed.contains("4 of 4 tasks are done, 2 of them before"),
        "{printed}"
    );
    assert_eq!(panorama(), before);
    let printed = succeed(&["run-task", text(&job), "K2.stitch"]);
    assert!(printed.contains("up to date"), "{printed}");
}

#[test]
fn what_fails_is_named_and_the_rest_is_done() {
    let dir = tempfile::tempdir().unwrap();
    plan(dir.path());
    let job = dir.path().join("job");
    std::fs::write(dir.path().join("s1/frames/000003.png"), "no picture").unwrap();
    let output = tunnelstitch(&["run-job", text(&job)]);
    let warned = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{warned}");
    for expected in [
        "K1.refine: task K1.refine: ",
        "000003.png",
        "K1.stitch: skipped because of K1.refine",
        "runs just what is missing",
    ] {
        assert!(warned.contains(expected), "{warned}");
    }
    assert!(job.join("K2/panorama.tif").exists());
    assert_eq!(due(&job), ["K1.refine", "K1.stitch"]);
    let log = std::fs::read_to_string(job.join("logs/K1.refine.log")).unwrap();
    assert!(log.contains("000003.png"), "{log}");
}

/// Rows of a query of a GeoPackage, of which every cell is a text.
fn rows(map: &Path, query: &str) -> Vec<Vec<String>> {
    let database = rusqlite::Connection::open(map).unwrap();
    let mut query = database.prepare(query).unwrap();
    let columns = query.column_count();
    let cells = |row: &rusqlite::Row<'_>| (0..columns).map(|k| row.get(k)).collect();
    query
        .query_map([], cells)
        .unwrap()
        .map(Result::unwrap)
        .collect()
}

/// The map has a section that failed, is the same from wherever it is drawn, and follows the marks.
#[test]
fn a_network_has_a_map_whatever_fails() {
    let dir = tempfile::tempdir().unwrap();
    plan(dir.path());
    let [network, job] = ["network.toml", "job"].map(|name| dir.path().join(name));
    edit(
        &network,
        "survey = \"s1\"",
        "survey = \"s1\"\nfrom = \"M1\"\nto = \"M2\"",
    );
    edit(
        &network,
        "survey = \"s2\"",
        "survey = \"s2\"\nfrom = \"M2\"\nto = \"M1\"",
    );
    let map_of = ["network-map", text(&network), text(&job), "--out"];
    let by_hand = dir.path().join("map.gpkg");
    let message = fail(&[&map_of[..], &[text(&by_hand)]].concat(), 3);
    assert!(message.contains("network.toml:"), "{message}");
    edit(
        &network,
        "[[section]]",
        "crs = \"EPSG:2056\"\n[[manhole]]\nid = \"M1\"\nposition_m = [2600000, 1200000]\n\
         [[manhole]]\nid = \"M2\"\nposition_m = [2600030, 1200040]\n[[section]]",
    );
    let steps = ["--steps", "refine"];
    let out = ["--out", text(&job)];
    succeed(&[&["plan-job", text(&network)], &out[..], &steps].concat());
    std::fs::write(dir.path().join("s1/frames/000003.png"), "no picture").unwrap();
    assert_eq!(
        tunnelstitch(&["run-job", text(&job)]).status.code(),
        Some(3)
    );

    let map = job.join("network.gpkg");
    let sections = rows(
        &map,
        "SELECT id, state, coalesce(reason, ''), coalesce(poses, ''), \
         coalesce(photometric_share, -1) || '' FROM sections",
    );
    assert_eq!(sections[0][..2], ["K1", "failed"]);
    assert!(sections[0][2].starts_with("K1.refine: "), "{sections:?}");
    assert!(sections[0][2].contains("000003.png"), "{sections:?}");
    assert_eq!(
        sections[1],
        ["K2", "refined", "", "K2/refined/poses.tum", "1.0"]
    );
    let first = std::fs::read(&map).unwrap();
    let beside = job.join("again.gpkg");
    let printed = succeed(&[&map_of[..], &[text(&beside)]].concat());
    assert!(printed.contains("1 failed, 1 refined"), "{printed}");
    assert_eq!(std::fs::read(&beside).unwrap(), first);

    let mark = r#"{"type": "FeatureCollection", "features": [{"type": "Feature", "id": "m1",
        "geometry": {"type": "Point", "coordinates": [5.0, 1.5]},
        "properties": {"class": "BAB", "severity": 3, "note": "wet", "chainage_m": 5.0,
        "clock": "4:30", "theta_deg": 135.0, "x_m": 0.1, "y_m": 5.0, "z_m": -1.0,
        "layer": "refined", "created": ""}}]}"#;
    std::fs::write(dir.path().join("s2/marks.geojson"), mark).unwrap();
    succeed(&["run-task", text(&job), "network.map"]);
    let defects = rows(&map, "SELECT section, class, clock, hex(geom) FROM defects");
    assert_eq!(defects[0][..3], ["K2", "BAB", "4:30"]);
    // 5 m from the second manhole towards the first.
    let place = [2_600_027.0, 1_200_036.0].map(f64::to_le_bytes).concat();
    let place: String = place.iter().map(|byte| format!("{byte:02X}")).collect();
    assert!(defects[0][3].ends_with(&place), "{defects:?}");
    let printed = succeed(&["run-task", text(&job), "network.map"]);
    assert!(printed.contains("up to date"), "{printed}");
}

/// The program of the tests is built without storage.
#[cfg(not(feature = "storage"))]
#[test]
fn storage_is_named_as_what_the_program_lacks() {
    let dir = crate::support::first_frames(3);
    edit(
        &dir.path().join("survey.toml"),
        "frames/*.jpg",
        "s3://tunnels/2026/*.jpg",
    );
    let out = dir.path().join("out.tif");
    for words in [
        vec!["check", text(dir.path())],
        vec!["stitch", text(dir.path()), "--out", text(&out)],
        vec!["run-job", "s3://tunnels/job"],
        vec!["run-task", "s3://tunnels/job", "K1.refine"],
    ] {
        let message = fail(&words, 3);
        assert!(message.contains("s3://tunnels/"), "{message}");
        assert!(message.contains("--features storage"), "{message}");
    }
    let mixed = fail(
        &["plan-job", text(dir.path()), "--out", "s3://tunnels/job"],
        2,
    );
    assert!(mixed.contains("both in one bucket"), "{mixed}");
    let secret = fail(&["run-job", "s3://key:password@tunnels/job"], 3);
    assert!(!secret.contains("password@"), "{secret}");
}

#[test]
fn jobs_that_cannot_be_planned_or_read_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let [network, job] = ["network.toml", "job"].map(|name| dir.path().join(name));
    std::fs::write(&network, "[[section]]\nid = \"K1\"\nsurvey = \"none\"\n").unwrap();
    let plan = ["plan-job", text(&network), "--out", text(&job)];
    let message = fail(&plan, 3);
    assert!(
        message.contains("section K1") && message.contains("survey.toml"),
        "{message}"
    );
    let report = fail(&[&plan[..], &["--steps", "report"]].concat(), 2);
    assert!(report.contains("needs refine"), "{report}");
    let message = fail(&["run-job", text(&job)], 3);
    assert!(
        message.contains("job.json") && message.contains("plan-job"),
        "{message}"
    );
    assert!(!job.exists());
}

/// Every kind of task, on a stretch of several bands of the panorama for each shard.
#[test]
fn tasks_ask_for_the_memory_that_they_take() {
    const MAX_NEED_OF_PEAK: f64 = 3.0;
    let dir = tempfile::tempdir().unwrap();
    let [survey, job] = ["s1", "job"].map(|name| dir.path().join(name));
    let options = ["--frames", "40", "--size", "320x240", "--advance-m", "0.3"];
    support::simulate(&survey, &options);
    let steps = ["--steps", "refine,stitch,report,export"];
    let of_job = ["plan-job", text(&survey), "--out", text(&job)];
    for shards in ["1", "2"] {
        let shards = ["--shards", shards];
        succeed(&[&of_job[..], &steps, &shards].concat());
        succeed(&["run-job", text(&job)]);
        let read = |path: &Path| -> Value {
            serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
        };
        for task in read(&job.join("job.json"))["tasks"].as_array().unwrap() {
            let id = task["id"].as_str().unwrap();
            let need = task["needs"]["memory_bytes"].as_f64().unwrap();
            let record = read(&job.join(format!("state/{id}.json")));
            let peak = record["peak_bytes"].as_f64().unwrap();
            let told = format!("{id} asks for {need} bytes and takes {peak}");
            assert!(peak <= need && need <= MAX_NEED_OF_PEAK * peak, "{told}");
        }
    }
}
