//! Shards of `refine`: a stretch that is refined by itself, and the files of all that are joined.

use crate::cli::output::{Failure, Terminal};
use crate::files::printed;
use crate::persist::checkpoint::{Checkpoint, Origin};
use crate::persist::part_file::{read_part, write_part};
use crate::persist::shard_number::ShardNumber;
use crate::progress::Progress;
use crate::refine::{RefineInput, RefineOptions, ShardState, WallPoints, refine_shard};
use crate::survey::Survey;
use serde::Serialize;
use std::path::Path;
use std::sync::Arc;

/// The result of a shard, for `--json`.
#[derive(Serialize)]
struct ShardReport<'a> {
    #[serde(flatten)]
    shard: ShardNumber,
    /// First frame that is its own, and the one after the last.
    frames: [usize; 2],
    file: &'a Path,
}

/// Refines a shard into its file in the folder `out`.
///
/// # Errors
/// Bad input, or a file that cannot be written.
pub fn write_shard(
    survey: &Survey,
    options: &RefineOptions,
    (shard, out): (ShardNumber, &Path),
    origin: &Origin,
    checkpoint: &mut Checkpoint,
    terminal: &Arc<Terminal>,
) -> Result<(), Failure> {
    let progress: Arc<dyn Progress> = Arc::clone(terminal) as Arc<dyn Progress>;
    let points = WallPoints::of_survey(survey)?;
    let input = RefineInput {
        points: points.as_ref(),
        ..RefineInput::from(survey)
    };
    let state = refine_shard(input, options, shard, Some(checkpoint), &progress)?;
    let file = shard.file(out);
    write_part(&file, origin, &state)?;
    let own = &state.shard.own;
    terminal.say(format!(
        "refined frames {} to {} as far as the last solve; wrote {}",
        own.start,
        own.end - 1,
        printed(&file)
    ));
    terminal.result(&ShardReport {
        shard,
        frames: [own.start, own.end],
        file: &file,
    })
}

/// Reads the shards in a folder, in order.
///
/// # Errors
/// A folder without shards, or with those of several divisions; one that is missing, damaged or of
/// another survey.
pub fn read_shards(folder: &Path, origin: &Origin) -> Result<Vec<ShardState>, Failure> {
    let shards = shards_in(folder)?.into_iter().map(|shard| {
        let part = read_part(&shard.file(folder), origin);
        part.map_err(|error| Failure::input(error.to_string()))
    });
    shards.collect()
}

/// The shards of the division that `--join` finds in a folder, in order.
///
/// # Errors
/// A folder without shards, or with those of several divisions.
pub fn shards_in(folder: &Path) -> Result<Vec<ShardNumber>, Failure> {
    let fail = |what: &str| Failure::input(format!("--join {}: {what}", printed(folder)));
    let shards = ShardNumber::all_in(folder).map_err(|error| fail(&error.to_string()))?;
    shards.ok_or_else(|| {
        fail(
            "there must be what all shards of one division wrote, as shard-1-of-8, and nothing of \
             another one",
        )
    })
}
