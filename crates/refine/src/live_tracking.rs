//! Provisional tracking of frames while they are taken: the tracking of a refinement at a coarser
//! level, on locally normalised frames, so that nothing has to be known of the light beforehand.
//! The result of a refinement does not depend on it.

use crate::error::RefineError;
use crate::input::{RefineInput, is_motionless};
use crate::model::context::EstimationContext;
use crate::model::rejection::RejectionReason;
use crate::options::{Photometry, RefineOptions, ShapeMode};
use crate::parameters::calibration::Kappa;
use crate::stages::setup::Setup;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::tracking::prescreening::is_featureless;
use crate::tracking::track::Tracking;
use std::sync::Arc;
use tunnelstitch_core::frames::{
    FrameCache, FrameSet, GreyImage, NoiseMeasurement, PictureNoise, Pyramid, StoredFrame,
    normalise_locally,
};
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::Pose;

/// Pyramid levels that frames are tracked on, from the coarsest. More are more exact than a preview
/// shows, and take longer than cameras give.
const TRACKING_LEVELS: usize = 2;
/// Pixels of the shorter side of the frames that are tracked, at the least; frames are halved as
/// long as they have more.
const MIN_SIDE: u32 = 200;
/// Frames by which the noise of the sensor is known, at the most.
const NOISE_FRAMES: usize = 32;

/// Frames that are tracked while they are taken.
pub struct LiveTracking {
    options: RefineOptions,
    /// The grey pyramids of the frames so far: halved, locally normalised. Those that no further
    /// frame can overlap are replaced by the first one, which is empty.
    pyramids: Vec<Arc<Pyramid>>,
    empty: Arc<Pyramid>,
    tracking: Tracking,
    /// 1-σ of the noise of the first frames, grey levels.
    noises: Vec<NoiseMeasurement>,
    skipped: usize,
}

/// Counts of frames by what has become of them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LiveCounts {
    /// Frames that match the wall that others show, or are the first that show theirs.
    pub tracked: usize,
    /// Frames that show hardly any contrast or cannot be decoded.
    pub empty: usize,
    /// Frames that do not match.
    pub unmatched: usize,
    /// Frames that were not looked at, since tracking was behind.
    pub skipped: usize,
}

impl Default for LiveTracking {
    fn default() -> Self {
        Self::new()
    }
}

impl LiveTracking {
    /// Tracking that has not begun.
    pub fn new() -> Self {
        Self {
            options: RefineOptions {
                calibrate: Some(Vec::new()),
                shape: ShapeMode::Fixed,
                photometry: Photometry::Normalised,
                tracking_levels: TRACKING_LEVELS,
                ..RefineOptions::default()
            },
            pyramids: Vec::new(),
            empty: Arc::new(Pyramid::new(GreyImage::new(1, 1, vec![f32::NAN]), 1)),
            tracking: Tracking::open_ended(Kappa::zeros()),
            noises: Vec::new(),
            skipped: 0,
        }
    }

    /// The camera of the first level of the frames' pyramids, and the number of levels.
    pub fn camera(&self, input: &RefineInput) -> (Camera, usize) {
        let level = halvings(input.cameras.shorter_side());
        let camera = input.cameras.of(0).at_level(level);
        let levels = self.options.coarsest_level(camera.width.min(camera.height)) + 1;
        (camera, levels)
    }

    /// Number of frames tracked so far, those that do not match or were skipped included.
    pub fn frames(&self) -> usize {
        self.tracking.tracked_frames()
    }

    /// The poses of the frames so far; of those that are not tracked, as the prior predicts them.
    pub fn poses(&self) -> Vec<Pose> {
        let states = self.tracking.states();
        states.estimates.iter().map(|frame| frame.pose).collect()
    }

    /// Counts of the frames so far.
    pub fn counts(&self) -> LiveCounts {
        let mut counts = LiveCounts {
            skipped: self.skipped,
            ..LiveCounts::default()
        };
        for rejection in &self.tracking.states().rejections {
            match rejection {
                None => counts.tracked += 1,
                Some(RejectionReason::LeftOut) => {}
                Some(reason) if reason.shows_nothing() => counts.empty += 1,
                Some(_) => counts.unmatched += 1,
            }
        }
        counts
    }

    /// True if frame `frame` shows the wall at its pose, as far as is known: unless it shows
    /// nothing or does not match.
    pub fn shows_wall(&self, frame: usize) -> bool {
        let rejection = self.tracking.states().rejections.get(frame);
        matches!(rejection, Some(None | Some(RejectionReason::LeftOut)))
    }

    /// The grey pyramid of a frame, locally normalised; None of one that no further frame can
    /// overlap, or that shows nothing.
    pub fn pyramid(&self, frame: usize) -> Option<&Pyramid> {
        let pyramid = self.pyramids.get(frame)?;
        (!Arc::ptr_eq(pyramid, &self.empty)).then_some(pyramid)
    }

    /// Tracks the frames that `input` has beyond those tracked so far, but for those that
    /// `is_skipped` names. Nothing happens as long as there are fewer than two, or they do not
    /// move.
    ///
    /// # Errors
    /// Poses that cannot be refined; equations without a solution.
    pub fn track(
        &mut self,
        input: &RefineInput,
        is_skipped: impl Fn(usize) -> bool,
    ) -> Result<(), RefineError> {
        let first = self.frames();
        if input.frames.len() < 2 || input.frames.len() == first || is_motionless(input.initial) {
            return Ok(());
        }
        let options = self.options.clone();
        let level = halvings(input.cameras.shorter_side());
        let cameras = input.cameras.at_level(level);
        let levels = options.coarsest_level(cameras.shorter_side()) + 1;
        let read = |k: usize| read_pyramid(input.frames, k, (input.cameras.size(), level), levels);
        let pyramids: Vec<Option<Pyramid>> = (first..input.frames.len()).par_map(read);
        let rejections = (first..).zip(&pyramids).map(|(k, pyramid)| match pyramid {
            None => Some(RejectionReason::Featureless),
            Some(_) if is_skipped(k) => Some(RejectionReason::LeftOut),
            Some(_) => None,
        });
        let rejections: Vec<Option<RejectionReason>> = rejections.collect();
        self.keep(pyramids);
        let mut setup = Setup::new(
            RefineInput {
                cameras,
                ..input.clone()
            },
            &options,
        )?;
        setup.frames = FrameCache::of_pyramids(self.pyramids.iter().cloned());
        let noise = PictureNoise::median(&self.noises);
        let context = EstimationContext {
            prior: &setup.tracking_prior,
            ..setup.initial_context(noise)
        };
        for rejection in rejections {
            self.skipped += usize::from(rejection == Some(RejectionReason::LeftOut));
            self.tracking.append(rejection);
            self.tracking.track_next(&context, &options)?;
        }
        Ok(())
    }

    /// Keeps the pyramids of further frames, and drops those that none can overlap any more;
    /// measures their noise, as long as there are few.
    fn keep(&mut self, pyramids: Vec<Option<Pyramid>>) {
        for pyramid in pyramids {
            if let Some(pyramid) = pyramid
                .as_ref()
                .filter(|_| self.noises.len() < NOISE_FRAMES)
            {
                self.noises.extend(NoiseMeasurement::of(pyramid));
            }
            let kept = pyramid.map_or_else(|| Arc::clone(&self.empty), Arc::new);
            self.pyramids.push(kept);
        }
        let first = self.frames().saturating_sub(MAX_OVERLAP_DISTANCE_FRAMES);
        let gone = self.pyramids[..first].iter_mut().rev();
        for pyramid in gone.take_while(|pyramid| !Arc::ptr_eq(pyramid, &self.empty)) {
            *pyramid = Arc::clone(&self.empty);
        }
    }
}

/// Number of times that frames whose shorter side has `side` pixels are halved.
fn halvings(side: u32) -> usize {
    let mut level = 0;
    while side >> (level + 1) >= MIN_SIDE {
        level += 1;
    }
    level
}

/// The pyramid of a frame of `size` (width and height, pixels), halved `level` times and locally
/// normalised; None if it shows nothing or cannot be decoded.
fn read_pyramid(
    frames: &FrameSet,
    frame: usize,
    ([width, height], level): ([u32; 2], usize),
    levels: usize,
) -> Option<Pyramid> {
    let stored = StoredFrame::decode(&frames[frame], width, height);
    let mut image = stored.ok()?.grey();
    if let Some(mask) = frames.masks().of(frame) {
        mask.blank(&mut image);
    }
    for _ in 0..level {
        image = image.halved();
    }
    let pyramid = Pyramid::new(normalise_locally(&image), levels);
    (!is_featureless(pyramid.level(levels - 1))).then_some(pyramid)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_scene::bricks;
    use nalgebra::{Vector2, Vector3};
    use tunnelstitch_core::test_wall::TestWall;
    use tunnelstitch_geometry::surface::{Surface, shortest_arc};
    use tunnelstitch_geometry::trajectory::{
        Jitter, JitterModel, StampedPose, indexed, poses_of, so3,
    };

    /// The frames of a wall, of which one is black, and initial poses with an error of each step.
    fn survey(black: usize) -> (TestWall, FrameSet, Vec<StampedPose>) {
        let wall = TestWall::ring(bricks);
        let pictures = wall.samples(|k, _, _, value| if k == black { 0.0 } else { value });
        let [width, height] = [wall.camera.width, wall.camera.height];
        let pictures = pictures
            .into_iter()
            .filter_map(|picture| Some(image::GrayImage::from_raw(width, height, picture)?.into()));
        let frames = FrameSet::in_memory(pictures);
        let error = so3::exp(&Vector3::new(0.04, -0.03, 0.05));
        let mut initial = vec![wall.poses[0]];
        for pair in wall.poses.windows(2) {
            let step = pair[0].r_wc.inverse() * pair[1].r_wc * error;
            let turned = initial[initial.len() - 1].r_wc * step;
            initial.push(Pose::new(turned, pair[1].t_wc));
        }
        (wall, frames, indexed(initial))
    }

    /// The last frame but one is skipped, and the last one is black: without them, each overlaps
    /// the one before.
    #[test]
    fn frames_are_tracked_as_they_come() {
        let (wall, frames, initial) = survey(13);
        let jitter = Jitter {
            model: JitterModel::RandomWalk,
            rotation_sigma_rad: 0.03,
            translation_sigma_m: [0.03; 3],
        };
        let surface: Arc<dyn Surface> = Arc::new(wall.circle);
        let mut tracking = LiveTracking::new();
        for count in [1, 2, 5, 5, 9, 14] {
            let frames = frames.first(count);
            let surface = Arc::clone(&surface);
            let input = RefineInput::new(wall.camera, surface, &frames, &initial[..count], jitter);
            tracking.track(&input, |frame| frame == 12).unwrap();
            assert_eq!(tracking.frames(), if count == 1 { 0 } else { count });
        }
        let expected = LiveCounts {
            tracked: 12,
            empty: 1,
            unmatched: 0,
            skipped: 1,
        };
        assert_eq!(tracking.counts(), expected);
        assert!(tracking.shows_wall(12) && !tracking.shows_wall(13));
        assert!(tracking.pyramid(12).is_some() && tracking.pyramid(13).is_none());
        // Steps on the wall between neighbours, which no gauge changes.
        let wall_at = |pose: &Pose| {
            let hit = wall.circle.hit(&pose.t_wc, &(pose.r_wc * Vector3::z()));
            hit.unwrap().wall
        };
        let step = |poses: &[Pose], k: usize| {
            let [from, to] = [wall_at(&poses[k]), wall_at(&poses[k + 1])];
            let around_m = shortest_arc(to.s_m - from.s_m, wall.perimeter_m());
            Vector2::new(around_m, to.h_m - from.h_m)
        };
        let error_m = |poses: &[Pose]| {
            let errors = (0..11).map(|k| (step(poses, k) - step(&wall.poses, k)).norm_squared());
            (errors.sum::<f64>() / 11.0).sqrt()
        };
        let [before_m, after_m] = [poses_of(&initial), tracking.poses()].map(|p| error_m(&p));
        assert!(after_m < 0.3 * before_m, "{after_m} m, {before_m} m before");
    }
}
