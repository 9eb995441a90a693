//! A survey's file with a refined calibration.

use super::file::SurveyFile;
use super::open::Survey;
use std::path::Path;

impl Survey {
    /// `survey.toml` for another folder, with the refined `radius_m` and the refined calibration in
    /// `camera_file`.
    ///
    /// Frames and poses are those of this survey, their paths absolute. The radius replaces only
    /// that of a straight round tunnel. The tables `[calibrate]` and `[options]` are left out.
    pub fn with_calibration(&self, radius_m: f64, camera_file: &str) -> SurveyFile {
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        let mut file = self.file.clone();
        for path in file.paths_mut() {
            *path = folder.join(&*path);
        }
        if file.tunnel.is_straight_and_round() {
            file.tunnel.radius_m = Some(radius_m);
        }
        file.camera.file = camera_file.into();
        file.camera.name = None;
        if let Some(images) = &mut file.frames.images {
            let escaped = glob::Pattern::escape(&folder.to_string_lossy());
            let pattern = Path::new(&escaped).join(&*images);
            *images = pattern.to_string_lossy().into_owned();
        }
        if let Some(video) = &mut file.frames.video {
            *video = folder.join(&*video);
        }
        file.calibrate = None;
        file.options.clear();
        file
    }
}
