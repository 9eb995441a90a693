//! Registration of neighbouring frames on each other in a reading of their poses and pictures.

use super::comparison::Registrations;
use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::stages::setup::Setup;
use crate::tracking::neighbour_pairs::register_pairs;
use crate::tracking::prescreening::{Prescreened, prescreen};
use crate::tracking::registration::Registered;
use image::DynamicImage;
use tunnelstitch_core::frames::{
    FrameCache, FrameSet, Light, PictureNoise, PictureOrientation, load_colour,
};
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::survey::{PoseReading, Survey};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::StampedPose;

/// The pictures of pairs of neighbouring frames.
pub struct PicturePairs<'s> {
    survey: &'s Survey,
    /// The frames of the pairs, in order.
    frames: Vec<usize>,
    /// The places of the pairs' first frames among these.
    firsts: Vec<usize>,
    /// The pictures as read.
    pictures: Vec<DynamicImage>,
    /// The pictures as the last reading turns them.
    turned: Option<TurnedPictures>,
}

/// The pictures as readings of one orientation turn them, decoded and normalised once.
struct TurnedPictures {
    orientation: PictureOrientation,
    files: FrameSet,
    cache: FrameCache,
    prescreened: Prescreened,
}

impl<'s> PicturePairs<'s> {
    /// Reads the frames `firsts` and those after them.
    ///
    /// # Errors
    /// [`RefineError`]: a frame that cannot be read.
    pub fn load(survey: &'s Survey, firsts: &[usize]) -> Result<Self, RefineError> {
        let frames = frames_of(firsts);
        let chosen = survey.frames.only(&frames);
        let [width, height] = survey.cameras.size();
        let files: Vec<_> = chosen.iter().collect();
        let pictures = files.par_map(|file| load_colour(file, width, height));
        let pictures: Result<Vec<_>, _> = pictures.into_iter().collect();
        let place = |first: &usize| frames.partition_point(|k| k < first);
        Ok(Self {
            survey,
            firsts: firsts.iter().map(place).collect(),
            frames,
            pictures: pictures.map_err(ProblemError::from)?,
            turned: None,
        })
    }

    /// Registers the second frame of each pair on the wall that the first one shows, as long as
    /// `is_wanted` of those before.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn register(
        &mut self,
        reading: &PoseReading,
        is_wanted: impl Fn(&[Option<Registered>]) -> bool,
    ) -> Result<Registrations, RefineError> {
        let initial: Vec<StampedPose> = self.frames.iter().map(|k| reading.initial[*k]).collect();
        let options = RefineOptions {
            // Only the poses.
            calibrate: Some(Vec::new()),
            ..RefineOptions::fast()
        };
        let before = self.turned.take();
        let turned = match before.filter(|before| before.orientation == reading.orientation) {
            Some(turned) => turned,
            None => self.turn(reading, &initial, &options)?,
        };
        let setup = self.setup(&turned.files, reading, &initial, &options)?;
        let context = EstimationContext {
            frames: &turned.cache,
            ..setup.initial_context(turned.prescreened.noise)
        };
        let rejections = turned.prescreened.rejections.clone();
        let states = FrameStates::at(&setup.prior.initial, rejections);
        let registered = register_pairs(&context, &options, &states, &self.firsts, is_wanted)?;
        self.turned = Some(turned);
        Ok(registered)
    }

    /// The pictures as a reading turns them.
    fn turn(
        &self,
        reading: &PoseReading,
        initial: &[StampedPose],
        options: &RefineOptions,
    ) -> Result<TurnedPictures, RefineError> {
        let turned = |picture| reading.orientation.turned(picture);
        let mut files = FrameSet::in_memory(self.pictures.iter().map(turned));
        if let Some(mask) = self.survey.frames.masks().of(0) {
            files.hide(mask);
        }
        let setup = self.setup(&files, reading, initial, options)?;
        // No light is known yet.
        setup.frames.set_light(Light::Normalised);
        let prescreened = prescreen(
            &setup.initial_context(PictureNoise::default()),
            setup.coarsest_level(),
            &Silent,
        )?;
        Ok(TurnedPictures {
            orientation: reading.orientation,
            cache: setup.frames,
            files,
            prescreened,
        })
    }

    /// The refinement of the pairs in a reading.
    fn setup<'a>(
        &'a self,
        frames: &'a FrameSet,
        reading: &PoseReading,
        initial: &'a [StampedPose],
        options: &'a RefineOptions,
    ) -> Result<Setup<'a>, RefineError> {
        let input = RefineInput {
            cameras: reading.camera.camera(self.survey.cameras.of(0)).into(),
            frames,
            initial,
            pose_gaps: &[],
            ..RefineInput::from(self.survey)
        };
        Setup::new(input, options)
    }
}

/// The frames of pairs, each once and in their order.
fn frames_of(firsts: &[usize]) -> Vec<usize> {
    let mut frames: Vec<usize> = firsts.iter().flat_map(|k| [*k, *k + 1]).collect();
    frames.sort_unstable();
    frames.dedup();
    frames
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_of_pairs_that_share_some_are_read_once() {
        assert_eq!(frames_of(&[0, 2]), [0, 1, 2, 3]);
        assert_eq!(frames_of(&[7, 3, 4]), [3, 4, 5, 7, 8]);
    }
}
