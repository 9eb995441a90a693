//! Options of a lamp that is fixed to the camera.

use crate::error::{SimulateError, check_option};
use nalgebra::Vector3;
use serde::Serialize;

/// Maximum distance of the lamp from the camera, as a share of the nominal radius.
const MAX_OFFSET_SHARE: f64 = 0.9;

/// Lamp that moves with the camera, in addition to the illumination of the wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraLamp {
    /// Position x, y, z in the camera's frame, metres.
    #[serde(rename = "lamp_offset_m")]
    pub offset_m: [f64; 3],
    /// Specular reflection S of a wall that faces lamp and camera, percent of white.
    pub sheen_percent: f64,
}

impl CameraLamp {
    /// Validates offset and sheen for a tunnel of the given nominal radius, metres.
    ///
    /// # Errors
    /// [`SimulateError::Option`].
    pub(super) fn validate(&self, radius_m: f64) -> Result<(), SimulateError> {
        check_option(
            Vector3::from(self.offset_m).norm() < MAX_OFFSET_SHARE * radius_m,
            "the lamp must be nearer to the camera than 0.9 times the radius",
        )?;
        check_option(
            (0.0..=100.0).contains(&self.sheen_percent),
            "the sheen must be 0 to 100 percent",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lamp_beyond_the_wall_is_refused() {
        let lamp = |offset_m| CameraLamp {
            offset_m,
            sheen_percent: 0.0,
        };
        assert!(lamp([2.0, 2.0, 0.0]).validate(3.0).is_err());
        assert!(lamp([f64::NAN, 0.0, 0.0]).validate(3.0).is_err());
        lamp([1.0, 1.0, 0.0]).validate(3.0).unwrap();
    }
}
