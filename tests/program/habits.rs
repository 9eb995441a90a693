//! Habits of people and programs: streams, folders, copies, clocks and axes.

use crate::support::{edit, fail, first_frames, simulate, succeed, text, tunnelstitch, with_input};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::path::Path;

use tunnelstitch::trajectory::{Pose, StampedPose, tum};

/// All that `init` prints, and its survey.toml.
fn init(folder: &Path) -> (String, String) {
    for name in ["survey.toml", "groundtruth.tum"] {
        let _ = std::fs::remove_file(folder.join(name));
    }
    let output = tunnelstitch(&["init", text(folder), "--radius-m", "3"]);
    assert!(output.status.success());
    let said = String::from_utf8([output.stdout, output.stderr].concat()).unwrap();
    let toml = std::fs::read_to_string(folder.join("survey.toml")).unwrap();
    (said, toml)
}

/// Replaces the initial poses by others of the same times.
fn change_poses(survey: &Path, change: impl Fn(&Pose) -> Pose) {
    let path = survey.join("baseline.tum");
    let changed = tum::read(&path).unwrap().into_iter();
    let changed: Vec<StampedPose> = changed
        .map(|stamped| StampedPose {
            pose: change(&stamped.pose),
            ..stamped
        })
        .collect();
    std::fs::write(&path, tum::format(&changed)).unwrap();
}

/// Poses, points of a plan and logs of gyros come out of a pipe as out of a file.
#[test]
fn files_may_come_from_standard_input() {
    let survey = first_frames(4);
    let dir = survey.path();
    let poses = std::fs::read_to_string(dir.join("groundtruth.tum")).unwrap();
    let convert = |poses: &'static str| {
        let to = ["--to", "kitti", "--out", "-", "--poses"];
        [&["convert", text(dir)], &to[..], &[poses]]
            .concat()
            .join("\n")
    };
    let run = |line: &str, input: &str| with_input(&line.split('\n').collect::<Vec<_>>(), input);
    let (piped, read) = (run(&convert("-"), &poses), run(&convert("truth"), ""));
    assert!(piped.status.success() && !piped.stdout.is_empty());
    assert_eq!(piped.stdout, read.stdout);
    let bad = run(&convert("-"), "0 0 0 0 0 0 0 1\n1 x 0 0 0 0 0 1\n");
    let said = String::from_utf8(bad.stderr).unwrap();
    assert!(
        said.contains("standard input:2: `x` is not a number"),
        "{said}"
    );

    let plan = ["plan", text(dir), "--out", "-", "--table", "-"];
    let table = "frame,chainage_m,angle_deg\n0,0,0\n3,0.3,90\n";
    assert!(with_input(&plan, table).status.success());
    let gyro = ["gyro", "-", "--frames", "3", "--fps", "3", "--out", "-"];
    let said = String::from_utf8(with_input(&gyro, "x\n").stderr).unwrap();
    assert!(
        said.contains("standard input:1: `x` where a gcsv log"),
        "{said}"
    );
    // A survey of others does not read it.
    edit(&dir.join("survey.toml"), "baseline.tum", "/dev/stdin");
    let check = with_input(&["check", text(dir)], &poses);
    assert_eq!(check.status.code(), Some(3));
}

/// Cameras and people divide a sequence by dates; the poses tell that it is one.
#[test]
fn init_joins_folders_that_have_as_many_pictures_as_there_are_poses() {
    let survey = first_frames(6);
    let dir = survey.path();
    for k in 0..6 {
        let folder = format!("frames/2026-11-2{}", k / 4);
        std::fs::create_dir_all(dir.join(&folder)).unwrap();
        let [from, to] = ["frames", &folder].map(|f| dir.join(format!("{f}/{k:06}.jpg")));
        std::fs::rename(from, to).unwrap();
    }
    let (said, toml) = init(dir);
    assert!(toml.contains("images = \"frames/*/*.jpg\""), "{toml}");
    assert!(said.contains("next: tunnelstitch check"), "{said}");
}

#[test]
fn pictures_that_are_no_frames_are_named() {
    let survey = first_frames(4);
    let dir = survey.path();
    std::fs::copy(
        dir.join("frames/000002.jpg"),
        dir.join("frames/000002 (1).jpg"),
    )
    .unwrap();
    let small = image::GrayImage::new(12, 9);
    small.save(dir.join("frames/000001_thumb.jpg")).unwrap();
    let said = fail(&["check", text(dir)], 3);
    for part in [
        "000001_thumb.jpg: 12 × 9 px",
        "000002 (1).jpg of 000002.jpg",
        "move them",
    ] {
        assert!(said.contains(part), "no {part} in {said}");
    }
    std::fs::remove_dir_all(dir.join("frames")).unwrap();
    std::fs::write(dir.join("frames.zip"), "PK").unwrap();
    let said = fail(&["init", text(dir), "--force"], 3);
    assert!(
        said.contains("frames.zip (1): an archive: unpack it"),
        "{said}"
    );
}

/// A table of poses and a calibration with a fault are named as what keeps a survey from being
/// ready, rather than passed over.
#[test]
fn init_names_faults_of_files_that_it_recognised() {
    let survey = first_frames(3);
    let dir = survey.path();
    std::fs::remove_file(dir.join("baseline.tum")).unwrap();
    std::fs::write(
        dir.join("poses.csv"),
        "tx,ty,tz,roll,pitch,yaw\n0,0,0,0,0,0\n",
    )
    .unwrap();
    let camera = std::fs::read_to_string(dir.join("camera.json")).unwrap();
    let mut camera: serde_json::Value = serde_json::from_str(&camera).unwrap();
    camera["fx"] = 5.2.into();
    std::fs::write(dir.join("camera.json"), camera.to_string()).unwrap();
    let (said, _) = init(dir);
    let lines = "write euler = \"ZYX\" and angle_unit = \"deg\" (or \"rad\") in [poses]";
    assert!(
        said.contains("poses.csv:1: ") && said.contains(lines),
        "{said}"
    );
    assert!(
        said.contains("camera.json is not used, and a pinhole is guessed"),
        "{said}"
    );
    // The lines of the message are all that is missing.
    let toml = dir.join("survey.toml");
    let written = std::fs::read_to_string(&toml).unwrap();
    assert!(written.contains("initial = \"poses.csv\""), "{written}");
    let table = "tx,ty,tz,roll,pitch,yaw\n0,0,0,0,0,0\n0,0.1,0,0,20,0\n0,0.2,0,0,40,0\n";
    std::fs::write(dir.join("poses.csv"), table).unwrap();
    let angles = "[poses]\neuler = \"ZYX\"\nangle_unit = \"deg\"\n";
    std::fs::write(&toml, written.replace("[poses]\n", angles)).unwrap();
    let poses = succeed(&["convert", text(dir), "--to", "tum", "--out", "-"]);
    assert_eq!(poses.lines().count(), 3, "{poses}");
}

#[test]
fn clocks_of_other_zones_are_told_and_mended() {
    let survey = first_frames(4);
    let dir = survey.path();
    let lines: Vec<String> = (0..4).map(|k| format!("{}", 1_700_007_200 + k)).collect();
    std::fs::write(dir.join("times.txt"), lines.join("\n")).unwrap();
    let poses = std::fs::read_to_string(dir.join("baseline.tum")).unwrap();
    let dated = |(k, line): (usize, &str)| {
        let (_, pose) = line.split_once(' ').unwrap();
        format!("2023-11-14T22:13:2{k}Z {pose}\n")
    };
    let poses: String = poses.lines().enumerate().map(dated).collect();
    std::fs::write(dir.join("baseline.tum"), poses).unwrap();
    let toml = dir.join("survey.toml");
    let text_of = std::fs::read_to_string(&toml).unwrap();
    let without_truth: Vec<&str> = text_of
        .lines()
        .filter(|line| !line.starts_with("truth"))
        .collect();
    std::fs::write(&toml, without_truth.join("\n")).unwrap();
    edit(&toml, "[frames]", "[frames]\ntimes = \"times.txt\"");
    edit(&toml, "[poses]", "[poses]\nassociate = \"time\"");
    let convert = ["convert", text(dir), "--to", "tum", "--out", "-"];
    let said = fail(&convert, 3);
    assert!(said.contains("2 h 0 min 0 s ahead"), "{said}");
    assert!(
        said.contains("time_offset_s = 7200 under [poses]"),
        "{said}"
    );
    edit(&toml, "[poses]", "[poses]\ntime_offset_s = 7200");
    assert!(succeed(&convert).starts_with("1700007200 "));
}

/// A table whose column `frame` counts them.
#[test]
fn counters_in_the_column_of_names_are_the_order_of_frames() {
    let survey = first_frames(4);
    let dir = survey.path();
    let toml = dir.join("survey.toml");
    let convert = ["convert", text(dir), "--to", "kitti", "--out", "-"];
    let given = succeed(&convert);
    let poses = std::fs::read_to_string(dir.join("baseline.tum")).unwrap();
    edit(&toml, "baseline.tum", "poses.csv");
    for first in [0, 1] {
        let row = |(k, line): (usize, &str)| {
            let (_, pose) = line.split_once(' ').unwrap();
            format!("{},{}\n", first + k, pose.replace(' ', ","))
        };
        let rows: String = poses.lines().enumerate().map(row).collect();
        let table = format!("frame,tx,ty,tz,qx,qy,qz,qw\n{rows}");
        std::fs::write(dir.join("poses.csv"), table).unwrap();
        assert_eq!(succeed(&convert), given);
    }
}

/// A body of ROS, whose x axis the camera looks along.
#[test]
fn bodies_of_robots_are_told_by_their_poses() {
    let folder = tempfile::tempdir().unwrap();
    let dir = &folder.path().join("survey");
    simulate(dir, &["--frames", "14", "--size", "160x120"]);
    let given = tum::read(&dir.join("baseline.tum")).unwrap();
    let optical = Matrix3::new(0., 0., 1., -1., 0., 0., 0., -1., 0.);
    let optical = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(optical));
    change_poses(dir, |pose| {
        Pose::new(pose.r_wc * optical.inverse(), pose.t_wc)
    });
    // They look ahead and roll, as some cameras do: the pictures tell.
    let output = tunnelstitch(&["check", text(dir)]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(
        said.contains("turn about it") && said.contains("(7 of 7, odds"),
        "{said}"
    );
    assert!(said.matches("--camera-axes ros").count() >= 2, "{said}");
    let to = ["--to", "tum", "--out", "-", "--camera-axes", "ros"];
    let out = succeed(&[&["convert", text(dir)], &to[..]].concat());
    let path = dir.join("back.tum");
    std::fs::write(&path, out).unwrap();
    for (own, given) in tum::read(&path).unwrap().iter().zip(&given) {
        assert!(own.pose.local(&given.pose).norm() < 1e-9);
    }
}

/// Left-handed poses look like mirrored pictures, and nothing in these tells one from the other:
/// both are named.
#[test]
fn left_handed_poses_are_named_beside_mirrored_pictures() {
    let folder = tempfile::tempdir().unwrap();
    let dir = folder.path().join("survey");
    simulate(&dir, &["--frames", "14", "--size", "160x120"]);
    change_poses(&dir, |pose| {
        let (q, t) = (pose.r_wc.coords, pose.t_wc);
        let mirrored = nalgebra::Quaternion::new(q.w, -q.x, q.y, -q.z);
        Pose::new(
            UnitQuaternion::new_unchecked(mirrored),
            Vector3::new(t.x, -t.y, t.z),
        )
    });
    let output = tunnelstitch(&["check", text(&dir)]);
    let said = String::from_utf8(output.stderr).unwrap();
    assert!(said.contains("--camera-axes unity"), "{said}");
    assert!(said.contains("orientation = \"flipped\""), "{said}");
}
