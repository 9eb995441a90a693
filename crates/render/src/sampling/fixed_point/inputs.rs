//! Inputs of sampling: points, and blocks of a patch in one frame or in several.

use super::super::patch_light::PatchLight;
use crate::warp::local_polynomial::PatchCoefficients;
use crate::warp::patches::{LANES, PATCH_EDGE};
use std::ops::Range;
use tunnelstitch_geometry::numerics::kernel::Kernel;

/// Samples of a picture.
#[derive(Clone, Copy)]
pub struct PictureSamples<'a> {
    /// Samples, row-major, channels interleaved, with [`PADDING`](super::super::sample::PADDING)
    /// zeros at the end.
    pub samples: &'a [u8],
    /// Samples a row.
    pub stride: usize,
}

/// Positions of the kernel for a batch of points.
#[derive(Clone, Copy)]
pub struct KernelPositions<'a> {
    /// Index of the first sample under the kernel; all of it must lie within the picture.
    pub first: &'a [u32],
    /// Phases along u and v.
    pub phases: [&'a [i32]; 2],
}

/// A patch of the warp that lies inside a frame, with all of its kernels.
#[derive(Clone, Copy)]
pub struct SampledPatch<'a> {
    /// The frame.
    pub source: PictureSamples<'a>,
    /// The kernel, of two taps at least.
    pub kernel: &'a Kernel,
    /// Pixels of the frame by polynomials, by powers of y.
    pub lines: &'a [PatchCoefficients; 4],
}

/// Columns of a patch that are processed for a range of them: whole groups of eight.
pub fn reach(columns: &Range<usize>) -> Range<usize> {
    let start = columns.start.min(PATCH_EDGE - LANES);
    start..columns.end.max(start + LANES)
}

/// Some columns of a patch, from one of its rows on, in one frame.
pub struct PatchBlock<'a> {
    /// The patch.
    pub patch: SampledPatch<'a>,
    /// First row, of the patch.
    pub row: usize,
    /// Columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
}

/// Most parts of a block: one for each corner of a cell.
pub const MAX_BLEND_PARTS: usize = 4;

/// Part of a frame in a block: `(value − bias) light`, with some weight.
pub struct BlendPart<'a> {
    /// The frame's patch.
    pub patch: SampledPatch<'a>,
    /// Bias that is subtracted.
    pub bias: f32,
    /// Factor; None for 1.
    pub light: Option<PatchLight>,
    /// Weights at the corners of a cell between four nodes, bilinear in between: the upper two,
    /// then the lower two.
    pub corners: [f32; 4],
}

/// Some rows and columns of a patch: the mean of parts with corrections added.
pub struct BlendedBlock<'a, const L: usize> {
    /// Parts, at most [`MAX_BLEND_PARTS`], in the order of their frames; their kernels have equally
    /// many taps. A single part weighs 1 everywhere.
    pub parts: &'a [BlendPart<'a>],
    /// The first row, of the patch.
    pub row: usize,
    /// Columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
    /// Position of each of the tile's columns between the nodes,
    /// [`TILE_COLUMNS`](crate::layout::tiles::TILE_COLUMNS) of them.
    pub across: &'a [f32],
    /// Position of each of the rows between the nodes.
    pub down: &'a [f32],
    /// Corrections that are added, in all columns of each of the rows,
    /// [`TILE_COLUMNS`](crate::layout::tiles::TILE_COLUMNS) a row.
    pub corrections: &'a [[f32; L]],
}
