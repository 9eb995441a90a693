//! OpenCV's files (YAML, JSON, XML), ROS's `camera_info`, EuRoC's `sensor.yaml`, the intrinsics of
//! RealSense and Open3D, and whatever else gives the numbers of OpenCV's model the usual names.

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::named_entries::{NamedEntries, plain};
use super::picture_size::PictureSize;
use super::unknown::unknown_calibration;
use super::value_tree::numbers;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;

const MATRIX: [&str; 6] = [
    "cameramatrix",
    "k",
    "intrinsics",
    "mtx",
    "intrinsicmatrix",
    "intrinsic",
];
/// Lists of fx, fy, cx and cy, as Kalibr and EuRoC write them.
const FOUR: [&str; 2] = ["intrinsics", "intrinsic"];
const DISTORTION: [&str; 9] = [
    "distortioncoefficients",
    "distcoeffs",
    "distcoeff",
    "distortioncoeffs",
    "d",
    "distortion",
    "dist",
    "coeffs",
    "distortionparameters",
];
/// Coefficients that are entries of their own, in OpenCV's order.
const COEFFICIENTS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
/// Those of a fisheye.
const FISHEYE_COEFFICIENTS: [&str; 4] = ["k1", "k2", "k3", "k4"];
/// Names of fx, fy, cx and cy.
const NUMBERS: [&[&str]; 4] = [
    &["fx", "focalx", "focallengthx"],
    &["fy", "focaly", "focallengthy"],
    &["cx", "ppx", "u0", "principalpointx"],
    &["cy", "ppy", "v0", "principalpointy"],
];
const WIDTH: [&str; 3] = ["imagewidth", "width", "w"];
const HEIGHT: [&str; 3] = ["imageheight", "height", "h"];
const SIZE: [&str; 3] = ["resolution", "imagesize", "imgsize"];
const MODEL: [&str; 3] = ["distortionmodel", "model", "cameramodel"];

/// True for a tree with a focal length and a principal point.
pub fn has_camera(tree: &Value) -> bool {
    let entries = NamedEntries::of(tree);
    entries.list(&MATRIX).is_some() || NUMBERS.iter().all(|names| entries.number(names).is_some())
}

/// Reads the camera matrix, or its four numbers; the distortion coefficients, as a list or one by
/// one; and the size of the pictures, under any of their common names.
///
/// ROS and others name the lens model; OpenCV's files hold a fisheye if `fisheye_model` is 1. Files
/// without a size have that of the pictures.
pub fn read(tree: &Value, picture_size: PictureSize) -> Result<Camera, ParseError> {
    let entries = NamedEntries::of(tree);
    let four = entries.list(&FOUR).map(|list| numbers(list, "intrinsics"));
    let [focal, centre] = match (entries.list(&MATRIX), four.transpose()?.as_deref()) {
        (_, Some([fx, fy, cx, cy])) => [[*fx, *fy], [*cx, *cy]],
        (Some(matrix), _) => focal_and_centre(matrix)?,
        (None, _) => {
            let named = NUMBERS.map(|names| entries.number(names));
            let [Some(fx), Some(fy), Some(cx), Some(cy)] = named else {
                return Err(unknown_calibration(
                    " (no `camera_matrix`, `fx`, `cam0` or `model_type`)",
                ));
            };
            [[fx, fy], [cx, cy]]
        }
    };
    let [width, height] = size(&entries, picture_size)?;
    Ok(Camera::at_rest(
        [width, height],
        focal,
        centre,
        lens(&entries)?,
    ))
}

/// Width and height of the pictures, pixels.
fn size(entries: &NamedEntries, picture_size: PictureSize) -> Result<[u32; 2], ParseError> {
    let remedy = "add the frames' size as image_width and image_height";
    let both = entries
        .list(&SIZE)
        .map(|list| numbers(list, "resolution"))
        .transpose()?;
    let sides = [&WIDTH, &HEIGHT].map(|names| entries.find(names, |_| true));
    let stated = match (both.as_deref(), sides) {
        (_, [None, None]) if both.is_none() => None,
        (_, [Some(width), Some(height)]) => Some([width.as_f64(), height.as_f64()]),
        (Some([width, height]), _) => Some([Some(*width), Some(*height)]),
        _ => {
            let what = format!("the entry `image_width` or `image_height` is missing; {remedy}");
            return Err(ParseError::new(what));
        }
    };
    let Some(stated) = stated else {
        return picture_size().ok_or_else(|| {
            ParseError::new(format!("the entry `image_width` is missing; {remedy}"))
        });
    };
    let is_side = |side: &f64| side.fract() == 0.0 && (1.0..=1e6).contains(side);
    match stated.map(|side| side.filter(is_side)) {
        [Some(width), Some(height)] => Ok([width as u32, height as u32]),
        _ => Err(ParseError::new(format!(
            "`image_width` and `image_height` must be whole numbers of pixels; {remedy}"
        ))),
    }
}

/// The lens of the model that the file names.
fn lens(entries: &NamedEntries) -> Result<Lens, ParseError> {
    let is_one = |flag: &Value| flag.as_f64() == Some(1.0) || flag.as_bool() == Some(true);
    let is_fisheye = entries.find(&["fisheyemodel", "fisheye"], is_one).is_some();
    let named = entries.text(&MODEL).unwrap_or_default();
    let listed = entries
        .list(&DISTORTION)
        .map(|list| numbers(list, "distortion_coefficients"))
        .transpose()?;
    let single = |names: &[&str]| -> Vec<f64> {
        let values = names.iter().map(|name| entries.number(&[name]));
        let values: Vec<Option<f64>> = values.collect();
        if values.iter().all(Option::is_none) {
            return Vec::new();
        }
        values.into_iter().map(Option::unwrap_or_default).collect()
    };
    match plain(named).as_str() {
        _ if is_fisheye => fisheye(listed.unwrap_or_else(|| single(&FISHEYE_COEFFICIENTS))),
        "equidistant" | "equi" | "fisheye" | "opencvfisheye" | "kannalabrandt"
        | "kannalabrandt4" => fisheye(listed.unwrap_or_else(|| single(&FISHEYE_COEFFICIENTS))),
        "" | "plumbbob" | "rationalpolynomial" | "radtan" | "radialtangential" | "brown"
        | "brownconrady" | "opencv" | "pinhole" | "perspective" => {
            brown_conrady(&listed.unwrap_or_else(|| single(&COEFFICIENTS)))
        }
        "none" => Ok(Lens::default()),
        _ => Err(ParseError::new(format!(
            "the distortion model {named:?} is not supported; known are plumb_bob, \
             rational_polynomial and equidistant"
        ))),
    }
}

fn fisheye(mut coefficients: Vec<f64>) -> Result<Lens, ParseError> {
    // Some write the five places of a pinhole.
    while coefficients.len() > FISHEYE_COEFFICIENTS.len() && coefficients.last() == Some(&0.0) {
        coefficients.pop();
    }
    kannala_brandt(&coefficients)
}

/// The focal lengths and the principal point of a camera matrix, pixels: nine numbers row by row,
/// or, as Open3D writes them, column by column.
pub fn focal_and_centre(matrix: &Value) -> Result<[[f64; 2]; 2], ParseError> {
    let k = numbers(matrix, "camera_matrix")?;
    let [fx, skew, cx, fy, cy] = match k[..] {
        [fx, 0.0, 0.0, 0.0, fy, 0.0, cx, cy, 1.0] if cx != 0.0 => [fx, 0.0, cx, fy, cy],
        [fx, skew, cx, _, fy, cy, _, _, _] => [fx, skew, cx, fy, cy],
        _ => {
            return Err(ParseError::new(format!(
                "`camera_matrix` has {} numbers; it must have 3 × 3",
                k.len()
            )));
        }
    };
    if skew != 0.0 {
        return Err(ParseError::new(format!(
            "`camera_matrix` has a skew of {skew}; cameras with skew are not supported"
        )));
    }
    Ok([[fx, fy], [cx, cy]])
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::{read_camera, read_sized};

    const SIZED: &str = "image_width: 640\nimage_height: 480\n";

    fn same_as(name: &str, text: &str) -> bool {
        let matrix = "camera_matrix: [500.0, 0, 310.0, 0, 501.0, 230.0, 0, 0, 1]\n";
        let reference = format!("{SIZED}{matrix}distortion_coefficients: [-0.2, 0.03, 0, 0, 0]\n");
        read_camera(name, text, None).unwrap() == read_camera("r.yaml", &reference, None).unwrap()
    }

    /// One camera, as OpenCV, ROS, EuRoC, RealSense, Open3D and people write it.
    #[test]
    fn names_of_other_programs_are_known() {
        let four = "fx: 500\nfy: 501\ncx: 310\ncy: 230\nk1: -0.2\nk2: 0.03\n";
        assert!(same_as("a.yaml", &format!("{SIZED}{four}")));
        let toml = four.replace(": ", " = ") + "width = 640\nheight = 480\n";
        assert!(same_as("a.toml", &toml));
        let euroc = "sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1]\n\
            resolution: [640, 480]\ncamera_model: pinhole\nintrinsics: [500, 501, 310, 230]\n\
            distortion_model: radial-tangential\n\
            distortion_coefficients: [-0.2, 0.03, 0.0, 0.0]\n";
        assert!(same_as("sensor.yaml", euroc));
        let echo = "height: 480\nwidth: 640\ndistortion_model: plumb_bob\n\
            D: [-0.2, 0.03, 0, 0, 0]\nK: [500, 0, 310, 0, 501, 230, 0, 0, 1]\n---\nheight: 1\n";
        assert!(same_as("echo.yaml", echo));
        let realsense = r#"{"width": 640, "height": 480, "ppx": 310, "ppy": 230, "fx": 500,
            "fy": 501, "model": "Brown Conrady", "coeffs": [-0.2, 0.03, 0, 0, 0]}"#;
        assert!(same_as("rs.json", realsense));
        let open3d = r#"{"intrinsic": {"width": 640, "height": 480,
            "intrinsic_matrix": [500, 0, 0, 0, 501, 0, 310, 230, 1]}, "k1": -0.2, "k2": 0.03}"#;
        assert!(same_as("o3d.json", open3d));
        let xml = "<opencv_storage><image_Width>640</image_Width><image_Height>480</image_Height>\
            <Camera_Matrix type_id=\"opencv-matrix\"><rows>3</rows><data>500. 0. 310. 0. 501. \
            230. 0. 0. 1.</data></Camera_Matrix><Distortion_Coefficients>\
            <data>-0.2 3e-2 0. 0. 0.</data></Distortion_Coefficients></opencv_storage>";
        assert!(same_as("c.xml", xml));
    }

    /// NeRF's files state neither size.
    #[test]
    fn an_angle_of_view_takes_the_size_of_the_pictures() {
        let text = r#"{"camera_angle_x": 1.0, "frames": [{"file_path": "./r_0"}]}"#;
        let camera = read_sized("transforms.json", text, None, Some([640, 480])).unwrap();
        assert!((camera.fx - 320.0 / 0.5f64.tan()).abs() < 1e-9);
        assert_eq!([camera.width, camera.height], [640, 480]);
        assert_eq!([camera.cx, camera.cy], [319.5, 239.5]);
    }

    /// OpenSfM and OpenDroneMap save cameras without the reconstruction.
    #[test]
    fn cameras_of_opensfm_are_read_alone() {
        let camera = r#"{"projection_type": "brown", "width": 640, "height": 480, "k1": -0.2,
            "focal_x": 0.8, "focal_y": 0.8, "c_x": 0.01, "c_y": 0.0}"#;
        let alone = format!(r#"{{"v2 unknown": {camera}}}"#);
        let whole = format!(r#"[{{"cameras": {alone}, "shots": {{}}}}]"#);
        let read = |text: &str| read_camera("cameras.json", text, None).unwrap();
        assert_eq!(read(&alone), read(&whole));
    }
}
