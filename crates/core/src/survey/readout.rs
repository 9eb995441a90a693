//! The readout time of a rolling shutter that the calibration states.

use super::camera_section::CameraSection;
use std::path::Path;
use tunnelstitch_geometry::camera::stated_readout_ms;
use tunnelstitch_geometry::files::printed;

/// The warning about a readout time that the calibration states and a survey in `folder` does not.
pub(super) fn readout_warning(section: &CameraSection, folder: &Path) -> Option<String> {
    if section.readout_ms.is_some() {
        return None;
    }
    let path = folder.join(section.file.as_ref()?);
    let readout_ms = stated_readout_ms(&path)?;
    Some(format!(
        "{}: states a rolling shutter; put readout_ms = {readout_ms} under [camera], or 0 if the \
         frames were taken by a global one",
        printed(&path)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_readout_time_that_the_survey_leaves_out_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let profile = r#"{"fisheye_params": {}, "calib_dimension": {}, "frame_readout_time": 8.5}"#;
        std::fs::write(dir.path().join("lens.json"), profile).unwrap();
        let mut section = CameraSection::of_file("lens.json");
        let warning = readout_warning(&section, dir.path()).unwrap();
        assert!(warning.contains("readout_ms = 8.5 under"), "{warning}");
        section.readout_ms = Some(0.0);
        assert_eq!(readout_warning(&section, dir.path()), None);
    }
}
