//! A table of broken inputs: each ends with exit code 3 (2 for wrong usage), a message that names
//! the file, line or frame, no panic, and no output.

use crate::support::{self, first_frames, text, tunnelstitch};
use std::path::Path;

/// A modification of a survey of three frames.
enum Damage {
    /// Replaces the content of a file.
    Write(&'static str, &'static [u8]),
    /// Replaces the first occurrence of a text in a file.
    Edit(&'static str, &'static str, &'static str),
    /// Truncates a file to its first half.
    Halve(&'static str),
    /// Removes a file.
    Remove(&'static str),
    /// Writes a file and replaces a text in another.
    WriteAndEdit(
        &'static str,
        &'static [u8],
        &'static str,
        &'static str,
        &'static str,
    ),
    /// No modification.
    None,
}

use Damage::{Edit, Halve, None, Remove, Write, WriteAndEdit};

/// Modification, command line (`S` is the survey, `O` a name for outputs), exit code, and required
/// parts of the message.
type Row = (Damage, &'static str, i32, &'static [&'static str]);

const TOML: &str = "survey.toml";
const CAMERA: &str = "camera.json";
const POSES: &str = "baseline.tum";
const REFINE: &str = "refine S --out O";
const STITCH: &str = "stitch S --out O.png";
const CHECK: &str = "check S";

const ROWS: &[Row] = &[
    // survey.toml
    (
        Write(TOML, b""),
        REFINE,
        3,
        &["survey.toml", "missing field `tunnel`"],
    ),
    (Write(TOML, b"[[["), REFINE, 3, &["survey.toml:1:"]),
    (
        Write(TOML, b"\xff\xfe\x00"),
        REFINE,
        3,
        &["survey.toml", "cannot read"],
    ),
    (
        Remove(TOML),
        REFINE,
        3,
        &["survey.toml", "a survey is a folder with a survey.toml"],
    ),
    (
        Edit(TOML, "radius_m", "raduis_m"),
        REFINE,
        3,
        &["survey.toml:", "unknown field `raduis_m`", "radius_m"],
    ),
    (
        Edit(TOML, "[camera]", "[kamera]"),
        REFINE,
        3,
        &["survey.toml:", "unknown field `kamera`"],
    ),
    (
        Edit(TOML, "radius_m = 3", "radius_m = 0"),
        REFINE,
        3,
        &["survey.toml", "radius_m", "positive"],
    ),
    (
        Edit(TOML, "radius_m = 3", "radius_m = -3"),
        STITCH,
        3,
        &["survey.toml", "radius_m", "positive"],
    ),
    (
        Edit(TOML, "radius_m = 3", "radius_m = nan #"),
        STITCH,
        3,
        &["survey.toml", "radius_m"],
    ),
    (
        Edit(TOML, "radius_m = 3", "radius_m = \"three\" #"),
        STITCH,
        3,
        &["survey.toml:", "string"],
    ),
    (
        Edit(TOML, "\"circle\"", "\"box\""),
        STITCH,
        3,
        &["survey.toml", "radius_m", "not a size"],
    ),
    (
        Edit(
            TOML,
            "radius_m = 3",
            "centreline = \"none.txt\"\nradius_m = 3",
        ),
        CHECK,
        3,
        &["none.txt", "cannot read"],
    ),
    (
        Edit(
            TOML,
            "radius_m = 3",
            "centreline = \"camera.json\"\nradius_m = 3",
        ),
        REFINE,
        3,
        &["camera.json:1", "x y z"],
    ),
    (
        Edit(
            TOML,
            "radius_m = 3",
            "ignore = [{ chainage_m = [5, 2] }]\nradius_m = 3",
        ),
        REFINE,
        3,
        &["survey.toml", "tunnel.ignore, item 1", "the smaller first"],
    ),
    (
        Edit(
            TOML,
            "radius_m = 3",
            "ignore = [{ theta = [5, 2] }]\nradius_m = 3",
        ),
        REFINE,
        3,
        &["survey.toml:", "unknown field `theta`", "theta_deg"],
    ),
    (
        Edit(TOML, "[frames]", "[frames]\nmask = \"mask.png\""),
        CHECK,
        3,
        &["mask.png", "frames.mask"],
    ),
    (
        Edit(TOML, "[frames]", "[frames]\nmask = \"camera.json\""),
        STITCH,
        3,
        &["camera.json", "PNG"],
    ),
    (
        Edit(TOML, "[frames]", "[frames]\nmask = \"frames/000001.jpg\""),
        REFINE,
        3,
        &["000001.jpg", "neither black nor white"],
    ),
    (
        Edit(TOML, "\"circle\"", "\"hexagon\""),
        CHECK,
        3,
        &["survey.toml:", "hexagon", "circle"],
    ),
    (
        Edit(TOML, "rotation_sigma_deg = 2", "rotation_sigma_deg = 0 #"),
        REFINE,
        3,
        &["survey.toml", "rotation_sigma_deg"],
    ),
    (
        Edit(TOML, "rotation_sigma_deg = 2", "rotation_sigma_deg = nan #"),
        REFINE,
        3,
        &["survey.toml", "rotation_sigma_deg"],
    ),
    (
        Edit(
            TOML,
            "translation_sigma_m = [0.02, ",
            "translation_sigma_m = [",
        ),
        REFINE,
        3,
        &["survey.toml:18", "array of length 3"],
    ),
    (
        Edit(TOML, "\"random-walk\"", "\"gaussian\""),
        REFINE,
        3,
        &["survey.toml:", "gaussian", "random-walk"],
    ),
    (
        Edit(
            TOML,
            "[prior]",
            "[calibrate]\nunknowns = [\"focus\"]\n[prior]",
        ),
        REFINE,
        3,
        &["survey.toml:", "focus", "focal"],
    ),
    (
        Edit(TOML, "[prior]", "[options.paint]\na = 1\n[prior]"),
        STITCH,
        3,
        &["survey.toml", "options.paint", "options.stitch"],
    ),
    (
        Edit(TOML, "[prior]", "[options.stitch]\nmoed = 1\n[prior]"),
        STITCH,
        3,
        &["survey.toml", "moed", "mode"],
    ),
    (
        Edit(
            TOML,
            "[prior]",
            "[options.stitch]\nmode = \"best\"\n[prior]",
        ),
        STITCH,
        3,
        &["survey.toml", "best", "best-view"],
    ),
    (
        Edit(TOML, "frames/*.jpg", "frames/[.jpg"),
        REFINE,
        3,
        &["frames/[.jpg"],
    ),
    (
        Edit(TOML, "frames/*.jpg", "frames/*.bmp"),
        CHECK,
        3,
        &["frames/*.bmp", "matches no file", "relative to survey.toml"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\nconvention = \"w2x\""),
        CHECK,
        3,
        &["survey.toml:", "w2x", "w2c"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\nformat = \"bvh\""),
        CHECK,
        3,
        &["survey.toml:", "bvh", "tum"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\ncamera_axes = \"maya\""),
        CHECK,
        3,
        &["survey.toml:", "maya", "opengl"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\ntime_tolerance_s = -1.0"),
        CHECK,
        3,
        &["survey.toml", "time_tolerance_s"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\nbody_to_camera = \"mount.yaml\""),
        CHECK,
        3,
        &["mount.yaml"],
    ),
    (
        Edit(TOML, "[poses]", "[poses]\ntunnel_frame = \"axis.json\""),
        CHECK,
        3,
        &["axis.json"],
    ),
    (
        WriteAndEdit(
            "axis.txt",
            b"2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n",
            TOML,
            "[poses]",
            "[poses]\ntunnel_frame = \"axis.txt\"",
        ),
        CHECK,
        3,
        &["axis.txt"],
    ),
    (
        Edit(TOML, "images =", "times = \"times.txt\"\nimages ="),
        CHECK,
        3,
        &["times.txt"],
    ),
    (
        WriteAndEdit(
            "times.txt",
            b"0\n1\n",
            TOML,
            "images =",
            "times = \"times.txt\"\nimages =",
        ),
        CHECK,
        3,
        &["times.txt", "2", "3"],
    ),
    // The calibration.
    (Remove(CAMERA), REFINE, 3, &["camera.json", "cannot read"]),
    (Write(CAMERA, b""), REFINE, 3, &["camera.json:1:"]),
    (Halve(CAMERA), REFINE, 3, &["camera.json:", "EOF"]),
    (
        Write(CAMERA, b"\xff\xd8\xff\xe0\0\x10JFIF"),
        REFINE,
        3,
        &["camera.json", "no text of UTF-8"],
    ),
    (
        Edit(CAMERA, "\"fx\"", "\"gx\""),
        REFINE,
        3,
        &["camera.json:", "unknown field `gx`"],
    ),
    (
        Edit(CAMERA, "\"fx\": 311", "\"fx\": -311"),
        REFINE,
        3,
        &["camera.json", "fx is -311"],
    ),
    (
        Edit(CAMERA, "\"fx\":", "\"fx\": \"wide\", \"max_angle_deg\":"),
        REFINE,
        3,
        &["camera.json:", "wide"],
    ),
    (
        Edit(CAMERA, "\"width\": 480", "\"width\": 4"),
        REFINE,
        3,
        &["camera.json", "16"],
    ),
    (
        Edit(CAMERA, "\"width\": 480", "\"width\": 500"),
        REFINE,
        3,
        &["frame ", "480 × 360", "500 × 360"],
    ),
    (
        Edit(CAMERA, "{", "{\"k1\": -5,"),
        REFINE,
        3,
        &["camera.json", "folds"],
    ),
    (
        Edit(CAMERA, "{", "{\"k1\": NaN,"),
        REFINE,
        3,
        &["camera.json:1:"],
    ),
    (
        Edit(CAMERA, "\"pinhole\"", "\"mirror\""),
        REFINE,
        3,
        &["camera.json:", "mirror", "pinhole"],
    ),
    (
        WriteAndEdit(
            "c.yaml",
            b"camera_matrix: [1, 2]\n",
            TOML,
            "camera.json",
            "c.yaml",
        ),
        CHECK,
        3,
        &["c.yaml", "3 × 3"],
    ),
    (
        WriteAndEdit("c.yaml", b"a: [1, 2\n", TOML, "camera.json", "c.yaml"),
        CHECK,
        3,
        &["c.yaml", "YAML"],
    ),
    (
        WriteAndEdit(
            "c.yaml",
            b"cam0:\n  camera_model: bal\n",
            TOML,
            "camera.json",
            "c.yaml",
        ),
        CHECK,
        3,
        &["c.yaml", "bal"],
    ),
    (
        WriteAndEdit(
            "c.txt",
            b"1 FULL_FOV 480 360 1 1 1 1 1\n",
            TOML,
            "camera.json",
            "c.txt",
        ),
        CHECK,
        3,
        &["c.txt:1:", "FULL_FOV"],
    ),
    (
        WriteAndEdit(
            "c.txt",
            b"1 PINHOLE 480 360 1 1 1 1\n2 PINHOLE 480 360 1 1 1 2\n",
            TOML,
            "camera.json",
            "c.txt",
        ),
        CHECK,
        3,
        &["c.txt", "several cameras (1, 2)", "name"],
    ),
    (
        WriteAndEdit(
            "t.json",
            b"{\"frames\": [], \"w\": 480}",
            TOML,
            "camera.json",
            "t.json",
        ),
        CHECK,
        3,
        &["t.json", "fl_x"],
    ),
    // Poses.
    (Remove(POSES), REFINE, 3, &["baseline.tum"]),
    (Write(POSES, b""), REFINE, 3, &["baseline.tum", "no poses"]),
    (
        Write(POSES, b"# time tx ty tz qx qy qz qw\n"),
        REFINE,
        3,
        &["baseline.tum", "no poses"],
    ),
    (
        Write(POSES, b"\x00\x01\x02\xff"),
        REFINE,
        3,
        &["baseline.tum"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2", "qw"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 zero 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2", "zero"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 nan 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 inf 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n"),
        REFINE,
        3,
        &["baseline.tum:2", "quaternion"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2"],
    ),
    (
        Write(POSES, b"1 0 0 0 0 0 0 1\n0 0 0 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum:2"],
    ),
    (
        Write(POSES, b"0 0 0 0 0 0 0 1\n"),
        REFINE,
        3,
        &["baseline.tum", "1 pose", "3 frames"],
    ),
    (
        Write(
            POSES,
            b"0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n",
        ),
        REFINE,
        3,
        &["baseline.tum", "4 poses", "3 frames"],
    ),
    (
        Write(
            POSES,
            b"0 0 0 0 0 0 0 1\n1 9 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n",
        ),
        REFINE,
        3,
        &["baseline.tum", "frame 1", "outside the tunnel"],
    ),
    (
        WriteAndEdit("p.csv", b"time,x,y\n0,0,0\n", TOML, "baseline.tum", "p.csv"),
        CHECK,
        3,
        &["p.csv:1"],
    ),
    (
        WriteAndEdit(
            "p.json",
            b"{\"frames\": [{\"file_path\": \"a\"",
            TOML,
            "baseline.tum",
            "p.json",
        ),
        CHECK,
        3,
        &["p.json"],
    ),
    (
        WriteAndEdit(
            "p.json",
            b"{\"frames\": [{\"file_path\": \"000000.jpg\", \"transform_matrix\": [[1]]}]}",
            TOML,
            "baseline.tum",
            "p.json",
        ),
        CHECK,
        3,
        &["p.json"],
    ),
    (
        WriteAndEdit(
            "k.txt",
            b"1 0 0 0 0 1 0 0 0 0 1\n",
            TOML,
            "baseline.tum",
            "k.txt",
        ),
        CHECK,
        3,
        &["k.txt:1"],
    ),
    (
        WriteAndEdit(
            "k.txt",
            b"2 0 0 0 0 2 0 0 0 0 2 0\n",
            TOML,
            "baseline.tum",
            "k.txt",
        ),
        CHECK,
        3,
        &["k.txt:1"],
    ),
    (
        Edit(TOML, "baseline.tum", "frames"),
        CHECK,
        3,
        &["images.txt"],
    ),
    (
        WriteAndEdit(
            "e.csv",
            b"#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1403636580838555648,0,0,0,1,0,0,0\n",
            TOML,
            "baseline.tum",
            "e.csv",
        ),
        CHECK,
        3,
        &["e.csv", "--body-to-camera"],
    ),
    // Frames.
    (
        Remove("frames/000001.jpg"),
        REFINE,
        3,
        &["baseline.tum", "3 poses", "2 frames"],
    ),
    (
        Halve("frames/000001.jpg"),
        REFINE,
        3,
        &["frame 1", "000001.jpg", "truncated"],
    ),
    (
        Write("frames/000001.jpg", b""),
        REFINE,
        3,
        &["frame 1", "000001.jpg"],
    ),
    (
        Write("frames/000001.jpg", b"no picture"),
        STITCH,
        3,
        &["frame 1", "000001.jpg"],
    ),
    (
        Write("frames/000002.jpg", b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"),
        STITCH,
        3,
        &["frame 2", "000002.jpg"],
    ),
    // Other files, and commands.
    (
        None,
        "stitch S --poses nowhere.tum --out O.png",
        3,
        &["nowhere.tum"],
    ),
    (
        Write("few.tum", b"0 0 0 0 0 0 0 1\n"),
        "compare S --refined S/few.tum --out O",
        3,
        &["few.tum", "3 frames"],
    ),
    (
        Write("covariance.csv", b"frame\n0\n"),
        "stitch S --covariance S/covariance.csv --maps O.maps --out O.png",
        3,
        &["covariance.csv"],
    ),
    (None, "stitch S --out O.bmp", 2, &["O.bmp"]),
    (
        None,
        "stitch S --out S/survey.toml.png/x.png --memory 1KiB",
        2,
        &["memory"],
    ),
    (
        None,
        "stitch S --out O.png --px-per-metre=-1",
        2,
        &["--px-per-metre"],
    ),
    (
        None,
        "stitch S --out O.png --memory 20MiB --px-per-metre 2000",
        3,
        &["--memory"],
    ),
    (None, "refine S --out O --threads 0", 2, &["--threads"]),
    (None, "refine S --out S/camera.json", 3, &["camera.json"]),
    (None, "locate S --frame 000009.jpg,1,1", 2, &["000009.jpg"]),
    (
        None,
        "locate S --frame 000001.jpg,900,1",
        2,
        &["900", "479"],
    ),
    (None, "locate S --clock 1,99:99", 2, &["--clock"]),
    (
        None,
        "convert S --to tum --out S/baseline.tum",
        2,
        &["baseline.tum"],
    ),
    (
        None,
        "simulate free --camera S/survey.toml --out O",
        3,
        &["survey.toml"],
    ),
    (
        None,
        "project S/baseline.tum --out O.png",
        3,
        &["baseline.tum"],
    ),
    (None, "refine", 2, &["Usage"]),
];

fn break_up(folder: &Path, damage: &Damage) {
    let edit = |name: &str, from: &str, to: &str| support::edit(&folder.join(name), from, to);
    match damage {
        Write(name, content) => std::fs::write(folder.join(name), content).unwrap(),
        Edit(name, from, to) => edit(name, from, to),
        Halve(name) => {
            let content = std::fs::read(folder.join(name)).unwrap();
            std::fs::write(folder.join(name), &content[..content.len() / 2]).unwrap();
        }
        Remove(name) => std::fs::remove_file(folder.join(name)).unwrap(),
        WriteAndEdit(file, content, name, from, to) => {
            std::fs::write(folder.join(file), content).unwrap();
            edit(name, from, to);
        }
        None => {}
    }
}

#[test]
fn every_broken_input_is_named_and_leaves_nothing_behind() {
    assert!(ROWS.len() >= 60);
    let mut wrong = Vec::new();
    for (number, (damage, command, code, parts)) in ROWS.iter().enumerate() {
        let survey = first_frames(3);
        let out = tempfile::tempdir().unwrap();
        break_up(survey.path(), damage);
        let name = out.path().join("O");
        let words: Vec<String> = command
            .split(' ')
            .map(|word| {
                let word = word.strip_prefix('S').map_or(word.to_owned(), |rest| {
                    text(survey.path()).to_owned() + rest
                });
                word.strip_prefix('O')
                    .map_or(word.clone(), |rest| text(&name).to_owned() + rest)
            })
            .collect();
        let words: Vec<&str> = words.iter().map(String::as_str).collect();
        let output = tunnelstitch(&words);
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        let missing: Vec<_> = parts
            .iter()
            .filter(|part| !message.contains(**part))
            .collect();
        let left: Vec<_> = std::fs::read_dir(out.path())
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| !path.is_dir() || path.read_dir().unwrap().next().is_some())
            .collect();
        let panicked = message.contains("panicked") || message.contains("bug in");
        if output.status.code() != Some(*code)
            || !missing.is_empty()
            || !left.is_empty()
            || panicked
        {
            wrong.push(format!(
                "row {number}, {command}: exit {:?} for {code}, missing {missing:?}, left \
                 {left:?}: {message}",
                output.status.code()
            ));
        }
    }
    assert!(
        wrong.is_empty(),
        "{} rows:\n{}",
        wrong.len(),
        wrong.join("\n")
    );
}
