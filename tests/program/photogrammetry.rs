//! Poses and cameras in the files of photogrammetry and camera programs, through the program.

use crate::support::{self, edit, first_frames, succeed, text};
use nalgebra::Matrix3;
use std::path::Path;
use tunnelstitch::camera::read_calibration;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{CameraAxes, Pose, so3, tum};

/// The poses of a file of the survey, as the program reads them.
fn read(dir: &Path, file: &str) -> Vec<Pose> {
    let (file, out) = (dir.join(file), dir.join("read.tum"));
    succeed(&[
        "convert",
        text(dir),
        "--poses",
        text(&file),
        "--to",
        "tum",
        "--out",
        text(&out),
    ]);
    let read = tum::read(&out).unwrap();
    read.iter().map(|stamped| stamped.pose).collect()
}

/// Numbers separated by a text.
fn joined(numbers: impl IntoIterator<Item = f64>, separator: &str) -> String {
    let words: Vec<String> = numbers.into_iter().map(|n| n.to_string()).collect();
    words.join(separator)
}

/// Numbers of a matrix row by row.
fn rows(matrix: &Matrix3<f64>) -> Vec<f64> {
    matrix.transpose().iter().copied().collect()
}

fn rotation(pose: &Pose) -> Matrix3<f64> {
    pose.r_wc.to_rotation_matrix().into_inner()
}

fn name(k: usize) -> String {
    format!("{k:06}")
}

/// A list of the poses, each written by `entry`.
fn list(poses: &[Pose], entry: impl Fn(usize, &Pose) -> String, separator: &str) -> String {
    let entries = poses.iter().enumerate().map(|(k, pose)| entry(k, pose));
    entries.collect::<Vec<_>>().join(separator)
}

fn opensfm(poses: &[Pose]) -> String {
    let shot = |k: usize, pose: &Pose| {
        let inverse = pose.inverse();
        let vector = so3::log(&inverse.r_wc);
        format!(
            r#""{}.jpg": {{"rotation": [{}], "translation": [{}], "camera": "c"}}"#,
            name(k),
            joined(vector.iter().copied(), ","),
            joined(inverse.t_wc.iter().copied(), ",")
        )
    };
    format!(
        r#"[{{"cameras": {{"c": {{"projection_type": "perspective", "width": 480, "height": 360,
            "focal": 0.9, "k1": 0, "k2": 0}}}}, "shots": {{{}}}}}]"#,
        list(poses, shot, ",")
    )
}

fn bundle(poses: &[Pose]) -> String {
    let camera = |_, pose: &Pose| {
        let inverse = CameraAxes::OpenGl.turn(pose).inverse();
        let r = joined(rows(&rotation(&inverse)), " ");
        format!(
            "400 0 0\n{r}\n{}",
            joined(inverse.t_wc.iter().copied(), " ")
        )
    };
    let cameras = list(poses, camera, "\n");
    format!("# Bundle file v0.3\n{} 0\n{cameras}\n", poses.len())
}

fn meshroom(poses: &[Pose]) -> String {
    let view = |k: usize, _: &Pose| {
        format!(
            r#"{{"viewId": "{k}", "poseId": "1{k}", "path": "D:/x/{}.jpg"}}"#,
            name(k)
        )
    };
    let placed = |k: usize, pose: &Pose| {
        // The columns of the rotation to the camera are the rows of that to the world.
        let r = joined(rows(&rotation(pose)), "\",\"");
        let centre = joined(pose.t_wc.iter().copied(), "\",\"");
        format!(
            r#"{{"poseId": "1{k}", "pose": {{"transform": {{"rotation": ["{r}"],
                "center": ["{centre}"]}}}}}}"#
        )
    };
    format!(
        r#"{{"version": ["1", "2", "11"], "views": [{}], "intrinsics": [], "poses": [{}]}}"#,
        list(poses, view, ","),
        list(poses, placed, ",")
    )
}

fn openmvg(poses: &[Pose]) -> String {
    let view = |k: usize, _: &Pose| {
        format!(
            r#"{{"key": {k}, "value": {{"ptr_wrapper": {{"data": {{"local_path": "",
                "filename": "{}.jpg", "id_pose": {k}}}}}}}}}"#,
            name(k)
        )
    };
    let placed = |k: usize, pose: &Pose| {
        let r = rows(&rotation(pose).transpose());
        let r: Vec<String> = r
            .chunks(3)
            .map(|row| joined(row.iter().copied(), ","))
            .collect();
        let centre = joined(pose.t_wc.iter().copied(), ",");
        format!(
            r#"{{"key": {k}, "value": {{"rotation": [[{}]], "center": [{centre}]}}}}"#,
            r.join("],[")
        )
    };
    format!(
        r#"{{"sfm_data_version": "0.3", "views": [{}], "intrinsics": [], "extrinsics": [{}]}}"#,
        list(poses, view, ","),
        list(poses, placed, ",")
    )
}

/// Cameras of a chunk of half the size, which is placed in the world by its transform.
fn metashape(poses: &[Pose]) -> String {
    let camera = |k: usize, pose: &Pose| {
        let (r, t) = (rows(&rotation(pose)), 0.5 * pose.t_wc);
        let rows = r.chunks(3).zip(t.iter());
        let rows: Vec<String> = rows
            .map(|(row, t)| joined(row.iter().copied().chain([*t]), " "))
            .collect();
        format!(
            r#"<camera id="{k}" label="{}"><transform>{} 0 0 0 1</transform></camera>"#,
            name(k),
            rows.join(" ")
        )
    };
    format!(
        "<document><chunk><cameras>{}</cameras><transform><scale>2</scale></transform></chunk>\
         </document>",
        list(poses, camera, "")
    )
}

/// The angles of `R_x(ω) R_y(φ) R_z(κ)`.
fn pix4d(poses: &[Pose]) -> String {
    let line = |k: usize, pose: &Pose| {
        let r = rotation(&CameraAxes::OpenGl.turn(pose));
        let angles = [
            (-r[(1, 2)]).atan2(r[(2, 2)]),
            r[(0, 2)].asin(),
            (-r[(0, 1)]).atan2(r[(0, 0)]),
        ];
        let numbers = pose.t_wc.iter().copied().chain(angles.map(f64::to_degrees));
        format!("{}.jpg {}", name(k), joined(numbers, " "))
    };
    let lines = list(poses, line, "\n");
    format!("imageName X Y Z Omega Phi Kappa\n{lines}\n")
}

/// The angles of `R_z(−heading) R_x(pitch) R_y(roll)`.
fn realitycapture(poses: &[Pose]) -> String {
    let line = |k: usize, pose: &Pose| {
        let r = rotation(&CameraAxes::OpenGl.turn(pose));
        let angles = [
            r[(0, 1)].atan2(r[(1, 1)]),
            r[(2, 1)].asin(),
            (-r[(2, 0)]).atan2(r[(2, 2)]),
        ];
        let numbers = pose.t_wc.iter().copied().chain(angles.map(f64::to_degrees));
        format!("{}.jpg,{}", name(k), joined(numbers, ","))
    };
    let lines = list(poses, line, "\n");
    format!("#name,x,y,alt,heading,pitch,roll\n{lines}\n")
}

/// The true poses of a survey in the file of every program are the true poses.
#[test]
fn every_program_has_the_same_poses() {
    let survey = first_frames(4);
    let dir = survey.path();
    let truth = tum::read(&dir.join("groundtruth.tum")).unwrap();
    let truth: Vec<Pose> = truth.iter().map(|stamped| stamped.pose).collect();
    let names: Vec<String> = (0..4).map(|k| format!("./{}.jpg 0 400", name(k))).collect();
    std::fs::write(dir.join("list.txt"), names.join("\n")).unwrap();
    for (file, content) in [
        ("reconstruction.json", opensfm(&truth)),
        ("bundle.out", bundle(&truth)),
        ("cameras.sfm", meshroom(&truth)),
        ("sfm_data.json", openmvg(&truth)),
        ("cameras.xml", metashape(&truth)),
        ("external.txt", pix4d(&truth)),
        ("cameras.csv", realitycapture(&truth)),
    ] {
        std::fs::write(dir.join(file), content).unwrap();
        for (k, (read, pose)) in read(dir, file).iter().zip(&truth).enumerate() {
            let off = read.local(pose).norm();
            assert!(off < 1e-9, "{file}: frame {k} is off by {off}");
        }
    }
}

/// Removes all of a survey but its frames, and returns their true poses.
fn leave_frames(survey: &Path) -> Vec<Pose> {
    let truth = tum::read(&survey.join("groundtruth.tum")).unwrap();
    for file in [
        "survey.toml",
        "camera.json",
        "baseline.tum",
        "groundtruth.tum",
    ] {
        std::fs::remove_file(survey.join(file)).unwrap();
    }
    truth.iter().map(|stamped| stamped.pose).collect()
}

/// `init` finds a file with poses and a camera in it, and a lens profile's readout time is named.
#[test]
fn init_finds_poses_and_cameras_in_one_file() {
    let survey = first_frames(4);
    let dir = survey.path();
    let truth = leave_frames(dir);
    std::fs::write(dir.join("reconstruction.json"), opensfm(&truth)).unwrap();
    succeed(&["init", text(dir), "--radius-m", "3"]);
    let toml = std::fs::read_to_string(dir.join("survey.toml")).unwrap();
    for line in [
        "file = \"reconstruction.json\"",
        "initial = \"reconstruction.json\"    # 4 poses for 4 frames",
    ] {
        assert!(toml.contains(line), "{toml}");
    }
    let camera = read_calibration(&dir.join("reconstruction.json"), None).unwrap();
    assert_eq!((camera.fx, camera.cx), (432.0, 239.5));
    let profile = r#"{"calib_dimension": {"w": 480, "h": 360}, "frame_readout_time": 12.5,
        "fisheye_params": {"camera_matrix": [[400, 0, 240], [0, 400, 180], [0, 0, 1]],
        "distortion_coeffs": [0.01, 0, 0, 0]}}"#;
    std::fs::write(dir.join("lens.json"), profile).unwrap();
    edit(
        &dir.join("survey.toml"),
        "file = \"reconstruction.json\"",
        "file = \"lens.json\"",
    );
    let out = dir.join("o.tum");
    let arguments = ["convert", text(dir), "--to", "tum", "--out", text(&out)];
    let said = support::tunnelstitch(&arguments).stderr;
    let said = String::from_utf8_lossy(&said);
    assert!(
        said.contains("put readout_ms = 12.5 under [camera]"),
        "{said}"
    );
}

/// A bundle file has poses and cameras, and the size of its pictures is that of the frames.
#[test]
fn init_takes_the_size_of_a_bundle_files_camera_from_the_frames() {
    let survey = first_frames(4);
    let dir = survey.path();
    let truth = leave_frames(dir);
    let names: Vec<String> = (0..4).map(|k| format!("./{}.jpg 0 400", name(k))).collect();
    std::fs::write(dir.join("list.txt"), names.join("\n")).unwrap();
    std::fs::write(dir.join("bundle.out"), bundle(&truth)).unwrap();
    succeed(&["init", text(dir), "--radius-m", "3"]);
    let toml = std::fs::read_to_string(dir.join("survey.toml")).unwrap();
    for line in [
        "file = \"bundle.out\"",
        "initial = \"bundle.out\"    # 4 poses for 4 frames",
    ] {
        assert!(toml.contains(line), "{toml}");
    }
    let survey = Survey::open(dir).unwrap();
    let camera = survey.cameras.of(0);
    assert_eq!((camera.width, camera.height), (480, 360));
    assert_eq!((camera.fx, camera.cx, camera.cy), (400.0, 239.5, 179.5));
}
