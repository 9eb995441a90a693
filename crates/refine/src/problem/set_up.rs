//! Steps of the set-up of a problem: posed frames, density of the samples, sparsity pattern.

use crate::linear::normal_equations::Pattern;
use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::problem_error::ProblemError;
use crate::samples::footprints::{MAX_VIEWING_DISTANCE_RADII, footprint};
use crate::samples::visibility::PosedFrame;
use crate::tiles::grid::SIDE;
use std::ops::Range;
use tunnelstitch_geometry::camera::{Camera, Sweep};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Surface, viewing_distance};

/// Least number of wall samples over the height of an image. Of whole tiles, a strip of half a tile
/// with its ring is lost at either border, together a ninth of this height.
const MIN_SAMPLES_PER_IMAGE_HEIGHT: usize = 9 * SIDE;

/// The participants at their poses with their footprints; None for those that are not compared.
/// `rates`: motion of each participant's camera during a readout of one second.
///
/// # Errors
/// [`ProblemError::Placement`].
pub fn pose_frames(
    context: &EstimationContext,
    camera: &Camera,
    window: &FrameWindow,
    rates: &[Sweep],
) -> Result<Vec<Option<PosedFrame>>, ProblemError> {
    let readout_s = context.calibration.readout_s(&context.kappa);
    let posed = (0..window.participants.len()).par_map(|k| {
        if !window.compared[k] {
            return Ok(None);
        }
        let frame = window.participants.start + k;
        let pose = window.estimates[k].pose;
        let sweep = rates[k].scaled(readout_s);
        Ok(Some(PosedFrame {
            pose,
            sweep,
            footprint: footprint(context, &camera.with_sweep(&sweep), frame, &pose)?,
            active: window.active.contains(&frame),
        }))
    });
    posed.into_iter().collect()
}

/// Sparsity pattern of the `active` frames: pairs of participants (counted from frame `first`) that
/// observe common tiles, and pairs of active frames with a common prior.
pub fn normal_pattern(
    covisible: &[(usize, usize)],
    prior_pairs: Vec<(usize, usize)>,
    first: usize,
    active: &Range<usize>,
) -> Pattern {
    let slot = |k: &usize| {
        let frame = first + k;
        active.contains(&frame).then(|| frame - active.start)
    };
    let covisible = covisible.iter();
    let covisible = covisible.filter_map(|(a, b)| slot(a).zip(slot(b)));
    Pattern::new(active.len(), covisible.chain(prior_pairs))
}

/// Least number of wall samples per pixel along each axis: one, but more at coarse levels, where
/// whole tiles of pixels would leave much of the image's border unused.
pub fn min_density(rows: u32) -> f64 {
    (MIN_SAMPLES_PER_IMAGE_HEIGHT as f64 / f64::from(rows))
        .ceil()
        .max(1.0)
}

/// Width of a pixel on the wall at the image centre of the median frame, metres. Frames that look
/// along the tunnel do not count.
pub fn pixel_size_on_wall<'p>(
    surface: &dyn Surface,
    camera: &Camera,
    posed: impl Iterator<Item = &'p PosedFrame>,
) -> f64 {
    let mut ranges: Vec<f64> = posed
        .filter_map(|frame| viewing_distance(surface, &frame.pose).ok())
        .collect();
    ranges.sort_unstable_by(f64::total_cmp);
    let median = ranges.get(ranges.len() / 2);
    let radius_m = surface.perimeter_m() / std::f64::consts::TAU;
    median
        .copied()
        .unwrap_or(radius_m)
        .min(MAX_VIEWING_DISTANCE_RADII * radius_m)
        / camera.fy
}
