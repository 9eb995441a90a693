//! Tests of rigs in `survey.toml`.

use crate::survey::{Survey, SurveyError};
use image::{GrayImage, Luma};
use std::path::Path;
use tunnelstitch_geometry::trajectory::{Pose, poses_of};

/// Sections of a rig of two cameras: the second looks the other way, a decimetre ahead.
const RIG: &str = r#"
[tunnel]
shape = "circle"
radius_m = 3.0

[[camera]]
horizontal_fov_deg = 60.0
frames = "left/*.png"
body_to_camera = "left.txt"

[[camera]]
horizontal_fov_deg = 70.0
frames = "right/*.png"
body_to_camera = "right.txt"

[poses]
initial = "poses.tum"
"#;

/// Three moments of the rig, with `pictures` of the second camera.
fn write_survey(folder: &Path, toml: &str, pictures: usize) {
    for (camera, count) in [("left", 3), ("right", pictures)] {
        std::fs::create_dir(folder.join(camera)).unwrap();
        for k in 0..count {
            let picture = GrayImage::from_pixel(32, 24, Luma([100]));
            picture
                .save(folder.join(format!("{camera}/{k}.png")))
                .unwrap();
        }
    }
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).unwrap();
    write("survey.toml", toml);
    write("left.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n");
    // x_camera = T x_body.
    write("right.txt", "-1 0 0 0\n0 1 0 -0.1\n0 0 -1 0\n");
    let line = |k: i32| format!("{k} 0 {} 0 0 0 0 1\n", 0.1 * f64::from(k));
    write("poses.tum", &(0..3).map(line).collect::<String>());
}

/// The survey, opened.
fn opened(toml: &str, pictures: usize) -> (tempfile::TempDir, Result<Survey, SurveyError>) {
    let dir = tempfile::tempdir().unwrap();
    write_survey(dir.path(), toml, pictures);
    let survey = Survey::open(dir.path());
    (dir, survey)
}

/// The message with which a survey is refused.
fn refused(toml: &str, pictures: usize) -> String {
    opened(toml, pictures).1.unwrap_err().to_string()
}

#[test]
fn frames_are_in_the_order_of_the_moments_with_the_poses_of_their_cameras() {
    let (dir, survey) = opened(RIG, 3);
    let survey = survey.unwrap();
    let names: Vec<String> = survey.frames.iter().map(|frame| frame.name()).collect();
    assert_eq!(names[..3], ["left/0.png", "right/0.png", "left/1.png"]);
    assert!(survey.cameras.of(4).fx > survey.cameras.of(5).fx);
    assert_eq!((survey.initial.len(), survey.initial[3].time_s), (6, 1.0));
    let right = &survey.initial[3].pose;
    assert!((right.t_wc - nalgebra::Vector3::new(0.0, 0.2, 0.0)).norm() < 1e-12);
    assert!((right.r_wc.angle() - std::f64::consts::PI).abs() < 1e-9);
    // A file with a pose for every picture has those of the cameras.
    let poses = poses_of(&survey.initial);
    let text = tunnelstitch_geometry::trajectory::tum::format(&survey.initial);
    let path = dir.path().join("pictures.tum");
    std::fs::write(&path, text).unwrap();
    let read = poses_of(&survey.read_poses(&path).unwrap());
    let is_near = |(a, b): (&Pose, &Pose)| a.local(b).norm() < 1e-12;
    assert_eq!(read.len(), 6);
    assert!(read.iter().zip(&poses).all(is_near));
}

#[test]
fn cameras_that_do_not_go_together_are_named() {
    let message = refused(RIG, 2);
    for part in [
        "camera 0 (left/*.png) has 3",
        "camera 1 (right/*.png) has 2",
    ] {
        assert!(message.contains(part), "{message}");
    }
    let message = refused(&RIG.replace("right.txt", "none.txt"), 3);
    assert!(message.contains("none.txt"), "{message}");
    let without = RIG.replace("body_to_camera = \"right.txt\"\n", "");
    let message = refused(&without, 3);
    assert!(
        message.contains("number 1 has no body_to_camera"),
        "{message}"
    );
    let message = refused(&RIG.replace("frames = \"left/*.png\"\n", ""), 3);
    assert!(message.contains("number 0 has no frames"), "{message}");
    let twice = format!("{RIG}\n[frames]\nimages = \"left/*.png\"\n");
    assert!(refused(&twice, 3).contains("each [[camera]]"));
    let negative = format!("{RIG}\n[rig]\ntranslation_sigma_mm = -1\n");
    let message = refused(&negative, 3);
    assert!(message.contains("translation_sigma_mm is -1"), "{message}");
}

#[test]
fn keys_of_a_rig_do_not_go_with_a_single_camera() {
    let single = RIG
        .split("[[camera]]")
        .enumerate()
        .filter(|(k, _)| *k != 1)
        .map(|(_, part)| part)
        .collect::<Vec<_>>()
        .join("[camera]");
    assert!(refused(&single, 3).contains("images under [frames]"));
}
