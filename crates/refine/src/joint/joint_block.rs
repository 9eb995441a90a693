//! Joint solve: the wall, finer than the frames' pixels, and the poses at once.
//!
//! [`crate::tiles::tile`] interpolates between a frame's pixels, and takes the mean of all
//! frames for the wall. For a wall that is smooth over a pixel this is nearly optimal. A sharp edge
//! is not smooth: every frame samples it at other fractions of a pixel, and the errors of
//! interpolation mimic displacements of some hundredths of a pixel. In the joint solve the wall is
//! a vector x of fine pixels, and a frame's pixel p is the mean over its own square on the wall,
//! `W_p x`, as in a camera ([`tunnelstitch_super_resolve`]). Poses and wall minimise
//!
//! `J = Σ_p ρ(e_p) + (roughness of x)`,   `e_p = a_i (z_p − W_p x)`,   `z_p = (I_p − b_i)/a_i`.
//!
//! For given poses x is the minimiser, so that the derivative of J by the poses is that at fixed x
//! (envelope theorem: `∂J/∂x = 0`). If frame i moves by ξ, its pixel moves by `A_i ξ` on the wall,
//! hence `∂e_p/∂ξ = −a_i (W_p ∇x)ᵀ A_i`. With the features
//! `φ_p = (W_p ∂x/∂s, W_p ∂x/∂h, W_p x, 1)` a tile has the moments
//!
//! - `g_i = Σ_p a_i ω e_p φ_p` over the pixels of frame i whose centres lie in it,
//! - `w̄_i = Σ_p a_i² ω`, per sample of the tile,
//! - `M`, the mean of `φ_p φ_pᵀ` over the pixels of all frames, weighted by `a_i² ω`,
//!
//! which enter the normal equations as those of [`crate::tiles::tile`].
//!
//! **Net force.** A common motion of all frames of a tile moves x with them and changes nothing, so
//! `Σ_i g_i` should vanish, as it does for residuals from a mean. It does not vanish exactly: the
//! roughness exerts forces as well, which cancel over the wall but not in each tile, and the
//! minimum is approximate. Along weak directions, in which neighbours hardly move against each
//! other, these forces would add up over all tiles to steps of many σ. Each tile's net force is
//! therefore removed from its frames by weight, `g_i −= (w̄_i/Σw̄) Σ_j g_j`.
//!
//! **Roughness.** The strength of the roughness is estimated once, from blocks spread over the
//! wall. Edges are detected in every solve, and the roughness there is reduced
//! ([`WallSolve::reweight_edges`]). On bricks, whose texture is far from Gaussian, this is the
//! largest gain.
//!
//! **FineGrid.** Fine pixels are constant, so the error at an edge depends on its position in one.
//! Walls are periodic along a lattice, as courses of bricks are, and errors that are equal along a
//! course bend a trajectory. The lattice of every block is therefore shifted by fractions of a fine
//! pixel, as the samples of tiles are ([`WallGrid::centre`]).
//!
//! **Smooth walls** have no detail finer than pixels. There the mean of all frames does better, as
//! it assumes nothing about the wall. The share of such detail in the pixels follows from the
//! roughness ([`tunnelstitch_super_resolve::aliased_variance`]); where it is small against
//! the noise, the wall is not solved for.
//!
//! The wall is solved block by block, with a margin, and x is discarded: memory does not grow with
//! the tunnel's length.
//!
//! Source: R. C. Hardie, K. J. Barnard, E. E. Armstrong, "Joint MAP registration and
//! high-resolution image estimation using a sequence of undersampled images", IEEE Transactions on
//! Image Processing 6(12), 1997.

use crate::joint::observation_mask::ObservationMask;
use crate::joint::region::region_around;
use crate::joint::stiffness::{Stiffness, StiffnessSums};
use crate::joint::wall_pixel::{WallPixel, normalise};
use crate::model::context::EstimationContext;
use crate::samples::visibility::{Tile, Visibility};
use crate::tiles::frame_samples::SampledFrame;
use crate::tiles::grid::{TILE, WallGrid, fractions};
use crate::tiles::residual_weighting::Loss;
use crate::tiles::tile_moments::{ObserverMoments, TileMoments};
use std::ops::Range;
use tunnelstitch_super_resolve::{
    FineGrid, Footprints, HUBER_LIMIT_SIGMAS, KINDS, MAX_CG_ITERATIONS, MAX_REWEIGHTING_ITERATIONS,
    Reading, Region, RoughnessEvidence, WallSolve, huber_weight,
};

/// Conjugate-gradient iterations for the response of the wall to the motion of a frame: twice as
/// many as between two rounds of reweighting, as they start from nothing.
const MAX_RESPONSE_ITERATIONS: usize = 2 * MAX_CG_ITERATIONS;

/// Weight of a pixel in a round of reweighting; `residual` in σ.
///
/// Huber's loss in the first round finds most of the wall in spite of glints. Tukey's
/// ([`crate::tiles::residual_weighting`]), by which poses are estimated, then rejects them.
fn pixel_weight(round: usize, residual: f32) -> f32 {
    match round {
        0 => huber_weight(residual, HUBER_LIMIT_SIGMAS),
        _ => Loss::weight(residual * residual, 1.0),
    }
}

/// Estimated properties of a wall, before it is solved for.
#[derive(Clone, Debug)]
pub struct WallModel {
    /// Strengths of its roughness ([`RoughnessEvidence::strengths`]).
    pub strengths: [f64; KINDS],
    /// Stiffness of the frames against it.
    pub stiffness: Stiffness,
}

/// A block of the wall with all pixels that observe it.
pub struct JointBlock<'a> {
    visibility: &'a Visibility,
    tiles: &'a [Tile],
    /// Frames of the visibility.
    sampled_frames: &'a [SampledFrame<'a>],
    /// Noise of a pixel, 1-σ in grey levels.
    sigma: f32,
    /// Spacing of the fine pixels along s and h, metres.
    spacing_m: [f64; 2],
    /// Frames that observe the block, ascending indices of the visibility.
    frames: Vec<usize>,
    region: Region,
    footprints: Footprints,
    mask: ObservationMask,
    /// Grey values of each frame's pixels on the wall.
    readings: Vec<Vec<Reading>>,
}

impl<'a> JointBlock<'a> {
    /// The block of tiles `block` of a visibility with its frames, whose pixel noise is `sigma`
    /// grey levels.
    pub fn new(
        context: &EstimationContext,
        grid: &WallGrid,
        visibility: &'a Visibility,
        block: &Range<usize>,
        sampled_frames: &'a [SampledFrame<'a>],
        sigma: f64,
    ) -> Self {
        let tiles = &visibility.tiles[block.clone()];
        let frames = visibility.frames(block);
        let region = region_around(grid, tiles);
        let shift = fractions(region.column, region.row);
        let spacing_m = [grid.spacing_s_m, grid.spacing_h_m];
        let lattice = FineGrid {
            columns: grid.columns * TILE as i64,
            spacing_m,
            start_m: [shift[0] * spacing_m[0], shift[1] * spacing_m[1]],
        };
        let mask = ObservationMask::new(context.ignored, grid, visibility, block, &frames, &region)
            .shifted(shift);
        let views: Vec<_> = frames.iter().map(|k| sampled_frames[*k].view()).collect();
        let footprints = Footprints::new(context.surface.as_ref(), &lattice, region, &views);
        let sigma = sigma as f32;
        let readings = frames.iter().enumerate().map(|(n, frame)| {
            let pixels = footprints.pixels(n).iter().zip(footprints.positions(n));
            let reading =
                |(pixel, position): (&u32, &[f32; 2])| match mask.observation(*position, n).shade {
                    0.0 => Reading::default(),
                    shade => sampled_frames[*frame].reading(*pixel, shade, sigma),
                };
            pixels.map(reading).collect()
        });
        let readings = readings.collect();
        Self {
            visibility,
            tiles,
            sampled_frames,
            sigma,
            spacing_m,
            frames,
            region,
            footprints,
            mask,
            readings,
        }
    }

    /// RoughnessEvidence on the roughness of the block.
    pub fn evidence(&self) -> RoughnessEvidence {
        let start = self.footprints.mean(&self.readings);
        let resolved = self.footprints.super_resolve(&self.readings, &start);
        resolved.evidence
    }

    /// Solves for the wall with roughness of these strengths.
    ///
    /// On bricks with noise of 2 grey levels, two rounds of reweighting instead of four make the
    /// poses' squared error 14 % larger, and seven 4 % smaller.
    fn solve(&self, strengths: [f64; KINDS]) -> WallSolve<'_> {
        let start = self.footprints.mean(&self.readings);
        let mut solve = WallSolve::new(&self.footprints, &self.readings, &start, strengths);
        solve.improve(MAX_CG_ITERATIONS);
        for round in 0..MAX_REWEIGHTING_ITERATIONS {
            solve.reweight_edges();
            solve.reweight_pixels(|residual| pixel_weight(round, residual));
            solve.improve(MAX_CG_ITERATIONS);
        }
        solve
    }

    /// Moments of every tile of the block.
    pub fn moments(&self, model: &WallModel) -> Vec<TileMoments> {
        let solve = self.solve(model.strengths);
        let mut moments = self.moments_of(&self.pixels(solve.x()));
        for tile in &mut moments {
            model.stiffness.apply(tile);
        }
        moments
    }

    /// Stiffness of the frames against the block, for roughness of these strengths.
    pub fn stiffness_sums(&self, strengths: [f64; KINDS]) -> StiffnessSums {
        let solve = self.solve(strengths);
        let pixels = self.pixels(solve.x());
        let moments = self.moments_of(&pixels);
        let mut sums = StiffnessSums::default();
        for axis in 0..2 {
            let zeros = |tile: &TileMoments| vec![0.0; tile.observers.len()];
            let mut stiffness: Vec<Vec<f64>> = moments.iter().map(zeros).collect();
            for (n, pixels) in pixels.iter().enumerate() {
                let mut displacement = vec![0.0; self.readings[n].len()];
                for pixel in pixels {
                    displacement[pixel.index] = pixel.features[axis];
                }
                let response = solve.response(n, &displacement, MAX_RESPONSE_ITERATIONS);
                for pixel in pixels {
                    let slope = f64::from(pixel.features[axis]);
                    let change = slope - f64::from(response[pixel.index]);
                    stiffness[pixel.tile][pixel.observer] += pixel.weight() * slope * change;
                }
            }
            for (tile, stiffness) in moments.iter().zip(&stiffness) {
                for (observer, stiffness) in stiffness.iter().enumerate() {
                    sums.add(tile, observer, axis, *stiffness);
                }
            }
        }
        sums
    }

    /// The compared pixels of each frame.
    fn pixels(&self, x: &[f32]) -> Vec<Vec<WallPixel>> {
        let slopes = self.slopes(x);
        let precision = self.sigma.powi(-2);
        let frames = self.frames.iter().enumerate();
        let pixels = frames.map(|(n, frame)| {
            let [s, h, value] = [&slopes[0], &slopes[1], x].map(|of| self.footprints.read(n, of));
            let gain = self.sampled_frames[*frame].gain();
            let positions = self.footprints.positions(n).iter().zip(&self.readings[n]);
            let pixels = positions
                .enumerate()
                .filter_map(|(p, (position, reading))| {
                    let observation = self.mask.observation(*position, n);
                    let (tile, observer) = observation
                        .indices
                        .filter(|_| reading.inverse_sigma > 0.0)?;
                    let gain = gain * observation.shade;
                    let residual = gain * (reading.value - value[p]);
                    Some(WallPixel {
                        index: p,
                        tile: tile as usize,
                        observer: observer as usize,
                        gain: f64::from(gain),
                        residual,
                        omega: f64::from(Loss::weight(residual * residual, precision)),
                        features: [s[p], h[p], value[p]],
                    })
                });
            pixels.collect()
        });
        pixels.collect()
    }

    /// Moments of every tile of the block, from its pixels.
    fn moments_of(&self, pixels: &[Vec<WallPixel>]) -> Vec<TileMoments> {
        let zeros = |tile: &Tile| TileMoments {
            observers: vec![ObserverMoments::default(); self.visibility.observers(tile).len()],
            ..TileMoments::default()
        };
        let mut moments: Vec<TileMoments> = self.tiles.iter().map(zeros).collect();
        for pixel in pixels.iter().flatten() {
            pixel.add_to(self.sigma, &mut moments[pixel.tile]);
        }
        moments.iter_mut().for_each(normalise);
        moments
    }

    /// `∂x/∂s` and `∂x/∂h` by central differences of the fourth order, as the detail that
    /// determines poses is only a few fine pixels wide. Zero at the region's border.
    fn slopes(&self, x: &[f32]) -> [Vec<f32>; 2] {
        let (columns, rows) = (self.region.columns, self.region.rows);
        let slope = |step: usize, spacing_m: f64| {
            let [near, far] = [8.0, -1.0].map(|factor| (factor / (12.0 * spacing_m)) as f32);
            let mut slopes = vec![0.0; x.len()];
            for row in 2..rows - 2 {
                for k in row * columns + 2..(row + 1) * columns - 2 {
                    slopes[k] = near * (x[k + step] - x[k - step])
                        + far * (x[k + 2 * step] - x[k - 2 * step]);
                }
            }
            slopes
        };
        [
            slope(1, self.spacing_m[0]),
            slope(columns, self.spacing_m[1]),
        ]
    }
}
