//! Valid files with random damage: every parser returns an error or finite values, and none panics.

use proptest::prelude::*;
use std::path::Path;
use tunnelstitch::camera::read_calibration;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{read_camera_in_body, read_poses, read_tunnel_frame};

const TUM: &str =
    "# time tx ty tz qx qy qz qw\n0 0 0 0 0 0 0 1\n1 0 0.1 0 0 0.258819045 0 0.965925826\n";
const KITTI: &str = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.5 0 1 0 0.25 0 0 1 0\n";
const CSV: &str =
    "time,name,tx,ty,tz,qx,qy,qz,qw\n0,a.jpg,0,0,0,0,0,0,1\n1,b.jpg,0,0.1,0,0,0.26,0,0.97\n";
const EUROC: &str = "#timestamp \
                     [ns],p_x,p_y,p_z,q_w,q_x,q_y,q_z\n\
                     1000000000,0,0,0,1,0,0,0\n1100000000,0,0,0,1,0,0,0\n";
const COLMAP: &str =
    "# Image list\n1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0.5 0 1 b.jpg\n1.5 2.5 -1\n";
const NERF: &str = r#"{"fl_x": 400, "fl_y": 400, "cx": 320, "cy": 240, "w": 640, "h": 480,
 "k1": -0.1, "camera_model": "OPENCV",
 "frames": [{"file_path": "a.jpg",
 "transform_matrix": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}"#;
const OWN: &str = r#"{"model": "kannala-brandt", "width": 640, "height": 480,
 "fx": 300, "fy": 300, "cx": 320, "cy": 240, "k1": -0.01}"#;
const OPENCV: &str = "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: \
                      !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
                      data: [415., 0., 318., 0., 417., 241., 0., 0., \
                      1.]\ndistortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   \
                      dt: d\n   data: [-0.3, 0.1, 0.001, -0.002, -0.02]\n";
const KALIBR: &str = "cam0:\n  camera_model: pinhole\n  distortion_coeffs: [-0.3, 0.1, 0.001, \
                      -0.002]\n  distortion_model: radtan\n  \
                      intrinsics: [415, 417, 318, 241]\n  resolution: [640, 480]\n  T_cam_imu:\n  \
                      - [1, 0, 0, 0]\n  - [0, 1, 0, 0]\n  - [0, 0, 1, 0]\n  \
                      - [0, 0, 0, 1]\n";
const CAMERAS: &str =
    "# cameras\n1 FULL_OPENCV 640 480 415 417 318 241 4.1 2.0 -0.0004 0.0006 0.1 4.4 3.1 0.45\n";
const MEI: &str = "%YAML:1.0\n---\nmodel_type: MEI\nimage_width: 640\nimage_height: \
                   480\nmirror_parameters:\n   xi: 0.9\ndistortion_parameters:\n   k1: -0.2\n   \
                   k2: 0.03\n   p1: 0.001\n   p2: -0.002\nprojection_parameters:\n   gamma1: \
                   415.\n   gamma2: 417.\n   u0: 318.\n   v0: 241.\n";
const BASALT: &str = r#"{"value0": {"intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 349.7,
 "fy": 348.7, "cx": 365.8, "cy": 249.3, "xi": -0.24, "alpha": 0.56}}],
 "resolution": [[752, 480]]}}"#;
const OCAM: &str = "5 -230 0 7.5e-3 -6e-5 1.6e-7\n3 268.0 71.0 -20.0\n240.4 318.5\n1.01 0.002 \
                    -0.003\n480 640\n";
const THIN_PRISM: &str = "1 THIN_PRISM_FISHEYE 640 480 300 300 320 240 -0.01 0.005 0.001 -0.002 \
                          -0.004 0.0007 0.0003 -0.0005\n";
const OWN_OCAM: &str = r#"{"model": "ocam", "width": 640, "height": 480, "fx": 230, "fy": 230,
 "cx": 320, "cy": 240, "polynomial": [-1.72, 3.17, -1.95], "c": 1.01, "d": 0.002, "e": -0.003}"#;
const AXIS: &str = r#"{"point_m": [0, 0, 0], "axis": [1, 0, 0], "theta_zero": [0, 0, 1]}"#;
const SURVEY: &str = "[tunnel]\nshape = \"circle\"\nradius_m = 3.0\nignore = [{ theta_deg = [150, \
                      210], chainage_m = [2.0, 5.5] }]\n[camera]\nfile = \
                      \"camera.json\"\n[frames]\nimages = \"*.jpg\"\n[poses]\n\
                      initial = \"baseline.tum\"\n[prior]\nmodel = \
                      \"random-walk\"\nrotation_sigma_deg = 2.0\ntranslation_sigma_m = [0.02, \
                      0.02, 0.03]\n\
                      [options.stitch]\nmode = \"average\"\n";

const GYROFLOW: &str = r#"{"calib_dimension": {"w": 640, "h": 480}, "frame_readout_time": 15.5,
 "fisheye_params": {"camera_matrix": [[415, 0, 318], [0, 417, 241], [0, 0, 1]],
 "distortion_coeffs": [-0.01, 0.005, -0.004, 0.0007]}}"#;
const OPENSFM: &str = r#"[{"cameras": {"v2": {"projection_type": "brown", "width": 640,
 "height": 480, "focal_x": 0.65, "focal_y": 0.65, "c_x": 0.01, "k1": -0.1}},
 "shots": {"a.png": {"rotation": [0.1, 0.2, 0.3], "translation": [1, 2, 3]}}}]"#;
const MESHROOM: &str = r#"{"version": ["1", "2", "6"], "views": [{"poseId": "2", "path": "a.png"}],
 "intrinsics": [{"intrinsicId": "3", "width": "640", "height": "480", "sensorWidth": "36",
 "type": "radial3", "focalLength": "24", "pixelRatio": "1", "principalPoint": ["-2", "1"],
 "distortionParams": ["-0.1", "0.01", "0"]}], "poses": [{"poseId": "2", "pose": {"transform":
 {"rotation": ["0", "0", "1", "-1", "0", "0", "0", "-1", "0"], "center": ["1", "2", "3"]}}}]}"#;
const OPENMVG: &str = r#"{"sfm_data_version": "0.3", "views": [{"key": 0, "value": {"ptr_wrapper":
 {"data": {"filename": "a.png", "id_pose": 5}}}}], "intrinsics": [{"key": 4, "value":
 {"ptr_wrapper": {"data": {"width": 640, "height": 480, "focal_length": 415,
 "principal_point": [318, 241], "disto_k3": [-0.1, 0.01, 0]}}}}], "extrinsics": [{"key": 5,
 "value": {"rotation": [[0, -1, 0], [0, 0, -1], [1, 0, 0]], "center": [1, 2, 3]}}]}"#;
const METASHAPE: &str = r#"<document><chunk><sensors><sensor id="0"><calibration type="fisheye">
<resolution width="640" height="480"/><f>415</f><cx>-2</cx><k1>-0.1</k1><p1>0.001</p1>
</calibration></sensor></sensors><cameras><camera id="0" label="a"><transform>0 0 1 1 -1 0 0 2
0 -1 0 3 0 0 0 1</transform></camera></cameras><transform><rotation>0 -1 0 1 0 0 0 0 1</rotation>
<translation>10 0 0</translation><scale>2</scale></transform></chunk></document>"#;
const REALITYCAPTURE: &str =
    "#name,x,y,alt,heading,pitch,roll,f\na.png,1,2,3,10,90,-5,35\nb.png,1,2,4,10,90,-5,35\n";
const PIX4D: &str = "imageName X Y Z Omega Phi Kappa\na.png 1 2 3 90 10 -5\nb.png 1 2 4 90 10 -5\n";

const SAMPLES: [(&str, &str); 24] = [
    ("poses.tum", TUM),
    ("poses.txt", KITTI),
    ("poses.csv", CSV),
    ("data.csv", EUROC),
    ("images.txt", COLMAP),
    ("transforms.json", NERF),
    ("camera.json", OWN),
    ("camera.yml", OPENCV),
    ("camchain.yaml", KALIBR),
    ("cameras.txt", CAMERAS),
    ("camera.yaml", MEI),
    ("calibration.json", BASALT),
    ("calib_results.txt", OCAM),
    ("cameras.txt", THIN_PRISM),
    ("camera.json", OWN_OCAM),
    ("lens.json", GYROFLOW),
    ("reconstruction.json", OPENSFM),
    ("cameras.sfm", MESHROOM),
    ("sfm_data.json", OPENMVG),
    ("cameras.xml", METASHAPE),
    ("cameras.csv", REALITYCAPTURE),
    ("external.txt", PIX4D),
    ("axis.json", AXIS),
    ("survey.toml", SURVEY),
];

/// One change of a text.
#[derive(Clone, Debug)]
enum Change {
    Byte(usize, u8),
    Cut(usize, usize),
    Repeat(usize, usize),
    Insert(usize, &'static str),
}

fn change() -> impl Strategy<Value = Change> {
    let odd = prop::sample::select(vec![
        "nan",
        "-",
        "1e999",
        "1e-999",
        "\"",
        "]",
        "{",
        "\n",
        "\r\n",
        "0",
        ",",
        ":",
        "\t",
        "é",
        "\0",
        "99999999999999999999",
    ]);
    prop_oneof![
        (any::<usize>(), any::<u8>()).prop_map(|(at, byte)| Change::Byte(at, byte)),
        (any::<usize>(), 1usize..40).prop_map(|(at, count)| Change::Cut(at, count)),
        (any::<usize>(), 1usize..40).prop_map(|(at, count)| Change::Repeat(at, count)),
        (any::<usize>(), odd).prop_map(|(at, text)| Change::Insert(at, text)),
    ]
}

fn changed(text: &str, changes: &[Change]) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    for change in changes {
        let length = bytes.len().max(1);
        let end = |at: usize, count: usize| (at % length + count).min(bytes.len());
        match *change {
            Change::Byte(at, byte) => {
                if let Some(place) = bytes.get_mut(at % length) {
                    *place = byte;
                }
            }
            Change::Cut(at, count) => {
                bytes.drain((at % length).min(bytes.len())..end(at, count));
            }
            Change::Repeat(at, count) => {
                let part = bytes[(at % length).min(bytes.len())..end(at, count)].to_vec();
                bytes.extend(part);
            }
            Change::Insert(at, text) => {
                let at = (at % length).min(bytes.len());
                bytes.splice(at..at, text.bytes());
            }
        }
    }
    bytes
}

fn read_by_all(path: &Path, name: &str) {
    if let Ok(camera) = read_calibration(path, None) {
        assert!(
            camera.fx > 0.0 && camera.fx.is_finite() && camera.cx.is_finite(),
            "{camera:?}"
        );
        for pixel in camera.border(4, 0.5) {
            assert!(pixel.iter().all(|v| v.is_finite()), "{camera:?}");
        }
    }
    if let Ok(file) = read_poses(path, None) {
        for entry in &file.entries {
            assert!(entry.pose.t_wc.iter().all(|v| v.is_finite()), "{entry:?}");
            assert!((entry.pose.r_wc.norm() - 1.0).abs() < 1e-9, "{entry:?}");
        }
    }
    for pose in [read_camera_in_body(path, None), read_tunnel_frame(path)]
        .into_iter()
        .flatten()
    {
        assert!(pose.t_wc.iter().all(|v| v.is_finite()), "{pose:?}");
    }
    if name == "survey.toml" {
        let message = Survey::open(path).map(|_| ()).unwrap_err().to_string();
        assert!(!message.is_empty());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 3000, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_never_panic(
        which in 0..SAMPLES.len(), changes in prop::collection::vec(change(), 0..4),
    ) {
        let (name, text) = SAMPLES[which];
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, changed(text, &changes)).unwrap();
        read_by_all(&path, name);
    }
}
