//! `[camera]`: the camera that took the frames, or one of a rig.

use super::error::SurveyError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::camera::{Camera, read_calibration_of};

/// Horizontal fields of view that a pinhole may have, degrees.
const FIELDS_OF_VIEW_DEG: std::ops::RangeInclusive<f64> = 1.0..=150.0;

/// `[camera]`: a calibration file, or, where there is none, a field of view.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CameraSection {
    /// Calibration file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Name of the camera, if the file has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Field of view across the frames instead of a file, degrees: a pinhole whose principal point
    /// is the middle of the frames.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub horizontal_fov_deg: Option<f64>,
    /// Rolling shutter: time from reading a frame's first row to reading its last, milliseconds of
    /// the poses' times; negative if rows are read bottom-up. Time and pose of a frame are those of
    /// its middle row. Without it, all rows are read at once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub readout_ms: Option<f64>,
    /// Distance from the camera up to which the wall is used, metres; six radii by default.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_range_m: Option<f64>,
    /// Of a rig: glob pattern of the pictures that this camera took, one a moment.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<String>,
    /// Of a rig: mask of this camera's pictures, instead of that under `[frames]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mask: Option<PathBuf>,
    /// Of a rig: the motion from the body whose poses the files hold to this camera; see
    /// [`read_camera_in_body`](tunnelstitch_geometry::trajectory::read_camera_in_body).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub body_to_camera: Option<PathBuf>,
}

impl CameraSection {
    /// The camera of a calibration file.
    pub fn of_file(file: impl Into<PathBuf>) -> Self {
        Self {
            file: Some(file.into()),
            ..Self::default()
        }
    }

    /// Checks a camera that is none of a rig; `has_rig`: there is a section `[rig]`. Returns what
    /// is wrong.
    pub(super) fn check_single(&self, has_rig: bool) -> Result<(), &'static str> {
        if self.frames.is_some() {
            return Err(
                "camera.frames goes with a rig of several [[camera]]; name the frames of a single \
                 one by images under [frames]",
            );
        }
        if self.mask.is_some() {
            return Err(
                "camera.mask goes with a rig of several [[camera]]; put the mask of a single one \
                 under [frames]",
            );
        }
        if self.body_to_camera.is_some() {
            return Err(
                "camera.body_to_camera goes with a rig of several [[camera]]; put that of a \
                 single one under [poses]",
            );
        }
        if has_rig {
            return Err("[rig] goes with several [[camera]], and there is a single one");
        }
        Ok(())
    }

    /// The camera of a survey in `folder`, whose file is `toml`; `picture_size` gives width and
    /// height of the frames, pixels, if they can be read.
    ///
    /// # Errors
    /// A calibration file that cannot be read; neither a file nor a field of view, or both; a field
    /// of view that no pinhole has; frames whose size is needed and unknown.
    pub fn camera(
        &self,
        toml: &Path,
        folder: &Path,
        picture_size: &dyn Fn() -> Option<[u32; 2]>,
    ) -> Result<Camera, SurveyError> {
        let value = |what: &str| SurveyError::Value {
            path: toml.to_owned(),
            what: what.to_owned(),
        };
        if self.name.is_some() && self.horizontal_fov_deg.is_some() {
            let what = "camera.name selects one of the cameras of camera.file, and there is none \
                        with camera.horizontal_fov_deg; take one of the two away";
            return Err(value(what));
        }
        let camera = match (&self.file, self.horizontal_fov_deg) {
            (Some(file), None) => {
                read_calibration_of(&folder.join(file), self.name.as_deref(), picture_size)?
            }
            (None, Some(fov_deg)) if FIELDS_OF_VIEW_DEG.contains(&fov_deg) => {
                let [width, height] = picture_size().ok_or_else(|| {
                    value("camera.horizontal_fov_deg needs frames whose size can be read")
                })?;
                Camera::from_horizontal_fov(width, height, fov_deg.to_radians())
            }
            (None, Some(_)) => {
                let what = "camera.horizontal_fov_deg must lie between 1 and 150; wider pictures \
                            are no pinhole's and need a calibration";
                return Err(value(what));
            }
            _ => {
                let what = "[camera] needs either file, a calibration, or horizontal_fov_deg, the \
                            field of view across the frames, in degrees";
                return Err(value(what));
            }
        };
        Ok(Camera {
            max_range_m: self.max_range_m.unwrap_or(camera.max_range_m),
            ..camera
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The camera of a field of view, with frames of 640 × 480 px.
    fn of_view(horizontal_fov_deg: f64, size: Option<[u32; 2]>) -> Result<Camera, String> {
        let section = CameraSection {
            horizontal_fov_deg: Some(horizontal_fov_deg),
            ..CameraSection::default()
        };
        let camera = section.camera(Path::new("survey.toml"), Path::new(""), &|| size);
        camera.map_err(|error| error.to_string())
    }

    #[test]
    fn a_field_of_view_is_a_pinhole_in_the_middle_of_the_frames() {
        let camera = of_view(90.0, Some([640, 480])).unwrap();
        assert!((camera.fx - 320.0).abs() < 1e-9 && camera.fx == camera.fy);
        assert_eq!([camera.cx, camera.cy], [319.5, 239.5]);
    }

    #[test]
    fn a_camera_that_is_not_or_wrongly_stated_is_refused() {
        let missing = CameraSection::default();
        let camera = missing.camera(Path::new("survey.toml"), Path::new(""), &|| None);
        let error = camera.unwrap_err().to_string();
        assert!(
            error.contains("survey.toml") && error.contains("either file"),
            "{error}"
        );
        let named = CameraSection {
            name: Some("cam0".to_owned()),
            horizontal_fov_deg: Some(90.0),
            ..CameraSection::default()
        };
        let camera = named.camera(Path::new("survey.toml"), Path::new(""), &|| {
            Some([640, 480])
        });
        let error = camera.unwrap_err().to_string();
        assert!(
            error.contains("camera.name") && error.contains("camera.horizontal_fov_deg"),
            "{error}"
        );
        assert!(
            of_view(170.0, Some([640, 480]))
                .unwrap_err()
                .contains("need a calibration")
        );
        assert!(
            of_view(90.0, None)
                .unwrap_err()
                .contains("size can be read")
        );
    }
}
