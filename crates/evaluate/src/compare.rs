//! Comparison of initial and refined poses by all measures.

use crate::error::EvaluateError;
use crate::error::check_pairs;
use crate::image_metrics::{ImageMetrics, image_metrics};
use crate::seam_residual::{SeamMap, SeamResidual};
use crate::trajectory_error::{TrajectoryError, trajectory_error};
use crate::unaligned_error::{UnalignedError, unaligned_error};
use crate::wall_error::{WallError, wall_error};
use serde::{Deserialize, Serialize};
use tunnelstitch_core::frames::FrameSet;
use tunnelstitch_core::progress::{JobStage, Progress};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_geometry::trajectory::{Pose, Shutter};
use tunnelstitch_render::{
    Canvas, Panorama, PictureCache, Placement, RenderError, RenderOptions, check_memory, level_for,
    native_px_per_metre, place_frames, render,
};

/// Panoramas in memory at once: three, and one on its way to the file.
const PANORAMAS: u64 = 4;

/// Input of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct CompareInput<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The camera.
    pub cameras: &'a Cameras,
    /// The frames on disk.
    pub files: &'a FrameSet,
    /// Poses before refinement, one per frame.
    pub initial: &'a [Pose],
    /// Poses after refinement, one per frame.
    pub refined: &'a [Pose],
    /// Readout times of the frames' rows.
    pub shutter: &'a Shutter,
    /// True poses, one per frame, where known.
    pub truth: Option<&'a [Pose]>,
    /// Resolution of the panoramas, pixels per metre; by default that of the frames on the wall.
    pub px_per_metre: Option<f64>,
    /// Options of the panoramas.
    pub render: RenderOptions,
}

/// Result of a comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Comparison {
    /// Number of frames.
    pub frames: usize,
    /// Canvas of all panoramas.
    pub canvas: Canvas,
    /// Scores of the initial poses.
    pub baseline: Scores,
    /// Scores of the refined poses.
    pub refined: Scores,
    /// Scores of the true poses, if known: the achievable optimum.
    pub truth: Option<Scores>,
}

/// Measures of one set of poses; those against the truth are `None` without it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Scores {
    /// Share of the canvas that some frame sees, 0–1.
    pub coverage: f64,
    /// Difference of overlapping frames; `None` if no two overlap.
    pub seam: Option<SeamResidual>,
    /// Errors of the poses.
    pub trajectory: Option<TrajectoryError>,
    /// Errors of the poses without alignment, as `evo` computes them.
    pub unaligned: Option<UnalignedError>,
    /// Errors on the wall.
    pub wall: Option<WallError>,
    /// Similarity to the panorama of the true poses.
    pub image: Option<ImageMetrics>,
}

/// Panorama of one set of poses, with its seam residuals.
#[derive(Clone, Debug)]
pub struct ComparedPanorama {
    /// The panorama.
    pub panorama: Panorama,
    /// Seam residuals over the wall.
    pub seams: SeamMap,
}

/// Panoramas of a comparison, all on one canvas.
#[derive(Clone, Debug)]
pub struct ComparedPanoramas {
    /// Panorama of the initial poses.
    pub baseline: ComparedPanorama,
    /// Panorama of the refined poses.
    pub refined: ComparedPanorama,
    /// Panorama of the true poses, if known.
    pub truth: Option<ComparedPanorama>,
}

/// Compares initial with refined poses, and both with the true poses if they are known.
///
/// With truth, both are first aligned to it along the tunnel's
/// [gauge](tunnelstitch_geometry::surface::Gauge), so that the panoramas coincide. All panoramas
/// share one canvas, which holds all footprints.
///
/// # Errors
/// [`EvaluateError::Count`]; [`EvaluateError::Frame`] and [`EvaluateError::Render`] for poses whose
/// frames miss the wall, and for unreadable frames.
pub fn compare(
    input: &CompareInput,
    progress: &dyn Progress,
) -> Result<(Comparison, ComparedPanoramas), EvaluateError> {
    let candidates = Candidates::new(input)?;
    let LaidOut {
        mut frames, canvas, ..
    } = candidates.lay_out(input)?;
    let loaded = frames.load_all(progress);
    loaded.map_err(|source| candidates.fail(source))?;

    let mut stages = panorama_stages(2 + usize::from(candidates.truth.is_some()));
    let mut enter_next = || {
        if let Some(stage) = stages.next() {
            progress.enter_job_stage(stage);
        }
    };
    let true_panorama = match &candidates.truth {
        Some(truth) => {
            enter_next();
            Some(truth.render(input, &mut frames, &canvas, progress)?)
        }
        None => None,
    };
    let mut score = |candidate: &PlacedPoses| -> Result<(Scores, ComparedPanorama), EvaluateError> {
        enter_next();
        let compared = candidate.render(input, &mut frames, &canvas, progress)?;
        let mut scores = Scores::without_truth(&compared);
        if let (Some(poses), Some(truth)) = (input.truth, &true_panorama) {
            scores.trajectory = Some(trajectory_error(
                input.surface.gauge(),
                candidate.given,
                poses,
            )?);
            scores.unaligned = Some(unaligned_error(candidate.given, poses)?);
            let wall = wall_error(input.surface, input.cameras, candidate.given, poses)?;
            scores.wall = Some(wall);
            scores.image = Some(image_metrics(&compared.panorama, &truth.panorama)?);
        }
        Ok((scores, compared))
    };
    let (baseline_scores, baseline_panorama) = score(&candidates.baseline)?;
    let (refined_scores, refined_panorama) = score(&candidates.refined)?;
    progress.leave_job();
    Ok((
        Comparison {
            frames: input.files.len(),
            canvas,
            baseline: baseline_scores,
            refined: refined_scores,
            truth: true_panorama.as_ref().map(Scores::without_truth),
        },
        ComparedPanoramas {
            baseline: baseline_panorama,
            refined: refined_panorama,
            truth: true_panorama,
        },
    ))
}

/// The stages of drawing so many panoramas, which take the same time: they are of one canvas.
fn panorama_stages(count: usize) -> impl Iterator<Item = JobStage> {
    let share = 1.0 / count as f64;
    (0..count).map(move |k| JobStage {
        number: k + 1,
        of: count,
        done_share: k as f64 * share,
        share,
    })
}

/// The panoramas of a comparison before they are drawn.
#[derive(Clone, Copy, Debug)]
pub struct ComparisonPlan {
    /// The canvas of all panoramas.
    pub canvas: Canvas,
    /// Memory of panoramas and frames, bytes.
    pub memory_bytes: u64,
}

/// Lays out what [`compare`] draws, and checks it before a frame is decoded.
///
/// # Errors
/// The errors of [`compare`], as far as they are known by then.
pub fn plan_comparison(input: &CompareInput) -> Result<ComparisonPlan, EvaluateError> {
    let laid_out = Candidates::new(input)?.lay_out(input)?;
    Ok(ComparisonPlan {
        canvas: laid_out.canvas,
        memory_bytes: laid_out.memory_bytes,
    })
}

impl Scores {
    /// The measures without truth.
    fn without_truth(compared: &ComparedPanorama) -> Self {
        Self {
            coverage: compared.panorama.coverage(),
            seam: compared.seams.residual(),
            trajectory: None,
            unaligned: None,
            wall: None,
            image: None,
        }
    }
}

/// One set of poses with the placements of its frames on the wall.
struct PlacedPoses<'a> {
    which: &'static str,
    given: &'a [Pose],
    /// Placements of the frames after alignment to the truth's gauge.
    placements: Vec<Placement>,
}

impl<'a> PlacedPoses<'a> {
    fn new(
        which: &'static str,
        input: &CompareInput,
        given: &'a [Pose],
    ) -> Result<Self, EvaluateError> {
        let aligned = match input.truth {
            Some(truth) => {
                let motion = input.surface.gauge().align(given, truth);
                motion.apply_all(given)
            }
            None => given.to_vec(),
        };
        let placements = place_frames(input.surface, input.cameras, &aligned, input.shutter)
            .map_err(|source| EvaluateError::Render { which, source })?;
        Ok(Self {
            which,
            given,
            placements,
        })
    }

    fn render(
        &self,
        input: &CompareInput,
        frames: &mut PictureCache,
        canvas: &Canvas,
        progress: &dyn Progress,
    ) -> Result<ComparedPanorama, EvaluateError> {
        let panorama = render(
            input.surface,
            frames,
            &self.placements,
            canvas,
            &input.render,
            progress,
        )
        .map_err(|source| EvaluateError::Render {
            which: self.which,
            source,
        })?;
        let seams = SeamMap::new(input.surface, frames, &self.placements, canvas);
        Ok(ComparedPanorama { panorama, seams })
    }
}

/// All sets of poses of a comparison, placed on the wall.
struct Candidates<'a> {
    baseline: PlacedPoses<'a>,
    refined: PlacedPoses<'a>,
    truth: Option<PlacedPoses<'a>>,
}

/// A comparison before a frame is decoded.
struct LaidOut {
    frames: PictureCache,
    canvas: Canvas,
    memory_bytes: u64,
}

impl<'a> Candidates<'a> {
    fn new(input: &CompareInput<'a>) -> Result<Self, EvaluateError> {
        for poses in [Some(input.initial), Some(input.refined), input.truth] {
            check_pairs(
                poses.map_or(input.files.len(), <[Pose]>::len),
                input.files.len(),
            )?;
        }
        Ok(Self {
            baseline: PlacedPoses::new("initial", input, input.initial)?,
            refined: PlacedPoses::new("refined", input, input.refined)?,
            truth: match input.truth {
                Some(poses) => Some(PlacedPoses::new("true", input, poses)?),
                None => None,
            },
        })
    }

    /// The poses that are nearest to the truth.
    fn best(&self) -> &PlacedPoses<'a> {
        self.truth.as_ref().unwrap_or(&self.refined)
    }

    /// An error of drawing the best poses.
    fn fail(&self, source: RenderError) -> EvaluateError {
        EvaluateError::Render {
            which: self.best().which,
            source,
        }
    }

    /// Opens the frames, computes the canvas that holds all footprints, and checks the memory.
    fn lay_out(&self, input: &CompareInput) -> Result<LaidOut, EvaluateError> {
        let fail = |source| self.fail(source);
        let native =
            native_px_per_metre(input.surface, input.cameras, self.best().given).map_err(fail)?;
        let placements = [
            Some(&self.baseline),
            Some(&self.refined),
            self.truth.as_ref(),
        ]
        .into_iter()
        .flatten()
        .flat_map(|candidate| &candidate.placements);
        let canvas = Canvas::covering(
            input.surface,
            placements.map(|placement| &placement.footprint),
            input.px_per_metre.unwrap_or(native),
        )
        .map_err(fail)?;
        let level = level_for(input.cameras.shorter_side(), native, canvas.px_per_metre);
        let frames = PictureCache::open(input.files, input.cameras, level).map_err(fail)?;
        let memory_bytes = check_memory(&canvas, PANORAMAS, &frames).map_err(fail)?;
        Ok(LaidOut {
            frames,
            canvas,
            memory_bytes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_panorama_is_a_share_of_the_job() {
        let stages: Vec<JobStage> = panorama_stages(3).collect();
        let mut done_share = 0.0;
        for (k, stage) in stages.iter().enumerate() {
            assert_eq!((stage.number, stage.of), (k + 1, 3));
            assert!((stage.done_share - done_share).abs() < 1e-12, "{stage:?}");
            done_share += stage.share;
        }
        assert!((done_share - 1.0).abs() < 1e-12);
    }
}
