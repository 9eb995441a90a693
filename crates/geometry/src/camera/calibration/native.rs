//! The program's own calibration format, `camera.json` or `camera.toml`.

use super::error::ParseError;
use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
use crate::camera::kannala_brandt::KannalaBrandt;
use crate::camera::lens::Lens;
use crate::camera::projection::Camera;
use crate::camera::sweep::Sweep;
use serde::{Deserialize, Serialize, Serializer};

#[derive(Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Model {
    /// Pinhole; coefficients of [`Model::BrownConrady`] are accepted.
    Pinhole,
    BrownConrady,
    #[serde(alias = "fisheye", alias = "equidistant")]
    KannalaBrandt,
}

#[derive(Clone, Copy, Default, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum PixelCentre {
    /// The centre of the first pixel is (0, 0).
    #[default]
    Integer,
    /// The centre of the first pixel is (½, ½).
    Half,
}

/// A calibration file: `model` ("pinhole", "brown-conrady" or "kannala-brandt"), `width`, `height`,
/// `fx`, `fy`, `cx`, `cy` in pixels; the coefficients k1 to k6, p1, p2 of a [`BrownConrady`] or k1
/// to k4 of a [`KannalaBrandt`], 0 if missing; `max_angle_deg`, the largest angle off the axis to
/// be used (no limit if missing); and `pixel_centre` ("integer", the default, or "half").
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
    #[serde(default, skip_serializing_if = "Option::is_none")]
    max_angle_deg: Option<f64>,
    #[serde(default)]
    pixel_centre: PixelCentre,
}

fn is_zero(value: &f64) -> bool {
    *value == 0.0
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
            what: error.message().to_owned(),
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
        let (model, k, [p1, p2], max_angle_rad, all_rad) = match &camera.lens {
            Lens::BrownConrady(lens) => {
                let BrownCoefficients { k, p } = *lens.coefficients();
                let model = if lens.is_distortion_free() {
                    Model::Pinhole
                } else {
                    Model::BrownConrady
                };
                (
                    model,
                    k,
                    p,
                    lens.max_angle_rad(),
                    std::f64::consts::FRAC_PI_2,
                )
            }
            Lens::KannalaBrandt(lens) => {
                let [k1, k2, k3, k4] = *lens.coefficients();
                let k = [k1, k2, k3, k4, 0.0, 0.0];
                let max_angle_rad = lens.max_angle_rad();
                (
                    Model::KannalaBrandt,
                    k,
                    [0.0; 2],
                    max_angle_rad,
                    std::f64::consts::PI,
                )
            }
        };
        let [k1, k2, k3, k4, k5, k6] = k;
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
            max_angle_deg: (max_angle_rad < all_rad).then(|| max_angle_rad.to_degrees()),
            pixel_centre: PixelCentre::Integer,
        }
    }

    fn camera(&self) -> Result<Camera, ParseError> {
        let coefficients = [
            ("k1", self.k1),
            ("k2", self.k2),
            ("p1", self.p1),
            ("p2", self.p2),
            ("k3", self.k3),
            ("k4", self.k4),
            ("k5", self.k5),
            ("k6", self.k6),
        ];
        if let Some((name, value)) = coefficients.iter().find(|(_, value)| !value.is_finite()) {
            return Err(ParseError::new(format!(
                "{name} is {value}; it must be a number"
            )));
        }
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
        let lens = if self.model == Model::KannalaBrandt {
            let foreign = ["p1", "p2", "k5", "k6"];
            let foreign = |(name, value): &&(&str, f64)| foreign.contains(name) && *value != 0.0;
            if let Some((name, _)) = coefficients.iter().find(foreign) {
                return Err(ParseError::new(format!(
                    "a kannala-brandt lens has k1 to k4 only, not {name}"
                )));
            }
            let lens = KannalaBrandt::new([self.k1, self.k2, self.k3, self.k4]);
            Lens::KannalaBrandt(lens.limited_to(max_angle_rad))
        } else {
            let lens = BrownConrady::new(BrownCoefficients {
                k: [self.k1, self.k2, self.k3, self.k4, self.k5, self.k6],
                p: [self.p1, self.p2],
            });
            Lens::BrownConrady(lens.limited_to(max_angle_rad))
        };
        let shift = match self.pixel_centre {
            PixelCentre::Integer => 0.0,
            PixelCentre::Half => 0.5,
        };
        Ok(Camera {
            width: self.width,
            height: self.height,
            fx: self.fx,
            fy: self.fy,
            cx: self.cx - shift,
            cy: self.cy - shift,
            lens,
            sweep: Sweep::default(),
            max_range_m: f64::INFINITY,
        })
    }
}
