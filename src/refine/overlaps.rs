//! Which frames see wall in common.

use super::problem::{ProblemError, Scene};
use super::track::{FARTHEST, Tracked};
use super::visibility::reach_m;
use crate::camera::Camera;
use crate::surface::Footprint;
use crate::trajectory::Pose;
use rayon::prelude::*;
use std::ops::Range;

/// What frame `frame` at `pose` sees of the wall through `camera`.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn footprint(
    scene: &Scene,
    camera: &Camera,
    frame: usize,
    pose: &Pose,
) -> Result<Footprint, ProblemError> {
    Footprint::within(scene.surface, camera, pose, reach_m(scene.surface))
        .map_err(|source| ProblemError::Placement { frame, source })
}

/// Frames compared at once: bounds the memory.
const BATCH: usize = 32;

/// The believed frames of a run on the wall.
pub struct Overlaps {
    /// What each sees; None for those in doubt and outside the run.
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
        scene: &Scene,
        camera: &Camera,
        tracked: &Tracked,
        run: &Range<usize>,
    ) -> Result<Self, ProblemError> {
        let frames = tracked.estimates.par_iter().zip(&tracked.doubts);
        let footprints = frames
            .enumerate()
            .map(|(k, (estimate, doubt))| {
                if !(run.contains(&k) && doubt.is_none()) {
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
        let last = (a + FARTHEST + 1).min(self.run.end);
        let overlaps = |other: &Footprint| other.overlaps(own, self.perimeter_m);
        (a + 1..last)
            .filter(|b| self.footprints[*b].as_ref().is_some_and(overlaps))
            .collect()
    }
}
