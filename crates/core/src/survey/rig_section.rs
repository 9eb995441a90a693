//! `[rig]`: the fixed relation of several cameras.

use serde::{Deserialize, Serialize};

/// Default 1-σ of the rotation between two cameras of a rig, degrees: a mount that has been
/// calibrated.
const ROTATION_SIGMA_DEG: f64 = 0.05;
/// Default 1-σ of the translation between two cameras of a rig, millimetres.
const TRANSLATION_SIGMA_MM: f64 = 1.0;
/// Smallest σ: a relation that is exact is one that is known far better than frames are
/// registered, degrees and millimetres.
const MIN_SIGMA: f64 = 1e-4;

/// `[rig]`: 1-σ of the relation of the cameras, as `body_to_camera` of each `[[camera]]` gives it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RigSection {
    /// 1-σ of the rotation from one camera to the next about each axis, degrees; 0 for an exact
    /// one.
    pub rotation_sigma_deg: f64,
    /// 1-σ of the translation from one camera to the next along each axis, millimetres; 0 for an
    /// exact one.
    pub translation_sigma_mm: f64,
}

impl Default for RigSection {
    fn default() -> Self {
        Self {
            rotation_sigma_deg: ROTATION_SIGMA_DEG,
            translation_sigma_mm: TRANSLATION_SIGMA_MM,
        }
    }
}

impl RigSection {
    /// 1-σ of rotation and translation, radians and metres.
    ///
    /// # Errors
    /// A value that is no σ, in words.
    pub(super) fn sigmas(&self) -> Result<(f64, f64), String> {
        let of = |name: &str, sigma: f64, most: f64| match sigma {
            sigma if (0.0..=most).contains(&sigma) => Ok(sigma.max(MIN_SIGMA)),
            sigma => Err(format!(
                "rig.{name} is {sigma}; it must lie between 0 and {most}"
            )),
        };
        let rotation_deg = of("rotation_sigma_deg", self.rotation_sigma_deg, 10.0)?;
        let translation_mm = of("translation_sigma_mm", self.translation_sigma_mm, 1000.0)?;
        Ok((rotation_deg.to_radians(), 1e-3 * translation_mm))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_relation_has_a_small_sigma_and_a_negative_one_none() {
        let section = |rotation_sigma_deg| RigSection {
            rotation_sigma_deg,
            ..RigSection::default()
        };
        let (rotation_rad, translation_m) = section(0.0).sigmas().unwrap();
        assert!(rotation_rad > 0.0 && rotation_rad < 1e-5);
        assert_eq!(translation_m, 1e-3);
        let error = section(-1.0).sigmas().unwrap_err();
        assert!(error.contains("rotation_sigma_deg is -1"), "{error}");
    }
}
