//! A survey's file with the calibration and the shape that refine has found.

use super::file::SurveyFile;
use super::open::Survey;
use crate::storage::StorageUrl;
use std::path::Path;

/// Files that refine has written beside a survey.
#[derive(Clone, Copy, Debug, Default)]
pub struct FoundFiles<'f> {
    /// The refined calibration of a single camera.
    pub camera_file: Option<&'f str>,
    /// The refined radius, metres.
    pub radius_m: Option<f64>,
    /// The shape of the wall.
    pub shape_file: Option<&'f str>,
}

impl Survey {
    /// `survey.toml` for another folder, with what refine has found: radius, calibration and shape.
    ///
    /// Frames and poses are those of this survey, their paths absolute (or addresses). The
    /// radius replaces only that of a straight round tunnel. The tables `[calibrate]` and
    /// `[options]` are left out.
    pub fn as_found(&self, found: &FoundFiles) -> SurveyFile {
        let folder = std::path::absolute(&self.folder).unwrap_or_else(|_| self.folder.clone());
        let mut file = self.file.clone();
        for path in file.paths_mut() {
            *path = folder.join(&*path);
        }
        if let Some(radius_m) = found.radius_m
            && file.tunnel.is_straight_and_round()
        {
            file.tunnel.radius_m = Some(radius_m);
        }
        if let Some(camera_file) = found.camera_file {
            let camera = file.camera.first_mut();
            camera.file = Some(camera_file.into());
            camera.horizontal_fov_deg = None;
            camera.name = None;
        }
        file.tunnel.shape_file = found.shape_file.map(Into::into);
        let of_rig = file.camera.all_mut().iter_mut();
        let of_rig = of_rig.filter_map(|camera| camera.frames.as_mut());
        let is_here = |images: &&mut String| matches!(StorageUrl::parse(images), Ok(None));
        for images in of_rig.chain(file.frames.images.as_mut()).filter(is_here) {
            let escaped = glob::Pattern::escape(&folder.to_string_lossy());
            let pattern = Path::new(&escaped).join(&*images);
            *images = pattern.to_string_lossy().into_owned();
        }
        let frames = &mut file.frames;
        for path in frames.video.iter_mut().chain(&mut frames.bag) {
            *path = folder.join(&*path);
        }
        file.calibrate = None;
        file.options.clear();
        file
    }
}
