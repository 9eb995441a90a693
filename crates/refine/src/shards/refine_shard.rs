//! The refinement of a stretch, as far as the last solve.

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::options::RefineOptions;
use crate::parameters::calibration::{BEND_INDEX, BEND_PARAMETERS};
use crate::pipeline::{Pause, run};
use crate::shards::division::{SHARD_CACHE_BYTES, Shard, options_of};
use crate::shards::state::{ShardEnd, ShardState, StraightShard};
use crate::stages::plan::Stage;
use crate::stages::session::Session;
use crate::stages::setup::calibration_of;
use std::sync::Arc;
use tunnelstitch_core::frames::FrameSet;
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::persist::shard_number::ShardNumber;
use tunnelstitch_core::progress::Progress;
use tunnelstitch_core::survey::PoseGap;
use tunnelstitch_geometry::trajectory::{Shutter, StampedPose, poses_of};

/// Refines one of equal stretches of a survey as far as the last solve, with snapshots kept in a
/// checkpoint.
///
/// # Errors
/// [`RefineError`].
pub fn refine_shard<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    ShardNumber { number, of }: ShardNumber,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<ShardState, RefineError> {
    let input = input.into();
    let options = &options_of(options, of, SHARD_CACHE_BYTES);
    let shard = shard_of(&input, number, of)?;
    let stretch = Stretch::new(&input, &shard);
    let input = stretch.input(&input);
    let mut session = Session::new(checkpoint, progress);
    let snapshot = session.snapshot()?;
    let pause = run(
        &input,
        options,
        snapshot,
        Stage::is_dense_solve,
        &mut session,
    )?;
    progress.leave_job();
    let snapshot = match pause {
        Pause::Before(snapshot) => Some(snapshot),
        Pause::Refined(_) => None,
    };
    Ok(ShardState { shard, snapshot })
}

/// The stretch of an input.
///
/// # Errors
/// [`RefineError::NoShard`].
pub fn shard_of(input: &RefineInput, number: usize, of: usize) -> Result<Shard, RefineError> {
    let frames = input.frames.len();
    let shard = Shard::new(number, of, frames, input.cameras.count());
    shard.ok_or(RefineError::NoShard { number, of, frames })
}

/// The parts of an input that are those of a stretch.
struct Stretch {
    frames: FrameSet,
    initial: Vec<StampedPose>,
    pose_gaps: Vec<PoseGap>,
    shutter: Shutter,
}

impl Stretch {
    fn new(input: &RefineInput, shard: &Shard) -> Self {
        let range = &shard.frames;
        let places: Vec<usize> = range.clone().collect();
        let gaps = input.pose_gaps.iter().filter_map(|gap| {
            let (start, end) = (
                gap.frames.start.max(range.start),
                gap.frames.end.min(range.end),
            );
            let frames = (start < end).then(|| shard.place(start)..shard.place(end))?;
            Some(PoseGap { frames })
        });
        Self {
            frames: input.frames.only(&places),
            initial: input.initial[range.clone()].to_vec(),
            pose_gaps: gaps.collect(),
            shutter: input.shutter.of_frames(range),
        }
    }

    /// The input of the stretch.
    fn input<'s>(&'s self, of_survey: &RefineInput<'s>) -> RefineInput<'s> {
        RefineInput {
            frames: &self.frames,
            initial: &self.initial,
            pose_gaps: &self.pose_gaps,
            shutter: self.shutter.clone(),
            ..of_survey.clone()
        }
    }
}

/// A stretch with its poses in the straight tunnel, and the bend by itself.
///
/// # Errors
/// [`RefineError`] of the options.
pub fn straightened(
    state: ShardState,
    input: &RefineInput,
    options: &RefineOptions,
) -> Result<StraightShard, RefineError> {
    let ShardState { shard, snapshot } = state;
    let stretch = Stretch::new(input, &shard);
    let input = stretch.input(input);
    let calibration = calibration_of(&input, options, &poses_of(input.initial))?;
    let end = snapshot.map(|mut snapshot| {
        let state = &mut snapshot.state;
        let bent = state.kappa;
        let curvature = state.kappa.fixed_rows_mut::<BEND_PARAMETERS>(BEND_INDEX);
        let bend_per_m = [curvature[0], curvature[1]];
        { curvature }.fill(0.0);
        let straight = state.kappa;
        for estimate in &mut state.frames.estimates {
            estimate.pose = calibration.carry(&estimate.pose, &bent, &straight);
        }
        ShardEnd {
            snapshot,
            bend_per_m,
        }
    });
    Ok(StraightShard { shard, end })
}
