//! Folders as people have them: pictures that were made smaller, poses of their own programs, of
//! keyframes and of tables in other languages, and times in pictures alone.

use crate::support::{edit, fail, first_frames, succeed, text, tunnelstitch};
use serde_json::{Value, json};
use std::path::Path;
use tunnelstitch::trajectory::{StampedPose, tum};

const FRAMES: usize = 8;
/// The time of the first frame, seconds since 1970: 2026-11-25, 08:47:38 UTC.
const START_S: u64 = 1_795_596_458;

/// All that `init` prints in a folder of frames, a calibration and these poses.
fn init(folder: &Path) -> String {
    for name in ["survey.toml", "groundtruth.tum", "baseline.tum"] {
        let _ = std::fs::remove_file(folder.join(name));
    }
    let output = tunnelstitch(&["init", text(folder), "--radius-m", "3"]);
    assert!(output.status.success());
    String::from_utf8([output.stdout, output.stderr].concat()).unwrap()
}

fn baseline(folder: &Path) -> Vec<StampedPose> {
    tum::read(&folder.join("baseline.tum")).unwrap()
}

fn checked(folder: &Path) -> Value {
    serde_json::from_str(&succeed(&["check", text(folder), "--json"])).unwrap()
}

fn warnings(check: &Value) -> String {
    check["warnings"].to_string()
}

/// The initial poses as the program reads them are those given, by their order.
fn assert_read(folder: &Path, given: &[StampedPose]) {
    let out = folder.join("read.tum");
    let to = ["--poses", "initial", "--to", "tum", "--out"];
    succeed(&[&["convert", text(folder)], &to[..], &[text(&out)]].concat());
    let read = tum::read(&out).unwrap();
    assert_eq!(read.len(), given.len());
    for (read, given) in read.iter().zip(given) {
        assert!(read.pose.local(&given.pose).norm() < 1e-6);
    }
}

#[test]
fn a_calibration_of_larger_pictures_is_scaled_to_the_frames() {
    let survey = first_frames(FRAMES);
    let dir = survey.path();
    let path = dir.join("camera.json");
    let mut camera: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
    let twice = |camera: &mut Value, key: &str, half: f64| {
        let value = camera[key].as_f64().unwrap();
        camera[key] = json!(2.0 * (value + half) - half);
    };
    for (key, half) in [("fx", 0.0), ("fy", 0.0), ("cx", 0.5), ("cy", 0.5)] {
        twice(&mut camera, key, half);
    }
    let right = checked(dir);
    assert!(right["px_per_metre"].is_number(), "{right}");
    for (width, is_scaled) in [(960, true), (500, false)] {
        camera["width"] = json!(width);
        camera["height"] = json!(width * 3 / 4);
        std::fs::write(&path, camera.to_string()).unwrap();
        if is_scaled {
            let scaled = checked(dir);
            assert_eq!(scaled["px_per_metre"], right["px_per_metre"]);
            let said = warnings(&scaled);
            assert!(said.contains("is scaled by 0.5000 with them"), "{said}");
        } else {
            // By little: it may have been cropped.
            let said = fail(&["check", text(dir)], 3);
            assert!(said.contains("480 × 360 px, not 500 × 375 px"), "{said}");
        }
    }
    camera["width"] = json!(960);
    camera["height"] = json!(720);
    std::fs::write(&path, camera.to_string()).unwrap();
    std::fs::copy(dir.join("baseline.tum"), dir.join("poses.tum")).unwrap();
    let said = init(dir);
    assert!(
        said.contains("960 × 720 px): it is scaled to the frames' size"),
        "{said}"
    );
}

#[test]
fn poses_in_json_of_ones_own_are_found_and_read() {
    let survey = first_frames(FRAMES);
    let dir = survey.path();
    let given = baseline(dir);
    let entry = |(k, stamped): (usize, &StampedPose)| {
        let pose = &stamped.pose;
        let (t, q) = (pose.t_wc.as_slice(), pose.r_wc.coords.as_slice());
        json!({ "image": format!("{k:06}.jpg"), "position": t, "orientation": q })
    };
    let poses: Vec<Value> = given.iter().enumerate().map(entry).rev().collect();
    std::fs::write(dir.join("path.json"), json!({ "poses": poses }).to_string()).unwrap();
    let said = init(dir);
    assert!(said.contains("path.json (Json, 8 poses)"), "{said}");
    assert!(said.contains("next: tunnelstitch check"), "{said}");
    assert_read(dir, &given);
}

#[test]
fn a_table_with_titles_in_another_language_is_named_with_its_columns() {
    let survey = first_frames(FRAMES);
    let dir = survey.path();
    let given = baseline(dir);
    let mut table = "Bild;Rechtswert;Hochwert;Höhe;a;b;c;d\n".to_owned();
    for (k, stamped) in given.iter().enumerate() {
        let (t, q) = (stamped.pose.t_wc, stamped.pose.r_wc.coords);
        let numbers = t
            .iter()
            .chain(q.iter())
            .map(|v| format!("{v:.9}").replace('.', ","));
        table += &format!("{k:06}.jpg;{}\n", numbers.collect::<Vec<_>>().join(";"));
    }
    std::fs::write(dir.join("Posen.csv"), table).unwrap();
    let said = init(dir);
    assert!(
        said.contains("columns (`Bild`, `Rechtswert`, `Hochwert`, `Höhe`, `a`"),
        "{said}"
    );
    // There is no file of poses yet, and that is what is said.
    let said = fail(&["check", text(dir)], 3);
    assert!(
        said.contains("there is no such file of initial poses"),
        "{said}"
    );
    let columns = "{ frame = \"Bild\", tx = \"Rechtswert\", ty = \"Hochwert\", tz = \"Höhe\", \
                   qx = \"a\", qy = \"b\", qz = \"c\", qw = \"d\" }";
    edit(
        &dir.join("survey.toml"),
        "initial = \"baseline.tum\"",
        &format!("initial = \"Posen.csv\"\ncolumns = {columns}"),
    );
    assert_read(dir, &given);
}

/// Poses at the times of some frames, half a second apart.
fn write_keyframes(folder: &Path, poses: &[StampedPose], of: &[usize]) {
    let line = |k: &usize| {
        let (t, q) = (poses[*k].pose.t_wc, poses[*k].pose.r_wc.coords);
        let time_ns = START_S * 1_000_000_000 + *k as u64 * 500_000_000;
        let numbers = t.iter().chain(q.iter()).map(|v| format!(" {v:.9}"));
        format!("{time_ns}{}\n", numbers.collect::<String>())
    };
    let lines: String = of.iter().map(line).collect();
    std::fs::write(folder.join("KeyFrameTrajectory.txt"), lines).unwrap();
}

#[test]
fn frames_between_keyframes_start_between_their_poses() {
    let survey = first_frames(FRAMES);
    let dir = survey.path();
    let given = baseline(dir);
    for k in 0..FRAMES {
        let name = format!("frames/{}.{}.jpg", START_S + k as u64 / 2, 5 * (k % 2));
        std::fs::rename(dir.join(format!("frames/{k:06}.jpg")), dir.join(name)).unwrap();
    }
    write_keyframes(dir, &given, &[0, 1, 3, 5, 7]);
    let said = init(dir);
    assert!(said.contains("next: tunnelstitch check"), "{said}");
    let said = warnings(&checked(dir));
    assert!(said.contains("no pose of frame 2 ("), "{said}");
    // Too few: the lines that the error names interpolate.
    write_keyframes(dir, &given, &[0, 3, 7]);
    let said = fail(&["check", text(dir)], 3);
    let lines = "interpolate = true and time_tolerance_s = 1";
    assert!(said.contains(lines), "{said}");
    let lines = lines.replace(" and ", "\n");
    edit(
        &dir.join("survey.toml"),
        "[prior]",
        &format!("{lines}\n\n[prior]"),
    );
    checked(dir);
}

/// A JPEG with the time of its exposure.
fn with_exif(jpeg: &[u8], time: &str, decimals: &str) -> Vec<u8> {
    let entry = |tag: u16, kind: u16, count: u32, value: [u8; 4]| {
        [
            &tag.to_le_bytes()[..],
            &kind.to_le_bytes(),
            &count.to_le_bytes(),
            &value,
        ]
        .concat()
    };
    let directory = |entries: &[Vec<u8>]| {
        let count = u16::try_from(entries.len()).unwrap().to_le_bytes();
        [&count[..], &entries.concat(), &[0; 4]].concat()
    };
    let mut inline = [0; 4];
    inline[..decimals.len()].copy_from_slice(decimals.as_bytes());
    let first = directory(&[entry(0x8769, 4, 1, 26u32.to_le_bytes())]);
    let second = directory(&[
        entry(0x9003, 2, 20, 56u32.to_le_bytes()),
        entry(0x9291, 2, decimals.len() as u32 + 1, inline),
    ]);
    let tiff = [
        &b"II*\0\x08\0\0\0"[..],
        &first,
        &second,
        time.as_bytes(),
        b"\0",
    ]
    .concat();
    let length = u16::try_from(tiff.len() + 8).unwrap().to_be_bytes();
    [
        &jpeg[..2],
        &[0xff, 0xe1],
        &length,
        b"Exif\0\0",
        &tiff,
        &jpeg[2..],
    ]
    .concat()
}

#[test]
fn pictures_have_the_times_of_their_exif_data() {
    let survey = first_frames(FRAMES);
    let dir = survey.path();
    let given = baseline(dir);
    for k in 0..FRAMES {
        let path = dir.join(format!("frames/{k:06}.jpg"));
        let time = format!("2026:11:25 08:47:{}", 38 + k / 2);
        let jpeg = with_exif(&std::fs::read(&path).unwrap(), &time, ["0", "5"][k % 2]);
        std::fs::write(&path, jpeg).unwrap();
    }
    // There are more poses than frames.
    let twice: Vec<StampedPose> = given.iter().chain(&given).copied().collect();
    write_keyframes(dir, &twice, &(0..2 * FRAMES).collect::<Vec<_>>());
    let said = init(dir);
    assert!(said.contains("next: tunnelstitch check"), "{said}");
    assert_read(dir, &given);
}
