//! Files that others have made do no harm: pipes, devices, links, names and sizes.
#![cfg(unix)]

use crate::support::{edit, entries, fail, first_frames, run_within, succeed, text};
use std::ffi::OsStr;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::Path;

/// Longest time of a refusal, seconds.
const MAX_REFUSAL_S: u64 = 20;

fn make_pipe(path: &Path) {
    let _ = std::fs::remove_file(path);
    let made = std::process::Command::new("mkfifo").arg(path).status();
    assert!(made.expect("mkfifo starts").success());
}

/// Message of a check that must end with exit code 3 soon.
fn refused_check(survey: &Path) -> String {
    let (code, message) = run_within(&["check", text(survey)], MAX_REFUSAL_S);
    assert_eq!(code, Some(3), "{message}");
    message
}

#[test]
fn pipes_and_devices_are_refused() {
    for name in [
        "survey.toml",
        "camera.json",
        "baseline.tum",
        "frames/000001.jpg",
        "mask.png",
    ] {
        let survey = first_frames(3);
        let path = survey.path().join(name);
        if name == "mask.png" {
            let toml = survey.path().join("survey.toml");
            edit(&toml, "[frames]", "[frames]\nmask = \"mask.png\"");
        }
        make_pipe(&path);
        let message = refused_check(survey.path());
        assert!(
            message.contains(name) && message.contains("a named pipe"),
            "{message}"
        );
        std::fs::remove_file(&path).unwrap();
        symlink("/dev/zero", &path).unwrap();
        let message = refused_check(survey.path());
        assert!(
            message.contains(name) && message.contains("a device"),
            "{message}"
        );
    }
}

#[test]
fn text_files_have_a_largest_size() {
    let survey = first_frames(3);
    let toml = survey.path().join("survey.toml");
    let mut content = std::fs::read_to_string(&toml).unwrap();
    content += &"# nothing\n".repeat(500_000);
    std::fs::write(&toml, content).unwrap();
    let message = refused_check(survey.path());
    assert!(
        message.contains("survey.toml") && message.contains("4 MiB"),
        "{message}"
    );
}

#[test]
fn locks_do_not_follow_links() {
    let survey = first_frames(3);
    let precious = survey.path().join("precious");
    std::fs::write(&precious, "kept").unwrap();
    let out = survey.path().join("out");
    let picture = survey.path().join("w.tif");
    let refine = ["refine", text(survey.path()), "--out", text(&out)];
    let stitch = ["stitch", text(survey.path()), "--out", text(&picture)];
    let cases = [
        (refine, out.join("refine.unfinished")),
        (stitch, survey.path().join("w.tif.unfinished")),
    ];
    for (arguments, folder) in cases {
        std::fs::create_dir_all(&folder).unwrap();
        symlink(&precious, folder.join("lock")).unwrap();
        let message = fail(&arguments, 3);
        assert!(message.contains("a symbolic link"), "{message}");
        std::fs::remove_dir_all(&folder).unwrap();
        // Nor is the folder a link, whose files would be removed.
        let other = survey.path().join("other");
        std::fs::create_dir_all(&other).unwrap();
        std::fs::write(other.join("file"), "kept").unwrap();
        symlink(&other, &folder).unwrap();
        let message = fail(&arguments, 3);
        assert!(message.contains("symbolic link"), "{message}");
        assert_eq!(entries(&other), 1);
    }
    assert_eq!(std::fs::read_to_string(&precious).unwrap(), "kept");
}

#[test]
fn only_regular_files_are_replaced() {
    let survey = first_frames(3);
    let pipe = survey.path().join("pipe.tum");
    make_pipe(&pipe);
    let convert = ["convert", text(survey.path()), "--to", "tum", "--out"];
    let message = fail(&[&convert[..], &[text(&pipe)]].concat(), 3);
    assert!(message.contains("a named pipe"), "{message}");
    let link = survey.path().join("null.tum");
    symlink("/dev/null", &link).unwrap();
    let message = fail(&[&convert[..], &[text(&link)]].concat(), 3);
    assert!(message.contains("a device"), "{message}");
    assert!(link.is_symlink());
}

#[test]
fn names_that_are_not_utf_8_are_named() {
    let survey = first_frames(3);
    let frames = survey.path().join("frames");
    let odd = frames.join(OsStr::from_bytes(b"000009\xff.jpg"));
    std::fs::copy(frames.join("000001.jpg"), &odd).unwrap();
    let message = refused_check(survey.path());
    assert!(
        message.contains("000009\\xff.jpg") && message.contains("UTF-8"),
        "{message}"
    );
    std::fs::remove_file(odd).unwrap();
    let folder = survey.path().join(OsStr::from_bytes(b"nu\xff"));
    std::fs::create_dir(&folder).unwrap();
    for name in [
        "survey.toml",
        "camera.json",
        "baseline.tum",
        "groundtruth.tum",
        "frames",
    ] {
        std::fs::rename(survey.path().join(name), folder.join(name)).unwrap();
    }
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .arg("check")
        .arg(&folder)
        .output()
        .unwrap();
    let message = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(3), "{message}");
    assert!(
        message.contains("nu\\xff") && message.contains("rename it"),
        "{message}"
    );
}

/// A survey whose second frame has the given name.
fn with_frame_called(name: &str) -> tempfile::TempDir {
    let survey = first_frames(3);
    let frames = survey.path().join("frames");
    std::fs::rename(frames.join("000001.jpg"), frames.join(name)).unwrap();
    survey
}

#[test]
fn any_name_comes_back_from_a_csv() {
    for name in ["000001\nx,\"q\".jpg", "=HYPERLINK(1).jpg", "000001 b.jpg"] {
        let survey = with_frame_called(name);
        let (folder, poses) = (text(survey.path()), survey.path().join("p.csv"));
        let write = [
            "convert",
            folder,
            "--to",
            "csv",
            "--out",
            text(&poses),
            "--quiet",
        ];
        succeed(&write);
        let written = std::fs::read_to_string(&poses).unwrap();
        assert!(!written.contains("\n="), "{written}");
        let again = survey.path().join("again.csv");
        let read = ["convert", folder, "--poses", text(&poses), "--to", "csv"];
        succeed(&[&read[..], &["--out", text(&again), "--quiet"]].concat());
        assert_eq!(std::fs::read_to_string(&again).unwrap(), written);
        let model = survey.path().join("model");
        let write = ["convert", folder, "--to", "colmap", "--out", text(&model)];
        if name.starts_with('=') {
            succeed(&write);
        } else {
            let message = fail(&write, 3);
            assert!(message.contains("COLMAP"), "{message}");
            assert!(!model.exists());
        }
    }
}

#[test]
fn names_are_printed_without_control_characters() {
    let survey = with_frame_called("000001\u{1b}[31mRED\u{7}\nerror: x.jpg");
    std::fs::write(
        survey
            .path()
            .join("frames/000001\u{1b}[31mRED\u{7}\nerror: x.jpg"),
        "no picture",
    )
    .unwrap();
    let out = survey.path().join("out");
    let message = fail(&["refine", text(survey.path()), "--out", text(&out)], 3);
    assert!(
        message.contains("000001\\u{1b}[31mRED\\u{7}\\nerror: x.jpg"),
        "{message}"
    );
    let toml = survey.path().join("survey.toml");
    edit(&toml, "baseline.tum", "\\u001b]0;x\\u0007.tum");
    let message = refused_check(survey.path());
    assert!(!message.contains(['\u{1b}', '\u{7}']), "{message:?}");
    edit(&toml, "\"circle\"", "\"\\u001b[2J\"");
    let message = refused_check(survey.path());
    assert!(!message.contains('\u{1b}'), "{message:?}");
}
