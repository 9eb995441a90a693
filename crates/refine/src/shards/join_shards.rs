//! The refinement of all stretches together, from where each of them has come to.

use crate::error::RefineError;
use crate::input::RefineInput;
use crate::options::RefineOptions;
use crate::parameters::calibration::Kappa;
use crate::parameters::shape::{Shape, ShapeModel};
use crate::parameters::unseen_errors::UnseenErrors;
use crate::pipeline::refine_from;
use crate::refined::Refined;
use crate::report::StageTime;
use crate::samples::footprints::{extent_h_m, footprints};
use crate::shards::alignment::ShardAlignment;
use crate::shards::division::{JOIN_CACHE_BYTES, Shard, options_of};
use crate::shards::joined_frames::{JoinedFrames, join_frames};
use crate::shards::joined_light::{JoinedLight, join_light};
use crate::shards::joined_shape::{WallStretch, join_shapes};
use crate::shards::joined_unknowns::{JoinedUnknowns, join_unknowns};
use crate::shards::joined_unseen::{UnseenStretch, join_unseen};
use crate::shards::refine_shard::{shard_of, straightened};
use crate::shards::state::{ShardEnd, ShardState, StraightShard};
use crate::stages::begin::begin;
use crate::stages::placement::displacement_by;
use crate::stages::plan::Stage;
use crate::stages::session::Session;
use crate::stages::setup::Setup;
use crate::stages::state::{GlobalSolve, PipelineState, Snapshot};
use crate::tracking::light_model::take_over;
use crate::uncertainty::observability::UnobservableParameter;
use std::collections::VecDeque;
use std::sync::Arc;
use tunnelstitch_core::frames::{Light, PictureNoise};
use tunnelstitch_core::persist::checkpoint::Checkpoint;
use tunnelstitch_core::progress::Progress;
use tunnelstitch_geometry::surface::{SplineLattice, WallPoint};

/// Refines a survey from the states of all its stretches, with snapshots kept in a checkpoint.
///
/// # Errors
/// [`RefineError`]: stretches that are not all of the survey, in order, or contradict each other.
pub fn join_shards<'a>(
    input: impl Into<RefineInput<'a>>,
    options: &RefineOptions,
    shards: Vec<ShardState>,
    checkpoint: Option<&mut Checkpoint>,
    progress: &Arc<dyn Progress>,
) -> Result<Refined, RefineError> {
    let input = input.into();
    let options = &options_of(options, shards.len(), JOIN_CACHE_BYTES);
    let mut session = Session::new(checkpoint, progress);
    let snapshot = match session.snapshot()? {
        Some(snapshot) => Some(snapshot),
        None => join(&input, options, shards)?,
    };
    refine_from(&input, options, snapshot, &mut session)
}

/// The snapshot before the last solve of all frames; None if the equations of no stretch have a
/// solution.
fn join(
    input: &RefineInput,
    options: &RefineOptions,
    mut shards: Vec<ShardState>,
) -> Result<Option<Snapshot>, RefineError> {
    check_complete(input, &shards)?;
    // A single stretch is the survey.
    if let [shard] = &mut shards[..] {
        return Ok(shard.snapshot.take().map(|snapshot| *snapshot));
    }
    let setup = Setup::new(input.clone(), options)?;
    let straight = shards.into_iter();
    let straight = straight.map(|shard| straightened(shard, input, options));
    let shards: Vec<StraightShard> = straight.collect::<Result<_, _>>()?;
    let frames = join_frames(&setup, &shards)?;
    let pairs = shards.iter().zip(&frames.alignments);
    let ended = pairs.filter_map(|(shard, alignment)| {
        let end = shard.end.as_ref()?;
        Some(Ended {
            shard: &shard.shard,
            end,
            alignment,
        })
    });
    let ended: Vec<Ended> = ended.collect();
    match ended.is_empty() {
        true => Ok(None),
        false => joined_snapshot(&setup, &ended, &frames).map(Some),
    }
}

/// Checks that stretches are all of the survey, each once, in order.
fn check_complete(input: &RefineInput, shards: &[ShardState]) -> Result<(), RefineError> {
    let incomplete = |what: String| RefineError::ShardsIncomplete { what };
    let of = shards.len();
    for (k, state) in shards.iter().enumerate() {
        let Shard {
            number, of: own, ..
        } = state.shard;
        if (number, own) != (k + 1, of) {
            return Err(incomplete(format!(
                "number {} of {of} is shard {number} of {own}",
                k + 1
            )));
        }
        if shard_of(input, number, of)? != state.shard {
            return Err(incomplete(format!(
                "shard {number} has the frames {:?} of a survey of another number of frames",
                state.shard.own
            )));
        }
    }
    match of {
        0 => Err(incomplete("there is none".to_owned())),
        _ => Ok(()),
    }
}

/// A stretch whose equations have a solution.
struct Ended<'s> {
    shard: &'s Shard,
    end: &'s ShardEnd,
    alignment: &'s ShardAlignment,
}

impl Ended<'_> {
    fn state(&self) -> &PipelineState {
        &self.end.snapshot.state
    }
}

/// The snapshot of all frames before the last solve.
fn joined_snapshot(
    setup: &Setup,
    ended: &[Ended],
    frames: &JoinedFrames,
) -> Result<Snapshot, RefineError> {
    let pairs: Vec<_> = ended
        .iter()
        .map(|ended| (ended.end, ended.alignment))
        .collect();
    let JoinedUnknowns {
        kappa,
        free,
        tested,
    } = join_unknowns(&pairs);
    let states = || ended.iter().map(Ended::state);
    let mut state = PipelineState {
        noise: PictureNoise::mean(&states().map(|state| state.noise).collect::<Vec<_>>()),
        is_lamp_ruled_out: states().any(|state| state.is_lamp_ruled_out),
        frames: frames.states.clone(),
        kappa: Kappa::zeros(),
        free,
        tested,
        levels: joined_levels(ended),
        ..begin(setup)
    };
    (state.over, state.stages) = stages_left(&state.stages, !frames.displaced.is_empty());
    let (shape, unseen) = joined_wall(setup, ended, &state)?;
    (state.shape, state.unseen) = (shape, unseen);
    setup.replace_kappa(&mut state, kappa);
    state.frames.reject(frames.displaced.clone());
    let lights: Vec<&Light> = ended
        .iter()
        .map(|ended| &ended.end.snapshot.light)
        .collect();
    match join_light(&lights)? {
        JoinedLight::Even => setup.frames.set_light(Light::Even),
        JoinedLight::Normalised => setup.frames.set_light(Light::Normalised),
        JoinedLight::Shaded(light) => {
            take_over(*light, &setup.context(&state), &state.frames.estimates);
        }
    }
    for unobservable in states().flat_map(|state| &state.unobservable) {
        let is_known = |known: &UnobservableParameter| known.unknown == unobservable.unknown;
        if !state.unobservable.iter().any(is_known) {
            state.unobservable.push(unobservable.clone());
        }
    }
    Ok(Snapshot {
        light: setup.frames.light(),
        hidden_bands: hidden_bands(ended),
        timings: joined_timings(ended),
        elapsed_s: 0.0,
        state,
    })
}

/// The stages that are over and those that are left: from the last solve on, and before it the
/// comparison of pairs, which registers rejected frames again, if some have been `displaced`.
fn stages_left(stages: &VecDeque<Stage>, displaced: bool) -> (Vec<Stage>, VecDeque<Stage>) {
    let last = stages.iter().position(Stage::is_dense_solve);
    let mut over: Vec<Stage> = stages.iter().copied().collect();
    let left = over.split_off(last.unwrap_or(over.len()));
    let validate = displaced.then_some(Stage::ValidatePairs);
    (over, validate.into_iter().chain(left).collect())
}

/// The wall's shape, and the errors by what is not seen of it; `state`: with the frames of all in
/// the straight tunnel.
fn joined_wall(
    setup: &Setup,
    ended: &[Ended],
    state: &PipelineState,
) -> Result<(Option<Shape>, UnseenErrors), RefineError> {
    let context = setup.initial_context(PictureNoise::default());
    let walls = [setup.input.surface.as_ref(); 2];
    let of_wall = ended.iter().filter_map(|ended| {
        let shape = ended.state().shape.as_ref()?;
        let (shard, motion) = (ended.shard, ended.alignment.motion);
        let first = &ended.state().frames.estimates[shard.place(shard.own.start)];
        let by = displacement_by(&motion, walls, &first.pose);
        let own = state.frames.estimates[shard.own.clone()].iter();
        let own = own.map(|estimate| walls[0].chainage_m(&estimate.pose.t_wc));
        let nothing = [f64::INFINITY, f64::NEG_INFINITY];
        let own_h_m = own.fold(nothing, |[from, to], h_m| [from.min(h_m), to.max(h_m)]);
        let unseen = UnseenStretch {
            shard,
            errors: &ended.state().unseen,
            motion,
            by,
            own_h_m,
        };
        let wall = WallStretch {
            shape,
            by,
            own_h_m,
            own_share: shard.own.len() as f64 / shard.frames.len() as f64,
        };
        Some((wall, unseen))
    });
    let (shapes, unseen): (Vec<WallStretch>, Vec<UnseenStretch>) = of_wall.unzip();
    if shapes.is_empty() {
        return Ok((None, UnseenErrors::default()));
    }
    let extent = match &setup.wall {
        Some(wall) => wall.shape.model.extent_h_m(),
        None => extent_h_m(&footprints(&context, &state.frames)?),
    };
    let origin = setup.displacement.as_ref();
    let origin = origin.map_or_else(WallPoint::default, |field| field.lattice().origin);
    let perimeter_m = context.nominal.perimeter_m();
    let model = ShapeModel::empty(perimeter_m, origin, extent);
    let lattice = SplineLattice {
        perimeter_m,
        columns: 0,
        origin,
    };
    let estimates = &state.frames.estimates;
    let unseen = join_unseen(&unseen, estimates, &context.gauge(), lattice, extent);
    Ok((Some(join_shapes(model, &shapes, origin)), unseen))
}

/// The bands that any stretch has found hidden, where they are in the tunnel of all.
fn hidden_bands(ended: &[Ended]) -> Vec<[f64; 2]> {
    let bands = ended.iter().flat_map(|ended| {
        let turn_rad = ended.alignment.motion.turn_rad;
        let bands = ended.end.snapshot.hidden_bands.iter();
        bands.map(move |band| band.map(|theta| theta + turn_rad))
    });
    bands.collect()
}

/// The solves that are over: of the first of each stretch, the second and so on, the one with the
/// most steps, with the observations of all.
fn joined_levels(ended: &[Ended]) -> Vec<GlobalSolve> {
    let most = ended.iter().map(|ended| ended.state().levels.len()).max();
    let level = |k: usize| {
        let of_all = || ended.iter().filter_map(|ended| ended.state().levels.get(k));
        let longest = of_all().max_by_key(|level| level.record.iterations)?;
        let mut joined = longest.clone();
        joined.record.observations = of_all().map(|level| level.record.observations).sum();
        joined.record.cost_start = of_all().map(|level| level.record.cost_start).sum();
        joined.record.cost_end = of_all().map(|level| level.record.cost_end).sum();
        Some(joined)
    };
    (0..most.unwrap_or(0)).filter_map(level).collect()
}

/// Times of the stages of all stretches together, in the order of the first that has them.
fn joined_timings(ended: &[Ended]) -> Vec<StageTime> {
    let mut joined: Vec<StageTime> = Vec::new();
    for time in ended.iter().flat_map(|ended| &ended.end.snapshot.timings) {
        match joined.iter_mut().find(|known| known.stage == time.stage) {
            Some(known) => known.seconds += time.seconds,
            None => joined.push(time.clone()),
        }
    }
    joined
}
