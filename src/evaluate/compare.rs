//! Initial against refined poses, by every measure there is.

use super::error::check_pairs;
use super::{
    EvaluateError, ImageMetrics, SeamResidual, TrajectoryError, WallError, image_metrics,
    seam_residual, trajectory_error, wall_error,
};
use crate::camera::Camera;
use crate::frames::FrameFile;
use crate::progress::Progress;
use crate::render::{
    Canvas, FrameStack, Panorama, Placement, RenderOptions, check_memory, level_for,
    native_px_per_metre, place, render,
};
use crate::surface::Surface;
use crate::trajectory::{Pose, Shutter};
use serde::Serialize;

/// What is compared.
#[derive(Clone, Copy, Debug)]
pub struct CompareInput<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The camera.
    pub camera: &'a Camera,
    /// The frames on disk.
    pub files: &'a [FrameFile],
    /// Poses before refinement, one per frame.
    pub initial: &'a [Pose],
    /// Poses after refinement, one per frame.
    pub refined: &'a [Pose],
    /// When the rows of frames are read.
    pub shutter: &'a Shutter,
    /// True poses, one per frame, where known.
    pub truth: Option<&'a [Pose]>,
    /// Resolution of the panoramas, pixels per metre; without it the frames' own at the wall.
    pub px_per_metre: Option<f64>,
    /// How frames become panoramas.
    pub render: RenderOptions,
}

/// What the comparison found.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// Number of frames.
    pub frames: usize,
    /// The stretch of wall that all panoramas show.
    pub canvas: Canvas,
    /// The initial poses.
    pub baseline: Scores,
    /// The refined poses.
    pub refined: Scores,
    /// The true poses, where known: what could be reached.
    pub truth: Option<Scores>,
}

/// Measures of one set of poses; those that need the truth are missing without it.
#[derive(Clone, Debug, Serialize)]
pub struct Scores {
    /// Share of the canvas that some frame sees, 0–1.
    pub coverage: f64,
    /// Disagreement of the frames where they overlap; `None` if no two do.
    pub seam: Option<SeamResidual>,
    /// Errors of the poses.
    pub trajectory: Option<TrajectoryError>,
    /// Errors on the wall.
    pub wall: Option<WallError>,
    /// Likeness to the panorama of the true poses.
    pub image: Option<ImageMetrics>,
}

/// The panoramas of a comparison, all on one canvas.
#[derive(Clone, Debug)]
pub struct Panoramas {
    /// From the initial poses.
    pub baseline: Panorama,
    /// From the refined poses.
    pub refined: Panorama,
    /// From the true poses, where known.
    pub truth: Option<Panorama>,
}

/// Compares initial with refined poses, and both with the true ones where they are known.
///
/// With truth, both are first moved along the tunnel's [gauge](crate::surface::Gauge) onto it, so that the
/// panoramas lie over each other. All panoramas share one canvas, which holds the footprints of all.
///
/// # Errors
/// [`EvaluateError::Count`]; [`EvaluateError::Frame`] and [`EvaluateError::Render`] for poses that cannot be
/// laid on the wall, and for unreadable frames.
pub fn compare(
    input: &CompareInput,
    progress: &dyn Progress,
) -> Result<(Comparison, Panoramas), EvaluateError> {
    for poses in [Some(input.initial), Some(input.refined), input.truth] {
        check_pairs(
            poses.map_or(input.files.len(), <[Pose]>::len),
            input.files.len(),
        )?;
    }
    let baseline = Candidate::new("initial", input, input.initial)?;
    let refined = Candidate::new("refined", input, input.refined)?;
    let truth = match input.truth {
        Some(poses) => Some(Candidate::new("true", input, poses)?),
        None => None,
    };
    let (mut frames, canvas) = prepare(input, &baseline, &refined, truth.as_ref(), progress)?;

    let true_panorama = match &truth {
        Some(truth) => Some(truth.draw(input, &mut frames, &canvas, progress)?),
        None => None,
    };
    let mut score = |candidate: &Candidate| -> Result<(Scores, Panorama), EvaluateError> {
        let panorama = candidate.draw(input, &mut frames, &canvas, progress)?;
        let mut scores = candidate.scores(input, &frames, &canvas, &panorama);
        if let (Some(poses), Some(true_panorama)) = (input.truth, &true_panorama) {
            scores.trajectory = Some(trajectory_error(
                input.surface.gauge(),
                candidate.given,
                poses,
            )?);
            let wall = wall_error(input.surface, input.camera, candidate.given, poses)?;
            scores.wall = Some(wall);
            scores.image = Some(image_metrics(&panorama, true_panorama)?);
        }
        Ok((scores, panorama))
    };
    let (baseline_scores, baseline_panorama) = score(&baseline)?;
    let (refined_scores, refined_panorama) = score(&refined)?;
    let truth_scores = match (&truth, &true_panorama) {
        (Some(truth), Some(panorama)) => Some(truth.scores(input, &frames, &canvas, panorama)),
        _ => None,
    };
    Ok((
        Comparison {
            frames: input.files.len(),
            canvas,
            baseline: baseline_scores,
            refined: refined_scores,
            truth: truth_scores,
        },
        Panoramas {
            baseline: baseline_panorama,
            refined: refined_panorama,
            truth: true_panorama,
        },
    ))
}

/// One set of poses, laid on the wall.
struct Candidate<'a> {
    which: &'static str,
    given: &'a [Pose],
    /// Where the frames lie once the poses are in the truth's gauge.
    placements: Vec<Placement>,
}

impl<'a> Candidate<'a> {
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
        let placements = place(input.surface, input.camera, &aligned, input.shutter)
            .map_err(|source| EvaluateError::Render { which, source })?;
        Ok(Self {
            which,
            given,
            placements,
        })
    }

    fn draw(
        &self,
        input: &CompareInput,
        frames: &mut FrameStack,
        canvas: &Canvas,
        progress: &dyn Progress,
    ) -> Result<Panorama, EvaluateError> {
        render(
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
        })
    }

    /// The measures that need no truth.
    fn scores(
        &self,
        input: &CompareInput,
        frames: &FrameStack,
        canvas: &Canvas,
        panorama: &Panorama,
    ) -> Scores {
        Scores {
            coverage: panorama.coverage(),
            seam: seam_residual(input.surface, frames, &self.placements, canvas),
            trajectory: None,
            wall: None,
            image: None,
        }
    }
}

/// The frames in memory and the canvas that holds all footprints.
fn prepare(
    input: &CompareInput,
    baseline: &Candidate,
    refined: &Candidate,
    truth: Option<&Candidate>,
    progress: &dyn Progress,
) -> Result<(FrameStack, Canvas), EvaluateError> {
    let best = truth.unwrap_or(refined);
    let fail = |source| EvaluateError::Render {
        which: best.which,
        source,
    };
    let native = native_px_per_metre(input.surface, input.camera, best.given).map_err(fail)?;
    let placements = [Some(baseline), Some(refined), truth]
        .into_iter()
        .flatten()
        .flat_map(|candidate| &candidate.placements);
    let canvas = Canvas::covering(
        input.surface,
        placements.map(|placement| &placement.footprint),
        input.px_per_metre.unwrap_or(native),
    )
    .map_err(fail)?;
    let level = level_for(input.camera, native, canvas.px_per_metre);
    let copies = 4;
    let mut frames = FrameStack::open(input.files, input.camera, level).map_err(fail)?;
    check_memory(&canvas, copies, &frames).map_err(fail)?;
    frames.hold_all(progress).map_err(fail)?;
    Ok((frames, canvas))
}
