//! Bands finer than any frame: drawn as usual and then solved from all frames
//! ([`tunnelstitch_super_resolve`]).

use super::band::Band;
use crate::layout::canvas::Canvas;
use crate::layout::placement::Placement;
use crate::layout::tiles::Tile;
use crate::sampling::exposure::{Exposure, Response};
use crate::sampling::picture::Picture;
use crate::sampling::picture_cache::PictureCache;
use crate::sampling::sample::{Sample, Samples};
use std::collections::BTreeMap;
use tunnelstitch_core::frames::{GreyImage, noise_sigma};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_super_resolve::{Footprints, MARGIN, PosedCamera, Reading, Region};

/// Variance of rounding to whole grey levels.
const ROUNDING_VARIANCE: f64 = 1.0 / 12.0;

/// Smallest 1-σ of a frame's noise, grey levels: rounding to 8 bits gives 0.29. A higher value
/// trusts clean frames less.
const MIN_NOISE_SIGMA: f32 = 0.2;

/// Readings of the evenly lit wall by frames, as long as they are needed.
#[derive(Default)]
pub struct FrameReadings {
    frames: BTreeMap<usize, CorrectedFrame>,
}

struct CorrectedFrame {
    /// Grey levels of 255 for each channel; NaN where clipped or masked.
    channels: Vec<Vec<f32>>,
    /// 1-σ of their noise.
    noise: f32,
}

impl FrameReadings {
    /// Bytes a sample of a frame.
    pub const SAMPLE_BYTES: u64 = 4;

    /// Keeps the readings of `frames`, which must be in memory, and no others.
    pub fn keep(&mut self, cache: &PictureCache, exposure: &Exposure, frames: &[usize]) {
        self.frames
            .retain(|frame, _| frames.binary_search(frame).is_ok());
        let missing: Vec<usize> = frames
            .iter()
            .copied()
            .filter(|frame| !self.frames.contains_key(frame))
            .collect();
        let read: Vec<Option<(usize, CorrectedFrame)>> = missing.par_map(|&frame| {
            Some((
                frame,
                CorrectedFrame::of(cache.picture(frame)?, exposure.of(frame)),
            ))
        });
        self.frames.extend(read.into_iter().flatten());
    }

    /// Solves a drawn band from all frames: pixels that some frame sees become those of the wall
    /// that explains all frames best.
    pub fn resolve(
        &self,
        surface: &dyn Surface,
        cache: &PictureCache,
        placements: &[Placement],
        canvas: &Canvas,
        tiles: &[Tile],
        band: &mut Band,
    ) {
        let solved: Vec<Vec<Vec<f32>>> =
            tiles.par_map(|tile| self.tile(surface, cache, placements, canvas, tile, band));
        for (tile, channels) in tiles.iter().zip(solved) {
            for (c, values) in channels.iter().enumerate() {
                band.write_channel(canvas, tile, c, values);
            }
        }
    }

    /// Solves a tile; one vector a channel.
    fn tile(
        &self,
        surface: &dyn Surface,
        cache: &PictureCache,
        placements: &[Placement],
        canvas: &Canvas,
        tile: &Tile,
        band: &Band,
    ) -> Vec<Vec<f32>> {
        // A tile that is not much narrower than the canvas has no margin to its sides.
        let across = MARGIN.min((canvas.columns - tile.columns) as usize / 2);
        let region = Region {
            column: i64::from(tile.column) - across as i64,
            row: i64::from(tile.row) - MARGIN as i64,
            columns: tile.columns as usize + 2 * across,
            rows: tile.rows as usize + 2 * MARGIN,
        };
        let seen: Vec<(&usize, &CorrectedFrame)> = tile
            .frames
            .iter()
            .filter_map(|frame| Some((frame, self.frames.get(frame)?)))
            .collect();
        let views: Vec<PosedCamera> = seen
            .iter()
            .map(|(frame, _)| PosedCamera {
                camera: placements[**frame].camera(cache.cameras().of(**frame)),
                pose: &placements[**frame].pose,
            })
            .collect();
        let footprints = Footprints::new(surface, &canvas.lattice(), region, &views);
        (0..band.format.channels)
            .map(|c| {
                let readings: Vec<Vec<Reading>> = seen
                    .iter()
                    .enumerate()
                    .map(|(view, (_, frame))| frame.readings(footprints.pixels(view), c))
                    .collect();
                let start = band.read_region(canvas, &region, c);
                let solved = footprints.super_resolve(&readings, &start).values;
                let rows = solved.chunks_exact(region.columns).skip(MARGIN);
                rows.take(tile.rows as usize)
                    .flat_map(|row| &row[across..across + tile.columns as usize])
                    .copied()
                    .collect()
            })
            .collect()
    }
}

impl CorrectedFrame {
    fn of(picture: &Picture, response: Response) -> Self {
        let channels = match picture.samples() {
            Samples::Eight(samples) => channels(picture, samples, response),
            Samples::Sixteen(samples) => channels(picture, samples, response),
        };
        let noise = channels.iter().map(|values| {
            let image = GreyImage::new(picture.width(), picture.height(), values.clone());
            noise_sigma(&image).unwrap_or_default()
        });
        let noise = noise.fold(0.0, f64::max);
        Self {
            noise: (noise * noise + ROUNDING_VARIANCE).sqrt() as f32,
            channels,
        }
    }

    /// Readings of some pixels in a channel.
    fn readings(&self, pixels: &[u32], channel: usize) -> Vec<Reading> {
        let values = &self.channels[channel];
        let inverse_sigma = 1.0 / self.noise.max(MIN_NOISE_SIGMA);
        let reading = |pixel: &u32| match values[*pixel as usize] {
            value if value.is_finite() => Reading {
                value,
                inverse_sigma,
            },
            _ => Reading::default(),
        };
        pixels.iter().map(reading).collect()
    }
}

fn channels<T: Sample>(picture: &Picture, samples: &[T], response: Response) -> Vec<Vec<f32>> {
    let (count, width) = (picture.format().channels, picture.width());
    let scale = 255.0 / T::WHITE;
    let (black, white) = (T::default(), T::nearest(T::WHITE));
    (0..count)
        .map(|c| {
            let own = samples[c..].iter().step_by(count);
            own.take(width * picture.height())
                .enumerate()
                .map(|(k, sample)| {
                    let (u, v) = (k % width, k / width);
                    let hidden = picture.mask().is_some_and(|mask| !mask.is_wall(u, v));
                    if hidden || *sample == black || *sample == white {
                        return f32::NAN;
                    }
                    let (u, v) = (u as f32, v as f32);
                    scale * response.wall(sample.value(), u, v)
                })
                .collect()
        })
        .collect()
}
