//! Helpers of the integration tests: the fixture, copies of its first frames, and running the
//! program.

pub mod chromium;
pub mod missing;
pub mod npm;
pub mod outputs;
pub mod recorder;
pub mod server;

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

/// The survey rendered by Blender.
pub fn blender_survey() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures/blender_free48")
}

/// The folder of [`blender_survey`] refined by two threads, once for all tests.
pub fn refined_blender_survey() -> &'static Path {
    static REFINED: OnceLock<tempfile::TempDir> = OnceLock::new();
    let refined = REFINED.get_or_init(|| {
        let dir = tempfile::tempdir().expect("a temporary folder");
        let survey = blender_survey();
        let refine = ["refine", text(&survey), "--out", text(dir.path())];
        succeed(&[&refine[..], &["--threads", "2", "--quiet"]].concat());
        dir
    });
    refined.path()
}

/// A writable survey of the fixture's first `count` frames.
pub fn first_frames(count: usize) -> tempfile::TempDir {
    let from = blender_survey();
    let dir = tempfile::tempdir().expect("a temporary folder");
    std::fs::create_dir(dir.path().join("frames")).expect("a folder for frames");
    for name in ["survey.toml", "camera.json"] {
        std::fs::copy(from.join(name), dir.path().join(name)).expect("a copy");
    }
    for k in 0..count {
        let name = format!("frames/{k:06}.jpg");
        std::fs::copy(from.join(&name), dir.path().join(&name)).expect("a copy of a frame");
    }
    for name in ["baseline.tum", "groundtruth.tum"] {
        let text = std::fs::read_to_string(from.join(name)).expect("poses");
        let first: Vec<&str> = text.lines().take(count).collect();
        std::fs::write(dir.path().join(name), first.join("\n") + "\n").expect("poses");
    }
    dir
}

/// Replaces the first occurrence of `from` in a text file by `to`; it must occur.
pub fn edit(path: &Path, from: &str, to: &str) {
    let text = std::fs::read_to_string(path).expect("a text file");
    assert!(text.contains(from), "{} holds no {from:?}", path.display());
    std::fs::write(path, text.replacen(from, to, 1)).expect("the edited file");
}

/// Runs the program.
pub fn tunnelstitch(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

/// Runs the program with a text as standard input.
pub fn with_input(arguments: &[&str], input: &str) -> Output {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child
        .stdin
        .take()
        .unwrap()
        .write_all(input.as_bytes())
        .unwrap();
    child.wait_with_output().unwrap()
}

/// Runs the program and expects success; returns standard output.
pub fn succeed(arguments: &[&str]) -> String {
    let output = tunnelstitch(arguments);
    assert!(
        output.status.success(),
        "{arguments:?}: {}",
        String::from_utf8_lossy(&output.stderr)
    );
    String::from_utf8_lossy(&output.stdout).into_owned()
}

/// Runs the program and expects it to fail with `code`; returns standard error.
pub fn fail(arguments: &[&str], code: i32) -> String {
    let output = tunnelstitch(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

/// Runs the program for at most `seconds`; returns its exit code, none if it was stopped, and what
/// it printed.
pub fn run_within(arguments: &[&str], seconds: u64) -> (Option<i32>, String) {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the program starts");
    let end = Instant::now() + Duration::from_secs(seconds);
    while child.try_wait().expect("a child").is_none() {
        if Instant::now() > end {
            child.kill().expect("a child");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().expect("a child");
    let texts = [output.stdout, output.stderr];
    let text = String::from_utf8_lossy(&texts.concat()).into_owned();
    (output.status.code(), text)
}

/// Blurs all pictures in a folder, each with a Gaussian of `sigma` pixels.
pub fn blur_pictures(folder: &Path, sigma: f32) {
    for picture in folder.read_dir().unwrap() {
        let path = picture.unwrap().path();
        image::open(&path).unwrap().blur(sigma).save(&path).unwrap();
    }
}

/// Simulates a survey into `out`; `options` are added to the defaults, but for 4 × 4 points per
/// pixel, which take half the time.
pub fn simulate(out: &Path, options: &[&str]) -> String {
    let start = ["simulate", "free", "--quiet", "--out", text(out)];
    let points: &[&str] = match options.contains(&"--supersample") {
        true => &[],
        false => &["--supersample", "4"],
    };
    succeed(&[&start, points, options].concat())
}

/// Error on the wall of poses of a simulated survey, root mean square, pixels.
pub fn wall_px(survey: &Path, poses: &Path) -> f64 {
    let survey = tunnelstitch::survey::Survey::open(survey).expect("a survey");
    let poses = tunnelstitch::trajectory::poses_of(&survey.read_poses(poses).expect("poses"));
    let truth = survey.truth.as_deref().expect("true poses");
    let error = tunnelstitch::evaluate::wall_error(
        survey.surface.as_ref(),
        &survey.cameras,
        &poses,
        &tunnelstitch::trajectory::poses_of(truth),
    );
    error.expect("poses that see the wall").px.rms
}

/// Content of a JSON file.
pub fn json(path: &Path) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).expect("a JSON file")).expect("JSON")
}

/// A path as an argument.
pub fn text(path: &Path) -> &str {
    path.to_str().expect("a path in UTF-8")
}

/// Runs the program until something appears in `folder`, interrupts it as Ctrl-C does, and returns
/// its exit code.
#[cfg(unix)]
pub fn interrupt(arguments: &[&str], folder: &Path) -> Option<i32> {
    let mut child = Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .args(arguments)
        .spawn()
        .expect("the program starts");
    while entries(folder) == 0 {
        let ended = child.try_wait().expect("a child");
        assert!(ended.is_none(), "it ended too early");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let interrupt = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status()
        .expect("kill starts");
    assert!(interrupt.success());
    child.wait().expect("a child").code()
}

/// Number of files and folders in a folder.
pub fn entries(folder: &Path) -> usize {
    std::fs::read_dir(folder).expect("a folder").count()
}

/// Width and height, and the values of a map in single precision.
pub fn read_map(path: &Path) -> ([usize; 2], Vec<f64>) {
    let file = std::io::BufReader::new(std::fs::File::open(path).expect("a map"));
    let mut decoder = tiff::decoder::Decoder::new(file).expect("a map");
    let (width, height) = decoder.dimensions().expect("a map");
    match decoder.read_image().expect("a map") {
        tiff::decoder::DecodingResult::F32(values) => (
            [width as usize, height as usize],
            values.into_iter().map(f64::from).collect(),
        ),
        _ => panic!("{} is not of single precision", path.display()),
    }
}
