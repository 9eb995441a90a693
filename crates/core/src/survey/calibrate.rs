//! `[calibrate]`: parameters shared by all frames that `refine` can estimate.

use serde::{Deserialize, Serialize};

/// A group of shared parameters that `refine` can estimate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum CalibrationGroup {
    /// Focal length; fx and fy scale together.
    Focal,
    /// Principal point.
    Centre,
    /// Radial distortion, k1 and k2.
    Distortion,
    /// The tunnel's radius.
    Radius,
    /// The tunnel's axis in the frame of the initial poses: two tilts and two offsets.
    Axis,
}

impl CalibrationGroup {
    /// All groups.
    pub const ALL: [Self; 5] = [
        Self::Focal,
        Self::Centre,
        Self::Distortion,
        Self::Radius,
        Self::Axis,
    ];
}

/// `[calibrate]`: the shared parameters to estimate, and the 1-σ of their given values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct CalibrateSection {
    /// The groups to estimate, unless the command line overrides them.
    pub unknowns: Vec<CalibrationGroup>,
    /// Focal length, percent.
    pub focal_sigma_percent: f64,
    /// Principal point, percent of the frames' width.
    pub centre_sigma_percent: f64,
    /// k1.
    pub k1_sigma: f64,
    /// k2.
    pub k2_sigma: f64,
    /// Radius, percent.
    pub radius_sigma_percent: f64,
    /// Each tilt of the axis, degrees.
    pub axis_tilt_sigma_deg: f64,
    /// Each offset of the axis, metres.
    pub axis_offset_sigma_m: f64,
}

impl Default for CalibrateSection {
    fn default() -> Self {
        Self {
            unknowns: Vec::new(),
            focal_sigma_percent: 2.0,
            centre_sigma_percent: 1.0,
            k1_sigma: 0.05,
            k2_sigma: 0.05,
            radius_sigma_percent: 1.0,
            axis_tilt_sigma_deg: 1.0,
            axis_offset_sigma_m: 0.05,
        }
    }
}

impl CalibrateSection {
    /// Checks the numbers.
    pub(super) fn validate(&self) -> Result<(), String> {
        let sigmas = [
            ("focal_sigma_percent", self.focal_sigma_percent, 30.0),
            ("centre_sigma_percent", self.centre_sigma_percent, 30.0),
            ("k1_sigma", self.k1_sigma, 1.0),
            ("k2_sigma", self.k2_sigma, 1.0),
            ("radius_sigma_percent", self.radius_sigma_percent, 30.0),
            ("axis_tilt_sigma_deg", self.axis_tilt_sigma_deg, 30.0),
            ("axis_offset_sigma_m", self.axis_offset_sigma_m, 100.0),
        ];
        let wrong = sigmas
            .iter()
            .find(|(_, value, most)| !(1e-9..=*most).contains(value));
        match wrong {
            None => Ok(()),
            Some((name, value, most)) => Err(format!(
                "calibrate.{name} is {value}; it must be more than 0 and no more than {most}"
            )),
        }
    }
}
