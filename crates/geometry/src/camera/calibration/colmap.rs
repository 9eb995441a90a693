//! COLMAP's `cameras.txt`, and the cameras of its text and its binary model.

use super::coefficients::{brown_conrady, eucm, fov, kannala_brandt, thin_prism_fisheye};
use super::error::ParseError;
use super::selection::select_camera;
use super::words::data_lines;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;

/// Creates a lens from its coefficients.
type ReadLens = fn(&[f64]) -> Result<Lens, ParseError>;

/// True for a file with lines of which none has a name where a camera has its model.
pub fn has_no_model(text: &str) -> bool {
    let has_name = |line: &str| {
        let second = line.split_whitespace().nth(1).unwrap_or_default();
        let mut letters = second.chars();
        letters
            .next()
            .is_some_and(|first| first.is_ascii_uppercase())
            && letters.all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_')
    };
    let mut lines = data_lines(text).peekable();
    lines.peek().is_some() && !lines.any(|(_, line)| has_name(line))
}

/// Reads `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`; pixel coordinates are counted from the corner of
/// the first pixel and converted.
pub fn read(text: &str, name: Option<&str>) -> Result<Camera, ParseError> {
    let cameras = data_lines(text).map(|(number, line)| {
        let mut words = line.split_whitespace();
        let id = words.next().unwrap_or_default().to_owned();
        (
            id,
            CameraLine {
                number,
                words: words.collect(),
            },
        )
    });
    let line = select_camera(cameras.collect(), name)?;
    camera(&line.words).map_err(|what| ParseError::at(line.number, what))
}

/// A camera's line without its id. COLMAP writes a camera for each picture unless asked to
/// share one: lines of the same words are one camera.
struct CameraLine<'a> {
    number: usize,
    words: Vec<&'a str>,
}

impl PartialEq for CameraLine<'_> {
    fn eq(&self, other: &Self) -> bool {
        self.words == other.words
    }
}

fn camera(words: &[&str]) -> Result<Camera, String> {
    let [model, width, height, params @ ..] = words else {
        return Err("a camera is `CAMERA_ID MODEL WIDTH HEIGHT PARAMS…`".to_owned());
    };
    let size = |word: &str| {
        word.parse::<u32>()
            .map_err(|_| format!("{word:?} is not a number of pixels"))
    };
    let (width, height) = (size(width)?, size(height)?);
    let params: Vec<f64> = params
        .iter()
        .map(|word| match word.parse::<f64>() {
            Ok(value) if value.is_finite() => Ok(value),
            _ => Err(format!("{word:?} is not a number")),
        })
        .collect::<Result<_, String>>()?;
    camera_of(model, [width, height], &params)
}

/// Creates a camera of COLMAP's model of that name; pixel coordinates are counted from the corner
/// of the first pixel and converted.
pub fn camera_of(model: &str, size: [u32; 2], params: &[f64]) -> Result<Camera, String> {
    let fail = |count: usize| format!("{model} has {count} parameters, not {}", params.len());
    // Focal lengths and principal point, and how many coefficients follow.
    let (central, rest, lens): (_, _, ReadLens) = match model {
        "SIMPLE_PINHOLE" => (3, 0, brown_conrady),
        "PINHOLE" => (4, 0, brown_conrady),
        "SIMPLE_RADIAL" => (3, 1, |d| brown_conrady(&[d[0], 0.0])),
        "RADIAL" => (3, 2, brown_conrady),
        "OPENCV" => (4, 4, brown_conrady),
        "FULL_OPENCV" => (4, 8, brown_conrady),
        "SIMPLE_RADIAL_FISHEYE" => (3, 1, kannala_brandt),
        "RADIAL_FISHEYE" => (3, 2, kannala_brandt),
        "OPENCV_FISHEYE" => (4, 4, kannala_brandt),
        "THIN_PRISM_FISHEYE" => (4, 8, thin_prism_fisheye),
        "FOV" => (4, 1, fov),
        "EUCM" => (4, 2, eucm),
        _ => {
            return Err(format!(
                "the camera model {model} is not supported; known are SIMPLE_PINHOLE, PINHOLE, \
                 SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV, SIMPLE_RADIAL_FISHEYE, \
                 RADIAL_FISHEYE, OPENCV_FISHEYE, THIN_PRISM_FISHEYE, FOV and EUCM (`colmap \
                 model_converter` and `colmap image_undistorter` make one)"
            ));
        }
    };
    if params.len() != central + rest {
        return Err(fail(central + rest));
    }
    let [fx, fy, cx, cy] = match params[..central] {
        [f, cx, cy] => [f, f, cx, cy],
        [fx, fy, cx, cy] => [fx, fy, cx, cy],
        _ => return Err(fail(central + rest)),
    };
    Ok(Camera::at_rest(
        size,
        [fx, fy],
        [cx - 0.5, cy - 0.5],
        lens(&params[central..]).map_err(|error| error.what)?,
    ))
}
