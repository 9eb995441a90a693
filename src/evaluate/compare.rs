//! Initial against refined poses, by every measure there is.

use super::error::check_pairs;
use super::{
    EvaluateError, ImageMetrics, SeamMap, SeamResidual, TrajectoryError, UnalignedError, WallError,
    image_metrics, trajectory_error, unaligned_error, wall_error,
};
use crate::camera::Camera;
use crate::frames::FrameSet;
use crate::progress::Progress;
use crate::render::{
    Canvas, Panorama, PictureCache, Placement, RenderOptions, check_memory, level_for,
    native_px_per_metre, place, render,
};
use crate::surface::Surface;
use crate::trajectory::{Pose, Shutter};
use serde::{Deserialize, Serialize};

/// What is compared.
#[derive(Clone, Copy, Debug)]
pub struct CompareInput<'a> {
    /// The tunnel.
    pub surface: &'a dyn Surface,
    /// The camera.
    pub camera: &'a Camera,
    /// The frames on disk.
    pub files: &'a FrameSet,
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
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
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct Scores {
    /// Share of the canvas that some frame sees, 0–1.
    pub coverage: f64,
    /// Disagreement of the frames where they overlap; `None` if no two do.
    pub seam: Option<SeamResidual>,
    /// Errors of the poses.
    pub trajectory: Option<TrajectoryError>,
    /// Errors of the poses as they stand, to be compared with `evo`.
    pub unaligned: Option<UnalignedError>,
    /// Errors on the wall.
    pub wall: Option<WallError>,
    /// Likeness to the panorama of the true poses.
    pub image: Option<ImageMetrics>,
}

/// What the frames make of the wall with one set of poses.
#[derive(Clone, Debug)]
pub struct Drawing {
    /// The panorama.
    pub panorama: Panorama,
    /// Where the frames agree.
    pub seams: SeamMap,
}

/// The drawings of a comparison, all on one canvas.
#[derive(Clone, Debug)]
pub struct Drawings {
    /// From the initial poses.
    pub baseline: Drawing,
    /// From the refined poses.
    pub refined: Drawing,
    /// From the true poses, where known.
    pub truth: Option<Drawing>,
}

/// Compares initial with refined poses, and both with the true ones where they are known.
///
/// With truth, both are first moved along the tunnel's [gauge](crate::surface::Gauge) onto it, so
/// that the panoramas lie over each other. All panoramas share one canvas, which holds the
/// footprints of all.
///
/// # Errors
/// [`EvaluateError::Count`]; [`EvaluateError::Frame`] and [`EvaluateError::Render`] for poses that
/// cannot be laid on the wall, and for unreadable frames.
pub fn compare(
    input: &CompareInput,
    progress: &dyn Progress,
) -> Result<(Comparison, Drawings), EvaluateError> {
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

    let true_drawing = match &truth {
        Some(truth) => Some(truth.draw(input, &mut frames, &canvas, progress)?),
        None => None,
    };
    let mut score = |candidate: &Candidate| -> Result<(Scores, Drawing), EvaluateError> {
        let drawing = candidate.draw(input, &mut frames, &canvas, progress)?;
        let mut scores = Scores::without_truth(&drawing);
        if let (Some(poses), Some(truth)) = (input.truth, &true_drawing) {
            scores.trajectory = Some(trajectory_error(
                input.surface.gauge(),
                candidate.given,
                poses,
            )?);
            scores.unaligned = Some(unaligned_error(candidate.given, poses)?);
            let wall = wall_error(input.surface, input.camera, candidate.given, poses)?;
            scores.wall = Some(wall);
            scores.image = Some(image_metrics(&drawing.panorama, &truth.panorama)?);
        }
        Ok((scores, drawing))
    };
    let (baseline_scores, baseline_drawing) = score(&baseline)?;
    let (refined_scores, refined_drawing) = score(&refined)?;
    Ok((
        Comparison {
            frames: input.files.len(),
            canvas,
            baseline: baseline_scores,
            refined: refined_scores,
            truth: true_drawing.as_ref().map(Scores::without_truth),
        },
        Drawings {
            baseline: baseline_drawing,
            refined: refined_drawing,
            truth: true_drawing,
        },
    ))
}

impl Scores {
    /// The measures that need no truth.
    fn without_truth(drawing: &Drawing) -> Self {
        Self {
            coverage: drawing.panorama.coverage(),
            seam: drawing.seams.residual(),
            trajectory: None,
            unaligned: None,
            wall: None,
            image: None,
        }
    }
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
        frames: &mut PictureCache,
        canvas: &Canvas,
        progress: &dyn Progress,
    ) -> Result<Drawing, EvaluateError> {
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
        Ok(Drawing { panorama, seams })
    }
}

/// The frames in memory and the canvas that holds all footprints.
fn prepare(
    input: &CompareInput,
    baseline: &Candidate,
    refined: &Candidate,
    truth: Option<&Candidate>,
    progress: &dyn Progress,
) -> Result<(PictureCache, Canvas), EvaluateError> {
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
    let mut frames = PictureCache::open(input.files, input.camera, level).map_err(fail)?;
    check_memory(&canvas, copies, &frames).map_err(fail)?;
    frames.load_all(progress).map_err(fail)?;
    Ok((frames, canvas))
}
