//! The wall and the poses at once, where frames are sharper than their pixels.
//!
//! [`crate::refine::tiles::tile`] takes what a frame shows between its pixels by interpolation, and the mean of
//! all frames for the wall. That is nearly all there is to know of a wall that is smooth over a
//! pixel. A sharp edge is not: every frame shows it at other fractions of a pixel, and what
//! interpolation makes of them passes for displacements of some hundredths of a pixel. So here the
//! wall is x, pixels of the density of the samples, and a frame's pixel p reads the mean of its own
//! square on it, `W_p x`, as cameras do ([`crate::super_resolve`]). Poses and wall together are the
//! most likely ones:
//!
//! `J = Σ_p ρ(e_p) + (roughness of x)`,   `e_p = a_i (z_p − W_p x)`,   `z_p = (I_p − b_i)/a_i`.
//!
//! For given poses x is the minimiser, so that J changes with the poses as if x stayed as it is
//! (the envelope theorem: `∂J/∂x = 0`). If frame i moves by ξ, its pixel reads at `A_i ξ` from
//! where it read before, hence `∂e_p/∂ξ = −a_i (W_p ∇x)ᵀ A_i`: with the features
//! `φ_p = (W_p ∂x/∂s, W_p ∂x/∂h, W_p x, 1)` a tile has the same moments as ever,
//!
//! - `g_i = Σ_p a_i ω e_p φ_p` over the pixels of frame i whose middles lie in it,
//! - `M`, the mean of `φ_p φ_pᵀ` over the pixels of all frames, and the weights
//!   `w̄_i = Σ_p a_i² ω`,
//!
//! and the normal equations are made of them as there.
//!
//! **No net force.** What moves all frames of a tile alike moves x with them and changes nothing,
//! so `Σ_i g_i` should be zero, as it is of residuals from a mean. It is not quite: x is held by
//! its roughness as well, whose forces cancel over the wall but not tile by tile, and the minimum
//! is approached, not reached. Along weak directions, in which neighbours hardly move against each
//! other, such forces would add up over all tiles to steps of many σ; so each tile's are taken off
//! its frames by weight, `g_i −= (w̄_i/Σw̄) Σ_j g_j`.
//!
//! How rough the wall is, is learned once from blocks spread over all of it; where edges are, anew
//! each time: they may stand out ([`WallSolve::reweight_edges`]). That is what most is gained by on
//! bricks, whose wall is not at all Gaussian.
//!
//! Fine pixels are even in themselves, and where an edge runs through one, what they make of it
//! depends on where. Walls repeat in step with a lattice, as courses of bricks do, and errors that
//! are the same all along a course bend a trajectory; so the lattice of every block is off by
//! fractions of its own, as the samples of tiles are ([`WallGrid::centre`]).
//!
//! **Smooth walls** have nothing between the pixels to be solved for, and interpolation with the
//! mean of all frames does better, as it supposes nothing of the wall. How much of what pixels read
//! is finer than they are, follows from how rough the wall is
//! ([`crate::super_resolve::aliased_variance`]); where that is little against the noise, the solve
//! before stands.
//!
//! Block by block of the wall, with a margin, and nothing is kept of x: memory does not grow with
//! the tunnel's length.
//!
//! Source: R. C. Hardie, K. J. Barnard, E. E. Armstrong, "Joint MAP registration and
//! high-resolution image estimation using a sequence of undersampled images", IEEE Transactions on
//! Image Processing 6(12), 1997.

use crate::refine::joint::observation_mask::ObservationMask;
use crate::refine::joint::stiffness::{Probe, Stiffness};
use crate::refine::model::context::EstimationContext;
use crate::refine::samples::visibility::{Tile, Visibility};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{TILE, TileId, WallGrid, fractions};
use crate::refine::tiles::residual_weighting::Loss;
use crate::refine::tiles::tile::{ObserverMoments, SAMPLES, TileMoments};
use crate::super_resolve::{
    FineGrid, Footprints, KINDS, MARGIN, Reading, Region, RoughnessEvidence, WallSolve,
    huber_weight,
};
use nalgebra::Vector4;
use std::ops::Range;

/// Fine pixels to a pixel's width.
pub const DENSITY: f64 = 3.0;
/// Wall samples to a pixel's width where the frames are searched for what is not wall beforehand.
pub const OUTLIER_MASK_DENSITY: f64 = 2.0;
/// A step shorter than this share of the uncertainty ends the solve: steps take long, and what is
/// left after one is a tenth of it.
pub const STEP_SIGMA: f64 = 0.3;
/// Steps of conjugate gradients between two rounds of reweighting.
const STEPS: usize = 10;

/// Rounds of reweighting; edges take some to become as sharp as they are. On bricks with noise of 2
/// grey levels, two rounds make the poses' squared error 14 % larger, and seven 4 % smaller.
const ROUNDS: usize = 4;

/// The loss of pixels in a round, as the weight of a residual in σ: Huber's in the first, which
/// finds most of the wall whatever glints on it, and then Tukey's, by which poses are estimated
/// ([`crate::refine::tiles::residual_weighting`]), which forgets the glint.
fn pixel_weight(round: usize, residual: f32) -> f32 {
    match round {
        0 => huber_weight(residual, 2.0),
        _ => Loss::weight(residual * residual, 1.0),
    }
}

/// Steps of conjugate gradients to find how the wall follows a frame.
const PROBE_STEPS: usize = 20;

/// What is known of a wall before it is solved for.
#[derive(Clone, Debug)]
pub struct WallModel {
    /// How rough it is ([`RoughnessEvidence::strengths`]).
    pub strengths: [f64; KINDS],
    /// How stiffly it holds frames.
    pub stiffness: Stiffness,
}

/// A block of the wall with all pixels that show it.
pub struct JointBlock<'a> {
    visibility: &'a Visibility,
    tiles: &'a [Tile],
    views: &'a [SampledFrame<'a>],
    sigma: f32,
    spacing_m: [f64; 2],
    frames: Vec<usize>,
    region: Region,
    footprints: Footprints,
    observations: ObservationMask,
    /// Of each frame's pixels.
    readings: Vec<Vec<Reading>>,
}

impl<'a> JointBlock<'a> {
    /// The block of tiles `block` with the frames `views` of a visibility, whose noise is `sigma`
    /// grey levels.
    pub fn new(
        scene: &EstimationContext,
        grid: &WallGrid,
        visibility: &'a Visibility,
        block: &Range<usize>,
        views: &'a [SampledFrame<'a>],
        sigma: f64,
    ) -> Self {
        let tiles = &visibility.tiles[block.clone()];
        let frames = visibility.frames(block);
        let region = region_of(grid, tiles);
        let shift = fractions(region.column, region.row);
        let spacing_m = [grid.spacing_s_m, grid.spacing_h_m];
        let lattice = FineGrid {
            columns: grid.columns * TILE as i64,
            spacing_m,
            start_m: [shift[0] * spacing_m[0], shift[1] * spacing_m[1]],
        };
        let observations =
            ObservationMask::new(scene.ignored, grid, visibility, block, &frames, &region)
                .shifted(shift);
        let shown: Vec<_> = frames.iter().map(|k| views[*k].placed()).collect();
        let footprints = Footprints::new(scene.surface, &lattice, region, &shown);
        let sigma = sigma as f32;
        let readings = frames.iter().enumerate().map(|(n, frame)| {
            let pixels = footprints.pixels(n).iter().zip(footprints.positions(n));
            let reading = |(pixel, place): (&u32, &[f32; 2])| match observations.of(*place, n).shade
            {
                0.0 => Reading::default(),
                shade => views[*frame].reading(*pixel, shade, sigma),
            };
            pixels.map(reading).collect()
        });
        let readings = readings.collect();
        Self {
            visibility,
            tiles,
            views,
            sigma,
            spacing_m,
            frames,
            region,
            footprints,
            observations,
            readings,
        }
    }

    /// How rough the wall is here.
    pub fn evidence(&self) -> RoughnessEvidence {
        let start = self.footprints.mean(&self.readings);
        let resolved = self.footprints.super_resolve(&self.readings, &start);
        resolved.evidence
    }

    /// The wall, as rough as `strengths` say.
    fn solve(&self, strengths: [f64; KINDS]) -> WallSolve<'_> {
        let start = self.footprints.mean(&self.readings);
        let mut solve = WallSolve::new(&self.footprints, &self.readings, &start, strengths);
        solve.improve(STEPS);
        for round in 0..ROUNDS {
            solve.reweight_edges();
            solve.reweight_pixels(|residual| pixel_weight(round, residual));
            solve.improve(STEPS);
        }
        solve
    }

    /// The moments of every tile of the block.
    pub fn moments(&self, wall: &WallModel) -> Vec<TileMoments> {
        let solve = self.solve(wall.strengths);
        let mut moments = self.moments_of(&self.pixels(solve.x()));
        for tile in &mut moments {
            wall.stiffness.apply(tile);
        }
        moments
    }

    /// How stiffly the wall holds the frames here, the wall being as rough as `strengths` say.
    pub fn stiffness(&self, strengths: [f64; KINDS]) -> Probe {
        let solve = self.solve(strengths);
        let pixels = self.pixels(solve.x());
        let moments = self.moments_of(&pixels);
        let mut probe = Probe::default();
        for axis in 0..2 {
            let nothing = |tile: &TileMoments| vec![0.0; tile.observers.len()];
            let mut held: Vec<Vec<f64>> = moments.iter().map(nothing).collect();
            for (view, pixels) in pixels.iter().enumerate() {
                let mut moved = vec![0.0; self.readings[view].len()];
                for pixel in pixels {
                    moved[pixel.number] = pixel.features[axis];
                }
                let follows = solve.response(view, &moved, PROBE_STEPS);
                for pixel in pixels {
                    let slope = f64::from(pixel.features[axis]);
                    let left = slope - f64::from(follows[pixel.number]);
                    held[pixel.tile][pixel.observer] += pixel.weight() * slope * left;
                }
            }
            for (tile, held) in moments.iter().zip(&held) {
                for (observer, held) in held.iter().enumerate() {
                    probe.add(tile, observer, axis, *held);
                }
            }
        }
        probe
    }

    /// The pixels that are compared, view by view.
    fn pixels(&self, x: &[f32]) -> Vec<Vec<Pixel>> {
        let slopes = self.slopes(x);
        let precision = self.sigma.powi(-2);
        let views = self.frames.iter().enumerate();
        let pixels = views.map(|(n, frame)| {
            let [s, h, value] = [&slopes[0], &slopes[1], x].map(|of| self.footprints.read(n, of));
            let gain = self.views[*frame].gain();
            let places = self.footprints.positions(n).iter().zip(&self.readings[n]);
            let pixels = places.enumerate().filter_map(|(p, (place, reading))| {
                let observation = self.observations.of(*place, n);
                let (tile, observer) = observation.place.filter(|_| reading.inverse_sigma > 0.0)?;
                let gain = gain * observation.shade;
                let residual = gain * (reading.value - value[p]);
                Some(Pixel {
                    number: p,
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

    /// The moments of every tile of the block, from its pixels.
    fn moments_of(&self, pixels: &[Vec<Pixel>]) -> Vec<TileMoments> {
        let nothing = |tile: &Tile| TileMoments {
            observers: vec![ObserverMoments::default(); self.visibility.observers(tile).len()],
            ..TileMoments::default()
        };
        let mut moments: Vec<TileMoments> = self.tiles.iter().map(nothing).collect();
        for pixel in pixels.iter().flatten() {
            pixel.add_to(self.sigma, &mut moments[pixel.tile]);
        }
        moments.iter_mut().for_each(settle);
        moments
    }

    /// `∂x/∂s` and `∂x/∂h`, by differences of the fourth order: the detail that poses are told by
    /// is but a few fine pixels wide. None at the region's border.
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

/// The fine pixels of some tiles with a margin.
pub fn region_of(grid: &WallGrid, tiles: &[Tile]) -> Region {
    let range = |of: fn(&TileId) -> i64| {
        let all = || tiles.iter().map(|tile| of(&tile.id));
        all().min().unwrap_or(0)..all().max().unwrap_or(-1) + 1
    };
    let (columns, rows) = (range(|id| id.column), range(|id| id.row));
    let side = TILE as i64;
    // A tunnel that is hardly wider than the tiles has no margin to their sides.
    let wide = columns.end - columns.start;
    let across = ((grid.columns - wide) * side / 2).min(MARGIN as i64);
    Region {
        column: columns.start * side - across,
        row: rows.start * side - MARGIN as i64,
        columns: (wide * side + 2 * across) as usize,
        rows: (rows.end - rows.start) as usize * TILE + 2 * MARGIN,
    }
}

/// A pixel against the wall.
struct Pixel {
    /// Its place among those of its view's footprints.
    number: usize,
    /// Its tile, and its frame among those that see the tile.
    tile: usize,
    observer: usize,
    /// `a_i`, shading included.
    gain: f64,
    /// `e_p`, grey levels.
    residual: f32,
    /// ω.
    omega: f64,
    /// `φ_p` without its 1.
    features: [f32; 3],
}

impl Pixel {
    /// `a_i² ω`.
    fn weight(&self) -> f64 {
        self.gain * self.gain * self.omega
    }

    /// Adds its part to its frame's moments and, weighted, to the tile's features.
    fn add_to(&self, sigma: f32, tile: &mut TileMoments) {
        let (square, precision) = (self.residual * self.residual, sigma.powi(-2));
        let [s, h, value] = self.features.map(f64::from);
        let phi = Vector4::new(s, h, value, 1.0);
        let weight = self.weight();
        let moments = &mut tile.observers[self.observer];
        moments.gradient += phi * (self.gain * self.omega * f64::from(self.residual));
        moments.weight += weight / SAMPLES as f64;
        moments.cost += f64::from(Loss::share(square, precision) / precision);
        moments.square += self.omega * f64::from(square);
        moments.pixels += 1.0;
        moments.inliers += self.omega;
        tile.features += phi * phi.transpose() * weight;
    }
}

/// Makes the sum of weighted features their mean over a sample, and takes the net force off the
/// frames.
fn settle(tile: &mut TileMoments) {
    let total: f64 = tile.observers.iter().map(|observer| observer.weight).sum();
    let force: Vector4<f64> = tile
        .observers
        .iter()
        .map(|observer| observer.gradient)
        .sum();
    let inverse = 1.0 / total.max(1e-12);
    tile.features *= inverse;
    for observer in &mut tile.observers {
        observer.gradient -= force * (observer.weight * inverse);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Matrix4;

    #[test]
    fn frames_of_a_tile_exert_no_net_force() {
        let observer = |gradient: [f64; 4], weight: f64| ObserverMoments {
            gradient: gradient.into(),
            weight,
            ..ObserverMoments::default()
        };
        let mut tile = TileMoments {
            observers: vec![
                observer([1.0, 2.0, -3.0, 0.5], 1.0),
                observer([4.0, -1.0, 0.0, 0.0], 3.0),
            ],
            features: Matrix4::identity() * 8.0,
        };
        settle(&mut tile);
        let [first, second] = [0, 1].map(|k| tile.observers[k].gradient);
        assert!((first + second).norm() < 1e-12);
        // A quarter of (5, 1, −3, ½) is taken off the first.
        assert!((first - Vector4::new(-0.25, 1.75, -2.25, 0.375)).norm() < 1e-12);
        assert_eq!(tile.features, Matrix4::identity() * 2.0);
    }
}
