//! Frames that are refined while they are taken.

use crate::support::outputs::files;
use crate::support::{fail, simulate, succeed, text};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A simulated survey, and a copy of it without its frames.
struct Surveys {
    dir: tempfile::TempDir,
    full: PathBuf,
    live: PathBuf,
}

impl Surveys {
    fn new(frames: &str) -> Self {
        let dir = tempfile::tempdir().unwrap();
        let (full, live) = (dir.path().join("full"), dir.path().join("live"));
        simulate(&full, &["--frames", frames, "--size", "160x120"]);
        fs::create_dir_all(live.join("frames")).unwrap();
        for entry in fs::read_dir(&full).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                fs::copy(&path, live.join(path.file_name().unwrap())).unwrap();
            }
        }
        Self { dir, full, live }
    }

    /// The frames, in order.
    fn frames(&self) -> Vec<PathBuf> {
        let entries = fs::read_dir(self.full.join("frames")).unwrap();
        let mut frames: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
        frames.sort();
        frames
    }

    /// Puts a frame into the folder, its first half before the second.
    fn take(&self, frame: &Path) {
        let content = fs::read(frame).unwrap();
        let path = self.live.join("frames").join(frame.file_name().unwrap());
        fs::write(&path, &content[..content.len() / 2]).unwrap();
        sleep(Duration::from_millis(15));
        fs::write(&path, &content).unwrap();
    }

    fn out(&self) -> PathBuf {
        self.dir.path().join("out")
    }

    /// Starts following the frames.
    fn follow(&self, seconds: &str) -> Child {
        let out = self.out();
        Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
            .args([
                "refine",
                text(&self.live),
                "--follow",
                "--follow-until",
                seconds,
            ])
            .args(["--out", text(&out)])
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .unwrap()
    }

    /// Refines the frames when all are there, and compares the poses.
    fn assert_as_batch(&self) {
        let batch = self.dir.path().join("batch");
        succeed(&["refine", text(&self.live), "--out", text(&batch)]);
        let (batch, followed) = (files(&batch), files(&self.out()));
        assert!(batch.keys().eq(followed.keys()), "{:?}", followed.keys());
        for name in ["poses.tum", "covariance.csv"] {
            assert!(
                batch[Path::new(name)] == followed[Path::new(name)],
                "{name}"
            );
        }
    }
}

/// Waits until a condition holds.
fn wait_for(condition: impl Fn() -> bool) {
    let since = Instant::now();
    while !condition() {
        assert!(since.elapsed() < Duration::from_secs(60), "nothing happens");
        sleep(Duration::from_millis(10));
    }
}

fn said(output: &Output) -> (String, String) {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (text(&output.stdout), text(&output.stderr))
}

/// Pictures that are written while the program runs, one of them late: all are in the result, which
/// is that of the batch.
#[test]
fn followed_frames_have_the_poses_of_the_batch() {
    let surveys = Surveys::new("10");
    let frames = surveys.frames();
    // Long enough for a busy machine.
    let child = surveys.follow("6");
    for frame in frames.iter().filter(|frame| **frame != frames[5]) {
        surveys.take(frame);
    }
    // The frame after the missing one waits for a second.
    let preview = surveys.out().join("preview.tum");
    let lines = || fs::read_to_string(&preview).map_or(0, |text| text.lines().count());
    wait_for(|| lines() > 6);
    surveys.take(&frames[5]);
    assert!(surveys.out().join("preview.png").is_file());
    let output = child.wait_with_output().unwrap();
    let (stdout, stderr) = said(&output);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(
        stdout.contains("the capture has ended: 10 frames, 9 tracked"),
        "{stdout}"
    );
    assert!(stderr.contains("1 frame is missing between"), "{stderr}");
    assert!(
        stderr.contains("is not in the preview: it came after"),
        "{stderr}"
    );
    surveys.assert_as_batch();
}

/// Ctrl-C ends the capture, and not the program; the file of poses grows with the frames.
#[cfg(unix)]
#[test]
fn an_interruption_ends_the_capture() {
    let surveys = Surveys::new("8");
    let poses = surveys.live.join("baseline.tum");
    let all = fs::read_to_string(&poses).unwrap();
    fs::write(&poses, "").unwrap();
    let child = surveys.follow("600");
    for (k, frame) in surveys.frames().iter().enumerate() {
        surveys.take(frame);
        let first: Vec<&str> = all.lines().take(k + 1).collect();
        fs::write(&poses, first.join("\n") + "\n").unwrap();
    }
    wait_for(|| surveys.out().join("preview.png").is_file());
    let pid = child.id().to_string();
    let sent = Command::new("kill").args(["-INT", &pid]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    let (stdout, stderr) = said(&output);
    assert_eq!(output.status.code(), Some(0), "{stderr}");
    assert!(stdout.contains("8 frames, 8 tracked"), "{stdout}");
    surveys.assert_as_batch();
}

#[test]
fn what_cannot_be_followed_is_refused_with_a_remedy() {
    let surveys = Surveys::new("4");
    let toml = surveys.live.join("survey.toml");
    let text_of = fs::read_to_string(&toml).unwrap();
    fs::write(
        &toml,
        text_of.replace("images = \"frames/*.png\"", "video = \"a.mp4\""),
    )
    .unwrap();
    let follow = ["refine", text(&surveys.live), "--follow", "--out"];
    let error = fail(&[&follow[..], &[text(&surveys.out())]].concat(), 3);
    assert!(error.contains("frames.images"), "{error}");
}
