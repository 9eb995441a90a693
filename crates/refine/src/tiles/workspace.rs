//! Values of a tile's observers, and reusable memory for the work on a tile.

use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{Plane, TilePoints, ZERO};
use crate::tiles::tile_arrays::sum;
use crate::tiles::tile_moments::TileMoments;

/// Observation of a tile by a frame.
pub struct TileObservation<'a> {
    /// The frame.
    pub frame: &'a SampledFrame<'a>,
    /// Pixels per wall sample q.
    pub pixels: f32,
    /// The camera's shading V around the tile.
    pub shade: f32,
}

/// Misfit of a frame against the other observers of a tile.
#[derive(Clone, Copy, Debug)]
pub struct Misfit {
    /// Mean loss, weighted by the variance: R of [`crate::samples::outlier_mask`].
    pub loss: f32,
    /// Mean variance v of the samples, grey levels²; it grows with the gradient of the texture.
    pub mean_variance: f32,
}

/// Values of one frame at the samples of a tile.
pub struct FrameValues {
    /// `z` at every wall sample; 0 where there is none.
    pub values: Plane,
    /// Pixels per wall sample q.
    pub pixels: f32,
    /// Gain a, shading included.
    pub gain: f32,
    /// Robust weight ω at every wall sample.
    pub weights: Plane,
    /// 1 where there is a value, else 0.
    pub valid: Plane,
}

/// Memory for the work on one tile, reused from tile to tile.
#[derive(Default)]
pub struct TileWorkspace {
    /// Values of each observer.
    pub frames: Vec<FrameValues>,
    /// True if some observer lacks a value at some sample.
    pub has_gaps: bool,
    /// Result of [`TileWorkspace::compute_moments`].
    pub moments: TileMoments,
    /// Result of [`TileWorkspace::compute_misfits`], for each observer.
    pub misfits: Vec<Misfit>,
    /// Values in ascending order, sample by sample, for the median.
    pub sorted: Vec<Plane>,
}

impl TileWorkspace {
    /// Samples all observers of a tile.
    #[inline(always)]
    pub fn sample<'a>(
        &mut self,
        points: &TilePoints,
        observations: impl Iterator<Item = TileObservation<'a>>,
    ) {
        self.frames.clear();
        self.frames.reserve_exact(observations.size_hint().0);
        self.has_gaps = false;
        for observation in observations {
            self.frames.push(FrameValues {
                values: ZERO,
                pixels: observation.pixels,
                gain: observation.frame.gain() * observation.shade,
                weights: ZERO,
                valid: [1.0; ZERO.len()],
            });
            let Some(frame) = self.frames.last_mut() else {
                continue;
            };
            observation
                .frame
                .sample(points, observation.shade, &mut frame.values);
            // One NaN makes the sum NaN.
            if sum(&frame.values).is_nan() {
                self.has_gaps = true;
                for (value, valid) in frame.values.iter_mut().zip(&mut frame.valid) {
                    if value.is_nan() {
                        (*value, *valid) = (0.0, 0.0);
                    }
                }
            }
        }
    }
}
