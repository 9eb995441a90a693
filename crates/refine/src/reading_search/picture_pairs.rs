//! Registration of neighbouring frames on each other in a reading of their poses and pictures.

use super::comparison::Registrations;
use crate::error::RefineError;
use crate::input::RefineInput;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::options::RefineOptions;
use crate::stages::setup::Setup;
use crate::tracking::neighbour_pairs::register_pairs;
use crate::tracking::prescreening::prescreen;
use crate::tracking::registration::Registered;
use image::DynamicImage;
use std::collections::BTreeMap;
use tunnelstitch_core::frames::{FrameSet, Light, load_colour};
use tunnelstitch_core::progress::Silent;
use tunnelstitch_core::survey::{PoseReading, Survey};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::trajectory::StampedPose;

/// The pictures of pairs of neighbouring frames, as read.
pub struct PicturePairs<'s> {
    survey: &'s Survey,
    /// The pictures by the indices of their frames.
    pictures: BTreeMap<usize, DynamicImage>,
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
        let pictures = pictures.map_err(ProblemError::from)?;
        Ok(Self {
            survey,
            pictures: frames.into_iter().zip(pictures).collect(),
        })
    }

    /// Registers the frames after `firsts` on the wall that each of these shows, as long as
    /// `is_wanted` of those before.
    ///
    /// # Errors
    /// [`RefineError`].
    pub fn register(
        &self,
        reading: &PoseReading,
        firsts: &[usize],
        is_wanted: impl Fn(&[Option<Registered>]) -> bool,
    ) -> Result<Registrations, RefineError> {
        let wanted = frames_of(firsts);
        let turned = |k: &usize| reading.orientation.turned(&self.pictures[k]);
        let mut frames = FrameSet::in_memory(wanted.iter().map(turned));
        if let Some(mask) = self.survey.frames.masks().of(0) {
            frames.hide(mask);
        }
        let initial: Vec<StampedPose> = wanted.iter().map(|k| reading.initial[*k]).collect();
        let options = RefineOptions {
            // Only the poses.
            calibrate: Some(Vec::new()),
            ..RefineOptions::fast()
        };
        let input = RefineInput {
            cameras: reading.camera(self.survey.cameras.of(0)).into(),
            frames: &frames,
            initial: &initial,
            pose_gaps: &[],
            ..RefineInput::from(self.survey)
        };
        let setup = Setup::new(input, &options)?;
        // No light is known yet.
        setup.frames.set_light(Light::Normalised);
        let firsts: Vec<usize> = firsts
            .iter()
            .map(|first| wanted.partition_point(|k| k < first))
            .collect();
        let prescreened = prescreen(&setup.initial_context(0.0), setup.coarsest_level(), &Silent)?;
        let context = setup.initial_context(prescreened.noise);
        let states = FrameStates::at(&setup.prior.initial, prescreened.rejections);
        Ok(register_pairs(
            &context, &options, &states, &firsts, is_wanted,
        )?)
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
