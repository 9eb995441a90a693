//! A calibration that was found in a folder.

use super::calibrated_size::scaled;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::camera::{CalibrationError, Camera, read_calibration_of};

/// Largest number of cameras of a file that are tried.
const MAX_TRIED_CAMERAS: usize = 16;

/// A calibration file, and the camera that was taken of it.
#[derive(Clone, Debug)]
pub struct FoundCalibration {
    /// The file, relative to the searched folder.
    pub path: PathBuf,
    /// The camera.
    pub camera: Camera,
    /// The choice, if the file holds several cameras that differ.
    pub selected: Option<SelectedCamera>,
}

/// One of several cameras of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SelectedCamera {
    /// Its name.
    pub name: String,
    /// Number of cameras.
    pub of: usize,
}

impl FoundCalibration {
    /// Reads the file `path` of `folder`. Of several cameras the first is taken whose size is that
    /// of the pictures, else the first.
    ///
    /// # Errors
    /// A file that is no calibration.
    pub(super) fn read(
        folder: &Path,
        path: &Path,
        picture_size: &dyn Fn() -> Option<[u32; 2]>,
    ) -> Result<Self, CalibrationError> {
        let read = |name: Option<&str>| {
            let camera = read_calibration_of(&folder.join(path), name, picture_size)?;
            Ok(Self {
                path: path.to_owned(),
                camera,
                selected: None,
            })
        };
        let names = match read(None) {
            Err(CalibrationError::Several { names, .. }) => names,
            other => return other,
        };
        let selected = |name: &String| {
            let selected = SelectedCamera {
                name: name.clone(),
                of: names.len(),
            };
            read(Some(name)).map(|found| Self {
                selected: Some(selected),
                ..found
            })
        };
        let size = picture_size();
        let fits = |found: &Self| Some(found.size().into()) == size;
        let tried = names.iter().take(MAX_TRIED_CAMERAS);
        let fitting = tried.filter_map(|name| selected(name).ok()).find(fits);
        match (fitting, names.first()) {
            (Some(found), _) => Ok(found),
            (None, Some(first)) => selected(first),
            (None, None) => read(None),
        }
    }

    /// Selects another of several cameras of the file, if it can be read.
    pub(super) fn select(&mut self, folder: &Path, name: &str) {
        let Some(selected) = self
            .selected
            .as_mut()
            .filter(|selected| selected.name != name)
        else {
            return;
        };
        if let Ok(camera) = read_calibration_of(&folder.join(&self.path), Some(name), &|| None) {
            name.clone_into(&mut selected.name);
            self.camera = camera;
        }
    }

    /// True if frames of that size, if it is known, take the calibration scaled.
    pub fn is_scaled_to(&self, frames: Option<(u32, u32)>) -> bool {
        frames.is_some_and(|(width, height)| scaled(&self.camera, [width, height]).is_some())
    }

    /// Width and height, pixels.
    pub fn size(&self) -> (u32, u32) {
        (self.camera.width, self.camera.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// COLMAP writes a camera for each picture, unless a single one is asked for.
    #[test]
    fn one_of_several_cameras_is_selected() {
        let dir = tempfile::tempdir().unwrap();
        let path = Path::new("cameras.txt");
        let read = |text: &str| {
            std::fs::write(dir.path().join(path), text).unwrap();
            FoundCalibration::read(dir.path(), path, &|| Some([64, 48])).unwrap()
        };
        let of = |id: u32, width: u32, f: u32| format!("{id} PINHOLE {width} 48 {f} {f} 32 24\n");
        let equal = read(&(of(1, 64, 50) + &of(2, 64, 50)));
        assert_eq!(equal.selected, None);
        let other = read(&(of(1, 32, 50) + &of(2, 64, 51) + &of(3, 64, 52)));
        assert_eq!(other.camera.fx, 51.0);
        let selected = other.selected.unwrap();
        assert_eq!((selected.name.as_str(), selected.of), ("2", 3));
        assert_eq!(read(&(of(7, 32, 50) + &of(8, 32, 51))).camera.fx, 50.0);
    }
}
