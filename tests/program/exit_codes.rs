//! Exit codes when the system refuses: a full disk, a closed standard error, a lock, no memory.
#![cfg(unix)]

use crate::support::{first_frames, simulate, text};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// Runs the program by a shell after a `limit`; `redirection` ends the line.
fn limited(limit: &str, arguments: &[&str], redirection: &str) -> Output {
    let line = format!("{limit}; exec \"$0\" \"$@\" {redirection}");
    Command::new("sh")
        .args(["-c", &line, env!("CARGO_BIN_EXE_tunnelstitch")])
        .args(arguments)
        .output()
        .expect("a shell")
}

#[track_caller]
fn assert_code(output: &Output, code: i32) {
    let message = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{message}");
}

/// A file that may grow no more is like a full disk; the limit is 4 or 8 KiB.
#[test]
fn a_full_disk_is_temporary_for_every_picture() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let (survey, picture) = (path("s"), path("w.png"));
    let small = ["--turns", "1", "--size", "64x48", "--supersample", "1"];
    simulate(&survey, &small);
    let limit = "ulimit -f 8";
    let stitch = [
        "stitch",
        text(&survey),
        "--out",
        text(&picture),
        "--px-per-metre",
        "40",
    ];
    assert_code(&limited(limit, &stitch, ""), 75);
    let again = path("again");
    let larger = [
        "simulate",
        "free",
        "--out",
        text(&again),
        "--turns",
        "1",
        "--size",
        "320x240",
    ];
    assert_code(&limited(limit, &larger, ""), 75);
    let poses = survey.join("groundtruth.tum");
    let out = path("compared");
    let compare = [
        "compare",
        text(&survey),
        "--refined",
        text(&poses),
        "--out",
        text(&out),
    ];
    assert_code(&limited(limit, &compare, ""), 75);
}

#[test]
fn a_standard_error_that_cannot_be_written_changes_nothing() {
    let missing = ["check", "/nonexistent"];
    if Path::new("/dev/full").exists() {
        assert_code(&limited(":", &missing, "2>/dev/full"), 3);
    }
    assert_code(&limited(":", &missing, "2>&-"), 3);
    // A pipe whose reader has gone.
    let mut child = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(missing)
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stderr.take());
    assert_eq!(child.wait().unwrap().code(), Some(3));
}

#[test]
fn maps_that_another_run_writes_are_temporary() {
    let survey = first_frames(3);
    let maps = survey.path().join("maps");
    let folder = survey.path().join("maps.unfinished");
    std::fs::create_dir(&folder).unwrap();
    let lock = std::fs::File::create(folder.join("lock")).unwrap();
    lock.lock().unwrap();
    let picture = survey.path().join("w.tif");
    let stitch = ["stitch", text(survey.path()), "--out", text(&picture)];
    let options = ["--maps", text(&maps), "--px-per-metre", "10"];
    let arguments = [&stitch[..], &options].concat();
    let output = limited(":", &arguments, "");
    assert_code(&output, 75);
    let message = String::from_utf8_lossy(&output.stderr);
    assert!(message.contains("another run"), "{message}");
    drop(lock);
    assert_code(&limited(":", &arguments, ""), 0);
    assert!(!folder.exists() && maps.is_dir());
}

/// Kibibytes of address space that the program itself takes, about, and so many more.
fn program_and_kib(more: u64) -> u64 {
    let program = std::fs::metadata(env!("CARGO_BIN_EXE_tunnelstitch")).unwrap();
    program.len() / 1024 + more
}

#[test]
fn too_little_memory_is_temporary() {
    let survey = first_frames(3);
    let (picture, out) = (survey.path().join("w.tif"), survey.path().join("out"));
    for (command, to) in [("stitch", &picture), ("refine", &out)] {
        let arguments = [
            command,
            text(survey.path()),
            "--out",
            text(to),
            "--threads",
            "1",
        ];
        let limit = format!("ulimit -v {}", program_and_kib(12_000));
        let output = limited(&limit, &arguments, "");
        assert_code(&output, 75);
        let message = String::from_utf8_lossy(&output.stderr);
        assert!(message.contains("of memory"), "{message}");
    }
}

/// Wherever memory ends: never a signal, and never a half-written panorama.
#[test]
fn memory_that_ends_at_any_moment_is_temporary() {
    let survey = first_frames(3);
    let picture = survey.path().join("w.png");
    let arguments = [
        "stitch",
        text(survey.path()),
        "--out",
        text(&picture),
        "--px-per-metre",
        "100",
        "--threads",
        "2",
    ];
    let mut codes = Vec::new();
    for more in (8_000..388_000).step_by(38_000) {
        let limit = format!("ulimit -v {}", program_and_kib(more));
        let output = limited(&limit, &arguments, "");
        let code = output.status.code();
        let message = String::from_utf8_lossy(&output.stderr);
        match code {
            Some(0) => drop(image::open(&picture).expect("a whole panorama")),
            _ => {
                assert_eq!(code, Some(75), "{limit}: {message}");
                assert!(message.contains("memory"), "{limit}: {message}");
                assert!(!picture.exists() || codes.contains(&Some(0)));
            }
        }
        codes.push(code);
    }
    assert!(
        codes.contains(&Some(75)) && codes.contains(&Some(0)),
        "{codes:?}"
    );
}
