//! The cameras of a COLMAP model that took the pictures of a folder.

use super::picture_group::PictureGroup;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::trajectory::{PoseFile, cameras_of_rigs};

/// A rig of cameras in a COLMAP model, each of which took a group of pictures.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundRig {
    /// COLMAP's file of rigs, relative to the searched folder.
    pub path: PathBuf,
    /// Its file of cameras.
    pub calibrations: PathBuf,
    /// The cameras, in the order of the rig.
    pub cameras: Vec<FoundRigCamera>,
}

/// A camera of a rig.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundRigCamera {
    /// Its name in the model.
    pub name: String,
    /// The pattern of its pictures.
    pub pattern: String,
}

impl FoundRig {
    /// Finds the rig with several cameras that took as many of the `pictures` each, in the model
    /// whose `poses` are in the file `path` of `folder`.
    pub(super) fn of(
        folder: &Path,
        (path, poses): &(PathBuf, PoseFile),
        pictures: &[PictureGroup],
    ) -> Option<Self> {
        let model = path.parent()?;
        let kind = path.extension()?;
        let file = |name: &str| model.join(name).with_extension(kind);
        let rigs = cameras_of_rigs(&folder.join(file("rigs"))).ok()?;
        let taken = |camera: String| {
            let by_it = |group: &&PictureGroup| camera_of(poses, group).as_ref() == Some(&camera);
            let group = pictures.iter().find(by_it)?;
            Some((camera, group))
        };
        let of_rig = |rig: Vec<String>| {
            let taken: Vec<(String, &PictureGroup)> = rig.into_iter().filter_map(taken).collect();
            let (_, first) = taken.first()?;
            let are_alike = taken.iter().all(|(_, group)| group.count == first.count);
            (taken.len() > 1 && are_alike).then_some(taken)
        };
        let cameras = rigs.into_iter().find_map(of_rig)?.into_iter();
        let camera = |(name, group): (String, &PictureGroup)| FoundRigCamera {
            name,
            pattern: group.pattern.clone(),
        };
        Some(Self {
            path: file("rigs"),
            calibrations: file("cameras"),
            cameras: cameras.map(camera).collect(),
        })
    }

    /// True if one of the cameras took the pictures.
    pub(super) fn has(&self, group: &PictureGroup) -> bool {
        self.cameras
            .iter()
            .any(|camera| camera.pattern == group.pattern)
    }
}

/// The name of the camera that took the pictures of a group, by a COLMAP model.
pub(super) fn camera_of(poses: &PoseFile, group: &PictureGroup) -> Option<String> {
    let is_first = |name: &String| group.first.ends_with(Path::new(name));
    let first = poses
        .entries
        .iter()
        .find(|entry| entry.name.as_ref().is_some_and(is_first));
    first?.camera.map(|camera| camera.to_string())
}

#[cfg(test)]
mod tests {
    use crate::survey::{Discovery, Survey};
    use std::path::Path;

    const CAMERAS: &str = "1 PINHOLE 64 48 40 40 32 24\n2 PINHOLE 64 48 41 41 32 24\n";
    const RIGS: &str = "1 2 CAMERA 2 CAMERA 1 1 1 0 0 0 -0.5 0 0\n";

    /// Two pictures each of a left and a right camera, and their model.
    fn write_model(dir: &Path, rigs: Option<&str>) {
        let mut images = String::new();
        for (id, (camera, name)) in [(2, "left"), (1, "right")].into_iter().enumerate() {
            std::fs::create_dir_all(dir.join("images").join(name)).unwrap();
            for k in 0..2 {
                let picture = image::GrayImage::new(64, 48);
                picture
                    .save(dir.join(format!("images/{name}/{k}.png")))
                    .unwrap();
                images += &format!("{}{k} 1 0 0 0 0 {k} 0 {camera} {name}/{k}.png\n\n", id + 1);
            }
        }
        let model = dir.join("sparse/0");
        std::fs::create_dir_all(&model).unwrap();
        std::fs::write(model.join("images.txt"), images).unwrap();
        std::fs::write(model.join("cameras.txt"), CAMERAS).unwrap();
        if let Some(rigs) = rigs {
            std::fs::write(model.join("rigs.txt"), rigs).unwrap();
        }
    }

    #[test]
    fn a_rig_of_a_model_is_taken_as_one() {
        let dir = tempfile::tempdir().unwrap();
        write_model(dir.path(), Some(RIGS));
        let found = Discovery::of(dir.path()).unwrap();
        assert_eq!(found.other_pictures().count(), 0);
        let text = found.survey_toml(Some(3.0));
        let text = text.replace("[poses]", "[poses]\nunit_m = 0.5");
        std::fs::write(dir.path().join("survey.toml"), text).unwrap();
        let survey = Survey::open(dir.path()).unwrap();
        assert_eq!((survey.frames.len(), survey.cameras.count()), (4, 2));
        // The first of the rig is its second camera, and the other one is half a unit beside it.
        assert_eq!(survey.cameras.of(0).fx, 41.0);
        assert_eq!(survey.file.camera.all()[1].name.as_deref(), Some("1"));
    }

    /// Without a rig, the camera of the frames is selected.
    #[test]
    fn the_camera_of_the_frames_is_selected() {
        let trivial = "1 1 CAMERA 1\n2 1 CAMERA 2\n";
        for rigs in [None, Some(trivial)] {
            let dir = tempfile::tempdir().unwrap();
            write_model(dir.path(), rigs);
            let found = Discovery::of(dir.path()).unwrap();
            assert!(found.rig.is_none());
            assert_eq!(found.pictures[0].pattern, "images/left/*.png");
            assert_eq!(found.calibrations[0].camera.fx, 41.0);
            let text = found.survey_toml(Some(3.0));
            assert!(text.contains("name = \"2\""), "{text}");
            assert_eq!(found.other_pictures().count(), 1);
        }
    }
}
