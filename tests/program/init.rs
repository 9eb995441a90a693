//! `init` on poses of structure from motion and on files that it leaves aside.

use crate::support::{fail, first_frames, text, tunnelstitch};
use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde_json::{Value, json};
use std::path::Path;
use tunnelstitch::trajectory::{CameraAxes, Pose, tum};

/// Runs the command; returns all that it prints.
fn init(folder: &Path, options: &[&str]) -> String {
    let output = tunnelstitch(&[&["init", text(folder)], options].concat());
    let said = [output.stdout, output.stderr].map(|text| String::from_utf8(text).unwrap());
    assert!(output.status.success(), "{said:?}");
    said.concat()
}

/// A survey without survey.toml whose camera looks along the tunnel, 10 cm a frame, with poses of
/// nerfstudio in a world that `frame` maps the tunnel to, four units a metre.
fn looking_along(frame: &Pose) -> tempfile::TempDir {
    let survey = first_frames(6);
    for name in ["survey.toml", "baseline.tum", "groundtruth.tum"] {
        std::fs::remove_file(survey.path().join(name)).unwrap();
    }
    let turn = UnitQuaternion::from_scaled_axis(-Vector3::x() * std::f64::consts::FRAC_PI_2);
    let entry = |k: u32| {
        let centre = Vector3::new(0.0, 0.1 * f64::from(k), 0.001 * f64::from(k % 2));
        let pose = CameraAxes::OpenGl.turn(&frame.after(&Pose::new(turn, centre)));
        let placed = Isometry3::from_parts((pose.t_wc * 4.0).into(), pose.r_wc);
        let matrix = placed.to_homogeneous();
        let rows: Vec<Vec<f64>> = matrix
            .row_iter()
            .map(|r| r.iter().copied().collect())
            .collect();
        json!({ "file_path": format!("./frames/{k:06}.jpg"), "transform_matrix": rows })
    };
    let frames: Vec<Value> = (0..6).map(entry).collect();
    let transforms = json!({ "frames": frames }).to_string();
    std::fs::write(survey.path().join("transforms.json"), transforms).unwrap();
    survey
}

/// Poses of a right model in a world of any axis and any scale: one length is asked for.
#[test]
fn the_axis_of_structure_from_motion_is_the_line_of_the_cameras() {
    let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
    let survey = looking_along(&Pose::new(rotation, Vector3::new(5.0, -3.0, 2.0)));
    let dir = survey.path();
    let said = init(dir, &["--radius-m", "3"]);
    for part in [
        "axis.json",
        "6 of 6 cameras",
        "without a scale",
        "--unit-m",
        "next: ",
    ] {
        assert!(said.contains(part), "no {part} in {said}");
    }
    assert!(!said.contains("--pose-convention"), "{said}");
    let refused = fail(
        &["init", text(dir), "--radius-m", "3", "--unit-m", "0.25"],
        3,
    );
    assert!(refused.contains("--force"), "{refused}");
    let said = init(dir, &["--radius-m", "3", "--unit-m", "0.25", "--force"]);
    assert!(
        !said.contains("scale") && !said.contains("warning"),
        "{said}"
    );
    let out = dir.join("read.tum");
    let convert = ["convert", text(dir), "--to", "tum", "--out", text(&out)];
    assert!(tunnelstitch(&convert).status.success());
    for (k, stamped) in tum::read(&out).unwrap().iter().enumerate() {
        let off = stamped.pose.t_wc - Vector3::y() * 0.1 * k as f64;
        assert!(off.norm() < 0.002, "frame {k} is off by {off}");
        // The camera looks along the tunnel, its upper edge towards θ = 0.
        let [ahead, up] = [Vector3::z(), -Vector3::y()].map(|axis| stamped.pose.r_wc * axis);
        assert!(ahead.y > 0.999 && up.z > 0.999, "frame {k}: {ahead} {up}");
    }
}

/// Poses in the frame of the tunnel need no axis, and an axis of the user's is not replaced.
#[test]
fn poses_in_the_tunnel_stay_as_they_are() {
    let survey = looking_along(&Pose::identity());
    let said = init(survey.path(), &["--radius-m", "3", "--unit-m", "0.25"]);
    assert!(!survey.path().join("axis.json").exists(), "{said}");
    assert!(
        said.contains("next: ") && !said.contains("warning"),
        "{said}"
    );
    let aside = looking_along(&Pose::new(UnitQuaternion::identity(), Vector3::x() * 4.0));
    let own = aside.path().join("axis.json");
    std::fs::write(&own, "{}").unwrap();
    let refused = fail(&["init", text(aside.path()), "--radius-m", "3"], 3);
    assert!(refused.contains("axis.json: exists already"), "{refused}");
    assert_eq!(std::fs::read_to_string(&own).unwrap(), "{}");
    assert!(!aside.path().join("survey.toml").exists());
}

/// Every file of the folder is taken or named with the reason.
#[test]
fn what_is_left_aside_is_named_with_the_reason() {
    let survey = first_frames(4);
    let dir = survey.path();
    let write = |name: &str, content: &str| std::fs::write(dir.join(name), content).unwrap();
    write("notes.txt", "Monday\n");
    write("short.tum", "0 0 0 0 0 0 0 1\n1 0 0 0.1 0 0 0\n");
    write("depth_0.npy", "");
    write("depth_1.npy", "");
    write("wall.laz", "");
    write("frame.json", r#"{"point_m": [0, 0, 0], "axis": [1, 0, 0]}"#);
    std::fs::copy(dir.join("camera.json"), dir.join("camera2.json")).unwrap();
    std::fs::create_dir_all(dir.join("a/b/c/d")).unwrap();
    let said = init(dir, &["--radius-m", "3", "--force"]);
    for part in [
        "camera2.json (480 × 360 px): one is enough",
        "no poses: line 1: in no known format\n",
        "short.tum: no poses: line 2: ",
        "*.npy (2): arrays of another program",
        "wall.laz: measured points: points = \"wall.laz\" under [tunnel]",
        "frame.json: a frame of reference: tunnel_frame = \"frame.json\" under [poses]",
        "a/b/c/d: not searched",
    ] {
        assert!(said.contains(part), "no {part} in {said}");
    }
    let output = tunnelstitch(&["init", text(dir), "--force", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let aside = report["left_aside"].as_array().unwrap();
    let npy = aside
        .iter()
        .find(|aside| aside["pattern"] == "*.npy")
        .unwrap();
    assert_eq!(npy["count"], 2, "{report}");
}

/// Folders named as no pattern should be, poses of converted frames on another system, and a folder
/// without poses.
#[test]
fn names_that_people_give_are_found_again() {
    let survey = first_frames(4);
    let dir = survey.path();
    let poses = std::fs::read_to_string(dir.join("baseline.tum")).unwrap();
    for name in ["survey.toml", "baseline.tum", "groundtruth.tum"] {
        std::fs::remove_file(dir.join(name)).unwrap();
    }
    std::fs::rename(dir.join("frames"), dir.join("photos [1]")).unwrap();
    let said = init(dir, &["--radius-m", "3"]);
    assert!(said.contains("initial poses   none found"), "{said}");
    assert!(said.contains("let tunnelstitch plan"), "{said}");
    let row = |(k, line): (usize, &str)| {
        let words: Vec<String> = line
            .split(' ')
            .skip(1)
            .map(|w| w.replace('.', ","))
            .collect();
        format!("C:\\Röhre\\{k:06}.PNG;{}\r\n", words.join(";"))
    };
    let rows: String = poses.lines().enumerate().map(row).collect();
    let table = format!("Image;x;y;z;qx;qy;qz;qw\r\n{rows}");
    // As a German spreadsheet saves it: ö is one byte.
    let bytes: Vec<u8> = table
        .chars()
        .map(|c| u8::try_from(u32::from(c)).unwrap())
        .collect();
    std::fs::write(dir.join("Posen.csv"), bytes).unwrap();
    let said = init(dir, &["--radius-m", "3", "--force"]);
    assert!(
        said.contains("next: ") && !said.contains("warning"),
        "{said}"
    );
    assert!(said.contains("photos [[]1[]]/*.jpg (4, "), "{said}");
}

/// Of pictures with different endings the largest group is taken, in any capitals, and the others
/// are named.
#[test]
fn other_pictures_beside_the_frames_are_named() {
    let survey = first_frames(5);
    let dir = survey.path();
    let frame = |name: &str| dir.join("frames").join(name);
    std::fs::rename(frame("000001.jpg"), frame("000001.JPG")).unwrap();
    let last = image::open(frame("000004.jpg")).unwrap();
    last.save(frame("000004.png")).unwrap();
    std::fs::remove_file(frame("000004.jpg")).unwrap();
    let said = init(dir, &["--radius-m", "3", "--force"]);
    for part in [
        "frames          frames/*.[jJ][pP][gG] (4, ",
        "other pictures  frames/*.png (1, ",
        "images = \"frames/*.png\" under [frames] takes this",
        "warning: frames/*.png (1) are left aside, beside the frames",
    ] {
        assert!(said.contains(part), "no {part} in {said}");
    }
    let output = tunnelstitch(&["init", text(dir), "--force", "--json"]);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["other_pictures"], json!(["frames/*.png"]));
}
