//! The wall and the poses at once, where frames are sharper than their pixels.
//!
//! [`super::tile`] takes what a frame shows between its pixels by interpolation, and the mean of all frames for the wall.
//! That is nearly all there is to know of a wall that is smooth over a pixel. A sharp edge is not: every frame shows it at other
//! fractions of a pixel, and what interpolation makes of them passes for displacements of some hundredths of a pixel. So here
//! the wall is x, pixels of the density of the samples, and a frame's pixel p reads the mean of its own square on it,
//! `W_p x`, as cameras do ([`crate::super_resolve`]). Poses and wall together are the most likely ones:
//!
//! `J = Σ_p ρ(e_p) + (roughness of x)`,   `e_p = a_i (z_p − W_p x)`,   `z_p = (I_p − b_i)/a_i`.
//!
//! For given poses x is the minimiser, so that J changes with the poses as if x stayed as it is (the envelope theorem: `∂J/∂x = 0`). If
//! frame i moves by ξ, its pixel reads at `A_i ξ` from where it read before, hence `∂e_p/∂ξ = −a_i (W_p ∇x)ᵀ A_i`: with the features
//! `φ_p = (W_p ∂x/∂s, W_p ∂x/∂h, W_p x, 1)` a tile has the same moments as ever,
//!
//! - `g_i = Σ_p a_i ω e_p φ_p` over the pixels of frame i whose middles lie in it,
//! - `M`, the mean of `φ_p φ_pᵀ` over the pixels of all frames, and the weights `w̄_i = Σ_p a_i² ω`,
//!
//! and the normal equations are made of them as there.
//!
//! **No net force.** What moves all frames of a tile alike moves x with them and changes nothing, so `Σ_i g_i` should be zero,
//! as it is of residuals from a mean. It is not quite: x is held by its roughness as well, whose forces cancel over the wall but not
//! tile by tile, and the minimum is approached, not reached. Along weak directions, in which neighbours hardly move against each other, such
//! forces would add up over all tiles to steps of many σ; so each tile's are taken off its frames by weight, `g_i −= (w̄_i/Σw̄) Σ_j g_j`.
//!
//! How rough the wall is, is learned once from blocks spread over all of it; where edges are, anew each time: they may stand out
//! ([`WallSolve::weigh_edges`]). That is what most is gained by on bricks, whose wall is not at all Gaussian.
//!
//! Block by block of the wall, with a margin, and nothing is kept of x: memory does not grow with the tunnel's length.
//!
//! Source: R. C. Hardie, K. J. Barnard, E. E. Armstrong, "Joint MAP registration and high-resolution image estimation
//! using a sequence of undersampled images", IEEE Transactions on Image Processing 6(12), 1997.

use super::grid::{TILE, TileId, WallGrid};
use super::problem::Scene;
use super::robust::Loss;
use super::tile::{ObserverMoments, SAMPLES, TileMoments};
use super::view::View;
use super::visibility::{Tile, Visibility};
use crate::super_resolve::{
    Evidence, Footprints, KINDS, Lattice, MARGIN, Reading, Region, WallSolve,
};
use crate::surface::Patches;
use nalgebra::{Matrix4, Vector4};
use std::ops::Range;

/// Steps of conjugate gradients between two rounds of reweighting.
const STEPS: usize = 10;

/// The losses of pixels in the rounds after the first, as weights of residuals in σ: Huber's, which finds most of the wall whatever
/// glints on it, and then Tukey's, by which poses are estimated ([`super::robust`]), which forgets the glint.
const LOSSES: [fn(f32) -> f32; 2] = [
    |residual| (2.0 / residual.abs()).min(1.0),
    |residual| Loss::weight(residual * residual, 1.0),
];

/// A block of the wall with all pixels that show it.
pub struct JointBlock<'a> {
    visibility: &'a Visibility,
    tiles: &'a [Tile],
    views: &'a [View<'a>],
    sigma: f32,
    spacing_m: [f64; 2],
    frames: Vec<usize>,
    region: Region,
    footprints: Footprints,
    sights: Sights,
    /// Of each frame's pixels.
    readings: Vec<Vec<Reading>>,
}

/// Who sees what of the tiles of a region.
struct Sights {
    /// Which tiles.
    columns: Range<i64>,
    rows: Range<i64>,
    /// Fine pixels from the first tile's corner to the region's.
    offset: [f32; 2],
    /// Row by row, column by column, frame by frame.
    all: Vec<Sight>,
    frames: usize,
}

/// How a frame sees a tile.
#[derive(Clone, Copy, Default)]
struct Sight {
    /// The camera's shading there; 0 if what the frame shows there is not taken for the wall.
    shade: f32,
    /// The tile among those of the block, and the frame among its observers; None where the frame helps to find the wall, but is
    /// not compared.
    place: Option<(u32, u32)>,
}

impl Sights {
    /// Besides the tiles in which a frame is compared, it is taken for the wall in those next to them, which it sees but partly, and
    /// next to tiles in which it does not show the wall it is not compared: otherwise frames would be drawn to where the
    /// wall is known better, away from the borders of what they show of it.
    fn new(
        ignored: &Patches,
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let mut sights = Self::compared(grid, visibility, block, frames, region);
        let compared = sights.all.clone();
        for tile in sights.tiles() {
            let id = around(grid, tile);
            if visibility.tile(id).is_none() && ignored.meet(&grid.area(id)) {
                continue;
            }
            for (n, frame) in frames.iter().enumerate() {
                if !visibility.leaves_out(id, *frame) {
                    let shades = sights.next_to(tile).map(|k| compared[k + n].shade);
                    let shade = shades.fold(0.0, f32::max);
                    let sight = sights.at(tile, n);
                    if sight.shade == 0.0 {
                        sight.shade = shade;
                    }
                }
            }
        }
        for tile in sights.tiles() {
            for n in 0..frames.len() {
                if sights.next_to(tile).any(|k| sights.all[k + n].shade == 0.0) {
                    sights.at(tile, n).place = None;
                }
            }
        }
        sights
    }

    /// Only the tiles in which frames are compared.
    fn compared(
        grid: &WallGrid,
        visibility: &Visibility,
        block: &Range<usize>,
        frames: &[usize],
        region: &Region,
    ) -> Self {
        let side = TILE as i64;
        let end = |first: i64, pixels: usize| (first + pixels as i64 - 1).div_euclid(side) + 1;
        let columns = region.column.div_euclid(side)..end(region.column, region.columns);
        let rows = region.row.div_euclid(side)..end(region.row, region.rows);
        let tiles = ((columns.end - columns.start) * (rows.end - rows.start)) as usize;
        let mut sights = Self {
            columns,
            rows,
            offset: [region.column, region.row].map(|pixel| pixel.rem_euclid(side) as f32),
            all: vec![Sight::default(); tiles * frames.len()],
            frames: frames.len(),
        };
        for tile in sights.tiles() {
            let Some((index, seen)) = visibility.tile(around(grid, tile)) else {
                continue;
            };
            let own = block.contains(&index);
            for (n, observer) in visibility.observers(seen).iter().enumerate() {
                if let Ok(frame) = frames.binary_search(&(observer.frame as usize)) {
                    *sights.at(tile, frame) = Sight {
                        shade: observer.shade,
                        place: own.then(|| ((index - block.start) as u32, n as u32)),
                    };
                }
            }
        }
        sights
    }

    /// The region's tiles; columns may go on around the section.
    fn tiles(&self) -> impl Iterator<Item = TileId> + use<> {
        let columns = self.columns.clone();
        self.rows.clone().flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| TileId { column, row })
        })
    }

    /// Where the tiles around a tile, as far as they are in the region, and itself begin.
    fn next_to(&self, tile: TileId) -> impl Iterator<Item = usize> + '_ {
        let near = |range: &Range<i64>, of: i64| range.start.max(of - 1)..range.end.min(of + 2);
        let columns = near(&self.columns, tile.column);
        near(&self.rows, tile.row).flat_map(move |row| {
            let columns = columns.clone();
            columns.map(move |column| self.start(TileId { column, row }))
        })
    }

    /// Where the frames of a tile begin.
    fn start(&self, tile: TileId) -> usize {
        let columns = (self.columns.end - self.columns.start) as usize;
        let (column, row) = (tile.column - self.columns.start, tile.row - self.rows.start);
        (row as usize * columns + column as usize) * self.frames
    }

    fn at(&mut self, tile: TileId, frame: usize) -> &mut Sight {
        let start = self.start(tile);
        &mut self.all[start + frame]
    }

    /// How a frame sees the tile around a place in the region.
    fn of(&self, [x, y]: [f32; 2], frame: usize) -> Sight {
        let tile = |at: f32, offset: f32| ((at + offset) / TILE as f32) as i64;
        let id = TileId {
            column: self.columns.start + tile(x, self.offset[0]),
            row: self.rows.start + tile(y, self.offset[1]),
        };
        self.all[self.start(id) + frame]
    }
}

/// The tile of the grid that a region's tile is.
fn around(grid: &WallGrid, tile: TileId) -> TileId {
    TileId {
        column: tile.column.rem_euclid(grid.columns),
        ..tile
    }
}

impl<'a> JointBlock<'a> {
    /// The block of tiles `block` with the frames `views` of a visibility, whose noise is `sigma` grey levels.
    pub fn new(
        scene: &Scene,
        grid: &WallGrid,
        visibility: &'a Visibility,
        block: &Range<usize>,
        views: &'a [View<'a>],
        sigma: f64,
    ) -> Self {
        let tiles = &visibility.tiles[block.clone()];
        let frames = visibility.frames(block);
        let range = |of: fn(&TileId) -> i64| {
            let all = || tiles.iter().map(|tile| of(&tile.id));
            (all().min().unwrap_or(0), all().max().unwrap_or(0) + 1)
        };
        let (columns, rows) = (range(|id| id.column), range(|id| id.row));
        let lattice = Lattice {
            columns: grid.columns * TILE as i64,
            spacing_m: [grid.spacing_s_m, grid.spacing_h_m],
            h_start_m: 0.0,
        };
        // A tunnel that is hardly wider than the block has no margin to its sides.
        let wide = (columns.1 - columns.0) * TILE as i64;
        let across = ((lattice.columns - wide) / 2).min(MARGIN as i64);
        let region = Region {
            column: columns.0 * TILE as i64 - across,
            row: rows.0 * TILE as i64 - MARGIN as i64,
            columns: (wide + 2 * across) as usize,
            rows: (rows.1 - rows.0) as usize * TILE + 2 * MARGIN,
        };
        let sights = Sights::new(scene.ignored, grid, visibility, block, &frames, &region);
        let shown: Vec<_> = frames.iter().map(|k| views[*k].placed()).collect();
        let footprints = Footprints::new(scene.surface, &lattice, region, &shown);
        let sigma = sigma as f32;
        let readings = frames.iter().enumerate().map(|(n, frame)| {
            let pixels = footprints.pixels(n).iter().zip(footprints.places(n));
            let reading = |(pixel, place): (&u32, &[f32; 2])| match sights.of(*place, n).shade {
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
            spacing_m: lattice.spacing_m,
            frames,
            region,
            footprints,
            sights,
            readings,
        }
    }

    /// How rough the wall is here.
    pub fn evidence(&self) -> Evidence {
        let start = self.footprints.mean(&self.readings);
        self.footprints
            .super_resolve(&self.readings, &start)
            .evidence
    }

    /// The moments of every tile of the block, the wall being as rough as `strengths` say.
    pub fn moments(&self, strengths: [f64; KINDS]) -> Vec<TileMoments> {
        let start = self.footprints.mean(&self.readings);
        let mut solve = WallSolve::new(&self.footprints, &self.readings, &start, strengths);
        solve.improve(STEPS);
        for loss in LOSSES {
            solve.weigh_edges();
            solve.weigh_pixels(loss);
            solve.improve(STEPS);
        }
        let features = self.features(solve.x());
        let nothing = |tile: &Tile| TileMoments {
            observers: vec![ObserverMoments::default(); self.visibility.observers(tile).len()],
            ..TileMoments::default()
        };
        let mut moments: Vec<TileMoments> = self.tiles.iter().map(nothing).collect();
        for (n, frame) in self.frames.iter().enumerate() {
            let [s, h, value] = [0, 1, 2].map(|k| self.footprints.read(n, &features[k]));
            let gain = self.views[*frame].gain();
            let places = self.footprints.places(n).iter().zip(&self.readings[n]);
            for (p, (place, reading)) in places.enumerate() {
                let sight = self.sights.of(*place, n);
                if let (Some((tile, observer)), true) = (sight.place, reading.inverse_sigma > 0.0) {
                    let found = &mut moments[tile as usize];
                    let gain = gain * sight.shade;
                    let pixel = Pixel {
                        gain: f64::from(gain),
                        residual: gain * (reading.value - value[p]),
                        features: [s[p], h[p], value[p]],
                    };
                    pixel.add_to(
                        self.sigma,
                        &mut found.observers[observer as usize],
                        &mut found.features,
                    );
                }
            }
        }
        moments.iter_mut().for_each(settle);
        moments
    }

    /// `∂x/∂s`, `∂x/∂h` and x; no slopes at the region's border.
    fn features<'x>(&self, x: &'x [f32]) -> [std::borrow::Cow<'x, [f32]>; 3] {
        let (columns, rows) = (self.region.columns, self.region.rows);
        let slope = |step: usize, spacing_m: f64| {
            let scale = (0.5 / spacing_m) as f32;
            let mut slopes = vec![0.0; x.len()];
            for row in 1..rows - 1 {
                for k in row * columns + 1..(row + 1) * columns - 1 {
                    slopes[k] = scale * (x[k + step] - x[k - step]);
                }
            }
            slopes.into()
        };
        [
            slope(1, self.spacing_m[0]),
            slope(columns, self.spacing_m[1]),
            x.into(),
        ]
    }
}

/// A pixel against the wall.
struct Pixel {
    /// `a_i`, shading included.
    gain: f64,
    /// `e_p`, grey levels.
    residual: f32,
    /// `φ_p` without its 1.
    features: [f32; 3],
}

impl Pixel {
    /// Adds its part to its frame's moments and, weighted, to the tile's features.
    fn add_to(&self, sigma: f32, moments: &mut ObserverMoments, features: &mut Matrix4<f64>) {
        let (square, precision) = (self.residual * self.residual, sigma.powi(-2));
        let omega = f64::from(Loss::weight(square, precision));
        let [s, h, value] = self.features.map(f64::from);
        let phi = Vector4::new(s, h, value, 1.0);
        let weight = self.gain * self.gain * omega;
        moments.gradient += phi * (self.gain * omega * f64::from(self.residual));
        moments.weight += weight / SAMPLES as f64;
        moments.cost += f64::from(Loss::share(square, precision) / precision);
        moments.square += omega * f64::from(square);
        moments.pixels += 1.0;
        moments.inliers += omega;
        *features += phi * phi.transpose() * weight;
    }
}

/// Makes the sum of weighted features their mean over a sample, and takes the net force off the frames.
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
