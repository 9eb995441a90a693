//! A survey whose frames are still being taken: pictures appear in their folder one after another,
//! and the file of poses is complete, as that of a plan, or grows with them.

use super::error::SurveyError;
use super::file::{SurveyFile, read_survey_file};
use super::numbering::Numbering;
use super::open::{Survey, folder_of, toml_path};
use super::pose_reader::{FramesToPose, PoseReader};
use crate::frames::{FrameError, FrameFile, FrameSet, PictureReading, list_frames};
use crate::storage::StorageUrl;
use std::collections::{HashMap, HashSet};
use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant, SystemTime};
use tunnelstitch_geometry::trajectory::StampedPose;

/// Longest time for which frames wait for one before them: one that is being written, or whose
/// number is missing.
const MAX_WAIT: Duration = Duration::from_secs(1);

/// A survey whose frames are still being taken.
#[derive(Debug)]
pub struct Capture {
    survey: Survey,
    reading: PictureReading,
    mask: Option<PathBuf>,
    /// The last frame in the order of names that is taken or set aside, by its place in the
    /// sequence, missing ones counted.
    last: Option<FrameFile>,
    /// Files that are taken or set aside.
    known: HashSet<PathBuf>,
    /// Files that wait.
    waiting: HashMap<PathBuf, Waiting>,
    set_aside: Vec<SetAside>,
    missing: Vec<MissingFrames>,
    pictures: usize,
    poses_error: Option<String>,
}

/// A file that waits for being taken.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    since: Instant,
    is_whole: bool,
}

/// A frame that is not shown while frames are taken.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SetAside {
    /// Its name.
    pub file: String,
    /// The reason.
    pub reason: String,
}

/// Frames that are missing in the numbering.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MissingFrames {
    /// Their number.
    pub count: usize,
    /// The name of the frame before them.
    pub before: String,
    /// The name of the frame after them.
    pub after: String,
}

/// A frame that is complete, and the number of missing ones before it.
struct Ready {
    frame: FrameFile,
    missing: usize,
}

impl Capture {
    /// Opens a survey that has its first picture; None as long as it has none. `change`: of the
    /// content of `survey.toml`. `path`: the survey's folder or its `survey.toml`.
    ///
    /// # Errors
    /// As [`Survey::open`], but for poses; frames that are no pictures in a folder, of one camera.
    pub fn open(
        path: &Path,
        change: impl Fn(&mut SurveyFile),
    ) -> Result<Option<Self>, SurveyError> {
        let toml_path = toml_path(path);
        let mut file = read_survey_file(&toml_path)?;
        change(&mut file);
        check_file(&file).map_err(|what| SurveyError::Value {
            path: toml_path.clone(),
            what,
        })?;
        let mask = file
            .frames
            .mask
            .map(|mask| folder_of(&toml_path).join(mask));
        let images = file.frames.images.unwrap_or_default();
        let listed = list(&folder_of(&toml_path), &images, mask.as_deref())?;
        let has_whole = |frame: &FrameFile| frame.size().is_ok() && frame.is_whole();
        if !listed.first().is_some_and(has_whole) {
            return Ok(None);
        }
        let mut survey = Survey::open_with(path, |file| {
            change(file);
            file.poses.is_awaited = true;
            file.frames.skip_bad = None;
        })?;
        let first = (&survey.frames).into_iter().next();
        let reading = first.and_then(FrameFile::reading).unwrap_or_default();
        survey.frames = FrameSet::new(Vec::new(), survey.frames.masks().clone());
        Ok(Some(Self {
            survey,
            reading,
            mask,
            last: None,
            known: HashSet::new(),
            waiting: HashMap::new(),
            set_aside: Vec::new(),
            missing: Vec::new(),
            pictures: 0,
            poses_error: None,
        }))
    }

    /// The survey with the frames that are taken so far, each with its initial pose.
    pub fn survey(&self) -> &Survey {
        &self.survey
    }

    /// Number of pictures in the folder, complete or not.
    pub fn pictures(&self) -> usize {
        self.pictures
    }

    /// Number of pictures that wait for their end, for one before them, or for their pose.
    pub fn waiting(&self) -> usize {
        self.waiting.len()
    }

    /// Frames that are not shown while frames are taken.
    pub fn set_aside(&self) -> &[SetAside] {
        &self.set_aside
    }

    /// Frames that are missing in the numbering.
    pub fn missing(&self) -> &[MissingFrames] {
        &self.missing
    }

    /// The error of the file of poses at the last reading, as while it is being written.
    pub fn poses_error(&self) -> Option<&str> {
        self.poses_error.as_deref()
    }

    /// Takes the frames that have been completed since the last call and have a pose, in the order
    /// of their names. Those that come after frames that were taken already, cannot be read, or
    /// have no pose although later ones have, are set aside.
    ///
    /// # Errors
    /// A folder that cannot be listed.
    pub fn take_further(&mut self, now: Instant) -> Result<(), SurveyError> {
        let images = self.survey.file.frames.images.as_deref();
        let images = images.unwrap_or_default();
        let listed = list(&self.survey.folder, images, self.mask.as_deref())?;
        self.pictures = listed.len();
        let numbering = Numbering::of(&listed);
        let after = self.set_late_aside(&listed);
        let ready = self.find_ready(&listed[after..], numbering, now);
        if ready.is_empty() {
            return Ok(());
        }
        let frames: Vec<FrameFile> = ready.iter().map(|ready| ready.frame.clone()).collect();
        match self.read_poses(&frames) {
            Ok(poses) => {
                self.poses_error = None;
                self.take(ready, &poses);
            }
            Err(error) => self.poses_error = Some(error.to_string()),
        }
        Ok(())
    }

    /// Sets those of the listed frames aside that come late; returns the number of the frames up to
    /// the last one that is taken.
    fn set_late_aside(&mut self, listed: &[FrameFile]) -> usize {
        let Some(last) = self.last.clone() else {
            return 0;
        };
        let found = listed.iter().position(|frame| frame.path == last.path);
        // A file that was taken away again.
        let after = found.map_or(0, |place| place + 1);
        for frame in &listed[..after] {
            if !self.known.contains(&frame.path) {
                self.leave_out(frame, format!("it came after {}", last.name()));
            }
        }
        after
    }

    /// The frames that are complete, by their places in the sequence, as far as those before them
    /// are.
    fn find_ready(
        &mut self,
        listed: &[FrameFile],
        numbering: Option<Numbering>,
        now: Instant,
    ) -> Vec<Ready> {
        let mut ready = Vec::new();
        let mut before = self.last.clone();
        for frame in listed {
            let gap = before.as_ref().zip(numbering);
            let missing = gap.map_or(0, |(before, of)| of.missing_between(before, frame));
            let next = before.as_ref().map_or(0, |before| before.index + 1);
            let frame = frame.clone().numbered(next + missing);
            if !self.known.contains(&frame.path) {
                match self.examine(&frame, missing, now) {
                    Ok(true) => ready.push(Ready {
                        frame: frame.clone(),
                        missing,
                    }),
                    Ok(false) => break,
                    Err(reason) => self.leave_out(&frame, reason),
                }
            }
            before = Some(frame);
        }
        ready
    }

    /// True if a frame with so many `missing` before it is complete and need not wait any more.
    ///
    /// # Errors
    /// The reason to set it aside.
    fn examine(&mut self, frame: &FrameFile, missing: usize, now: Instant) -> Result<bool, String> {
        let [width, height] = self.survey.cameras.size();
        let reading = self.reading;
        let first_seen = Waiting {
            since: now,
            is_whole: false,
        };
        let waiting = self.waiting.entry(frame.path.clone()).or_insert(first_seen);
        let has_waited = now.saturating_duration_since(waiting.since) >= MAX_WAIT;
        if !waiting.is_whole {
            match frame.clone().with_reading(reading).examine(width, height) {
                Ok(()) => waiting.is_whole = true,
                Err(error) if has_waited => return Err(error.reason()),
                Err(_) => return Ok(false),
            }
        }
        Ok(missing == 0 || has_waited)
    }

    /// Reads the poses of frames as far as the file has them yet.
    fn read_poses(&self, frames: &[FrameFile]) -> Result<Vec<Option<StampedPose>>, SurveyError> {
        let survey = &self.survey;
        let section = &survey.file.poses;
        let path = survey.folder.join(&section.initial);
        if is_being_written(&path) {
            return Ok(vec![None; frames.len()]);
        }
        let to_pose = FramesToPose {
            frames,
            pictures: frames,
            ..survey.frames_to_pose()
        };
        let reader = PoseReader::new(section, &survey.folder, &to_pose)?;
        reader.read_present(&path)
    }

    /// Takes frames as far as there are poses, and sets those between aside that have none.
    fn take(&mut self, ready: Vec<Ready>, poses: &[Option<StampedPose>]) {
        let posed = poses.iter().rposition(Option::is_some);
        let count = posed.map_or(0, |last| last + 1);
        for (Ready { frame, missing }, pose) in ready.into_iter().zip(poses).take(count) {
            if let Some(before) = self.last.as_ref().filter(|_| missing > 0) {
                self.missing.push(MissingFrames {
                    count: missing,
                    before: before.name(),
                    after: frame.name(),
                });
            }
            match self.check_pose(*pose) {
                Ok(pose) => {
                    self.survey.initial.push(pose);
                    let read = frame.clone().with_reading(self.reading);
                    self.survey.frames.push(read);
                    self.waiting.remove(&frame.path);
                    self.known.insert(frame.path.clone());
                }
                Err(reason) => self.leave_out(&frame, reason.to_owned()),
            }
            self.last = Some(frame);
        }
    }

    /// The pose of the next frame, carried along with the bend of the tunnel.
    ///
    /// # Errors
    /// The reason to set the frame aside.
    fn check_pose(&self, pose: Option<StampedPose>) -> Result<StampedPose, &'static str> {
        let survey = &self.survey;
        let pose = pose.ok_or("the file of poses has none for it")?;
        let is_later = |last: &StampedPose| last.time_s < pose.time_s;
        if !survey.initial.last().is_none_or(is_later) {
            return Err("the time of its pose is not later than that of the frame before");
        }
        let pose = match survey.file.poses.as_built {
            Some(true) => pose,
            _ => survey.carried(vec![pose])[0],
        };
        let is_inside = survey.surface.check_inside(&pose.pose.t_wc);
        is_inside
            .map(|()| pose)
            .map_err(|_| "its pose lies outside the tunnel")
    }

    fn leave_out(&mut self, frame: &FrameFile, reason: String) {
        self.waiting.remove(&frame.path);
        self.known.insert(frame.path.clone());
        self.set_aside.push(SetAside {
            file: frame.name(),
            reason,
        });
    }
}

/// The pictures that match a pattern so far.
fn list(folder: &Path, pattern: &str, mask: Option<&Path>) -> Result<Vec<FrameFile>, SurveyError> {
    match list_frames(folder, pattern, mask) {
        Err(FrameError::NoFrames { .. }) => Ok(Vec::new()),
        listed => Ok(listed?),
    }
}

/// True for a text whose last line has no end, while it grows.
fn is_being_written(path: &Path) -> bool {
    let read = || {
        let mut file = File::open(path)?;
        let modified = file.metadata()?.modified()?;
        let mut last = [0];
        file.seek(SeekFrom::End(-1))?;
        file.read_exact(&mut last)?;
        Ok::<_, std::io::Error>((last, modified))
    };
    let age = |modified| {
        SystemTime::now()
            .duration_since(modified)
            .unwrap_or_default()
    };
    read().is_ok_and(|(last, modified)| last != *b"\n" && age(modified) < MAX_WAIT)
}

/// Checks that frames can be followed; returns what does not go with it.
fn check_file(file: &SurveyFile) -> Result<(), String> {
    let frames = &file.frames;
    let on_storage = |images: &String| !matches!(StorageUrl::parse(images), Ok(None));
    if file.camera.is_rig() || frames.images.as_ref().is_none_or(on_storage) {
        return Err(
            "frames can be followed while they are taken only as pictures of one camera in a \
             folder (frames.images); extract those of a video or recording into one, or refine \
             when all are there"
                .to_owned(),
        );
    }
    if frames.times.is_some() {
        return Err(
            "frames.times does not go with following frames while they are taken; name the \
             frames after their times, or refine when all are there"
                .to_owned(),
        );
    }
    if file.poses.reversed == Some(true) || file.poses.shift_frames.is_some() {
        return Err(
            "poses.reversed and poses.shift_frames do not go with following frames while they \
             are taken; refine when all are there"
                .to_owned(),
        );
    }
    Ok(())
}

#[cfg(test)]
mod tests;
