//! The cameras of Bundler's `bundle.out` (v0.3), focal length and two coefficients of each.
//!
//! A point (x, y, z) of the camera, y up and z backwards, is at `f r(p) p` from the middle of the
//! picture, `p = −(x, y) / z`, `r(p) = 1 + k1 |p|² + k2 |p|⁴`, to the right and up. With y down and
//! z forward, as here, that is the model of OpenCV with two coefficients and the principal point in
//! the middle: ((w − 1) / 2, (h − 1) / 2), as the centre of the first pixel is (0, 0). The size of
//! the pictures is not in the file. Cameras are named by their numbers, from 0.
//!
//! Source: "Bundler v0.4 User's Manual", "Output format and scene representation".

use super::coefficients::brown_conrady;
use super::error::ParseError;
use super::per_picture::select_shared;
use super::picture_size::{PictureSize, needed};
use super::words::{data_lines, finite};
use crate::camera::projection::Camera;

/// Begin of the file's first line.
const TITLE: &str = "# Bundle file";
/// Numbers of a camera: f k1 k2, R, t.
const CAMERA_NUMBERS: usize = 15;

/// True for a text that begins as a bundle file does.
pub fn is_bundle(text: &str) -> bool {
    text.starts_with(TITLE)
}

/// Reads the calibration that all cameras share, or that of the camera of this number. Cameras
/// without a pose are left out.
pub fn read(text: &str, name: Option<&str>, size: PictureSize) -> Result<Camera, ParseError> {
    let [f, k1, k2] = select_shared(cameras(text)?, name)?;
    let [width, height] = needed(size)?;
    let centre = [width, height].map(|side| 0.5 * (f64::from(side) - 1.0));
    let lens = brown_conrady(&[k1, k2])?;
    Ok(Camera::at_rest([width, height], [f, f], centre, lens))
}

/// Focal length and coefficients of each camera with a pose, with its number.
fn cameras(text: &str) -> Result<Vec<(String, [f64; 3])>, ParseError> {
    let lines = data_lines(text);
    let mut words = lines.flat_map(|(number, line)| {
        let words = line.split_whitespace();
        words.map(move |word| (number, word))
    });
    let ends = || ParseError::new("the file ends before its last camera; it was cut off");
    let (number, word) = words.next().ok_or_else(ends)?;
    let count: usize = word.parse().map_err(|_| {
        let what = format!("{word:?} is not the number of cameras");
        ParseError::at(number, what)
    })?;
    // The number of points.
    words.next();
    let mut cameras = Vec::new();
    for camera in 0..count {
        let mut values = [0.0; CAMERA_NUMBERS];
        for value in &mut values {
            let (number, word) = words.next().ok_or_else(ends)?;
            *value = finite(word, number)?;
        }
        let [f, k1, k2, pose @ ..] = values;
        if pose.iter().any(|value| *value != 0.0) {
            cameras.push((camera.to_string(), [f, k1, k2]));
        }
    }
    Ok(cameras)
}

#[cfg(test)]
mod tests {
    use crate::camera::calibration::tests::read_sized;
    use nalgebra::Vector3;

    const BUNDLE: &str = "# Bundle file v0.3\n3 1\n\
        400 0.1 0.2\n1 0 0\n0 1 0\n0 0 1\n0 0 0\n\
        0 0 0\n0 0 0\n0 0 0\n0 0 0\n0 0 0\n\
        400 0.1 0.2\n1 0 0\n0 1 0\n0 0 1\n1 2 3\n";

    /// A point of Bundler's manual worked by hand: x 1 to the right, y 0.5 up, 2 ahead.
    #[test]
    fn points_are_where_the_manual_says() {
        let camera = read_sized("bundle.out", BUNDLE, None, Some([640, 480])).unwrap();
        // p = −(1, 0.5) / −2 = (0.5, 0.25), |p|² = 0.3125, r = 1.05078125.
        let r = 1.0 + 0.1 * 0.3125 + 0.2 * 0.3125 * 0.3125;
        let [right, up] = [400.0 * r * 0.5, 400.0 * r * 0.25];
        // y up and z backwards are −y and −z here.
        let pixel = camera.project(&Vector3::new(1.0, -0.5, 2.0)).unwrap();
        assert!((pixel.x - (319.5 + right)).abs() < 1e-9, "{pixel}");
        assert!((pixel.y - (239.5 - up)).abs() < 1e-9, "{pixel}");
    }

    #[test]
    fn cameras_that_differ_are_selected_by_number() {
        let other = BUNDLE.replacen("400", "500", 1);
        let read = |name| read_sized("bundle.out", &other, name, Some([640, 480]));
        assert_eq!(read(Some("2")).unwrap().fx, 400.0);
        for (text, size, expected) in [
            (
                other.as_str(),
                Some([640, 480]),
                "1 of 2 pictures have another",
            ),
            (BUNDLE, None, "no size of its pictures"),
            (&BUNDLE[..80], Some([640, 480]), "cut off"),
            (
                &BUNDLE.replacen("0.2", "x", 1),
                Some([640, 480]),
                "out:3: \"x\" is not",
            ),
            (
                &BUNDLE.replacen("3 1", "n 1", 1),
                Some([640, 480]),
                "out:2: \"n\" is not",
            ),
            ("400 0 0\n", Some([640, 480]), "not a calibration known"),
        ] {
            let message = read_sized("bundle.out", text, None, size).unwrap_err();
            assert!(message.to_string().contains(expected), "{message}");
        }
        assert!(
            read(Some("1"))
                .unwrap_err()
                .to_string()
                .contains("no picture \"1\"")
        );
    }
}
