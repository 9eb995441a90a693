//! Tables of angles, lost poses and stacks of pictures: read, or named with what to do.

use crate::support::{edit, fail, first_frames, simulate, succeed, text, tunnelstitch};
use nalgebra::UnitQuaternion;
use serde_json::Value;
use std::path::Path;
use tiff::encoder::{TiffEncoder, colortype};
use tunnelstitch::trajectory::{StampedPose, tum};

/// Roll, pitch and yaw of a frame, degrees.
fn angles_deg(frame: usize) -> [f64; 3] {
    let k = frame as f64;
    [5.0 + k, 10.0 - k, 30.0 * k]
}

/// The positions of the survey with these angles, as a CSV.
fn table_of_angles(survey: &Path) -> String {
    let mut table = "frame,tx,ty,tz,roll,pitch,yaw\n".to_owned();
    let poses = tum::read(&survey.join("baseline.tum")).unwrap();
    for (k, stamped) in poses.iter().enumerate() {
        let ([roll, pitch, yaw], t) = (angles_deg(k), stamped.pose.t_wc);
        table += &format!("{k}.jpg,{},{},{},{roll},{pitch},{yaw}\n", t.x, t.y, t.z);
    }
    table
}

#[test]
fn angles_are_read_with_the_lines_that_the_error_names() {
    let survey = first_frames(4);
    let dir = survey.path();
    std::fs::write(dir.join("angles.csv"), table_of_angles(dir)).unwrap();
    let toml = dir.join("survey.toml");
    edit(&toml, "baseline.tum", "angles.csv");
    let refused = fail(&["check", text(dir)], 3);
    let lines = "write euler = \"ZYX\" and angle_unit = \"deg\" (or \"rad\") in [poses]";
    assert!(
        refused.contains("angles.csv:1: ") && refused.contains(lines),
        "{refused}"
    );
    edit(
        &toml,
        "[poses]",
        "[poses]\nassociate = \"order\"\neuler = \"ZYX\"",
    );
    let refused = fail(&["check", text(dir)], 3);
    assert!(
        refused.contains("angle_unit = \"deg\" or \"rad\""),
        "{refused}"
    );
    edit(&toml, "[poses]", "[poses]\nangle_unit = \"deg\"");
    let read = |flags: &[&str]| {
        let out = dir.join("read.tum");
        let convert = ["convert", text(dir), "--poses", "initial", "--to", "tum"];
        succeed(&[&convert[..], &["--out", text(&out)], flags].concat());
        tum::read(&out).unwrap()
    };
    let largest = |read: &[StampedPose]| {
        let off = |(k, stamped): (usize, &StampedPose)| {
            let [roll, pitch, yaw] = angles_deg(k).map(f64::to_radians);
            let expected = UnitQuaternion::from_euler_angles(roll, pitch, yaw);
            stamped.pose.r_wc.angle_to(&expected)
        };
        read.iter().enumerate().map(off).fold(0.0, f64::max)
    };
    assert!(largest(&read(&[])) < 1e-9);
    assert!(largest(&read(&["--pose-euler", "xyz"])) < 1e-9);
    assert!(largest(&read(&["--pose-euler", "XYZ"])) > 0.01);
    let refused = fail(&["check", text(dir), "--pose-euler", "ZXZ"], 2);
    assert!(refused.contains("X, Y and Z once each"), "{refused}");
}

/// A tracker that writes the identity where it has lost the camera.
#[test]
fn poses_that_fall_to_the_origin_are_named_with_their_frames() {
    let survey = first_frames(8);
    let dir = survey.path();
    let warnings = || -> String {
        let said = succeed(&["check", text(dir), "--json"]);
        let check: Value = serde_json::from_str(&said).unwrap();
        check["warnings"].to_string()
    };
    assert!(!warnings().contains("origin"), "{}", warnings());
    let file = dir.join("baseline.tum");
    let text_of = std::fs::read_to_string(&file).unwrap();
    let lost = |(k, line): (usize, &str)| {
        let time = line.split_whitespace().next().unwrap();
        match k {
            5 | 6 => format!("{time} 0 0 0 0 0 0 1\n"),
            _ => format!("{line}\n"),
        }
    };
    let lines = text_of.lines().filter(|line| !line.starts_with('#'));
    let changed: String = lines.clone().enumerate().map(lost).collect();
    std::fs::write(&file, changed).unwrap();
    let said = warnings();
    assert!(
        said.contains("poses fall back to the origin amid others, those of frames 5 to 6; "),
        "{said}"
    );
    let refined = tunnelstitch(&["refine", text(dir), "--out", text(&dir.join("r"))]);
    let said = String::from_utf8_lossy(&refined.stderr).into_owned();
    assert!(
        said.contains("poses fall back to the origin amid others, those of frames 5 to 6; "),
        "{said}"
    );
    let zeros = lines.map(|line| {
        let time = line.split_whitespace().next().unwrap();
        format!("{time} 0 0 0 0 0 0 0\n")
    });
    std::fs::write(&file, zeros.collect::<String>()).unwrap();
    let refused = fail(&["check", text(dir)], 3);
    assert!(refused.contains("lost the camera"), "{refused}");
}

#[test]
fn a_stack_of_pictures_is_refused_with_the_command_that_splits_it() {
    let survey = first_frames(4);
    let dir = survey.path();
    let stack = std::fs::File::create(dir.join("stack.tif")).unwrap();
    let mut encoder = TiffEncoder::new(stack).unwrap();
    for grey in 0..4u8 {
        let page = vec![grey; 480 * 360];
        encoder
            .write_image::<colortype::Gray8>(480, 360, &page)
            .unwrap();
    }
    drop(encoder);
    edit(&dir.join("survey.toml"), "frames/*.jpg", "stack.tif");
    let refused = fail(&["check", text(dir)], 3);
    let expected = "stack.tif: a TIFF file of 4 pages";
    assert!(refused.contains(expected), "{refused}");
    assert!(
        refused.contains("`convert stack.tif frame-%06d.png`"),
        "{refused}"
    );
}

/// Degrees that are declared as radians: only the pictures tell.
#[test]
fn angles_in_the_other_unit_are_named_by_the_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let survey = folder.path().join("survey");
    let motion = ["--frames", "16", "--turn-deg", "20", "--advance-m", "0.05"];
    simulate(&survey, &[&motion[..], &["--size", "160x120"]].concat());
    let mut table = "tx,ty,tz,roll,pitch,yaw\n".to_owned();
    for stamped in tum::read(&survey.join("baseline.tum")).unwrap() {
        let (roll, pitch, yaw) = stamped.pose.r_wc.euler_angles();
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
        let t = stamped.pose.t_wc;
        table += &format!("{},{},{},{roll},{pitch},{yaw}\n", t.x, t.y, t.z);
    }
    std::fs::write(survey.join("angles.csv"), table).unwrap();
    let toml = survey.join("survey.toml");
    let lines = "initial = \"angles.csv\"\neuler = \"ZYX\"\nangle_unit = \"rad\"";
    edit(&toml, "truth = \"groundtruth.tum\"\n", "");
    edit(&toml, "initial = \"baseline.tum\"", lines);
    let readings = || -> Value {
        let said = succeed(&["check", text(&survey), "--json"]);
        let mut check: Value = serde_json::from_str(&said).unwrap();
        check["readings"]["readings"].take()
    };
    let expected = "angles in deg (angle_unit = \"deg\" under [poses])";
    assert_eq!(readings(), Value::from(vec![expected]));
    edit(&toml, "\"rad\"", "\"deg\"");
    assert_eq!(readings(), Value::Null);
}
