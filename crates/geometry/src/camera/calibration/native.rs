//! The program's own calibration format, `camera.json` or `camera.toml`.

use super::error::ParseError;
use super::lens_keys::{LensKeys, Model};
use crate::camera::projection::Camera;
use serde::{Deserialize, Serialize, Serializer};
use serde_json::Value;

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PixelCentre {
    /// The centre of the first pixel is (0, 0).
    #[default]
    Integer,
    /// The centre of the first pixel is (½, ½).
    Half,
}

/// A calibration file: `model` ([`Model`]), `width`, `height`, `fx`, `fy`, `cx`, `cy` in pixels;
/// the parameters of the lens ([`LensKeys`]), of which coefficients are 0 if missing;
/// `max_angle_deg`, the largest angle off the axis to be used (no limit if missing); and
/// `pixel_centre` ("integer", the default, or "half").
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraFile {
    model: Model,
    width: u32,
    height: u32,
    fx: f64,
    fy: f64,
    cx: f64,
    cy: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k1: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k2: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    p1: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    p2: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k3: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k4: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k5: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    k6: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    sx1: f64,
    #[serde(default, skip_serializing_if = "is_zero")]
    sy1: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    xi: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    alpha: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    beta: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    omega: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    polynomial: Option<Vec<f64>>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    c: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    d: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    e: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max_angle_deg: Option<f64>,
    #[serde(default)]
    pixel_centre: PixelCentre,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

/// Keys that every camera has.
const KEYS: [&str; 7] = ["model", "width", "height", "fx", "fy", "cx", "cy"];

/// True for an object with one of the keys that every camera has.
pub fn is_native(tree: &Value) -> bool {
    KEYS.iter().any(|key| tree.get(key).is_some())
}

/// True for an object with all of the keys that every camera has.
pub fn has_all_keys(tree: &Value) -> bool {
    KEYS.iter().all(|key| tree.get(key).is_some())
}

/// Reads the file as JSON.
pub fn read_json(text: &str) -> Result<Camera, ParseError> {
    let file: CameraFile = serde_json::from_str(text)
        .map_err(|error| ParseError::at(error.line(), error.to_string()))?;
    file.camera()
}

/// Reads the file as TOML.
pub fn read_toml(text: &str) -> Result<Camera, ParseError> {
    let file: CameraFile = toml::from_str(text).map_err(|error| {
        let before = error.span().map(|span| &text[..span.start.min(text.len())]);
        ParseError {
            line: before.map(|before| 1 + before.matches('\n').count()),
            ..ParseError::new(error.message())
        }
    })?;
    file.camera()
}

/// Formats a `camera.json` that [`crate::camera::calibration::read_calibration`] restores exactly.
pub fn format_calibration(camera: &Camera) -> String {
    // Numbers and plain names always serialise.
    serde_json::to_string_pretty(&CameraFile::of(camera)).unwrap_or_default() + "\n"
}

impl Serialize for Camera {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        CameraFile::of(self).serialize(serializer)
    }
}

impl CameraFile {
    /// Converts a camera to its file.
    pub fn of(camera: &Camera) -> Self {
        let LensKeys {
            model,
            k: [k1, k2, k3, k4, k5, k6],
            p: [p1, p2],
            s: [sx1, sy1],
            xi,
            alpha,
            beta,
            omega,
            polynomial,
            affine: [c, d, e],
        } = LensKeys::of(&camera.lens);
        Self {
            model,
            width: camera.width,
            height: camera.height,
            fx: camera.fx,
            fy: camera.fy,
            cx: camera.cx,
            cy: camera.cy,
            k1,
            k2,
            p1,
            p2,
            k3,
            k4,
            k5,
            k6,
            sx1,
            sy1,
            xi,
            alpha,
            beta,
            omega,
            polynomial,
            c,
            d,
            e,
            max_angle_deg: camera.lens.max_angle_rad().map(f64::to_degrees),
            pixel_centre: PixelCentre::Integer,
        }
    }

    fn camera(&self) -> Result<Camera, ParseError> {
        let lens = LensKeys {
            model: self.model,
            k: [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6],
            p: [self.p1, self.p2],
            s: [self.sx1, self.sy1],
            xi: self.xi,
            alpha: self.alpha,
            beta: self.beta,
            omega: self.omega,
            polynomial: self.polynomial.clone(),
            affine: [self.c, self.d, self.e],
        }
        .lens()?;
        let max_angle_rad = match self.max_angle_deg {
            None => f64::INFINITY,
            Some(deg) if deg > 0.0 && deg <= 180.0 => deg.to_radians(),
            Some(deg) => {
                return Err(ParseError::new(format!(
                    "max_angle_deg is {deg}; it is an angle off the optical axis, above 0 and up \
                     to 180"
                )));
            }
        };
        let shift = match self.pixel_centre {
            PixelCentre::Integer => 0.0,
            PixelCentre::Half => 0.5,
        };
        Ok(Camera::at_rest(
            [self.width, self.height],
            [self.fx, self.fy],
            [self.cx - shift, self.cy - shift],
            lens.limited_to(max_angle_rad),
        ))
    }
}
