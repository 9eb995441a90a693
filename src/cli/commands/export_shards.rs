//! Shards of `export --3dtiles`: exposures and seams, bands drawn apart, tiles from all of them.

use crate::cli::commands::refine_shards::shards_in;
use crate::cli::commands::stitch_shards::{PartReport, SEAMS_FILE, read};
use crate::cli::output::{Failure, Terminal};
use crate::files::printed;
use crate::inspect::TextureShards;
use crate::persist::atomic::{OutputSet, StagedFolder};
use crate::persist::part_file::write_part;
use crate::persist::shard_number::ShardNumber;
use crate::render::Canvas;
use std::path::Path;

/// Finds exposures and seams, and writes them into the folder of the parts.
///
/// # Errors
/// A frame that cannot be decoded; a file that cannot be written.
pub fn write_seams(
    texture: &TextureShards,
    parts: &Path,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let settled = texture.settle()?;
    let file = parts.join(SEAMS_FILE);
    write_part(&file, &texture.origin, &settled)?;
    terminal.say(format!(
        "found exposures and seams; wrote {}",
        printed(&file)
    ));
    terminal.result(&PartReport { shard: None, file })
}

/// Draws the bands of a shard into its folder among the parts.
///
/// # Errors
/// Seams that are missing or of another texture; a frame that cannot be decoded; a file that cannot
/// be written.
pub fn write_shard(
    texture: &TextureShards,
    parts: &Path,
    shard: ShardNumber,
    terminal: &Terminal,
) -> Result<(), Failure> {
    let settled = read(&parts.join(SEAMS_FILE), &texture.origin)?;
    let folder = parts.join(shard.name());
    let staged = StagedFolder::begin(&folder)?;
    let bands = texture.draw(settled, shard, staged.path())?;
    let mut outputs = OutputSet::default();
    outputs.folder(staged)?;
    outputs.commit()?;
    terminal.say(format!("drew {bands} bands; wrote {}", printed(&folder)));
    terminal.result(&PartReport {
        shard: Some(shard),
        file: folder,
    })
}

/// Cuts the bands of all shards in a folder into the tiles of another one, which is added to a set
/// of outputs.
///
/// # Errors
/// Parts that are missing, damaged, or of another texture; an output that cannot be written.
pub fn join_shards(
    texture: &TextureShards,
    parts: &Path,
    tiles: &Path,
    outputs: &mut OutputSet,
) -> Result<Canvas, Failure> {
    let settled = read(&parts.join(SEAMS_FILE), &texture.origin)?;
    let shards = shards_in(parts)?;
    Ok(texture.join((parts, &shards), settled, tiles, outputs)?)
}
