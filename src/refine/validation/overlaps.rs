//! Which frames see wall in common.

use crate::camera::Camera;
use crate::refine::model::context::EstimationContext;
use crate::refine::model::frame_states::FrameStates;
use crate::refine::model::problem_error::ProblemError;
use crate::refine::samples::footprints::footprint;
use crate::refine::thresholds::footprints::MAX_OVERLAP_DISTANCE_FRAMES;
use crate::surface::Footprint;
use rayon::prelude::*;
use std::ops::Range;

/// Frames compared at once: bounds the memory.
const BATCH: usize = 32;

/// The inliers frames of a run on the wall.
pub struct Overlaps {
    /// What each sees; None for those in rejection and outside the run.
    pub footprints: Vec<Option<Footprint>>,
    run: Range<usize>,
    perimeter_m: f64,
}

/// Some frames and those after them that may share wall with them.
pub struct Batch {
    /// A frame and those after it, for every frame that has any.
    pub partners: Vec<(usize, Vec<usize>)>,
    /// All of them, ascending.
    pub needed: Vec<usize>,
}

impl Overlaps {
    /// Of a run of frames at their present poses, through `camera`.
    ///
    /// # Errors
    /// [`ProblemError::Placement`].
    pub fn of(
        scene: &EstimationContext,
        camera: &Camera,
        tracked: &FrameStates,
        run: &Range<usize>,
    ) -> Result<Self, ProblemError> {
        let frames = tracked.estimates.par_iter().zip(&tracked.rejections);
        let footprints = frames
            .enumerate()
            .map(|(k, (estimate, rejection))| {
                if !(run.contains(&k) && rejection.is_none()) {
                    Ok(None)
                } else {
                    let camera = camera.with_sweep(&tracked.sweep(scene, k));
                    footprint(scene, &camera, k, &estimate.pose).map(Some)
                }
            })
            .collect::<Result<_, _>>()?;
        Ok(Self {
            footprints,
            run: run.clone(),
            perimeter_m: scene.surface.perimeter_m(),
        })
    }

    /// The frames of the run, a few at a time, with those partners that are `wanted`.
    pub fn batches(&self, wanted: impl Fn(usize, usize) -> bool) -> impl Iterator<Item = Batch> {
        self.run.clone().step_by(BATCH).map(move |start| {
            let frames = start..(start + BATCH).min(self.run.end);
            let partners: Vec<(usize, Vec<usize>)> = frames
                .map(|a| {
                    let mut others = self.after(a);
                    others.retain(|b| wanted(a, *b));
                    (a, others)
                })
                .filter(|(_, others)| !others.is_empty())
                .collect();
            let all = partners
                .iter()
                .flat_map(|(a, others)| std::iter::once(a).chain(others));
            let mut needed: Vec<usize> = all.copied().collect();
            needed.sort_unstable();
            needed.dedup();
            Batch { partners, needed }
        })
    }

    /// The frames after frame `a` that may share wall with it, as far on as overlap is looked for.
    fn after(&self, a: usize) -> Vec<usize> {
        let Some(own) = &self.footprints[a] else {
            return Vec::new();
        };
        let last = (a + MAX_OVERLAP_DISTANCE_FRAMES + 1).min(self.run.end);
        let overlaps = |other: &Footprint| other.overlaps(own, self.perimeter_m);
        (a + 1..last)
            .filter(|b| self.footprints[*b].as_ref().is_some_and(overlaps))
            .collect()
    }
}
