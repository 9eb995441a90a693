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
