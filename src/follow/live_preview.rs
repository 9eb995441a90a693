//! Provisional poses and a picture of the wall while frames are taken.

use super::live_status::LiveStatus;
use crate::frames::{PictureFormat, add_picture};
use crate::persist::atomic::{OutputSet, WriteError};
use crate::refine::{LiveTracking, RefineInput};
use crate::render::{LiveWall, RenderError, level_for, native_px_per_metre};
use crate::survey::{Capture, Survey, SurveyError, SurveyFile};
use crate::trajectory::{StampedPose, Trajectory, tum};
use std::path::Path;
use std::time::{Duration, Instant};

/// Name of the provisional poses.
const POSES_FILE: &str = "preview.tum";
/// Name of the picture of the wall so far.
const PICTURE_FILE: &str = "preview.png";
/// Files that are written while frames are taken.
pub const PREVIEW_FILES: [&str; 2] = [POSES_FILE, PICTURE_FILE];

/// Frames that wait for being tracked, at the most: of more, only some are tracked.
const MAX_QUEUE: usize = 12;
/// Pixels of a frame as it is tracked along each side of one of the picture of the wall.
const SHRINK: f64 = 2.0;

/// An error of following frames.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FollowError {
    /// The survey, or its folder of frames.
    #[error(transparent)]
    Survey(#[from] SurveyError),
    /// A file of the preview cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// A picture of the preview cannot be drawn.
    #[error(transparent)]
    Render(#[from] RenderError),
}

/// Provisional poses and a picture of the wall while frames are taken.
pub struct LivePreview {
    capture: Capture,
    tracking: LiveTracking,
    wall: Option<LiveWall>,
    /// Number of frames that the wall has.
    drawn: usize,
    /// The time of the last look into the folder, and how long before it ended frames that it
    /// found may have been there.
    looked: Instant,
    lag: Duration,
    /// The reason for which frames are not tracked any more.
    failure: Option<String>,
}

impl LivePreview {
    /// Opens a survey that has its first picture; None as long as it has none ([`Capture::open`]).
    ///
    /// # Errors
    /// Those of [`Capture::open`].
    pub fn open(
        survey: &Path,
        change: impl Fn(&mut SurveyFile),
    ) -> Result<Option<Self>, FollowError> {
        let capture = Capture::open(survey, change)?;
        Ok(capture.map(|capture| Self {
            capture,
            tracking: LiveTracking::new(),
            wall: None,
            drawn: 0,
            looked: Instant::now(),
            lag: Duration::ZERO,
            failure: None,
        }))
    }

    /// The survey with the frames so far.
    pub fn survey(&self) -> &Survey {
        self.capture.survey()
    }

    /// Number of pictures in the folder, complete or not.
    pub fn pictures(&self) -> usize {
        self.capture.pictures()
    }

    /// Takes the frames that are new in the folder, tracks and draws them; false if there are none.
    ///
    /// # Errors
    /// A folder that cannot be listed. Frames that cannot be tracked end the preview, but not the
    /// capture.
    pub fn advance(&mut self) -> Result<bool, FollowError> {
        let now = Instant::now();
        let before = std::mem::replace(&mut self.looked, now);
        self.capture.take_further(now)?;
        let first = self.tracking.frames();
        if self.failure.is_none() {
            self.failure = self.track().and_then(|()| self.draw()).err();
        }
        let is_new = self.tracking.frames() > first;
        if is_new {
            self.lag = before.elapsed();
        }
        Ok(is_new)
    }

    /// Tracks the frames that are taken; some of them if they are many.
    fn track(&mut self) -> Result<(), String> {
        let survey = self.capture.survey();
        let waiting = survey.frames.len() - self.tracking.frames();
        let step = waiting.div_ceil(MAX_QUEUE).max(1);
        let is_skipped = |frame: usize| !frame.is_multiple_of(step);
        let tracked = self.tracking.track(&RefineInput::from(survey), is_skipped);
        tracked.map_err(|error| error.to_string())
    }

    /// Draws the frames that are tracked.
    fn draw(&mut self) -> Result<(), String> {
        let (survey, tracking) = (self.capture.survey(), &self.tracking);
        let (surface, poses) = (survey.surface.as_ref(), tracking.poses());
        if poses.is_empty() {
            return Ok(());
        }
        let input = RefineInput::from(survey);
        let (camera, levels) = tracking.camera(&input);
        let native = native_px_per_metre(surface, camera, &poses[..1]);
        let native = native.map_err(|error| error.to_string())?;
        let new = || LiveWall::new(surface, native / SHRINK);
        let wall = self.wall.get_or_insert_with(new);
        let level = level_for(camera.width.min(camera.height), native, wall.px_per_metre());
        let level = level.min(levels - 1);
        let camera = camera.at_level(level);
        for (frame, pose) in poses.iter().enumerate().skip(self.drawn) {
            let pyramid = tracking
                .pyramid(frame)
                .filter(|_| tracking.shows_wall(frame));
            let picture = pyramid.map(|pyramid| pyramid.level(level));
            let added = wall.add(surface, &camera, pose, picture);
            added.map_err(|error| format!("frame {frame}: {error}"))?;
        }
        self.drawn = poses.len();
        Ok(())
    }

    /// The provisional poses.
    pub fn trajectory(&self) -> Trajectory {
        let poses = self.tracking.poses().into_iter();
        let stamped = self.survey().initial.iter().zip(poses);
        let stamped = stamped.map(|(initial, pose)| StampedPose {
            time_s: initial.time_s,
            pose,
        });
        stamped.collect()
    }

    /// Writes the provisional poses and the picture of the wall into a folder.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn write(&self, folder: &Path) -> Result<(), FollowError> {
        let mut outputs = OutputSet::default();
        outputs.write_text(&folder.join(POSES_FILE), &tum::format(&self.trajectory()))?;
        let surface = self.survey().surface.as_ref();
        let wall = self.wall.as_ref().map(|wall| wall.picture(surface));
        if let Some(picture) = wall.transpose()?.flatten() {
            let path = folder.join(PICTURE_FILE);
            add_picture(&mut outputs, &path, &picture.into(), PictureFormat::Png)?;
        }
        Ok(outputs.commit()?)
    }

    /// The state of the frames so far.
    ///
    /// # Errors
    /// None that is known: gaps are found in memory.
    pub fn status(&self) -> Result<LiveStatus, FollowError> {
        let surface = self.survey().surface.as_ref();
        let gaps = self.wall.as_ref().map(|wall| wall.gaps(surface));
        let last = self.trajectory().last().copied();
        Ok(LiveStatus {
            pictures: self.capture.pictures(),
            waiting: self.capture.waiting(),
            counts: self.tracking.counts(),
            lag: self.lag,
            chainage_m: last.map(|last| surface.chainage_m(&last.pose.t_wc)),
            gaps: gaps.transpose()?.unwrap_or_default(),
            missing: self.capture.missing().to_vec(),
            set_aside: self.capture.set_aside().to_vec(),
            poses_error: self.capture.poses_error().map(str::to_owned),
            failure: self.failure.clone(),
        })
    }
}
