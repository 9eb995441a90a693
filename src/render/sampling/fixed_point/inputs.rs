//! What is sampled: points, and blocks of a patch in one frame or in several.

use super::super::patch_light::Light;
use crate::numerics::kernel::Kernel;
use crate::render::warp::local_polynomial::Lanes;
use crate::render::warp::patches::{EIGHT, PATCH};
use std::ops::Range;

/// What the kernel needs to know of a picture.
#[derive(Clone, Copy)]
pub struct Source<'a> {
    /// Row-major, channels interleaved; [`PADDING`](super::super::sample::PADDING) more at the end than there are.
    pub samples: &'a [u8],
    /// Samples of a row.
    pub stride: usize,
}

/// Where the kernel lies for each point.
#[derive(Clone, Copy)]
pub struct Places<'a> {
    /// Index of the first sample under the kernel; all of it must lie within the picture.
    pub first: &'a [u32],
    /// Phases along u and v.
    pub phases: [&'a [i32]; 2],
}

/// A patch of the chart that lies inside a frame, kernels and all.
#[derive(Clone, Copy)]
pub struct Patch<'a> {
    /// The frame.
    pub source: Source<'a>,
    /// The kernel, of two taps at least.
    pub kernel: &'a Kernel,
    /// Where its pixels appear, by powers of y.
    pub lines: &'a [Lanes; 4],
}

/// The columns of a patch that are looked at for the sake of these: whole eights.
pub fn reach(columns: &Range<usize>) -> Range<usize> {
    let start = columns.start.min(PATCH - EIGHT);
    start..columns.end.max(start + EIGHT)
}

/// Some columns of a patch, from one of its rows on.
pub struct Block<'a> {
    /// The patch.
    pub patch: Patch<'a>,
    /// Its first row that is meant.
    pub row: usize,
    /// The columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
}

/// The most parts of a block: one for each corner of a cell.
pub const PARTS: usize = 4;

/// What a frame has in a block: `(value − bias) light`, with some weight.
pub struct Part<'a> {
    /// The frame's patch.
    pub patch: Patch<'a>,
    /// What is taken away.
    pub bias: f32,
    /// What is multiplied by; None for 1.
    pub light: Option<Light>,
    /// Weights at the corners of a cell between four nodes, bilinear in between: the upper two,
    /// then the lower two.
    pub corners: [f32; 4],
}

/// Some rows and columns of a patch, the mean of parts with corrections added.
pub struct LitBlock<'a, const L: usize> {
    /// The parts, [`PARTS`] at the most, in the order of their frames; their kernels have equally
    /// many taps. One alone weighs 1 everywhere.
    pub parts: &'a [Part<'a>],
    /// The first row, of the patch.
    pub row: usize,
    /// The columns, of the patch.
    pub columns: Range<usize>,
    /// Column of the tile where the patch begins.
    pub first: usize,
    /// How far each of the tile's columns lies between the nodes, [`crate::render::sampling::point_batch::RUN`] of them.
    pub across: &'a [f32],
    /// How far each of the rows lies between the nodes.
    pub down: &'a [f32],
    /// What is added, in all columns of each of the rows, [`crate::render::sampling::point_batch::RUN`] a row.
    pub corrections: &'a [[f32; L]],
}
