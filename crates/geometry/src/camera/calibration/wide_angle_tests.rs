use super::tests::{calibrated, read_camera};
use super::*;
use crate::camera::double_sphere::DoubleSphere;
use crate::camera::eucm::Eucm;
use crate::camera::fov::Fov;
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;
use crate::camera::lens_tests::wide_angle_lenses;
use crate::camera::mei::Mei;
use crate::camera::projection::Camera;
use crate::camera::thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};
use nalgebra::{Vector2, Vector3};

#[test]
fn our_own_file_restores_every_wide_angle_camera_exactly() {
    for lens in wide_angle_lenses() {
        // Small enough for the field of view of any of them.
        let camera = Camera {
            fx: 900.0,
            fy: 900.0,
            ..calibrated(*lens)
        };
        let text = format_calibration(&camera);
        assert_eq!(
            read_camera("camera.json", &text, None).unwrap(),
            camera,
            "{text}"
        );
        assert!(
            text.contains(&format!("\"model\": {:?}", lens.name())),
            "{text}"
        );
        let tree: toml::Table = serde_json::from_str(&text).unwrap();
        let text = toml::to_string(&tree).unwrap();
        assert_eq!(
            read_camera("camera.toml", &text, None).unwrap(),
            camera,
            "{text}"
        );
    }
}

const MEI: &str = "%YAML:1.0\n---\nmodel_type: MEI\ncamera_name: camera\nimage_width: 640\n\
                   image_height: 480\nmirror_parameters:\n   xi: 0.9\ndistortion_parameters:\n   \
                   k1: -0.2\n   k2: 3.0e-02\n   p1: 1.0e-03\n   p2: -2.0e-03\n\
                   projection_parameters:\n   gamma1: 415.\n   gamma2: 417.\n   u0: 318.\n   \
                   v0: 241.\n";
const PINHOLE: &str = "%YAML:1.0\n---\nmodel_type: PINHOLE\nimage_width: 640\nimage_height: 480\n\
                       distortion_parameters:\n   k1: -0.1\n   k2: 0.01\n   p1: 0.0\n   p2: 0.0\n\
                       projection_parameters:\n   fx: 415.0\n   fy: 417.0\n   cx: 318.0\n   \
                       cy: 241.0\n";
const FISHEYE: &str = "%YAML:1.0\n---\nmodel_type: KANNALA_BRANDT\nimage_width: 640\n\
                       image_height: 480\nprojection_parameters:\n   k2: -0.01\n   k3: 0.005\n   \
                       k4: -0.004\n   k5: 0.0007\n   mu: 415.0\n   mv: 417.0\n   u0: 318.0\n   \
                       v0: 241.0\n";

fn basalt(model: &str, parameters: &str) -> String {
    format!(
        r#"{{"value0": {{"T_imu_cam": [], "intrinsics": [
            {{"camera_type": "{model}", "intrinsics": {{
                "fx": 415, "fy": 417, "cx": 318, "cy": 241{parameters}}}}}],
            "resolution": [[640, 480]]}}}}"#
    )
}

fn kalibr(model: &str, own: &str, distortion: &str, coefficients: &str) -> String {
    format!(
        "cam0:\n  camera_model: {model}\n  intrinsics: [{own}415, 417, 318, 241]\n  \
         distortion_model: {distortion}\n  distortion_coeffs: [{coefficients}]\n  \
         resolution: [640, 480]\n"
    )
}

#[test]
fn files_of_other_programs_hold_the_same_lens() {
    let mei = Lens::Mei(Mei::new(0.9, [-0.2, 0.03], [1e-3, -2e-3]).unwrap());
    let plain_mei = Lens::Mei(Mei::new(0.9, [0.0; 2], [0.0; 2]).unwrap());
    let ds = Lens::DoubleSphere(DoubleSphere::new(-0.25, 0.57).unwrap());
    let eucm = |beta| Lens::Eucm(Eucm::new(0.63, beta).unwrap());
    let fov = Lens::Fov(Fov::new(0.93).unwrap());
    let fisheye = Lens::KannalaBrandt(KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]));
    let thin_prism = ThinPrismFisheye::new(ThinPrismCoefficients {
        k: [-0.01, 0.005, -0.004, 0.0007],
        p: [1e-3, -2e-3],
        s: [3e-4, -5e-4],
    });
    let colmap = |model: &str| format!("# cameras\n3 {model}\n");
    let files: Vec<(&str, String, Lens)> = vec![
        ("c.yaml", MEI.to_owned(), mei),
        ("c.yaml", PINHOLE.to_owned(), Lens::radial(-0.1, 0.01)),
        ("c.yaml", FISHEYE.to_owned(), fisheye),
        (
            "c.yaml",
            kalibr("omni", "0.9, ", "radtan", "-0.2, 0.03, 0.001, -0.002"),
            mei,
        ),
        ("c.yaml", kalibr("omni", "0.9, ", "none", ""), plain_mei),
        ("c.yaml", kalibr("ds", "-0.25, 0.57, ", "none", ""), ds),
        (
            "c.yaml",
            kalibr("eucm", "0.63, 1.04, ", "none", ""),
            eucm(1.04),
        ),
        ("c.yaml", kalibr("pinhole", "", "fov", "0.93"), fov),
        (
            "c.json",
            basalt("ds", r#", "xi": -0.25, "alpha": 0.57"#),
            ds,
        ),
        (
            "c.json",
            basalt("eucm", r#", "alpha": 0.63, "beta": 1.04"#),
            eucm(1.04),
        ),
        ("c.json", basalt("ucm", r#", "alpha": 0.63"#), eucm(1.0)),
        ("c.json", basalt("fov", r#", "w": 0.93"#), fov),
        (
            "c.json",
            basalt(
                "kb4",
                r#", "k1": -0.01, "k2": 0.005, "k3": -0.004, "k4": 0.0007"#,
            ),
            fisheye,
        ),
        ("c.json", basalt("pinhole", ""), Lens::default()),
        ("c.txt", colmap("FOV 640 480 415 417 318.5 241.5 0.93"), fov),
        (
            "c.txt",
            colmap("EUCM 640 480 415 417 318.5 241.5 0.63 1.04"),
            eucm(1.04),
        ),
        (
            "c.txt",
            colmap(
                "THIN_PRISM_FISHEYE 640 480 415 417 318.5 241.5 -0.01 0.005 0.001 -0.002 -0.004 \
                 0.0007 0.0003 -0.0005",
            ),
            Lens::ThinPrismFisheye(thin_prism.unwrap()),
        ),
    ];
    for (name, text, lens) in files {
        assert_eq!(
            read_camera(name, &text, None).unwrap(),
            calibrated(lens),
            "{text}"
        );
    }
}

/// OCamCalib's file, with the inverse polynomial cut down to what the reader needs: a line.
const OCAM: &str = "#polynomial coefficients for the DIRECT mapping function\n\n\
                    5 -230 0 7.5e-3 -6e-5 1.6e-7\n\n\
                    #polynomial coefficients for the inverse mapping function\n\n\
                    3 268.0 71.0 -20.0\n\n\
                    #\"row\" and \"column\", starting from 0 (C convention)\n\n\
                    240.4 318.5\n\n#affine parameters \"c\", \"d\", \"e\"\n\n\
                    1.01 0.002 -0.003\n\n#image size: \"height\" and \"width\"\n\n480 640\n";

/// The pixels are the roots of the polynomial that `world2cam` of the toolbox solves, computed with
/// 30 digits by mpmath.
#[test]
fn pixels_of_ocamcalib_are_those_of_its_direct_polynomial() {
    let camera = read_camera("calib_results.txt", OCAM, None).unwrap();
    assert_eq!((camera.width, camera.height), (640, 480));
    for (x_c, u, v) in [
        ([0.3, -0.2, 1.0], 381.04176861936475, 198.49743113792394),
        ([-1.2, 0.7, 0.9], 133.16736193727462, 349.0310429905967),
        ([0.8, 1.1, 0.1], 475.67363995557486, 459.89465522100244),
        ([2.0, -1.0, -0.4], 574.8574786881039, 111.64532023952442),
    ] {
        let pixel = camera.project(&Vector3::from(x_c)).unwrap();
        assert!((pixel - Vector2::new(u, v)).norm() < 1e-10, "{pixel}");
    }
}

#[test]
fn one_of_several_cameras_of_basalt_is_chosen_by_its_number() {
    let text = basalt("pinhole", "")
        .replace("\"intrinsics\": [", "\"intrinsics\": [{}, ")
        .replace("[[640, 480]]", "[[1, 1], [640, 480]]");
    let message = read_camera("c.json", &text, None).unwrap_err().to_string();
    assert!(
        message.contains("several cameras (cam0, cam1)"),
        "{message}"
    );
    let camera = read_camera("c.json", &text, Some("cam1")).unwrap();
    assert_eq!(camera, calibrated(Lens::default()));
}

#[test]
fn files_that_hold_no_lens_say_why() {
    let own = |rest: &str| {
        format!(r#"{{"width": 40, "height": 20, "fx":30,"fy":30,"cx":20,"cy":10, {rest}}}"#)
    };
    let matrix = "1452.44 0 708\n0 1452.44 532\n0 0 1";
    let unknown = "not a calibration known here; known are camera.json";
    let files: Vec<(&str, String, &str)> = vec![
        ("K.txt", matrix.to_owned(), unknown),
        (
            "c.json",
            r#"{"name": "a lens", "calib": []}"#.to_owned(),
            unknown,
        ),
        (
            "c.yaml",
            "a: 1\n".to_owned(),
            "not a calibration known here (no `camera_matrix`",
        ),
        ("c.json", own(r#""model": "mei""#), "xi is missing"),
        (
            "c.json",
            own(r#""model": "eucm", "alpha": 0.6"#),
            "beta is missing",
        ),
        (
            "c.json",
            own(r#""model": "fov", "omega": 4"#),
            "omega is 4; it must be above 0",
        ),
        (
            "c.json",
            own(r#""model": "ocam""#),
            "a list of 1 to 8 numbers",
        ),
        (
            "c.json",
            own(r#""model": "fov", "omega": 1, "k1": 1"#),
            "omega only, not k1",
        ),
        (
            "c.json",
            own(r#""model": "pinhole", "xi": 1"#),
            "p1 and p2 only, not xi",
        ),
        (
            "c.json",
            own(r#""model": "double-sphere", "xi": 0, "alpha": 2"#),
            "alpha is 2; it must lie between 0 and 1",
        ),
        ("c.json", basalt("bal", ""), "\"bal\" is not supported"),
        ("c.json", basalt("ds", r#", "xi": 1"#), "`alpha` is missing"),
        (
            "c.yaml",
            MEI.replace("MEI", "SCARAMUZZA"),
            "calib_results.txt",
        ),
        ("c.yaml", MEI.replace("   xi", "   zeta"), "`xi` is missing"),
        (
            "c.yaml",
            kalibr("ds", "", "none", ""),
            "the model ds has xi, alpha",
        ),
        (
            "c.yaml",
            kalibr("omni", "1, ", "equidistant", "1"),
            "known: radtan and none",
        ),
        (
            "c.txt",
            OCAM.replace("-230", "230"),
            "c.txt:3: the polynomial begins with 230",
        ),
        (
            "c.txt",
            OCAM.replace("-230 0", "-230 1"),
            "the linear coefficient is 1",
        ),
        (
            "c.txt",
            OCAM.replace("318.5", ""),
            "the centre is `row column`",
        ),
        ("c.txt", OCAM.replace("480 640", "480 640.5"), "in pixels"),
    ];
    for (name, text, expected) in files {
        let message = read_camera(name, &text, None).unwrap_err().to_string();
        assert!(message.contains(expected), "{text}: {message}");
    }
}
