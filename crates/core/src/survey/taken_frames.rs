//! The frames of a survey and the cameras that took them.

use super::calibrated_size::scaled_to_frames;
use super::camera_section::CameraSection;
use super::error::SurveyError;
use super::file::{FramesSection, SurveyFile};
use super::frame_list::{FrameList, bits_warning};
use super::frame_skipping::skip_unreadable;
use super::skipped_frame::SkippedFrame;
use crate::frames::{FrameFile, FrameSet, Mask, Masks, Video};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tunnelstitch_geometry::camera::{Camera, Cameras};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::surface::{Surface, with_range};
use tunnelstitch_geometry::trajectory::{Pose, Rig, is_rig_file, read_camera_in_body};

/// The frames of a survey and the cameras that took them.
pub(super) struct TakenFrames {
    /// The cameras.
    pub cameras: Cameras,
    /// The frames, in order, with the masks of their cameras.
    pub frames: FrameSet,
    /// The relation of the cameras of a rig.
    pub rig: Option<Rig>,
    /// The frames of the first camera of a rig, by which poses are associated with moments; empty
    /// for a single camera.
    pub moments: Vec<FrameFile>,
    /// The frames that are left out because they cannot be read.
    pub skipped: Vec<SkippedFrame>,
    /// Times of the frames, for a rig of the moments, seconds, if given by a file, a video or a
    /// recording.
    pub times_s: Option<Vec<f64>>,
    /// The video that contains the frames, if any.
    pub video: Option<Arc<Video>>,
    /// Bits of the values in files of 16 bits, if these leave the upper ones empty and the survey
    /// does not say so.
    pub bits: Option<u8>,
    /// Warnings about the pictures' orientation and bits.
    pub warnings: Vec<String>,
}

/// A survey's file and the places it names.
#[derive(Clone, Copy)]
pub(super) struct SurveyPlace<'a> {
    /// The content of the file.
    pub file: &'a SurveyFile,
    /// The file.
    pub toml_path: &'a Path,
    /// Its folder.
    pub folder: &'a Path,
}

impl SurveyPlace<'_> {
    /// An error of a value in the file.
    fn value(&self, what: impl Into<String>) -> SurveyError {
        SurveyError::Value {
            path: self.toml_path.to_owned(),
            what: what.into(),
        }
    }

    /// The camera of a section whose frames are those of `frames`, with its range in the tunnel.
    fn camera(
        &self,
        section: &CameraSection,
        frames: &FramesSection,
        surface: &dyn Surface,
    ) -> Result<Camera, SurveyError> {
        let size = || FrameList::first_size(frames, self.toml_path, self.folder);
        let camera = section.camera(self.toml_path, self.folder, &size)?;
        Ok(with_range(&camera, surface))
    }

    /// The camera with its calibration scaled to the size of its frames, if it is of another, and
    /// the warning that it is.
    fn scaled(
        &self,
        section: &CameraSection,
        camera: Camera,
        listed: &FrameList,
    ) -> (Camera, Option<String>) {
        let file = section.file.as_ref().map(|file| self.folder.join(file));
        let scaled = file.and_then(|file| scaled_to_frames(&camera, &listed.frames, &file));
        scaled.map_or((camera, None), |(camera, said)| (camera, Some(said)))
    }

    /// The mask of frames of a camera, if they have one.
    fn mask(&self, frames: &FramesSection, camera: &Camera) -> Result<Option<Mask>, SurveyError> {
        let (width, height) = (camera.width, camera.height);
        let read = |mask| Mask::read(&self.folder.join(mask), width, height);
        Ok(frames.mask.as_ref().map(read).transpose()?)
    }

    /// Lists the frames, and reads the calibrations of their cameras.
    ///
    /// # Errors
    /// Frames, calibrations, masks or mounts that cannot be read or do not go together.
    pub fn take_frames(&self, surface: &dyn Surface) -> Result<TakenFrames, SurveyError> {
        match self.file.camera.is_rig() {
            true => self.take_frames_of_rig(surface),
            false => self.take_frames_of_one(surface),
        }
    }

    /// The frames of a single camera.
    fn take_frames_of_one(&self, surface: &dyn Surface) -> Result<TakenFrames, SurveyError> {
        let section = self.file.camera.first();
        section
            .check_single(self.file.rig.is_some())
            .map_err(|what| self.value(what))?;
        let frames = &self.file.frames;
        let camera = self.camera(section, frames, surface)?;
        let listed = FrameList::new(frames, self.toml_path, self.folder, None)?;
        let (camera, scaled) = self.scaled(section, camera, &listed);
        let mut warnings = Vec::from_iter(scaled);
        let size = (camera.width, camera.height);
        let (listed, warning) = listed.oriented(size, frames);
        warnings.extend(warning);
        let (listed, skipped) = match frames.skip_bad {
            Some(true) => skip_unreadable(listed, size)?,
            _ => (listed, Vec::new()),
        };
        let bits = FrameList::used_bits(std::slice::from_ref(&listed), size, frames);
        warnings.extend(bits.map(bits_warning));
        let listed = match bits {
            Some(bits) => listed.with_bits(bits),
            None => listed,
        };
        Ok(TakenFrames {
            cameras: camera.into(),
            rig: None,
            moments: Vec::new(),
            skipped,
            times_s: listed.times_s,
            video: listed.video,
            bits,
            warnings,
            frames: FrameSet::new(listed.frames, self.mask(frames, &camera)?),
        })
    }

    /// The frames of a rig, moment by moment.
    fn take_frames_of_rig(&self, surface: &dyn Surface) -> Result<TakenFrames, SurveyError> {
        self.check_rig().map_err(|what| self.value(what))?;
        let (mut cameras, mut mounts, mut masks) = (Vec::new(), Vec::new(), Vec::new());
        let (mut lists, mut warnings) = (Vec::new(), Vec::new());
        for (k, section) in self.file.camera.all().iter().enumerate() {
            let frames = self.file.frames_of(k);
            let camera = self.camera(section, &frames, surface)?;
            let listed = FrameList::new(&frames, self.toml_path, self.folder, None)?;
            let (camera, scaled) = self.scaled(section, camera, &listed);
            warnings.extend(scaled);
            let (listed, warning) = listed.oriented((camera.width, camera.height), &frames);
            warnings.extend(warning);
            masks.push(self.mask(&frames, &camera)?);
            cameras.push(camera);
            lists.push(listed);
            let mount = section.body_to_camera.as_ref().ok_or_else(|| {
                self.value(format!(
                    "[[camera]] number {k} has no body_to_camera: the file of its place on the rig"
                ))
            })?;
            let name = section.name.as_deref();
            let camera_in_body = read_camera_in_body(&self.folder.join(mount), name)?;
            // A model of COLMAP is in its own unit.
            let unit_m = self.file.poses.unit_m.filter(|_| is_rig_file(mount));
            let t_m = unit_m.unwrap_or(1.0) * camera_in_body.t_wc;
            mounts.push(Pose::new(camera_in_body.r_wc, t_m));
        }
        self.check_same(&cameras, &lists)?;
        let cameras = Cameras::of_rig(cameras).ok_or(SurveyError::NoFrame)?;
        let bits = FrameList::used_bits(&lists, cameras.size().into(), &self.file.frames);
        if let Some(bits) = bits {
            let read = lists.into_iter().map(|list| list.with_bits(bits));
            lists = read.collect();
            warnings.push(bits_warning(bits));
        }
        let (rotation_sigma_rad, translation_sigma_m) = (self.file.rig.unwrap_or_default())
            .sigmas()
            .map_err(|what| self.value(what))?;
        let moments = lists[0].frames.clone();
        let times_s = lists[0].times_s.take();
        let count = lists.len();
        let folder = common_folder(&lists);
        let frame = |index: usize| {
            let own = lists[index % count].frames[index / count].clone();
            own.numbered(index).named_from(&folder)
        };
        let frames = (0..count * moments.len()).map(frame).collect();
        Ok(TakenFrames {
            cameras,
            frames: FrameSet::new(frames, Masks::of_rig(masks)),
            rig: Rig::new(mounts, rotation_sigma_rad, translation_sigma_m),
            moments,
            skipped: Vec::new(),
            times_s,
            video: None,
            bits,
            warnings,
        })
    }

    /// Checks the keys that go with a rig; returns what is wrong.
    fn check_rig(&self) -> Result<(), String> {
        let file = self.file;
        let frames = &file.frames;
        if frames.images.is_some() || frames.video.is_some() || frames.bag.is_some() {
            return Err(
                "[frames] names frames, but each [[camera]] of a rig has its own: frames = \
                 \"left/*.png\" under each, and none under [frames]"
                    .to_owned(),
            );
        }
        if frames.skip_bad == Some(true) {
            return Err(
                "frames.skip_bad does not go with a rig, all of whose cameras have a picture of \
                 every moment; take the bad pictures of all cameras away"
                    .to_owned(),
            );
        }
        if file.poses.body_to_camera.is_some() {
            return Err(
                "poses.body_to_camera goes with a single [camera]; each [[camera]] of a rig has \
                 its own body_to_camera"
                    .to_owned(),
            );
        }
        for (k, camera) in file.camera.all().iter().enumerate() {
            if camera.frames.is_none() {
                return Err(format!(
                    "[[camera]] number {k} has no frames: a pattern of its pictures, as frames = \
                     \"left/*.png\""
                ));
            }
            if camera
                .readout_ms
                .is_some_and(|readout_ms| readout_ms != 0.0)
            {
                return Err(format!(
                    "[[camera]] number {k}: readout_ms goes with a single [camera]; rigs of \
                     rolling shutters are not supported"
                ));
            }
        }
        Ok(())
    }

    /// Checks that all cameras of a rig have as many pictures, of the same size.
    fn check_same(&self, cameras: &[Camera], lists: &[FrameList]) -> Result<(), SurveyError> {
        let pattern = |k: usize| self.file.camera.all()[k].frames.as_deref();
        let named = |k: usize| printed(Path::new(pattern(k).unwrap_or_default())).to_string();
        let counts: Vec<usize> = lists.iter().map(|list| list.frames.len()).collect();
        for k in 1..cameras.len() {
            if counts[k] != counts[0] {
                return Err(self.value(format!(
                    "camera 0 ({}) has {} pictures, and camera {k} ({}) has {}; the cameras of a \
                     rig take one picture each at every moment",
                    named(0),
                    counts[0],
                    named(k),
                    counts[k]
                )));
            }
            let size = |camera: &Camera| [camera.width, camera.height];
            let [own, first] = [size(&cameras[k]), size(&cameras[0])];
            if own != first {
                return Err(self.value(format!(
                    "camera 0 has pictures of {} × {} px, and camera {k} ({}) of {} × {} px; \
                     those of a rig must have the same size",
                    first[0],
                    first[1],
                    named(k),
                    own[0],
                    own[1]
                )));
            }
        }
        Ok(())
    }
}

/// The innermost folder that holds the first pictures of all cameras.
fn common_folder(lists: &[FrameList]) -> Arc<Path> {
    let first = lists.iter().filter_map(|list| list.frames.first());
    let folders = first.filter_map(|frame| frame.path.parent());
    let shared = |a: PathBuf, b: PathBuf| -> PathBuf {
        let both = a.components().zip(b.components());
        both.take_while(|(a, b)| a == b).map(|(a, _)| a).collect()
    };
    let common = folders.map(Path::to_owned).reduce(shared);
    common.unwrap_or_default().into()
}

#[cfg(test)]
mod tests;
