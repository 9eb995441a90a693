//! Frames, poses and calibrations from recordings of robots, through the program.

use crate::support::recorder::{
    Wire, compressed, image, messages_of, transform, write_bag, write_mcap,
};
use crate::support::{edit, fail, simulate, succeed, text};
use image::{DynamicImage, GrayImage};
use nalgebra::{UnitQuaternion, Vector3};
use serde_json::Value;
use std::path::{Path, PathBuf};
use tunnelstitch::camera::Camera;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::Pose;

/// A turn of a brick tunnel in small frames.
fn simulated(folder: &Path) -> PathBuf {
    let out = folder.join("survey");
    simulate(&out, &["--turns", "1", "--size", "160x120"]);
    out
}

/// A survey beside `pictures`, whose frames, poses and calibration are those of the recording
/// `name`, which is written by `write`.
fn recorded(pictures: &Path, name: &str, write: impl FnOnce(&Path)) -> PathBuf {
    let folder = pictures.with_file_name(name.replace('.', "-"));
    std::fs::create_dir(&folder).unwrap();
    let toml = folder.join("survey.toml");
    std::fs::copy(pictures.join("survey.toml"), &toml).unwrap();
    std::fs::copy(
        pictures.join("groundtruth.tum"),
        folder.join("groundtruth.tum"),
    )
    .unwrap();
    edit(&toml, "camera.json", name);
    edit(
        &toml,
        "images = \"frames/*.png\"",
        &format!("bag = {name:?}"),
    );
    edit(&toml, "baseline.tum", name);
    write(&folder.join(name));
    folder
}

/// The survey of `pictures` in a recording of ROS 2.
fn in_mcap(pictures: &Path, name: &str) -> PathBuf {
    let survey = Survey::open(pictures).unwrap();
    let messages = messages_of(&survey, Wire::Ros2);
    recorded(pictures, name, |path| {
        write_mcap(path, Wire::Ros2, &messages)
    })
}

/// Findings of `check` about the frames and the poses.
fn checked(survey: &Path) -> Value {
    let said = succeed(&["check", text(survey), "--json", "--quiet"]);
    let mut said: Value = serde_json::from_str(&said).unwrap();
    // It tells the folder.
    said.as_object_mut().unwrap().remove("survey");
    said
}

/// Refines a survey with its wall as given and stitches it; returns the poses and the panorama.
fn refined(survey: &Path) -> (Vec<u8>, DynamicImage) {
    let out = survey.join("refined");
    let refine = ["refine", text(survey), "--out", text(&out), "--quiet"];
    succeed(&[&refine[..], &["--shape", "fixed", "--fast"]].concat());
    let (poses, panorama) = (out.join("poses.tum"), survey.join("panorama.png"));
    let stitch = ["stitch", text(survey), "--poses", text(&poses)];
    let options = ["--out", text(&panorama), "--px-per-metre", "40", "--quiet"];
    succeed(&[&stitch[..], &options].concat());
    (
        std::fs::read(poses).unwrap(),
        image::open(panorama).unwrap(),
    )
}

#[test]
fn a_recording_gives_what_its_pictures_give() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let survey = Survey::open(&pictures).unwrap();
    let (expected, found) = (checked(&pictures), refined(&pictures));
    let [of_ros1, of_ros2] = [Wire::Ros1, Wire::Ros2].map(|wire| messages_of(&survey, wire));
    let write = |path: &Path| match path.file_name().and_then(|name| name.to_str()) {
        Some("ros2.mcap") => write_mcap(path, Wire::Ros2, &of_ros2),
        Some("ros1.mcap") => write_mcap(path, Wire::Ros1, &of_ros1),
        _ => write_bag(path, &of_ros1),
    };
    for name in ["ros2.mcap", "ros1.mcap", "ros1.bag"] {
        let recorded = recorded(&pictures, name, write);
        assert_eq!(checked(&recorded), expected, "{name}");
        // Messages of ROS 1 are read from either file by the same code.
        assert!(name == "ros1.mcap" || refined(&recorded) == found, "{name}");
    }
}

/// The robot drives in `odom`, which stands in `map`; the camera is mounted on it.
#[test]
fn the_camera_is_found_through_the_frames_of_a_robot() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let survey = Survey::open(&pictures).unwrap();
    let quarter = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, -0.2, 1.0));
    let mount = Pose::new(quarter, Vector3::new(0.2, 0.0, 0.5));
    let odom = Pose::new(quarter.inverse(), Vector3::new(-3.0, 1.0, 0.0));
    for (name, wire) in [("tf.mcap", Wire::Ros2), ("tf.bag", Wire::Ros1)] {
        let mut messages = messages_of(&survey, wire);
        messages.retain(|message| message.topic != "/odom");
        let fixed = [(["map", "odom"], &odom), (["base", "camera"], &mount)];
        for (frames, pose) in fixed {
            messages.push(transform(wire, "/tf_static", 0.0, frames, pose));
        }
        for stamped in &survey.initial {
            let base = odom.inverse().after(&stamped.pose).after(&mount.inverse());
            let frames = ["odom", "base"];
            messages.push(transform(wire, "/tf", stamped.time_s, frames, &base));
        }
        let folder = recorded(&pictures, name, |path| match wire {
            Wire::Ros1 => write_bag(path, &messages),
            Wire::Ros2 => write_mcap(path, wire, &messages),
        });
        let toml = folder.join("survey.toml");
        let initial = format!("initial = {name:?}");
        edit(
            &toml,
            &initial,
            &format!("{initial}\nparent = \"map\"\nchild = \"camera\""),
        );
        let read = Survey::open(&folder).unwrap();
        for (found, expected) in read.initial.iter().zip(&survey.initial) {
            assert!(found.pose.local(&expected.pose).norm() < 1e-9, "{name}");
        }
        edit(&toml, "child = \"camera\"", "child = \"wheel\"");
        let said = fail(&["check", text(&folder)], 3);
        assert!(
            said.contains("there is no frame \"wheel\"; its transforms are"),
            "{said}"
        );
        assert!(said.contains("base to camera (static)"), "{said}");
    }
}

#[test]
fn init_finds_the_parts_of_a_recording() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let expected = checked(&pictures);
    let folder = in_mcap(&pictures, "robot.mcap");
    for name in ["survey.toml", "groundtruth.tum"] {
        std::fs::remove_file(folder.join(name)).unwrap();
    }
    let init = ["init", text(&folder), "--radius-m", "3", "--json"];
    let said: Value = serde_json::from_str(&succeed(&init)).unwrap();
    for key in ["recording", "calibration", "initial_poses"] {
        assert_eq!(said[key], "robot.mcap", "{said}");
    }
    assert_eq!(said["missing"], Value::Null, "{said}");
    let toml = std::fs::read_to_string(folder.join("survey.toml")).unwrap();
    for line in [
        "topic = \"/camera/image_raw\"",
        "topic = \"/odom\"",
        "name = \"/camera/camera_info\"",
    ] {
        assert!(toml.contains(line), "{toml}");
    }
    let found = checked(&folder);
    assert_eq!(found["frames"], expected["frames"]);
}

#[test]
fn init_says_which_topics_cannot_be_read() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let mut survey = Survey::open(&pictures).unwrap();
    survey.cameras = survey.cameras.map(|camera| Camera {
        fx: 1e-3,
        ..*camera
    });
    let messages = messages_of(&survey, Wire::Ros1);
    let folder = recorded(&pictures, "robot.bag", |path| write_bag(path, &messages));
    std::fs::remove_file(folder.join("groundtruth.tum")).unwrap();
    let init = [
        "init",
        text(&folder),
        "--radius-m",
        "3",
        "--force",
        "--json",
    ];
    let said: Value = serde_json::from_str(&succeed(&init)).unwrap();
    assert_eq!(said["calibration"], Value::Null, "{said}");
    let aside = said["left_aside"].to_string();
    assert!(
        aside.contains("robot.bag") && aside.contains("fx is 0.001"),
        "{said}"
    );
}

#[test]
fn topics_are_chosen_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let survey = Survey::open(&pictures).unwrap();
    let mut messages = messages_of(&survey, Wire::Ros2);
    let file = std::fs::read(&survey.frames[0].path).unwrap();
    messages.push(compressed(Wire::Ros2, 1.5, &file));
    let folder = recorded(&pictures, "two.mcap", |path| {
        write_mcap(path, Wire::Ros2, &messages);
    });
    let toml = folder.join("survey.toml");
    let said = fail(&["check", text(&folder)], 3);
    for part in [
        "/camera/image_raw (",
        "/camera/image_raw/compressed (",
        "1 messages",
        "[frames]",
    ] {
        assert!(said.contains(part), "{said}");
    }
    edit(
        &toml,
        "bag = \"two.mcap\"",
        "bag = \"two.mcap\"\ntopic = \"/other\"",
    );
    let said = fail(&["check", text(&folder)], 3);
    assert!(
        said.contains("\"/other\"") && said.contains("/camera/image_raw ("),
        "{said}"
    );
    edit(&toml, "\"/other\"", "\"/camera/image_raw\"");
    checked(&folder);
    edit(&toml, "bag = \"two.mcap\"", "images = \"*.png\"");
    let said = fail(&["check", text(&folder)], 3);
    assert!(said.contains("frames.topic goes with frames.bag"), "{said}");
}

#[test]
fn images_that_cannot_be_read_are_named_and_may_be_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let survey = Survey::open(&pictures).unwrap();
    let mut messages = messages_of(&survey, Wire::Ros2);
    let grey: DynamicImage = GrayImage::new(160, 120).into();
    let place = messages
        .iter()
        .rposition(|message| message.topic.ends_with("raw"));
    let place = place.unwrap();
    messages[place] = image(Wire::Ros2, messages[place].time_s, &grey, "bayer_rggb8");
    let folder = recorded(&pictures, "bad.mcap", |path| {
        write_mcap(path, Wire::Ros2, &messages);
    });
    let said = fail(&["check", text(&folder)], 3);
    let name = format!("bad.mcap#{:06}", survey.frames.len() - 1);
    for part in [&*name, "bayer_rggb8", "image_proc"] {
        assert!(said.contains(part), "{said}");
    }
    let check = ["check", text(&folder), "--skip-bad", "--json", "--quiet"];
    let said: Value = serde_json::from_str(&succeed(&check)).unwrap();
    assert_eq!(said["frames"], survey.frames.len() - 1, "{said}");
}

#[test]
fn a_recording_that_is_cut_off_is_an_error_with_the_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let pictures = simulated(dir.path());
    let mcap = in_mcap(&pictures, "cut.mcap");
    let messages = messages_of(&Survey::open(&pictures).unwrap(), Wire::Ros1);
    let bag = recorded(&pictures, "cut.bag", |path| write_bag(path, &messages));
    let kinds = [
        (
            mcap,
            "cut.mcap",
            "mcap recover",
            "does not begin as MCAP files do",
        ),
        (bag, "cut.bag", "rosbag reindex", "does not begin as bags"),
    ];
    for (folder, name, remedy, no_recording) in kinds {
        let path = folder.join(name);
        let bytes = std::fs::read(&path).unwrap();
        for end in [0, 5, 100, bytes.len() / 2, bytes.len() - 100] {
            std::fs::write(&path, &bytes[..end]).unwrap();
            let out = folder.join("refined");
            for command in [
                &["check", text(&folder)][..],
                &["refine", text(&folder), "--out", text(&out)],
            ] {
                let said = fail(command, 3);
                assert!(said.contains(name) && said.contains(remedy), "{said}");
            }
        }
        std::fs::write(&path, b"a text, and no recording at all").unwrap();
        let said = fail(&["check", text(&folder)], 3);
        assert!(said.contains(no_recording), "{said}");
    }
}
