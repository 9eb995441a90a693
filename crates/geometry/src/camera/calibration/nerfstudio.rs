//! The camera in the `transforms.json` of nerfstudio, instant-ngp and NeRF's synthetic scenes.
//!
//! The two older programs give the angle of view instead of the focal length: `f = w / 2 / tan(α /
//! 2)`. Source: instant-ngp, "Tips for training NeRF models".

use super::coefficients::{brown_conrady, kannala_brandt};
use super::error::ParseError;
use super::picture_size::PictureSize;
use super::selection::select_camera;
use super::value_tree::{number, pixels, text_entry};
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use serde_json::Value;
use std::f64::consts::PI;

/// True for a file with `fl_x`, `frames` or `camera_angle_x`.
pub fn is_transforms(tree: &Value) -> bool {
    ["fl_x", "frames", "camera_angle_x"]
        .iter()
        .any(|name| tree.get(name).is_some())
}

/// Reads `fl_x`, `fl_y`, `cx`, `cy`, `w`, `h`, `camera_model` and the coefficients, given at the
/// top level or, if every frame has its own, in each frame (then `name` is a frame's `file_path`).
/// Pixel coordinates are counted from the corner of the first pixel and converted.
///
/// Without any `fl_x`, the angles of view `camera_angle_x` and `camera_angle_y` (radians) give the
/// focal lengths, the size may be that of the frames, and the principal point is the middle of the
/// picture unless it is given.
pub fn read(
    tree: &Value,
    name: Option<&str>,
    picture_size: PictureSize,
) -> Result<Camera, ParseError> {
    if tree.get("fl_x").is_some() {
        return camera(tree, tree);
    }
    let frames = tree.get("frames").and_then(Value::as_array);
    let own: Vec<_> = frames
        .into_iter()
        .flatten()
        .filter(|frame| frame.get("fl_x").is_some())
        .map(|frame| {
            let path = text_entry(frame, "file_path").unwrap_or("?");
            (path.to_owned(), frame)
        })
        .collect();
    if own.is_empty() {
        return camera_of_angles(tree, picture_size);
    }
    // Identical cameras of all frames count as one.
    let (_, first) = &own[0];
    let intrinsics = [
        "fl_x", "fl_y", "cx", "cy", "w", "h", "k1", "k2", "k3", "k4", "p1", "p2",
    ];
    let alike = |frame: &Value| {
        intrinsics
            .iter()
            .all(|name| frame.get(name) == first.get(name))
    };
    if own.iter().all(|(_, frame)| alike(frame)) {
        return camera(first, tree);
    }
    camera(select_camera(own, name)?, tree)
}

fn camera(own: &Value, tree: &Value) -> Result<Camera, ParseError> {
    let fx = number(own, &["fl_x"])?;
    Ok(Camera::at_rest(
        [pixels(own, &["w"])?, pixels(own, &["h"])?],
        [
            fx,
            own.get("fl_y").map_or(Ok(fx), |_| number(own, &["fl_y"]))?,
        ],
        [number(own, &["cx"])? - 0.5, number(own, &["cy"])? - 0.5],
        lens(own, tree)?,
    ))
}

/// The camera of a file that gives its angles of view.
fn camera_of_angles(tree: &Value, picture_size: PictureSize) -> Result<Camera, ParseError> {
    if tree.get("camera_angle_x").is_none() {
        return Err(ParseError::new(
            "there is no `fl_x`; the focal lengths in pixels must be given as fl_x and fl_y, or \
             the angle of view as camera_angle_x in radians",
        ));
    }
    let [width, height] = size_of_frames(tree, picture_size)?;
    let [middle_x, middle_y] = [width, height].map(|side| 0.5 * f64::from(side));
    let fx = focal_px(tree, "camera_angle_x", middle_x)?;
    let fy = match tree.get("camera_angle_y") {
        Some(_) => focal_px(tree, "camera_angle_y", middle_y)?,
        None => fx,
    };
    let centre =
        |name: &str, middle: f64| tree.get(name).map_or(Ok(middle), |_| number(tree, &[name]));
    Ok(Camera::at_rest(
        [width, height],
        [fx, fy],
        [centre("cx", middle_x)? - 0.5, centre("cy", middle_y)? - 0.5],
        lens(tree, tree)?,
    ))
}

/// The focal length of an angle of view across twice `half_px`, pixels.
fn focal_px(tree: &Value, name: &str, half_px: f64) -> Result<f64, ParseError> {
    let angle_rad = number(tree, &[name])?;
    if angle_rad > 0.0 && angle_rad < PI {
        return Ok(half_px / (0.5 * angle_rad).tan());
    }
    Err(ParseError::new(format!(
        "`{name}` is {angle_rad}; an angle of view is in radians, between 0 and π"
    )))
}

/// Width and height of the pictures, pixels: those of the file, those that all frames share, or
/// those of the pictures themselves.
fn size_of_frames(tree: &Value, picture_size: PictureSize) -> Result<[u32; 2], ParseError> {
    let size = |of: &Value| Ok([pixels(of, &["w"])?, pixels(of, &["h"])?]);
    let frames = tree.get("frames").and_then(Value::as_array);
    let mut frames = frames.into_iter().flatten();
    let has_size = |of: &Value| of.get("w").is_some() || of.get("h").is_some();
    if !has_size(tree)
        && !frames.clone().any(has_size)
        && let Some(size) = picture_size()
    {
        return Ok(size);
    }
    let Some(first) = frames.next().filter(|_| tree.get("w").is_none()) else {
        return size(tree);
    };
    let alike = |frame: &Value| {
        ["w", "h"]
            .iter()
            .all(|name| frame.get(name) == first.get(name))
    };
    if first.get("w").is_none() || !frames.all(alike) {
        return Err(ParseError::new(
            "there is neither a size `w` and `h` nor one that all frames share; add \
             \"w\": WIDTH, \"h\": HEIGHT in pixels beside camera_angle_x",
        ));
    }
    size(first)
}

fn lens(own: &Value, tree: &Value) -> Result<Lens, ParseError> {
    let coefficient = |name: &str| match own.get(name) {
        None => Ok(0.0),
        Some(_) => number(own, &[name]),
    };
    let [k1, k2, k3, k4] = [
        coefficient("k1")?,
        coefficient("k2")?,
        coefficient("k3")?,
        coefficient("k4")?,
    ];
    let model = text_entry(own, "camera_model").or_else(|| text_entry(tree, "camera_model"));
    let lens = match model.unwrap_or("OPENCV") {
        "OPENCV_FISHEYE" => kannala_brandt(&[k1, k2, k3, k4])?,
        "PINHOLE" | "SIMPLE_PINHOLE" => Lens::default(),
        "OPENCV" | "SIMPLE_RADIAL" | "RADIAL" => {
            if k4 != 0.0 {
                return Err(ParseError::new(
                    "k4 is the eighth power of the radius in nerfstudio's model and is not \
                     supported; it must be 0",
                ));
            }
            brown_conrady(&[k1, k2, coefficient("p1")?, coefficient("p2")?, k3])?
        }
        other => {
            return Err(ParseError::new(format!(
                "the camera model {other} is not supported; known are PINHOLE, OPENCV and \
                 OPENCV_FISHEYE"
            )));
        }
    };
    Ok(lens)
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_camera;

    /// A quarter of a turn across 640 px: f = 320 px.
    #[test]
    fn angles_of_view_are_focal_lengths() {
        let quarter = std::f64::consts::FRAC_PI_2;
        let frames = r#""frames": [{"file_path": "a", "w": 640, "h": 480},
            {"file_path": "b", "w": 640, "h": 480}]"#;
        let of_file = r#""w": 640, "h": 480, "frames": []"#;
        for size in [of_file, frames] {
            let text = format!(r#"{{"camera_angle_x": {quarter}, {size}}}"#);
            let camera = read_camera("transforms.json", &text, None).unwrap();
            assert!((camera.fx - 320.0).abs() < 1e-9 && camera.fx == camera.fy);
            assert_eq!((camera.cx, camera.cy), (319.5, 239.5));
        }
        let text = format!(
            r#"{{"camera_angle_x": {quarter}, "camera_angle_y": {quarter}, "cx": 300.5, "cy": 240,
                "k1": -0.1, {of_file}}}"#
        );
        let camera = read_camera("transforms.json", &text, None).unwrap();
        assert!((camera.fy - 240.0).abs() < 1e-9);
        assert_eq!((camera.cx, camera.lens.name()), (300.0, "brown-conrady"));
    }

    #[test]
    fn an_angle_needs_the_size_of_the_frames() {
        for (entries, expected) in [
            (r#""camera_angle_x": 0.7"#, "`w` is missing"),
            (r#""camera_angle_x": 0.7, "frames": [{}]"#, "neither a size"),
            (
                r#""camera_angle_x": 0.7, "frames": [{"w": 64, "h": 48}, {"w": 32, "h": 48}]"#,
                "neither a size",
            ),
            (
                r#""camera_angle_x": 70, "w": 640, "h": 480"#,
                "`camera_angle_x` is 70",
            ),
        ] {
            let text = format!("{{{entries}}}");
            let message = read_camera("transforms.json", &text, None).unwrap_err();
            assert!(message.to_string().contains(expected), "{message}");
        }
    }
}
