//! Stencils: sparse rows of the observation matrix from fine pixels to pixels.

use crate::region::Region;
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;

/// Maximum fine pixels along a side of a stencil.
///
/// Pixels with wider, oblique footprints are left out.
pub(super) const MAX_STENCIL_WIDTH: usize = 12;
/// Number of parts of a pixel along each side.
const PARTS_PER_SIDE: usize = 4;

/// Footprint of a pixel: centre and sides of its parallelogram, fine pixels.
pub(super) struct PixelFootprint {
    pub pixel: usize,
    pub middle: [f32; 2],
    pub sides: [[f32; 2]; 2],
}

impl PixelFootprint {
    /// Half the width of the parallelogram along an axis.
    pub fn half_width(&self, axis: usize) -> f32 {
        0.5 * (self.sides[0][axis].abs() + self.sides[1][axis].abs())
    }

    /// The first fine pixel along an axis.
    fn first(&self, axis: usize) -> f32 {
        (self.middle[axis] - self.half_width(axis)).floor()
    }

    /// The number of fine pixels along an axis.
    fn span(&self, axis: usize) -> usize {
        let end = (self.middle[axis] + self.half_width(axis)).floor() + 1.0;
        (end - self.first(axis)) as usize
    }
}

/// Stencils of one view's pixels.
///
/// Pixel p reads `Σ_k w_pk x_k`, with `w_pk` the share of its square, projected onto the wall, that
/// lies in fine pixel k. The projected square is a parallelogram, as the map from pixels to the
/// wall is linear within a pixel. It is divided into [`PARTS_PER_SIDE`]² parts, each replaced by
/// the axis-aligned rectangle of its width and height around its centre. That is exact for an
/// upright camera; for a rotated one the weight and the centre are exact and the width is close.
pub(super) struct Stencils {
    /// Fine pixels from one row of the region to the next.
    stride: usize,
    /// Fine pixels along a stencil's rows: 4, 6, 8 or 12.
    width: usize,
    /// Rows of a stencil.
    height: usize,
    /// Index of the first fine pixel of each stencil.
    first: Vec<u32>,
    /// Weights `w`, stencil by stencil, row by row.
    weights: Vec<f32>,
    /// Row-major indices of the pixels in their frame.
    pub pixels: Vec<u32>,
    /// Centres of the pixels in the region, fine pixels from its first corner.
    pub positions: Vec<[f32; 2]>,
}

impl Stencils {
    /// Computes the stencils of footprints that lie entirely in the region.
    pub fn new(region: &Region, mut footprints: Vec<PixelFootprint>) -> Self {
        let most = |axis| {
            footprints
                .iter()
                .map(|footprint| footprint.span(axis))
                .max()
        };
        let width = match most(0).unwrap_or(1) {
            0..=4 => 4,
            5..=6 => 6,
            7..=8 => 8,
            _ => MAX_STENCIL_WIDTH,
        };
        let height = most(1).unwrap_or(1);
        if region.columns < width || region.rows < height {
            footprints.clear();
        }
        // A stencil may be wider than its footprint; it begins earlier if it would end beyond the
        // region.
        let corner = |footprint: &PixelFootprint| {
            let column = (footprint.first(0) as usize).min(region.columns.saturating_sub(width));
            let row = (footprint.first(1) as usize).min(region.rows.saturating_sub(height));
            [column, row]
        };
        let mut weights = vec![0.0; footprints.len() * width * height];
        dispatch_simd(
            #[inline(always)]
            || {
                let stencils = weights.chunks_exact_mut(width * height);
                for (footprint, stencil) in footprints.iter().zip(stencils) {
                    match width {
                        4 => fill::<4>(footprint, corner(footprint), stencil),
                        6 => fill::<6>(footprint, corner(footprint), stencil),
                        8 => fill::<8>(footprint, corner(footprint), stencil),
                        _ => fill::<MAX_STENCIL_WIDTH>(footprint, corner(footprint), stencil),
                    }
                }
            },
        );
        let first = footprints.iter().map(|footprint| {
            let [column, row] = corner(footprint);
            (row * region.columns + column) as u32
        });
        Self {
            stride: region.columns,
            width,
            height,
            first: first.collect(),
            weights,
            pixels: footprints
                .iter()
                .map(|footprint| footprint.pixel as u32)
                .collect(),
            positions: footprints
                .iter()
                .map(|footprint| footprint.middle)
                .collect(),
        }
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        self.first.len()
    }

    /// Computes `Σ_k w_pk x_k` for every pixel p.
    #[inline(always)]
    pub fn read(&self, x: &[f32], out: &mut Vec<f32>) {
        match self.width {
            4 => self.read_as::<4>(x, out),
            6 => self.read_as::<6>(x, out),
            8 => self.read_as::<8>(x, out),
            _ => self.read_as::<MAX_STENCIL_WIDTH>(x, out),
        }
    }

    #[inline(always)]
    fn read_as<const W: usize>(&self, x: &[f32], out: &mut Vec<f32>) {
        out.clear();
        let stencils = self.weights.chunks_exact(W * self.height);
        let all = self.first.iter().zip(stencils);
        out.extend(all.map(|(first, stencil)| self.dot::<W>(stencil, x, *first as usize)));
    }

    /// Adds `Σ_p w_pk v_p` to every fine pixel k.
    #[inline(always)]
    pub fn spread(&self, values: &[f32], y: &mut [f32]) {
        match self.width {
            4 => self.spread_as::<4>(values, y),
            6 => self.spread_as::<6>(values, y),
            8 => self.spread_as::<8>(values, y),
            _ => self.spread_as::<MAX_STENCIL_WIDTH>(values, y),
        }
    }

    #[inline(always)]
    fn spread_as<const W: usize>(&self, values: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(W * self.height);
        for ((first, stencil), value) in self.first.iter().zip(stencils).zip(values) {
            self.add::<W>(stencil, *value, y, *first as usize);
        }
    }

    /// Adds `Σ_p w_pk ω_p Σ_l w_pl x_l` to every fine pixel k: the view's part of the normal matrix
    /// times x.
    #[inline(always)]
    pub fn add_normal(&self, omega: &[f32], x: &[f32], y: &mut [f32]) {
        match self.width {
            4 => self.add_normal_as::<4>(omega, x, y),
            6 => self.add_normal_as::<6>(omega, x, y),
            8 => self.add_normal_as::<8>(omega, x, y),
            _ => self.add_normal_as::<MAX_STENCIL_WIDTH>(omega, x, y),
        }
    }

    #[inline(always)]
    fn add_normal_as<const W: usize>(&self, omega: &[f32], x: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(W * self.height);
        for ((first, stencil), omega) in self.first.iter().zip(stencils).zip(omega) {
            let first = *first as usize;
            let read = self.dot::<W>(stencil, x, first);
            self.add::<W>(stencil, omega * read, y, first);
        }
    }

    /// Adds the diagonal of the view's part of the normal matrix, `Σ_p w_pk² ω_p`.
    pub fn add_diagonal(&self, omega: &[f32], y: &mut [f32]) {
        let stencils = self.weights.chunks_exact(self.width * self.height);
        for ((first, stencil), omega) in self.first.iter().zip(stencils).zip(omega) {
            for (j, row) in stencil.chunks_exact(self.width).enumerate() {
                let start = *first as usize + j * self.stride;
                for (y, w) in y[start..start + self.width].iter_mut().zip(row) {
                    *y += w * w * omega;
                }
            }
        }
    }

    #[inline(always)]
    fn dot<const W: usize>(&self, stencil: &[f32], x: &[f32], first: usize) -> f32 {
        let mut sums = [0.0f32; W];
        for (j, row) in stencil.chunks_exact(W).enumerate() {
            let start = first + j * self.stride;
            for (sum, (w, x)) in sums.iter_mut().zip(row.iter().zip(&x[start..start + W])) {
                *sum += w * x;
            }
        }
        sums.iter().sum()
    }

    #[inline(always)]
    fn add<const W: usize>(&self, stencil: &[f32], value: f32, y: &mut [f32], first: usize) {
        for (j, row) in stencil.chunks_exact(W).enumerate() {
            let start = first + j * self.stride;
            for (y, w) in y[start..start + W].iter_mut().zip(row) {
                *y += w * value;
            }
        }
    }
}

/// Fills a pixel's stencil (initially zero), W fine pixels wide, with its first pixel at `corner`.
#[inline(always)]
fn fill<const W: usize>(footprint: &PixelFootprint, corner: [usize; 2], stencil: &mut [f32]) {
    let reach_s = (footprint.half_width(0) / PARTS_PER_SIDE as f32).max(MIN_HALF_WIDTH);
    let reach_h = (footprint.half_width(1) / PARTS_PER_SIDE as f32).max(MIN_HALF_WIDTH);
    let middle_s = footprint.middle[0] - corner[0] as f32;
    let middle_h = footprint.middle[1] - corner[1] as f32;
    let [[us, uh], [vs, vh]] = footprint.sides;
    // A part's share of the pixel, over its width and height.
    let density = 1.0 / ((PARTS_PER_SIDE * PARTS_PER_SIDE) as f32 * 4.0 * reach_s * reach_h);
    for j in 0..PARTS_PER_SIDE {
        for i in 0..PARTS_PER_SIDE {
            let (part_u, part_v) = (middle_of(i), middle_of(j));
            let across = middle_s + part_u * us + part_v * vs;
            let down = middle_h + part_u * uh + part_v * vh;
            let mut widths = [0.0; W];
            for (k, width) in widths.iter_mut().enumerate() {
                *width = density * overlap(k, across - reach_s, across + reach_s);
            }
            for (k, row) in stencil.chunks_exact_mut(W).enumerate() {
                let height = overlap(k, down - reach_h, down + reach_h);
                for (w, width) in row.iter_mut().zip(&widths) {
                    *w += height * width;
                }
            }
        }
    }
}

/// Centre of a part along a side of its pixel, −½ to ½.
#[inline(always)]
fn middle_of(part: usize) -> f32 {
    (part as f32 + 0.5) / PARTS_PER_SIDE as f32 - 0.5
}

/// Minimum half width of a part, fine pixels, so that no part degenerates to a line.
const MIN_HALF_WIDTH: f32 = 1e-4;

/// Length of the intersection of an interval with a unit cell.
#[inline(always)]
fn overlap(cell: usize, from: f32, to: f32) -> f32 {
    let cell = cell as f32;
    (to.min(cell + 1.0) - from.max(cell)).max(0.0)
}
