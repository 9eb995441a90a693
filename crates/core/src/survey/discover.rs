//! Search of a folder for the parts of a survey.

use super::file::SURVEY_FILE;
use super::found_calibration::FoundCalibration;
use super::joined_folders::joined;
use super::left_aside::{AsideReason, LeftAside, reason_by_name, reason_of_text};
use super::matrix_folders::{self, matrix_folders};
use super::model_cameras::{FoundRig, camera_of};
use super::picture_group::PictureGroup;
use super::recorded_parts::{FoundInRecording, RecordedFrames, RecordedParts};
use super::refusal::SurveyPart;
use super::straight_axis::{AXIS_FILE, FoundAxis};
use super::walked_folder::WalkedFolder;
use crate::frames::{FrameError, PictureOrientation, Video};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use tunnelstitch_geometry::recordings::is_recording;
use tunnelstitch_geometry::trajectory::csv::PICTURE_EXTENSIONS;
use tunnelstitch_geometry::trajectory::gyro::gopro_readout_ms;
use tunnelstitch_geometry::trajectory::{
    DuplicateTimes, PoseEntry, PoseFile, PoseFileOptions, read_poses_with,
};

/// The file of Record3D, beside its pictures.
const RECORD3D_FILE: &str = "metadata";
/// Extensions of videos.
const VIDEO_EXTENSIONS: [&str; 7] = ["mp4", "mov", "m4v", "mkv", "avi", "webm", "mts"];

/// A video whose pictures are the frames.
#[derive(Clone, Debug, PartialEq)]
pub struct VideoChoice {
    /// The file, relative to the searched folder.
    pub path: PathBuf,
    /// Sampling interval of the frames, pictures.
    pub every: usize,
    /// Number of frames.
    pub count: usize,
    /// Width and height, pixels.
    pub size: (u32, u32),
    /// Readout time of the rolling shutter that the video of a GoPro states, milliseconds.
    pub readout_ms: Option<f64>,
}

/// The parts of a survey found in a folder; all paths are relative to the folder.
#[derive(Clone, Debug, Default)]
pub struct Discovery {
    /// A picture named `mask`.
    pub mask: Option<PathBuf>,
    /// The videos.
    pub videos: Vec<PathBuf>,
    /// The video of the frames, if one was chosen ([`Discovery::choose_video`]).
    pub video: Option<VideoChoice>,
    /// The recordings with images, poses or calibrations.
    pub recordings: Vec<RecordedParts>,
    /// The images of the frames, if they are of a recording ([`Discovery::choose_recording`]), and
    /// the recording, relative to the searched folder.
    pub recorded: Option<(PathBuf, RecordedFrames)>,
    /// Groups of pictures, the largest first.
    pub pictures: Vec<PictureGroup>,
    /// The rig of a COLMAP model that took several of these groups.
    pub rig: Option<FoundRig>,
    /// Calibrations, those with the frames' size first, and among these those that state it.
    pub calibrations: Vec<FoundCalibration>,
    /// Pose files; first those with as many poses as frames, and among these first those not named
    /// as ground truth.
    pub poses: Vec<(PathBuf, PoseFile)>,
    /// The other files and folders, with the reasons.
    pub left_aside: Vec<LeftAside>,
    /// Bits of the values in files of 16 bits, if they leave the upper ones empty
    /// ([`Discovery::find_bits`]).
    pub bits: Option<u32>,
    /// Length of a unit of the initial poses, metres, if the user told it
    /// ([`Discovery::find_axis`]).
    pub unit_m: Option<f64>,
    /// The tunnel's axis in the world of the initial poses, if they show that it is not the
    /// world's y axis ([`Discovery::find_axis`]).
    pub axis: Option<FoundAxis>,
}

impl Discovery {
    /// Searches `folder` and three levels of folders below it, without hidden ones.
    ///
    /// # Errors
    /// A folder that cannot be read.
    pub fn of(folder: &Path) -> std::io::Result<Self> {
        let walked = WalkedFolder::of(folder)?;
        let group = |((parent, _), files): (&(PathBuf, String), &Vec<&PathBuf>)| {
            PictureGroup::of(folder, parent, files)
        };
        let mut found = Self {
            pictures: picture_files(&walked.files).iter().map(group).collect(),
            ..Self::default()
        };
        let unsearched = walked.unsearched.into_iter();
        let mut aside: Vec<(PathBuf, AsideReason)> = unsearched
            .map(|(path, reason)| (path, reason.into()))
            .collect();
        let of_matrices = matrix_folders(folder, &walked.files);
        let files = walked.files.iter();
        for file in files.filter(|file| !matrix_folders::holds(&of_matrices, file)) {
            let lower = extension(file).to_lowercase();
            if PICTURE_EXTENSIONS.contains(&lower.as_str()) {
                if is_mask(file) && found.mask.is_some() {
                    aside.push((file.clone(), "there is another mask".into()));
                } else if is_mask(file) {
                    found.mask = Some(file.clone());
                }
            } else if VIDEO_EXTENSIONS.contains(&lower.as_str()) {
                found.videos.push(file.clone());
            } else if is_recording(file) {
                match FoundInRecording::of(folder, file) {
                    Ok(recorded) => {
                        let reasons = recorded.refusals.iter();
                        aside.extend(reasons.map(|reason| (file.clone(), reason.as_str().into())));
                        found.take_recording(file, recorded);
                    }
                    Err(reason) => aside.push((file.clone(), reason.into())),
                }
            } else if !file.ends_with(SURVEY_FILE)
                && let Err(reason) = found.take_text(folder, file, &lower)
            {
                aside.push((file.clone(), reason));
            }
        }
        found.poses.extend(of_matrices);
        found.sort();
        found.find_cameras(folder);
        found.join_folders();
        let rigs = found.rig.as_ref().map(|rig| rig.path.clone());
        aside.retain(|(path, _)| Some(path) != rigs.as_ref());
        found.left_aside = LeftAside::grouped(aside);
        Ok(found)
    }

    /// Takes the pictures of several folders as one sequence, if there are as many poses of one
    /// camera.
    fn join_folders(&mut self) {
        let initial = self.initial().map(|(_, poses)| &poses.entries);
        let of_one = |entries: &&Vec<PoseEntry>| {
            let mut pairs = entries.windows(2);
            pairs.all(|pair| pair[0].camera == pair[1].camera)
        };
        let count = initial.filter(of_one).map(Vec::len);
        let all = count.and_then(|count| joined(&self.pictures, count));
        if let Some(all) = all.filter(|all| self.rig.is_none() && all.count != self.frames().0) {
            let matched = glob::Pattern::new(&all.pattern).ok();
            let is_part = |group: &PictureGroup| {
                matched
                    .as_ref()
                    .is_some_and(|m| m.matches_path(&group.first))
            };
            self.pictures.retain(|group| !is_part(group));
            self.pictures.insert(0, all);
        }
    }

    /// Finds the cameras that took the pictures, if the poses are those of a COLMAP model.
    fn find_cameras(&mut self, folder: &Path) {
        let Some(initial) = self.initial() else {
            return;
        };
        self.rig = FoundRig::of(folder, initial, &self.pictures);
        let of_frames = self.pictures.first().and_then(|group| {
            let (path, poses) = self.initial()?;
            Some((path.parent()?.to_owned(), camera_of(poses, group)?))
        });
        if let Some((model, name)) = of_frames {
            let of_model = |found: &&mut FoundCalibration| found.path.parent() == Some(&model);
            let calibrations = self.calibrations.iter_mut();
            calibrations
                .filter(of_model)
                .for_each(|found| found.select(folder, &name));
        }
    }

    /// Takes the parts of a recording.
    fn take_recording(&mut self, file: &Path, found: FoundInRecording) {
        let calibration = found.camera.map(|camera| FoundCalibration {
            path: file.to_owned(),
            camera,
            selected: None,
        });
        self.calibrations.extend(calibration);
        let poses = found.poses.map(|poses| (file.to_owned(), poses));
        self.poses.extend(poses);
        self.recordings.push(found.parts);
    }

    /// Selects the images of the first recording that has some as the frames; false if there is
    /// none.
    pub fn choose_recording(&mut self) -> bool {
        let images = |parts: &RecordedParts| Some((parts.path.clone(), parts.images.clone()?));
        self.recorded = self.recordings.iter().find_map(images);
        self.sort();
        self.recorded.is_some()
    }

    /// The parts of a recording, by its path.
    pub(super) fn parts_of(&self, path: &Path) -> Option<&RecordedParts> {
        self.recordings.iter().find(|parts| parts.path == path)
    }

    /// Takes a file as calibration, as poses or as both.
    ///
    /// # Errors
    /// The reason why it is neither.
    fn take_text(
        &mut self,
        folder: &Path,
        file: &Path,
        extension: &str,
    ) -> Result<(), AsideReason> {
        let path = folder.join(file);
        let bytes = path.metadata().map_or(0, |metadata| metadata.len());
        let mut refusals = Vec::new();
        let (mut is_tried, mut is_taken) = (false, false);
        if is_calibration(file, extension) {
            is_tried = true;
            let size = || self.picture_size();
            let read = || FoundCalibration::read(folder, file, &size);
            match SurveyPart::Calibration.read(bytes, read) {
                Ok(found) => {
                    is_taken = true;
                    self.calibrations.push(found);
                }
                Err(refusal) => refusals.push(refusal),
            }
        }
        if is_pose_file(file, extension) {
            is_tried = true;
            // Poses with a time that is there twice are those to associate by time.
            let options = PoseFileOptions {
                duplicate_times: DuplicateTimes::Merge,
                ..PoseFileOptions::default()
            };
            match SurveyPart::Poses.read(bytes, || read_poses_with(&path, &options)) {
                Ok(poses) => {
                    is_taken = true;
                    self.poses.push((file.to_owned(), poses));
                }
                Err(refusal) => refusals.push(refusal),
            }
        }
        match (is_taken, is_tried) {
            (true, _) => Ok(()),
            (false, true) => Err(reason_of_text(folder, file, &refusals)),
            (false, false) => Err(reason_by_name(folder, file, extension).into()),
        }
    }

    /// Selects every `every`-th picture of a video as the frames; the path is relative to the
    /// searched `folder`.
    ///
    /// # Errors
    /// The errors of [`Video::open`].
    pub fn choose_video(
        &mut self,
        folder: &Path,
        path: &Path,
        every: usize,
    ) -> Result<(), FrameError> {
        let video = Video::open(&folder.join(path))?;
        self.rig = None;
        // The rows of a turned picture are not read one after the other.
        let has_rows = video.rotation_deg() == 0;
        let readout_ms = gopro_readout_ms(video.path()).filter(|_| has_rows);
        self.video = Some(VideoChoice {
            path: path.to_owned(),
            every,
            count: video.pictures().div_ceil(every.max(1)),
            size: video.size(),
            readout_ms,
        });
        self.sort();
        Ok(())
    }

    /// Notes the length of a unit of the initial poses, metres, if it is known, and finds the axis
    /// of a straight tunnel of that radius, if it is known, for poses of structure from motion.
    pub fn find_axis(&mut self, unit_m: Option<f64>, radius_m: Option<f64>) {
        let initial = self.initial();
        self.axis = initial.and_then(|(_, poses)| FoundAxis::of(poses, unit_m, radius_m));
        self.unit_m = unit_m;
        if self.axis.is_some() {
            // It is written anew.
            self.left_aside.retain(|aside| aside.pattern != AXIS_FILE);
        }
    }

    /// True if the initial poses are in a unit that neither their format nor the user tells.
    pub fn lacks_scale(&self) -> bool {
        let initial = self.initial();
        self.unit_m.is_none() && initial.is_some_and(|(_, poses)| poses.format.has_no_scale())
    }

    /// The pictures that are the frames, if they are not those of a video or recording.
    pub fn picture_frames(&self) -> Option<&PictureGroup> {
        let has_pictures = self.video.is_none() && self.recorded.is_none();
        self.pictures.first().filter(|_| has_pictures)
    }

    /// The other pictures in files: those that are not the frames.
    pub fn other_pictures(&self) -> impl Iterator<Item = &PictureGroup> {
        let rig = self.rig.as_ref();
        // The largest group is that of the frames.
        let taken = usize::from(self.video.is_none() && self.recorded.is_none());
        let others = self.pictures.iter().skip(taken);
        others.filter(move |group| !rig.is_some_and(|rig| rig.has(group)))
    }

    /// Decodes frames of the searched `folder`, if the calibration fits them, to find out whether
    /// files of 16 bits leave the upper bits empty.
    pub fn find_bits(&mut self, folder: &Path) {
        let mask = self.mask.as_ref().map(|mask| folder.join(mask));
        let frames = self.picture_frames().zip(self.calibrations.first());
        self.bits =
            frames.and_then(|(group, found)| group.bits(folder, mask.as_deref(), found.size()));
    }

    /// The orientation of the frames that the calibration asks for, where their EXIF data name one.
    pub fn orientation(&self) -> Option<PictureOrientation> {
        let size = self.calibrations.first()?.size();
        self.picture_frames()?.orientation(size)
    }

    /// Number of frames, and their size if known, pixels.
    pub fn frames(&self) -> (usize, Option<(u32, u32)>) {
        let pictures = self.pictures.first();
        match (&self.video, &self.recorded) {
            (Some(video), _) => (video.count, Some(video.size)),
            (None, Some((_, images))) => (images.count, images.size),
            (None, None) => pictures.map_or((0, None), |group| (group.count, group.size)),
        }
    }

    /// Width and height of the pictures, pixels, for a calibration that does not state them.
    fn picture_size(&self) -> Option<[u32; 2]> {
        let groups = self.pictures.iter();
        let largest = groups.min_by_key(|group| std::cmp::Reverse(group.count))?;
        largest.size.map(|(width, height)| [width, height])
    }

    fn sort(&mut self) {
        self.pictures
            .sort_by_key(|group| std::cmp::Reverse(group.count));
        let (count, size) = self.frames();
        let turned = self.picture_frames().and_then(|group| group.turned_size);
        self.calibrations.sort_by_key(|found| {
            let calibrated = Some(found.size());
            let other_size = (calibrated != size, calibrated != turned);
            (other_size, has_no_size(&found.path))
        });
        self.poses.sort_by_key(|(path, poses)| {
            let other_count = poses.entries.len() != count;
            (
                other_count && !poses.has_times() && !poses.has_names(),
                is_truth(path),
                other_count,
            )
        });
    }

    /// The initial poses: the first file not named as ground truth.
    pub fn initial(&self) -> Option<&(PathBuf, PoseFile)> {
        self.poses.iter().find(|(path, _)| !is_truth(path))
    }

    /// The only file that was recognised as poses but is faulty, with the reason, if no other has
    /// poses.
    pub(super) fn faulty_poses(&self) -> Option<&LeftAside> {
        let mut faulty = self
            .left_aside
            .iter()
            .filter(|aside| aside.is_faulty_pose_file());
        let only = faulty.next().filter(|aside| aside.count == 1);
        only.filter(|_| faulty.next().is_none() && self.initial().is_none())
    }

    /// The ground truth, if a file is named so.
    pub fn truth(&self) -> Option<&(PathBuf, PoseFile)> {
        self.poses.iter().find(|(path, _)| is_truth(path))
    }
}

/// True if a picture is a mask, by its name.
fn is_mask(file: &Path) -> bool {
    file.file_stem()
        .is_some_and(|stem| stem.eq_ignore_ascii_case("mask"))
}

/// True if a file may be a calibration, by its name; `extension` is in lower case.
fn is_calibration(file: &Path, extension: &str) -> bool {
    match extension {
        "json" | "toml" | "yaml" | "yml" | "txt" | "sfm" | "xml" | "out" | "csv" | "cam" => true,
        "" => file.ends_with(RECORD3D_FILE),
        "bin" => file.ends_with("cameras.bin"),
        _ => false,
    }
}

/// True if a calibration has its size from the pictures, by its name.
fn has_no_size(file: &Path) -> bool {
    ["out", "csv", "cam"].contains(&extension(file).to_lowercase().as_str())
}

/// The extension of a file's name.
fn extension(file: &Path) -> String {
    let extension = file.extension().unwrap_or_default();
    extension.to_string_lossy().into_owned()
}

/// The pictures among files, without masks, by folder and extension.
fn picture_files(files: &[PathBuf]) -> PictureFiles<'_> {
    let mut groups: PictureFiles = BTreeMap::new();
    for file in files {
        let extension = extension(file).to_lowercase();
        if PICTURE_EXTENSIONS.contains(&extension.as_str()) && !is_mask(file) {
            let parent = file.parent().unwrap_or(Path::new("")).to_owned();
            groups.entry((parent, extension)).or_default().push(file);
        }
    }
    groups
}

/// True if a file may hold poses, by its name; `extension` is in lower case.
fn is_pose_file(file: &Path, extension: &str) -> bool {
    match extension {
        "txt" | "tum" | "csv" | "tsv" | "tab" | "dat" | "asc" | "log" | "traj" | "opk" | "json"
        | "kitti" | "out" | "sfm" | "xml" | "yaml" | "yml" => true,
        "" => file.ends_with(RECORD3D_FILE),
        "bin" => file.ends_with("images.bin"),
        _ => false,
    }
}

/// True if a file's name denotes ground truth.
fn is_truth(path: &Path) -> bool {
    let name = path
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .to_lowercase();
    let words = ["truth", "groundtruth", "ground_truth", "ground-truth"];
    words.iter().any(|word| name.contains(word)) || name == "gt" || name.starts_with("gt_")
}

/// The pictures of a folder with an extension, in lower case.
type PictureFiles<'a> = BTreeMap<(PathBuf, String), Vec<&'a PathBuf>>;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_survey_is_found_part_by_part() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../fixtures/blender_free48");
        let found = Discovery::of(&folder).unwrap();
        let group = &found.pictures[0];
        assert_eq!((group.pattern.as_str(), group.count), ("frames/*.jpg", 48));
        assert_eq!(group.size, Some((480, 360)));
        assert_eq!(found.calibrations[0].path, Path::new("camera.json"));
        assert_eq!(found.initial().unwrap().0, Path::new("baseline.tum"));
        assert_eq!(found.truth().unwrap().0, Path::new("groundtruth.tum"));
    }

    #[test]
    fn what_does_not_fit_the_pictures_comes_last() {
        let dir = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(dir.path().join(name), text).unwrap();
        std::fs::create_dir_all(dir.path().join("images/.hidden")).unwrap();
        for k in 0..3 {
            let picture = image::GrayImage::new(64, 48);
            picture
                .save(dir.path().join(format!("images/{k}.png")))
                .unwrap();
        }
        image::GrayImage::new(8, 8)
            .save(dir.path().join("images/.hidden/x.png"))
            .unwrap();
        write("a.txt", "1 PINHOLE 128 96 50 50 64 48\n");
        write("b.txt", "1 PINHOLE 64 48 50 50 32 24\n");
        write("few.txt", "1 0 0 0 0 0 0 0 1\n1 0 0 1 0 0 0 0 1\n");
        write("long.tum", "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
        write(
            "right.tum",
            "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n",
        );
        image::GrayImage::new(64, 48)
            .save(dir.path().join("images/Mask.png"))
            .unwrap();
        write("notes.txt", "measured on a Monday\n");
        let bundle = "# Bundle file v0.3\n1 0\n50 0 0\n1 0 0\n0 1 0\n0 0 1\n0 0 1\n";
        write("a.out", bundle);
        let found = Discovery::of(dir.path()).unwrap();
        assert_eq!(found.pictures.len(), 1);
        assert_eq!(found.pictures[0].pattern, "images/*.png");
        assert_eq!(found.pictures[0].count, 3);
        assert_eq!(found.mask.as_deref(), Some(Path::new("images/Mask.png")));
        let calibrations = found.calibrations.iter();
        let calibrations: Vec<_> = calibrations
            .map(|found| (found.path.as_path(), found.camera.width))
            .collect();
        let expected = [("b.txt", 64), ("a.out", 64), ("a.txt", 128)];
        assert_eq!(
            calibrations,
            expected.map(|(path, width)| (Path::new(path), width))
        );
        assert_eq!(found.initial().unwrap().0, Path::new("right.tum"));
        assert!(found.truth().is_none());
    }

    /// The results of a run that are kept in the folder of the survey.
    #[test]
    fn refined_poses_are_no_initial_ones() {
        let dir = tempfile::tempdir().unwrap();
        let results = dir.path().join("refined");
        std::fs::create_dir(&results).unwrap();
        std::fs::write(results.join("poses.tum"), "0 0 0 0 0 0 0 1\n").unwrap();
        assert!(Discovery::of(dir.path()).unwrap().initial().is_some());
        std::fs::write(results.join("refine.json"), "{}").unwrap();
        let found = Discovery::of(dir.path()).unwrap();
        assert!(found.initial().is_none());
        assert_eq!(found.left_aside[0].pattern, "refined");
    }

    /// As many poses as frames are there only because one of two was left out.
    #[test]
    fn poses_that_contradict_each_other_are_associated_by_time() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["1.5.png", "2.5.png"] {
            let picture = image::GrayImage::new(64, 48);
            picture.save(dir.path().join(name)).unwrap();
        }
        let poses = "1.5 0 0 0 0 0 0 1\n2.5 0 0 0 0 0 0 1\n2.5 0 0.5 0 0 0 0 1\n";
        std::fs::write(dir.path().join("poses.tum"), poses).unwrap();
        let found = Discovery::of(dir.path()).unwrap();
        let text = found.survey_toml(Some(3.0));
        assert!(text.contains("\nassociate = \"time\""), "{text}");
    }
}
