//! 3D Tiles in shards: exposures and seams once, bands drawn apart, tiles cut from all of them.

use super::band_files::{BandFiles, read_band};
use super::error::InspectError;
use super::layers::{TextureOptions, lay_out_texture};
use super::tiles_target::TilesFolder;
use crate::persist::atomic::OutputSet;
use crate::persist::checkpoint::Origin;
use crate::persist::shard_number::ShardNumber;
use crate::progress::Progress;
use crate::render::{Canvas, PanoramaJob, RenderError, Settled, Stitch, Target};
use crate::survey::Survey;
use crate::trajectory::Pose;
use std::path::Path;

/// The texture of the wall, drawn in shards along the tunnel.
pub struct TextureShards<'a> {
    /// The survey.
    pub survey: &'a Survey,
    /// Poses of its frames.
    pub poses: &'a [Pose],
    /// Options of the texture.
    pub options: TextureOptions,
    /// The run whose parts the shards are.
    pub origin: Origin,
    /// Receiver of progress.
    pub job: PanoramaJob<'a>,
}

impl TextureShards<'_> {
    fn lay_out(&self) -> Result<Stitch<'_>, RenderError> {
        let shutter = self.survey.shutter();
        lay_out_texture(self.survey, self.poses, &shutter, &self.options)
    }

    /// Finds exposures and seams.
    ///
    /// # Errors
    /// A frame that cannot be decoded, too little memory.
    pub fn settle(&self) -> Result<Settled, InspectError> {
        let mut stitch = self.lay_out()?;
        let budget = stitch.budget(0)?.without_spare_room();
        Ok(stitch.settle(&budget, &self.job.panorama(0))?)
    }

    /// Draws the bands of a shard into files of an existing folder; returns their number.
    ///
    /// # Errors
    /// A frame that cannot be decoded, too little memory, a file that cannot be written.
    pub fn draw(
        &self,
        settled: Settled,
        shard: ShardNumber,
        folder: &Path,
    ) -> Result<usize, InspectError> {
        let mut stitch = self.lay_out()?;
        let room = stitch.budget(0)?.without_spare_room().room;
        let (plan, frames) = stitch.plan(settled);
        let bands = shard.range(plan.bands());
        let mut files = BandFiles::new(folder, &self.origin);
        let progress = self.job.panorama(0);
        plan.draw_bands(bands.clone(), frames, room, &mut [&mut files], &progress)?;
        Ok(bands.len())
    }

    /// Cuts the bands of all shards, each in its folder within `parts`, into the tiles of `folder`,
    /// which is added to a set of outputs; returns the canvas.
    ///
    /// # Errors
    /// Bands that are missing, damaged or of another texture; a file that cannot be written.
    pub fn join(
        &self,
        (parts, shards): (&Path, &[ShardNumber]),
        settled: Settled,
        folder: &Path,
        outputs: &mut OutputSet,
    ) -> Result<Canvas, InspectError> {
        let mut stitch = self.lay_out()?;
        let (canvas, format) = (*stitch.canvas(), stitch.frames().format());
        let (plan, _) = stitch.plan(settled);
        let surface = self.survey.surface.as_ref();
        let quality = self.options.quality;
        let mut tiles = TilesFolder::begin(surface, &canvas, format, folder, quality)?;
        let progress = self.job.panorama(0);
        progress.start("bands", plan.bands());
        for shard in shards {
            let of_shard = parts.join(shard.name());
            for band in shard.range(plan.bands()) {
                let band = read_band(&of_shard, band, &self.origin)?;
                tiles.target().put(&canvas, &band)?;
                progress.advance(1);
            }
        }
        progress.finish();
        tiles.finish(outputs, &canvas)?;
        Ok(canvas)
    }
}
