//! COLMAP's `cameras.bin`.
//!
//! | bytes | content |
//! | --- | --- |
//! | 8 | number of cameras |
//! | 4 | id of a camera |
//! | 4 | number of its model |
//! | 8, 8 | width and height, pixels |
//! | 8 each | its parameters, as many as the model has, in the order of `cameras.txt` |
//!
//! All numbers are little-endian; the last four rows repeat. Source: COLMAP's documentation,
//! "Output Format"; `src/colmap/sensor/models.h` for the numbers of the models.

use super::colmap::camera_of;
use super::error::ParseError;
use super::selection::select_camera;
use crate::camera::projection::Camera;
use crate::files::BinaryFile;
use std::io;

/// Name and number of parameters of the model with each number.
const MODELS: [(&str, usize); 18] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
    ("RAD_TAN_THIN_PRISM_FISHEYE", 16),
    ("SIMPLE_DIVISION", 4),
    ("DIVISION", 5),
    ("SIMPLE_FISHEYE", 3),
    ("FISHEYE", 4),
    ("EUCM", 6),
    ("EQUIRECTANGULAR", 2),
];

/// Bytes of a camera without parameters.
const MIN_CAMERA_BYTES: u64 = 24;

/// A camera as the file has it, without its id.
struct CameraRecord {
    /// Position in the file, bytes.
    at: u64,
    model: &'static str,
    size: [u64; 2],
    params: Vec<f64>,
}

impl PartialEq for CameraRecord {
    fn eq(&self, other: &Self) -> bool {
        (self.model, self.size, &self.params) == (other.model, other.size, &other.params)
    }
}

/// Reads one of the cameras; `name` is its id, and may be omitted if all are equal.
pub fn read(file: &mut BinaryFile, name: Option<&str>) -> Result<Camera, ParseError> {
    let unreadable = |error: io::Error| {
        ParseError::new(format!(
            "{error}; cameras.bin of a COLMAP model is read, or its text model (colmap \
             model_converter --output_type TXT)"
        ))
    };
    let count = file.count(MIN_CAMERA_BYTES).map_err(unreadable)?;
    let mut cameras = Vec::with_capacity(count);
    for _ in 0..count {
        let at = file.at();
        let id = file.u32().map_err(unreadable)?;
        let number = file.i32().map_err(unreadable)?;
        let size = [file.u64(), file.u64()];
        let model = usize::try_from(number).ok().and_then(|k| MODELS.get(k));
        let Some((model, parameters)) = model else {
            return Err(ParseError::new(format!(
                "byte {at}: camera {id} has the model number {number}, which is none of COLMAP's \
                 0 to {}; save the model as text (colmap model_converter --output_type TXT)",
                MODELS.len() - 1
            )));
        };
        let [width, height] = size;
        let params = (0..*parameters).map(|_| file.f64s().map(|[value]| value));
        let record = CameraRecord {
            at,
            model,
            size: [width.map_err(unreadable)?, height.map_err(unreadable)?],
            params: params.collect::<Result<_, _>>().map_err(unreadable)?,
        };
        cameras.push((id.to_string(), record));
    }
    file.end().map_err(unreadable)?;
    let record = select_camera(cameras, name)?;
    camera(&record).map_err(|what| ParseError::new(format!("byte {}: {what}", record.at)))
}

fn camera(record: &CameraRecord) -> Result<Camera, String> {
    let side = |side: u64| {
        u32::try_from(side).map_err(|_| format!("a side of {side} is not a number of pixels"))
    };
    let [width, height] = record.size;
    if let Some(value) = record.params.iter().find(|value| !value.is_finite()) {
        return Err(format!("a parameter is {value}; it must be a number"));
    }
    camera_of(record.model, [side(width)?, side(height)?], &record.params)
}
