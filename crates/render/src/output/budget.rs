//! Memory of a panorama, computed before the first frame is read.

use super::memory;
use crate::compositing::options::RenderOptions;
use crate::compositing::seam_grid;
use crate::compositing::seams::Seams;
use crate::compositing::super_resolution::FrameReadings;
use crate::error::RenderError;
use crate::layout::canvas::Canvas;
use crate::layout::placement::Placement;
use crate::layout::tiles::BAND_ROWS;
use crate::sampling::exposure::Exposure;
use crate::sampling::picture_cache::PictureCache;
use crate::sampling::thumbnails::Thumbnails;
use serde::Serialize;
use tunnelstitch_geometry::surface::Surface;

/// The memory of a panorama, bytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Budget {
    /// Thumbnails of all frames.
    pub thumbnails: u64,
    /// The grid of seams.
    pub grid: u64,
    /// Distance of its nodes, canvas pixels.
    pub grid_step_px: f64,
    /// Observations of wall points for exposures, before bands are drawn.
    pub exposure: u64,
    /// The light over every frame, if there is a lamp.
    pub light: u64,
    /// The band being drawn and written.
    pub band: u64,
    /// Memory of the output until it is finished.
    pub output: u64,
    /// Frames being decoded.
    pub decoding: u64,
    /// Readings of frames, where the wall is solved from all of them.
    pub readings: u64,
    /// Frames of one band, which must be in memory at least.
    pub frames_least: u64,
    /// Room for frames.
    pub room: u64,
}

/// Copies of a band: the one being drawn, the one before, its tiles being written, and their
/// compressed form.
const BAND_COPIES: u64 = 5;
/// Copies of a frame while it is decoded: file, decoder's picture, converted picture.
const DECODING_COPIES: u64 = 4;

/// Memory of one tile while it is solved, bytes.
const SOLVER_BYTES: u64 = 32 << 20;

impl Budget {
    /// Bands ahead whose frames are kept if there is room.
    pub const BANDS_AHEAD: usize = 8;

    /// Computes the memory for drawing `canvas` within `limit` bytes, of which the output holds
    /// `output`.
    ///
    /// # Errors
    /// [`RenderError::Memory`] if even the least is more than the limit, or than the system has
    /// free.
    pub fn new(
        surface: &dyn Surface,
        canvas: &Canvas,
        frames: &PictureCache,
        placements: &[Placement],
        options: &RenderOptions,
        output: u64,
        limit: u64,
    ) -> Result<Self, RenderError> {
        let available = memory::available_bytes();
        let threads = rayon::current_num_threads();
        let work = (placements, options);
        let least = Self::least(surface, canvas, frames, work, output, threads)?;
        let needed = least.fixed() + least.frames_least;
        memory::check_limit(canvas, frames, needed, limit, available)?;
        let limit = available.map_or(limit, |available| limit.min(available));
        Ok(least.within(limit, frames))
    }

    /// Computes the memory for drawing `canvas` on so many threads, with no more frames at a time
    /// than a band needs, whatever is free.
    ///
    /// # Errors
    /// [`RenderError`] of a camera that sees no wall.
    pub(crate) fn least(
        surface: &dyn Surface,
        canvas: &Canvas,
        frames: &PictureCache,
        (placements, options): (&[Placement], &RenderOptions),
        output: u64,
        threads: usize,
    ) -> Result<Self, RenderError> {
        let format = frames.format();
        let (mut thumbnails, mut grid, mut exposure, mut light) = (0, 0, 0, 0);
        if options.needs_thumbnails() {
            let nodes = seam_grid::grid(canvas);
            grid = nodes.pixels() as u64 * Seams::bytes_per_node(format.channels);
            let level = Thumbnails::level(surface, frames, placements, &nodes)?;
            let size = frames.cameras().size();
            thumbnails = Thumbnails::bytes(size, level, format.channels, frames.len());
            exposure = Exposure::solve_bytes(placements, canvas);
            light = Exposure::light_bytes(frames.len());
        }
        let rows = BAND_ROWS.min(canvas.rows);
        let pixel = format.pixel_bytes(true) as u64 + 4;
        let band = BAND_COPIES * u64::from(rows) * u64::from(canvas.columns) * pixel;
        let decoding = DECODING_COPIES * threads as u64 * frames.full_frame_bytes();
        let most = max_frames_in_a_band(canvas, placements) as u64;
        let frames_least = most * frames.frame_bytes();
        let readings = if options.super_resolve {
            let samples = frames.frame_bytes() / format.sample_bytes() as u64;
            most * samples * FrameReadings::SAMPLE_BYTES + threads as u64 * SOLVER_BYTES
        } else {
            0
        };
        Ok(Self {
            thumbnails,
            grid,
            grid_step_px: seam_grid::node_spacing_px(canvas),
            exposure,
            light,
            band,
            output,
            decoding,
            readings,
            frames_least,
            room: frames_least,
        })
    }

    /// Keeps as many frames as `limit` bytes have room for, if decoding them again takes time.
    ///
    /// With the frames of one band none is decoded twice while bands are drawn; with more, some are
    /// not even once more than for their thumbnails.
    pub(crate) fn within(self, limit: u64, frames: &PictureCache) -> Self {
        let room = match frames.is_compressed() {
            // Frames of a band come after the observations for exposures.
            true => limit.saturating_sub(self.fixed() + self.exposure),
            false => 0,
        };
        Self {
            room: room.max(self.frames_least),
            ..self
        }
    }

    /// Keeps no more frames than a band needs: enough where each is used for one purpose only.
    #[must_use]
    pub fn without_spare_room(self) -> Self {
        let room = self.room.min(self.frames_least);
        Self { room, ..self }
    }

    /// Largest memory at any time, with `frames` bytes of frames in all.
    pub fn most(&self, frames: u64) -> u64 {
        self.fixed() + self.exposure + frames.min(self.room)
    }

    /// Memory while exposures and seams are found, bytes.
    pub(crate) fn settling(&self) -> u64 {
        let finding = self.thumbnails + self.grid + self.exposure;
        // Once more for the thumbnails.
        finding + 2 * self.light + self.decoding + self.room
    }

    /// Memory while bands are drawn with exposures and seams that were found before, bytes.
    pub(crate) fn drawing(&self) -> u64 {
        let drawing = self.grid + self.light + self.band + self.output;
        drawing + self.decoding + self.readings + self.room
    }

    /// Memory beside that of frames and of observations for exposures, bytes.
    fn fixed(&self) -> u64 {
        let kept = self.thumbnails + self.grid + 2 * self.light;
        kept + self.band + self.output + self.decoding + self.readings
    }
}

/// Largest number of frames that meet the same band.
fn max_frames_in_a_band(canvas: &Canvas, placements: &[Placement]) -> usize {
    let band_m = f64::from(BAND_ROWS) / canvas.px_per_metre;
    let band = |h_m: f64| ((h_m - canvas.h_start_m) / band_m).floor();
    let count = canvas.rows.div_ceil(BAND_ROWS) as usize;
    // Where frames begin and end.
    let mut steps = vec![0i64; count + 1];
    for placement in placements {
        let pixel_m = band_m / f64::from(BAND_ROWS);
        let footprint = placement.footprint.widened_conservatively(pixel_m);
        let last = (count - 1) as f64;
        steps[band(footprint.h_min_m).clamp(0.0, last) as usize] += 1;
        steps[band(footprint.h_max_m).clamp(0.0, last) as usize + 1] -= 1;
    }
    let mut now = 0;
    let counts = steps.iter().map(|step| {
        now += step;
        now
    });
    counts.max().unwrap_or(0) as usize
}
