//! Pairs of frames that may share wall, in batches.

use crate::model::context::EstimationContext;
use crate::model::frame_states::FrameStates;
use crate::model::problem_error::ProblemError;
use crate::samples::footprints::footprint;
use crate::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Footprint;

/// Frames compared at once: bounds the memory.
const BATCH: usize = 32;

/// The parts of the wall that the inliers see.
pub struct Overlaps {
    /// The footprint of every frame; None for rejected ones.
    pub footprints: Vec<Option<Footprint>>,
    perimeter_m: f64,
}

/// Some frames, each with the later ones that may share wall with it.
pub struct Batch {
    /// Each frame that has any with its later partners.
    pub partners: Vec<(usize, Vec<usize>)>,
    /// All frames of the batch, ascending.
    pub needed: Vec<usize>,
}

impl Overlaps {
    /// The overlaps of the inliers at their present poses, through `cameras`.
    ///
    /// # Errors
    /// [`ProblemError::Placement`].
    pub fn of(
        context: &EstimationContext,
        cameras: &Cameras,
        states: &FrameStates,
    ) -> Result<Self, ProblemError> {
        let footprints = (0..states.estimates.len()).par_map(|k| {
            if states.rejections[k].is_none() {
                let camera = cameras.of(k).with_sweep(&states.sweep(context, k));
                footprint(context, &camera, k, &states.estimates[k].pose).map(Some)
            } else {
                Ok(None)
            }
        });
        Ok(Self {
            footprints: footprints.into_iter().collect::<Result<_, _>>()?,
            perimeter_m: context.surface.perimeter_m(),
        })
    }

    /// The frames in batches, each with those of its later partners for which `is_wanted` is true.
    pub fn batches(&self, is_wanted: impl Fn(usize, usize) -> bool) -> impl Iterator<Item = Batch> {
        (0..self.footprints.len()).step_by(BATCH).map(move |start| {
            let frames = start..(start + BATCH).min(self.footprints.len());
            let partners: Vec<(usize, Vec<usize>)> = frames
                .map(|a| {
                    let mut partners = self.later_partners(a);
                    partners.retain(|b| is_wanted(a, *b));
                    (a, partners)
                })
                .filter(|(_, partners)| !partners.is_empty())
                .collect();
            let all = partners
                .iter()
                .flat_map(|(a, partners)| std::iter::once(a).chain(partners));
            let mut needed: Vec<usize> = all.copied().collect();
            needed.sort_unstable();
            needed.dedup();
            Batch { partners, needed }
        })
    }

    /// The frames after frame `a` that may share wall with it.
    fn later_partners(&self, a: usize) -> Vec<usize> {
        let Some(own) = &self.footprints[a] else {
            return Vec::new();
        };
        let end = (a + MAX_OVERLAP_DISTANCE_FRAMES + 1).min(self.footprints.len());
        let overlaps = |other: &Footprint| other.overlaps(own, self.perimeter_m);
        (a + 1..end)
            .filter(|b| self.footprints[*b].as_ref().is_some_and(overlaps))
            .collect()
    }
}
