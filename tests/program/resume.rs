//! Runs that are killed and continued.

use crate::support::outputs::outputs;
use crate::support::{succeed, text};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

/// Smallest number of times that each command is killed.
const KILLS: u32 = 4;

/// A simulated survey.
fn survey(folder: &Path, frames: usize, size: &str) -> PathBuf {
    let survey = folder.join("survey");
    let frames = frames.to_string();
    let simulate = [
        "simulate",
        "free",
        "--frames",
        &frames,
        "--size",
        size,
        "--out",
        text(&survey),
    ];
    succeed(&simulate);
    survey
}

fn start(arguments: &[&str]) -> Child {
    Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap()
}

/// Starts the command and kills it at random moments, at least until so many runs have continued
/// another one, and then lets it end. The machine may have become busier or less busy: after a run
/// that was killed the next is given more time, after one that has ended less than that one took.
fn killed(arguments: &[&str], mut takes: Duration, seed: u64, least_resumed: u32) {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let (mut kills, mut resumed) = (0, 0);
    for run in 0.. {
        assert!(
            run < 10 * KILLS,
            "of {run} runs {kills} were killed and {resumed} had continued"
        );
        let mut child = start(arguments);
        let patience = takes.mul_f64(rng.random_range(0.1..0.8));
        std::thread::sleep(patience);
        child.kill().unwrap();
        let output = child.wait_with_output().unwrap();
        let has_ended = output.status.success();
        takes = if has_ended {
            patience
        } else {
            takes.mul_f64(1.0 + 1.0 / f64::from(KILLS))
        };
        kills += u32::from(!has_ended);
        resumed += u32::from(
            String::from_utf8_lossy(&output.stdout).contains("continuing the interrupted run"),
        );
        if kills >= KILLS && resumed >= least_resumed {
            break;
        }
    }
    succeed(arguments);
}

/// Checks that two folders hold the same files with the same bytes.
fn assert_same(left: &Path, right: &Path) {
    let [left, right] = [left, right].map(outputs);
    assert_eq!(
        left.keys().collect::<Vec<_>>(),
        right.keys().collect::<Vec<_>>()
    );
    for (name, content) in &left {
        assert!(*content == right[name], "{} is different", name.display());
    }
}

/// Refines a survey without interruption and with kills, and compares the results.
fn refine_with_kills(survey: &Path, folder: &Path, options: &[&str]) {
    let (whole, broken) = (folder.join("whole"), folder.join("broken"));
    let refine = |out| [&["refine", text(survey), "--out", text(out)], options].concat();
    let since = Instant::now();
    succeed(&refine(&whole));
    killed(&refine(&broken), since.elapsed(), 1, 1);
    assert_same(&whole, &broken);
}

#[test]
fn refine_ends_with_the_same_bytes_however_often_it_is_killed() {
    let dir = tempfile::tempdir().unwrap();
    let survey = survey(dir.path(), 18, "160x120");
    refine_with_kills(&survey, dir.path(), &["--calibrate", "focal"]);
}

#[test]
fn joint_refine_ends_with_the_same_bytes_however_often_it_is_killed() {
    let dir = tempfile::tempdir().unwrap();
    let survey = survey(dir.path(), 4, "120x90");
    refine_with_kills(&survey, dir.path(), &["--joint"]);
    let report = std::fs::read_to_string(dir.path().join("broken/refine.json")).unwrap();
    assert!(report.contains("\"joint\": true"), "{report}");
}

#[test]
fn stitch_ends_with_the_same_bytes_however_often_it_is_killed() {
    let dir = tempfile::tempdir().unwrap();
    let survey = survey(dir.path(), 18, "160x120");
    // Every kind of file at once, several bands high: the panorama in memory or on disk, Deep Zoom,
    // maps.
    for (picture, scale, seed) in [("wall.tif", "300", 2), ("wall.png", "200", 3)] {
        let run = |name: &str, kill: Option<Duration>| -> (PathBuf, Duration) {
            let folder = dir.path().join(format!("{name}-{picture}"));
            let (out, dzi, maps) = (
                folder.join(picture),
                folder.join("wall.dzi"),
                folder.join("maps"),
            );
            let arguments = [
                "stitch",
                text(&survey),
                "--px-per-metre",
                scale,
                "--out",
                text(&out),
                "--dzi",
                text(&dzi),
                "--maps",
                text(&maps),
            ];
            let since = Instant::now();
            match kill {
                Some(takes) => killed(&arguments, takes, seed, 1),
                None => drop(succeed(&arguments)),
            }
            (folder, since.elapsed())
        };
        let (whole, takes) = run("whole", None);
        let (broken, _) = run("broken", Some(takes));
        assert_same(&whole, &broken);
    }
}

/// A shard of a panorama, and what joins all of them.
#[test]
fn a_panorama_in_shards_has_the_same_bytes_however_often_its_tasks_are_killed() {
    let dir = tempfile::tempdir().unwrap();
    let survey = survey(dir.path(), 48, "128x96");
    let [plain, joined, parts] = ["plain", "joined", "parts"].map(|name| dir.path().join(name));
    let stitch = |words: &[&str], out: &Path| -> Vec<String> {
        let first = ["stitch", text(&survey), "--px-per-metre", "250"];
        let words = [&first[..], words, &["--out", text(out)]].concat();
        words.into_iter().map(str::to_owned).collect()
    };
    fn words(words: &[String]) -> Vec<&str> {
        words.iter().map(String::as_str).collect()
    }
    let start = Instant::now();
    succeed(&words(&stitch(&[], &plain.join("wall.tif"))));
    let takes = start.elapsed();
    succeed(&words(&stitch(&["--seams"], &parts)));
    succeed(&words(&stitch(&["--shard", "2/2"], &parts)));
    // A part this small may end before it keeps a state.
    killed(
        &words(&stitch(&["--shard", "1/2"], &parts)),
        takes / 2,
        5,
        0,
    );
    let join = stitch(&["--join", text(&parts)], &joined.join("wall.tif"));
    succeed(&words(&join));
    // A run of it has its command line.
    for folder in [&plain, &joined] {
        std::fs::remove_file(folder.join("wall.tif.run.toml")).unwrap();
    }
    assert_same(&plain, &joined);
    let left = std::fs::read_dir(&parts).unwrap().count();
    assert_eq!(left, 3);
}

/// Waits until the run has kept a state.
fn wait_for_a_state(child: &mut Child, folder: &Path) {
    let has_state = || {
        let mut entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.any(|entry| text(&entry.path()).ends_with(".state"))
    };
    while !has_state() {
        let ended = child.try_wait().unwrap();
        assert!(ended.is_none(), "ended without a state: {ended:?}");
        std::thread::sleep(Duration::from_millis(5));
    }
}

#[test]
fn an_interrupted_run_continues_and_another_is_refused() {
    let dir = tempfile::tempdir().unwrap();
    let survey = survey(dir.path(), 12, "240x180");
    let out = dir.path().join("refined");
    let kept = out.join("refine.unfinished");
    let arguments = ["refine", text(&survey), "--out", text(&out)];
    let mut child = start(&arguments);
    wait_for_a_state(&mut child, &kept);
    // Two at a time would write over each other.
    let second = start(&arguments).wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&second.stderr).into_owned();
    assert_eq!(second.status.code(), Some(75), "{message}");
    assert!(message.contains("another run"), "{message}");
    // Ctrl-C.
    let interrupted = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupted.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130));
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(message.contains("the same command continues"), "{message}");
    assert!(kept.is_dir());

    let other = start(&[&arguments[..], &["--max-iterations", "3"]].concat());
    let other = other.wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&other.stderr).into_owned();
    assert_eq!(other.status.code(), Some(3), "{message}");
    assert!(
        message.contains("options") && message.contains("--fresh"),
        "{message}"
    );
    // The survey has changed.
    let frame = survey.join("frames/000003.png");
    let original = std::fs::read(&frame).unwrap();
    image::GrayImage::new(320, 240).save(&frame).unwrap();
    let other = start(&arguments).wait_with_output().unwrap();
    let message = String::from_utf8_lossy(&other.stderr).into_owned();
    assert_eq!(other.status.code(), Some(3), "{message}");
    assert!(message.contains("frames has changed"), "{message}");
    std::fs::write(&frame, original).unwrap();

    let said = succeed(&arguments);
    assert!(said.contains("continuing the interrupted run"), "{said}");
    assert!(!kept.exists());
    let again = succeed(&[&arguments[..], &["--fresh"]].concat());
    assert!(!again.contains("continuing the interrupted run"), "{again}");
}
