//! Shards of `stitch`: seams of a panorama, its bands drawn apart, and its files from all parts.

use crate::cli::commands::refine_shards::shards_in;
use crate::cli::commands::stitch_run::StitchRun;
use crate::cli::output::Failure;
use crate::files::printed;
use crate::persist::atomic::{OutputSet, StagedFolder};
use crate::persist::checkpoint::{Checkpoint, Origin};
use crate::persist::part_file::{read_part, write_part};
use crate::persist::provenance::Input;
use crate::persist::shard_number::ShardNumber;
use crate::progress::Progress;
use crate::render::{CheckpointedFiles, PanoramaJob, PanoramaPart, Settled, Stitch};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::{Path, PathBuf};

/// Name of the exposures and seams in the folder of the parts.
pub const SEAMS_FILE: &str = "seams.state";
/// Name of the state of a shard in its folder.
const STATE_FILE: &str = "state";

/// A part of a panorama, for `--json`.
#[derive(Serialize)]
pub struct PartReport {
    /// The shard, unless it is the seams.
    #[serde(flatten)]
    pub shard: Option<ShardNumber>,
    /// Its file or folder.
    pub file: PathBuf,
}

/// Finds exposures and seams, and writes them into the folder of the parts.
///
/// # Errors
/// A frame that cannot be decoded; a file that cannot be written.
pub fn write_seams(run: &StitchRun, stitch: &mut Stitch, origin: &Origin) -> Result<(), Failure> {
    let progress = PanoramaJob::new(run.terminal, 1).panorama(0);
    let settled = stitch.settle(&run.budget, &progress)?;
    let file = run.output.out.join(SEAMS_FILE);
    write_part(&file, origin, &settled)?;
    drop(progress);
    (run.terminal).say(format!(
        "found exposures and seams; wrote {}",
        printed(&file)
    ));
    run.terminal.result(&PartReport { shard: None, file })
}

/// Draws the bands of a shard into its folder among the parts.
///
/// # Errors
/// Seams that are missing or of another panorama; a frame that cannot be decoded; a file that
/// cannot be written.
pub fn write_shard(
    run: &StitchRun,
    stitch: &mut Stitch,
    shard: ShardNumber,
    origin: &Origin,
    checkpoint: &mut Checkpoint,
) -> Result<(), Failure> {
    let parts = &run.output.out;
    let settled: Settled = read(&parts.join(SEAMS_FILE), origin)?;
    let mut files = run.begin_files(stitch, checkpoint)?;
    let (plan, frames) = stitch.plan(settled);
    let bands = shard.range(plan.bands());
    let left = bands.start + files.bands()..bands.end;
    let mut target = CheckpointedFiles {
        files: &mut files,
        checkpoint,
    };
    let room = run.budget.room;
    plan.draw_bands(left, frames, room, &mut [&mut target], run.terminal)?;
    let folder = parts.join(shard.name());
    let staged = StagedFolder::begin(&folder)?;
    let part = files.hand_over(checkpoint, staged.path())?;
    write_part(&staged.path().join(STATE_FILE), origin, &part)?;
    let mut outputs = OutputSet::default();
    outputs.folder(staged)?;
    outputs.commit()?;
    (run.terminal).say(format!(
        "drew {} of {} bands; wrote {}",
        bands.len(),
        plan.bands(),
        printed(&folder)
    ));
    run.terminal.result(&PartReport {
        shard: Some(shard),
        file: folder,
    })
}

/// Puts the files of a panorama together from all parts in a folder, which are of the run `origin`.
///
/// # Errors
/// Parts that are missing, damaged, or of another panorama; an output that cannot be written.
pub fn join_shards(
    run: &StitchRun,
    stitch: &mut Stitch,
    (folder, origin): (&Path, &Origin),
    checkpoint: &mut Checkpoint,
    inputs: &[Input],
) -> Result<(), Failure> {
    let settled: Settled = read(&folder.join(SEAMS_FILE), origin)?;
    let shards = shards_in(folder)?;
    let mut files = run.begin_files(stitch, checkpoint)?;
    run.terminal.start("shards", shards.len());
    for shard in shards {
        let of_shard = folder.join(shard.name());
        let part: PanoramaPart = read(&of_shard.join(STATE_FILE), origin)?;
        files.absorb(part, &of_shard)?;
        run.terminal.advance(1);
    }
    run.terminal.finish();
    let (plan, _) = stitch.plan(settled);
    run.finish(files, &plan, inputs)
}

/// Reads a part of the run `origin`.
///
/// # Errors
/// A part that is missing, damaged, or of another run.
pub fn read<P: DeserializeOwned>(path: &Path, origin: &Origin) -> Result<P, Failure> {
    read_part(path, origin).map_err(|error| Failure::input(error.to_string()))
}
