//! Steps of the set-up of a problem: posed frames, density of the samples, sparsity pattern.

use crate::linear::normal_equations::Pattern;
use crate::model::context::{EstimationContext, FrameWindow};
use crate::model::problem_error::ProblemError;
use crate::parameters::shape::{FunctionValue, Shape};
use crate::points::equations::PointEquations;
use crate::samples::footprints::footprint;
use crate::samples::tile_coverage::TileCoverage;
use crate::samples::visibility::PosedFrame;
use crate::tiles::grid::{SIDE, WallGrid};
use std::collections::HashSet;
use std::ops::Range;
use tunnelstitch_geometry::camera::{Cameras, Sweep};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Surface, mean_radius_m, viewing_distance};
use tunnelstitch_geometry::trajectory::Pose;

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
    cameras: &Cameras,
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
        let camera = cameras.of(frame).with_sweep(&sweep);
        Ok(Some(PosedFrame {
            index: frame,
            pose,
            sweep,
            footprint: footprint(context, &camera, frame, &pose)?,
            active: window.active.contains(&frame),
        }))
    });
    posed.into_iter().collect()
}

/// Sparsity pattern of the `active` frames among participants that are counted from frame `first`,
/// and of the blocks of the shape behind them: frames that observe common tiles or have a common
/// prior, blocks with functions in a common block of the wall or at a common measured point, and
/// those with the frames that observe it.
pub fn normal_pattern(
    context: &EstimationContext,
    coverage: &TileCoverage,
    grid: &WallGrid,
    (first, active): (usize, &Range<usize>),
    shape: Option<(&Shape, Option<&PointEquations>)>,
) -> Pattern {
    let slot = |k: usize| {
        let frame = first + k;
        active.contains(&frame).then(|| frame - active.start)
    };
    let covisible = coverage.pairs.iter();
    let covisible = covisible.filter_map(|(a, b)| slot(*a).zip(slot(*b)));
    let mut pairs: HashSet<(usize, usize)> = covisible.collect();
    pairs.extend(context.prior.pairs(active));
    let Some((Shape { model, .. }, points)) = shape else {
        return Pattern::new(active.len(), pairs);
    };
    let of_points = points.into_iter().flat_map(PointEquations::pairs);
    pairs.extend(of_points.map(|(a, b)| (active.len() + a, active.len() + b)));
    for stretch in 0..coverage.len() {
        let visibility = coverage.visibility(stretch);
        for tiles in &visibility.blocks {
            let tiles_of_block = visibility.tiles[tiles.clone()].iter();
            let functions =
                tiles_of_block.flat_map(|tile| model.functions_at(grid.centre(tile.id)));
            let of_shape = shape_slots(functions, active.len());
            let observers = visibility.frames(tiles).into_iter();
            let observers = observers.filter_map(|k| slot(coverage.frames(stretch)[k]));
            let slots: Vec<usize> = observers.chain(of_shape.iter().copied()).collect();
            for a in &of_shape {
                pairs.extend(slots.iter().map(|b| (*b.min(a), *b.max(a))));
            }
        }
    }
    Pattern::new(active.len() + model.blocks(), pairs)
}

/// Slots of the blocks that some functions of the shape belong to, ascending; they follow the slots
/// of the `frames` active frames.
pub fn shape_slots(functions: impl Iterator<Item = FunctionValue>, frames: usize) -> Vec<usize> {
    let mut slots: Vec<usize> = functions.map(|f| frames + f.block).collect();
    slots.sort_unstable();
    slots.dedup();
    slots
}

/// Least number of wall samples per pixel along each axis: one, but more at coarse levels, where
/// whole tiles of pixels would leave much of the image's border unused.
pub fn min_density(rows: u32) -> f64 {
    (MIN_SAMPLES_PER_IMAGE_HEIGHT as f64 / f64::from(rows))
        .ceil()
        .max(1.0)
}

/// Width of a pixel on the wall where the median frame sees it best, metres; `poses`: of frames.
pub fn pixel_size_on_wall<'p>(
    surface: &dyn Surface,
    cameras: &Cameras,
    poses: impl Iterator<Item = (usize, &'p Pose)>,
) -> f64 {
    let mut sizes: Vec<f64> = poses
        .filter_map(|(frame, pose)| {
            let camera = cameras.of(frame);
            let range_m = viewing_distance(surface, camera, pose).ok()?;
            Some(range_m / camera.vertical_focal_px())
        })
        .collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let at_wall = || mean_radius_m(surface) / cameras.of(0).vertical_focal_px();
    sizes.get(sizes.len() / 2).copied().unwrap_or_else(at_wall)
}
