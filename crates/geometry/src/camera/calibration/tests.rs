use super::*;
use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;

fn read_as(name: &str, text: &str) -> Result<Camera, CalibrationError> {
    read_camera(name, text, None)
}

/// Reads a calibration file with this name and text, of which it is the `camera`.
pub(super) fn read_camera(
    name: &str,
    text: &str,
    camera: Option<&str>,
) -> Result<Camera, CalibrationError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_calibration(&path, camera)
}

/// Reads a calibration file of pictures of this width and height.
pub(super) fn read_sized(
    name: &str,
    text: &str,
    camera: Option<&str>,
    size: Option<[u32; 2]>,
) -> Result<Camera, CalibrationError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, text).unwrap();
    read_calibration_of(&path, camera, &|| size)
}

fn with(lens: Lens) -> Camera {
    Camera {
        lens,
        ..Camera::from_vertical_fov(640, 480, 1.0471975511965976)
    }
}

fn brown(k: [f64; 6], p: [f64; 2]) -> Lens {
    Lens::BrownConrady(BrownConrady::new(BrownCoefficients { k, p }))
}

#[test]
fn our_own_file_restores_every_camera_exactly() {
    let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
    for lens in [
        Lens::default(),
        Lens::radial(-0.0512345678901, 0.003),
        brown([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]),
        brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]),
        Lens::KannalaBrandt(fisheye),
        Lens::KannalaBrandt(fisheye.limited_to(1.25)),
    ] {
        let camera = with(lens);
        let text = format_calibration(&camera);
        assert_eq!(read_as("camera.json", &text).unwrap(), camera, "{text}");
        let tree: toml::Table = serde_json::from_str(&text).unwrap();
        let text = toml::to_string(&tree).unwrap();
        assert_eq!(read_as("camera.toml", &text).unwrap(), camera, "{text}");
    }
}

#[test]
fn half_pixel_centres_are_converted() {
    let text = r#"{"model":"pinhole","width":40,"height":20,
        "fx":3,"fy":3,"cx":2,"cy":1,"pixel_centre":"half"}"#;
    let camera = read_as("camera.json", text).unwrap();
    assert_eq!((camera.cx, camera.cy), (1.5, 0.5));
}

/// A file as `cv2.FileStorage` and OpenCV's calibration sample write it.
const OPENCV: &str = "%YAML:1.0
---
calibration_time: \"Mon 02 Nov 2026\"
image_width: 640
image_height: 480
flags: 0
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 4.1500000000000000e+02, 0., 3.1800000000000000e+02, 0.,
       4.1700000000000000e+02, 2.4100000000000000e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 5
   cols: 1
   dt: d
   data: [ -3.0e-01, 1.0e-01, 1.0e-03, -2.0e-03, -2.0e-02 ]
avg_reprojection_error: 1.2e-01
";

/// The camera of the calibration files of the tests.
pub(super) fn calibrated(lens: Lens) -> Camera {
    Camera::at_rest([640, 480], [415.0, 417.0], [318.0, 241.0], lens)
}

#[test]
fn files_of_other_programs_are_the_same_camera() {
    let five = calibrated(brown([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]));
    let four = calibrated(brown([-0.3, 0.1, 0.0, 0.0, 0.0, 0.0], [1e-3, -2e-3]));
    let eight = calibrated(brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]));
    let fish = calibrated(Lens::KannalaBrandt(KannalaBrandt::new([
        -0.01, 0.005, -0.004, 0.0007,
    ])));
    let radial = calibrated(Lens::radial(-0.1, 0.01));
    let opencv_fisheye = OPENCV.replace("flags: 0", "fisheye_model: 1").replace(
        "-3.0e-01, 1.0e-01, 1.0e-03, -2.0e-03, -2.0e-02",
        "-0.01, 0.005, -0.004, 0.0007",
    );
    let ros = |model: &str, d: &str| {
        format!(
            "image_width: 640\nimage_height: 480\ncamera_name: front\ncamera_matrix:\n  rows: 3\n  \
             cols: 3\n  data: [415, 0, 318, \
             0, 417, 241, 0, 0, 1]\ndistortion_model: {model}\ndistortion_coefficients:\n  rows: \
             1\n  cols: 5\n  data: [{d}]\n\
             rectification_matrix:\n  rows: 3\n  cols: 3\n  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]\n"
        )
    };
    let ros_message = "header: {stamp: {sec: 1, nanosec: 2}, frame_id: cam}\nheight: 480\nwidth: \
                       640\ndistortion_model: plumb_bob\n\
                       d: [-0.3, 0.1, 0.001, -0.002, -0.02]\nk: [415.0, 0.0, 318.0, 0.0, 417.0, \
                       241.0, 0.0, 0.0, 1.0]\n";
    let kalibr = |model: &str, d: &str| {
        format!(
            "cam0:\n  cam_overlaps: []\n  camera_model: pinhole\n  distortion_coeffs: [{d}]\n  \
             distortion_model: {model}\n  \
             intrinsics: [415.0, 417.0, 318.0, 241.0]\n  resolution: [640, 480]\n  rostopic: \
             /cam0/image_raw\n  T_cam_imu:\n  - [1.0, 0.0, \
             0.0, 0.0]\n"
        )
    };
    let colmap = |model: &str| {
        format!(
            "# Camera list with one line of data per camera:\r\n#   CAMERA_ID, MODEL, WIDTH, \
             HEIGHT, PARAMS[]\r\n7 {model}\r\n"
        )
    };
    let nerf = |model: &str, rest: &str| {
        format!(
            r#"{{"camera_model": "{model}", "fl_x": 415, "fl_y": 417, "cx": 318.5, "cy": 241.5,
                "w": 640, "h": 480, {rest}, "frames": []}}"#
        )
    };
    let files: Vec<(&str, String, Camera)> = vec![
        ("a.yml", OPENCV.to_owned(), five),
        ("a.yml", opencv_fisheye, fish),
        (
            "a.yaml",
            ros("plumb_bob", "-0.3, 0.1, 0.001, -0.002, -0.02"),
            five,
        ),
        (
            "a.yaml",
            ros(
                "rational_polynomial",
                "4.1, 2.0, -0.0004, 0.0006, 0.1, 4.4, 3.1, 0.45",
            ),
            eight,
        ),
        (
            "a.yaml",
            ros("equidistant", "-0.01, 0.005, -0.004, 0.0007"),
            fish,
        ),
        ("a.yaml", ros_message.to_owned(), five),
        ("a.yaml", kalibr("radtan", "-0.3, 0.1, 0.001, -0.002"), four),
        (
            "a.yaml",
            kalibr("equidistant", "-0.01, 0.005, -0.004, 0.0007"),
            fish,
        ),
        (
            "cameras.txt",
            colmap("OPENCV 640 480 415 417 318.5 241.5 -0.3 0.1 0.001 -0.002"),
            four,
        ),
        (
            "cameras.txt",
            colmap(
                "FULL_OPENCV 640 480 415 417 318.5 241.5 4.1 2.0 -0.0004 0.0006 0.1 4.4 3.1 0.45",
            ),
            eight,
        ),
        (
            "cameras.txt",
            colmap("OPENCV_FISHEYE 640 480 415 417 318.5 241.5 -0.01 0.005 -0.004 0.0007"),
            fish,
        ),
        (
            "cameras.txt",
            colmap("RADIAL 640 480 415 318.5 241.5 -0.1 0.01"),
            Camera {
                fy: 415.0,
                ..radial
            },
        ),
        (
            "cameras.txt",
            colmap("PINHOLE 640 480 415 417 318.5 241.5"),
            calibrated(Lens::default()),
        ),
        (
            "transforms.json",
            nerf(
                "OPENCV",
                r#""k1": -0.3, "k2": 0.1, "p1": 0.001, "p2": -0.002"#,
            ),
            four,
        ),
        (
            "transforms.json",
            nerf(
                "OPENCV_FISHEYE",
                r#""k1": -0.01, "k2": 0.005, "k3": -0.004, "k4": 0.0007"#,
            ),
            fish,
        ),
    ];
    for (name, text, expected) in files {
        assert_eq!(read_as(name, &text).unwrap(), expected, "{text}");
    }
}

#[test]
fn one_of_several_cameras_is_chosen_by_name() {
    let text = "1 PINHOLE 640 480 415 417 318.5 241.5\n2 PINHOLE 640 480 400 400 320 240\n";
    let message = read_as("cameras.txt", text).unwrap_err().to_string();
    assert!(message.contains("several cameras (1, 2)"), "{message}");
    assert_eq!(
        read_camera("cameras.txt", text, Some("2")).unwrap().fx,
        400.0
    );
    let message = read_camera("cameras.txt", text, Some("3")).unwrap_err();
    assert!(message.to_string().contains("no camera \"3\""), "{message}");
}

#[test]
fn bad_files_say_where_and_what() {
    let own = |rest: &str| {
        format!(
            r#"{{"model":"pinhole","width": 40, "height": 20,
                "fx":30,"fy":30,"cx":20,"cy":10{rest}}}"#
        )
    };
    let files: Vec<(&str, String, &str)> = vec![
        ("c.json", own(r#","k9":0"#), "unknown field `k9`"),
        ("c.json", own(r#","k1":-2"#), "folds the picture"),
        (
            "c.json",
            own(r#","max_angle_deg":-2"#),
            "max_angle_deg is -2",
        ),
        ("c.json", own("").replace("30", "-3"), "fx is -3"),
        (
            "c.json",
            own("").replace("\"pinhole\"", "\"omni\""),
            "unknown variant `omni`",
        ),
        (
            "c.json",
            r#"{"model":"pinhole","width":4}"#.to_owned(),
            "missing field",
        ),
        (
            "c.json",
            own(r#","p1":0.1"#).replace("pinhole", "kannala-brandt"),
            "k1 to k4 only, not p1",
        ),
        ("c.json", "not json".to_owned(), "c.json:1: expected"),
        (
            "c.toml",
            "model = \"pinhole\"\nwdith = 3\n".to_owned(),
            "c.toml:2: unknown field",
        ),
        ("c.yml", OPENCV.replace("0., 1. ]", "0. ]"), "has 8 numbers"),
        (
            "c.yml",
            OPENCV.replace("image_width", "image_wdith"),
            "add the frames' size",
        ),
        (
            "c.yml",
            OPENCV.replace("4.1500000000000000e+02", "x"),
            "must be a number",
        ),
        (
            "c.yml",
            OPENCV.replace("4.1500000000000000e+02", ".nan"),
            "non-finite float",
        ),
        (
            "c.yml",
            OPENCV.replace(", -2.0e-02 ]", " "),
            "not valid YAML",
        ),
        (
            "c.yml",
            OPENCV.replace(", -2.0e-02 ]", ", 1, 2 ]"),
            "6 distortion coefficients",
        ),
        ("c.yml", "- 1\n- 2\n".to_owned(), "no entries"),
        ("c.yml", "a: 1\n".to_owned(), "no `camera_matrix`"),
        (
            "c.yml",
            "cam0: {camera_model: bal}\n".to_owned(),
            "\"bal\" is not supported",
        ),
        ("c.xml", "<opencv_storage>".to_owned(), "is no valid XML"),
        ("c.txt", String::new(), "holds no camera"),
        (
            "c.txt",
            "\n1 PINHOLE 640 480 415\n".to_owned(),
            "c.txt:2: PINHOLE has 4 parameters",
        ),
        (
            "c.txt",
            "1 FULL_FOV 640 480 415 417 318 241 1\n".to_owned(),
            "FULL_FOV is not supported",
        ),
        (
            "c.txt",
            "1 PINHOLE 640 480 415 417 318 x\n".to_owned(),
            "\"x\" is not a number",
        ),
        (
            "c.json",
            r#"{"frames": []}"#.to_owned(),
            "there is no `fl_x`",
        ),
        (
            "c.json",
            r#"{"fl_x": 1, "w": 640, "h": 480, "cx": 1, "cy": 2, "k4": 1}"#.to_owned(),
            "k4 is the eighth power",
        ),
    ];
    for (name, text, expected) in files {
        let message = read_as(name, &text).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("c.yml");
    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    let message = read_calibration(&path, None).unwrap_err().to_string();
    assert!(message.contains("no text of UTF-8"), "{message}");
}

/// Scripts of OpenCV dump JSON, or YAML without a size.
#[test]
fn camera_matrices_without_a_size_have_that_of_the_pictures() {
    let matrix = "[[500.0, 0, 310.0], [0, 501.0, 230.0], [0, 0, 1]]";
    for (name, text) in [
        (
            "a.json",
            format!("{{\"mtx\": {matrix}, \"dist\": [[-0.2, 0.03, 0, 0, 0]]}}"),
        ),
        (
            "b.json",
            format!("{{\"camera_matrix\": {matrix}, \"dist_coeff\": [-0.2, 0.03, 0, 0]}}"),
        ),
        (
            "c.yaml",
            format!("camera_matrix: {matrix}\ndist_coeff: [[-0.2, 0.03, 0, 0, 0]]\n"),
        ),
    ] {
        let camera = read_sized(name, &text, None, Some([640, 480])).unwrap();
        assert_eq!([camera.width, camera.height], [640, 480]);
        assert_eq!(
            [camera.fx, camera.fy, camera.cx, camera.cy],
            [500.0, 501.0, 310.0, 230.0]
        );
        assert_eq!(
            camera.lens,
            brown([-0.2, 0.03, 0.0, 0.0, 0.0, 0.0], [0.0; 2])
        );
        let said = read_as(name, &text).unwrap_err().to_string();
        assert!(said.contains("add the frames' size"), "{said}");
    }
}
