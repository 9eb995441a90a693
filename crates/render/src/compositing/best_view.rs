//! Tiles drawn from the best frame at each place, with transitions from frame to frame.
//!
//! A tile is drawn in strips between two rows of the seams' nodes. Blocks that lie inside all
//! frames that share them are drawn patch by patch of the frames' warps; at the frames' borders and
//! around holes, tiles are drawn row by row. (Whole patches at once where one frame is alone would
//! be slower: that many rows are far apart in the frame and in the panorama.)

use super::accumulator::RowAccumulator;
use super::frame_shares::{FrameShare, FrameShares};
use super::seam_grid::{ColumnCells, RowPosition, strips};
use super::seams::Seams;
use crate::layout::canvas::Canvas;
use crate::layout::placement::NO_FRAME;
use crate::layout::tiles::TILE_COLUMNS;
use crate::layout::tiles::Tile;
use crate::sampling::fixed_point::{self, BlendPart, BlendedBlock, MAX_BLEND_PARTS};
use crate::sampling::frame_view::FrameView;
use crate::sampling::point_batch::PointBatch;
use crate::sampling::sample::Sample;
use crate::warp::patches::{LANES, PATCH_EDGE, split_at_multiples, split_at_patches, within_patch};
use crate::warp::projection::LocalPoints;
use arrayvec::ArrayVec;
use std::ops::Range;
use tunnelstitch_geometry::numerics::simd_dispatch::prefetch_rows;

/// Buffers that are used again for the next tile.
#[derive(Default)]
pub struct BestViewBuffers {
    shares: FrameShares,
    /// Corrections of each row of a row of patches, [`TILE_COLUMNS`] columns each.
    corrections: Vec<f32>,
    /// Position of each row of a strip between the nodes.
    down: Vec<f32>,
}

/// Renderer of a tile from views, in the order of their frames, along seams; `C`: channels, `L`:
/// lanes of a correction.
pub struct BestViewRenderer<'a, const C: usize, const L: usize> {
    seams: &'a Seams,
    views: &'a [FrameView<'a>],
    /// Wall points of the tile, if some view needs exact projection.
    points: &'a LocalPoints,
    across: ColumnCells,
    /// Position of each row between the nodes.
    down: Vec<RowPosition>,
    /// True if every pixel is copied from one frame, without exposure undone or frames mixed.
    copies: bool,
}

impl<'a, const C: usize, const L: usize> BestViewRenderer<'a, C, L> {
    pub fn new(
        seams: &'a Seams,
        (canvas, tile): (&Canvas, &Tile),
        views: &'a [FrameView<'a>],
        points: &'a LocalPoints,
    ) -> Self {
        Self {
            seams,
            views,
            points,
            across: seams.column_cells(canvas, tile),
            down: seams.row_positions(canvas, tile),
            copies: seams.are_hard() && views.iter().all(FrameView::can_copy),
        }
    }

    /// Draws rows of pixels, alpha last, and the frames that they show.
    pub fn draw<T: Sample>(
        &self,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        batch: &mut PointBatch,
        sums: &mut RowAccumulator,
        buffers: &mut BestViewBuffers,
    ) {
        let all = self.across.len();
        // The only frame of each patch of a row of them, if there is one.
        let mut alone = ArrayVec::<Option<usize>, { TILE_COLUMNS / PATCH_EDGE }>::new();
        for strip in strips(&self.down) {
            let next = strip.end..(strip.end + strip.len()).min(pixels.len());
            if let Some(next) = T::bytes(&mut pixels[next]) {
                prefetch_rows(next);
            }
            if strip.start.is_multiple_of(PATCH_EDGE) {
                let end = (strip.start + PATCH_EDGE).min(self.down.len());
                let rows = strip.start..end;
                self.correct(&rows, &mut buffers.corrections);
                let ends = [&self.down[rows.start], &self.down[rows.end - 1]];
                let only = |columns| self.seams.sole_frame(&self.across, &columns, ends);
                alone = split_at_patches(0..all).map(only).collect();
            }
            let BestViewBuffers {
                shares,
                corrections,
                down,
            } = &mut *buffers;
            let corrections = corrections.as_chunks::<L>().0;
            let corrections = corrections
                .get(strip.start % PATCH_EDGE * TILE_COLUMNS..)
                .unwrap_or(&[]);
            let drawn = self.blocks(&strip, pixels, sources, (shares, down), corrections, &alone);
            let drawn = self.holes(&strip, pixels, sources, drawn);
            let mut corrections = corrections.chunks_exact(TILE_COLUMNS);
            for row in strip {
                let corrections = corrections.next().unwrap_or(&[[0.0; L]; TILE_COLUMNS]);
                for open in drawn.open(all) {
                    self.seams
                        .frame_shares(&self.across, open.clone(), &self.down[row], shares);
                    match T::bytes(&mut pixels[row..row + 1]) {
                        Some([pixels]) if self.copies => {
                            self.copy(row, open.clone(), shares, batch, sums, pixels);
                        }
                        _ => {
                            self.mix(row, open.clone(), shares, batch, sums);
                            let pixels = &mut pixels[row][open.start * (C + 1)..open.end * (C + 1)];
                            sums.put::<T, C, L>(open.clone(), corrections, pixels);
                        }
                    }
                    if let Some(sources) = sources.get_mut(row) {
                        sources[open.clone()].copy_from_slice(&sums.sources()[open]);
                    }
                }
            }
        }
    }

    fn view(&self, frame: usize) -> Option<&FrameView<'a>> {
        let at = self.views.binary_search_by_key(&frame, |view| view.frame);
        Some(&self.views[at.ok()?])
    }

    /// Views except that of the frame that has some columns alone, if one has.
    fn others(
        &self,
        shares: &FrameShares,
        columns: &Range<usize>,
    ) -> impl Iterator<Item = &FrameView<'a>> {
        let alone = shares.sole_frame(columns);
        let views = self.views.iter();
        views.filter(move |view| Some(view.frame) != alone)
    }

    fn correct(&self, rows: &Range<usize>, corrections: &mut Vec<f32>) {
        corrections.clear();
        if self.copies {
            return;
        }
        corrections.resize(rows.len() * TILE_COLUMNS * L, 0.0);
        let corrections = corrections
            .as_chunks_mut::<L>()
            .0
            .chunks_exact_mut(TILE_COLUMNS);
        for (row, found) in self.down[rows.clone()].iter().zip(corrections) {
            let found = &mut found[..self.across.len()];
            self.seams.corrections(&self.across, row, found);
        }
    }

    /// Draws the columns that lie inside all frames that show them, and returns these columns.
    /// `alone`: the frames of those patches that show only one.
    fn blocks<T: Sample>(
        &self,
        strip: &Range<usize>,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        (shares, down): (&mut FrameShares, &mut Vec<f32>),
        corrections: &[[f32; L]],
        alone: &[Option<usize>],
    ) -> Columns {
        let mut drawn = Columns::default();
        let Some(pixels) = T::bytes(pixels) else {
            return drawn;
        };
        down.clear();
        down.extend(self.down[strip.clone()].iter().map(RowPosition::t));
        let first = &self.down[strip.start];
        for (columns, alone) in split_at_patches(0..self.across.len()).zip(alone) {
            shares.set_sole(*alone, columns.clone());
            if alone.is_none() {
                self.seams
                    .frame_shares(&self.across, columns, first, shares);
            }
            for cell in shares.by_cells() {
                // The frame of the largest weight is found pixel by pixel.
                if cell.len() > 1 && !sources.is_empty() {
                    continue;
                }
                let mut draw = |columns: Range<usize>| {
                    let done = self.block(strip, &columns, cell, down, corrections, pixels);
                    if done {
                        name(cell[0].frame as u32, strip, &columns, sources);
                        drawn.add(columns);
                    }
                    done
                };
                let all = cell[0].from..cell[0].to;
                // Next to a frame's border, as much of it as lies inside.
                if !draw(all.clone()) && all.len() > LANES {
                    for eight in split_at_multiples::<LANES>(all) {
                        draw(eight);
                    }
                }
            }
        }
        drawn
    }

    /// Clears columns that certainly no frame shows, eight at a time, and returns the columns that
    /// are done, those in `drawn` among them.
    fn holes<T: Sample>(
        &self,
        strip: &Range<usize>,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        drawn: Columns,
    ) -> Columns {
        let mut done = drawn;
        let mut clear = |columns: &Range<usize>| {
            let hole = self
                .views
                .iter()
                .all(|view| view.is_outside(strip, columns));
            if hole {
                for pixels in &mut pixels[strip.clone()] {
                    pixels[columns.start * (C + 1)..columns.end * (C + 1)].fill(T::default());
                }
                name(NO_FRAME, strip, columns, sources);
                done.add(columns.clone());
            }
            hole
        };
        for piece in drawn.open(self.across.len()).flat_map(split_at_patches) {
            if !clear(&piece) && piece.len() > LANES {
                for eight in split_at_multiples::<LANES>(piece) {
                    clear(&eight);
                }
            }
        }
        done
    }

    /// Draws the blend of frames in some rows and columns of a patch, or a single frame's; false
    /// without doing it if one does not show all of it.
    fn block(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        shares: &[FrameShare],
        down: &[f32],
        corrections: &[[f32; L]],
        pixels: &mut [&mut [u8]],
    ) -> bool {
        let pixels = &mut pixels[rows.clone()];
        if self.copies {
            let view = self.view(shares[0].frame);
            return view.is_some_and(|view| view.block::<C>(rows.clone(), columns.clone(), pixels));
        }
        let part = |share: &FrameShare| self.view(share.frame)?.part(rows, columns, share.corners);
        let mut parts = ArrayVec::<BlendPart, MAX_BLEND_PARTS>::new();
        let mut weights = [0.0; 4];
        for share in shares {
            let Some(part) = part(share) else {
                return false;
            };
            for (weight, corner) in weights.iter_mut().zip(part.corners) {
                *weight += corner;
            }
            parts.push(part);
        }
        if weights != [1.0; 4] {
            return false;
        }
        let (first, columns) = within_patch(columns);
        let block = BlendedBlock {
            parts: &parts,
            row: rows.start % PATCH_EDGE,
            columns,
            first,
            across: self.across.between(),
            down,
            corrections,
        };
        fixed_point::draw_blended_block::<C, L>(&block, pixels)
    }

    /// Mixes the frames that share some columns of a row.
    fn mix(
        &self,
        row: usize,
        columns: Range<usize>,
        shares: &FrameShares,
        batch: &mut PointBatch,
        sums: &mut RowAccumulator,
    ) {
        let place = (row, self.across.len());
        sums.clear(columns.clone());
        for (share, weights) in shares.iter() {
            if let Some(view) = self.view(share.frame) {
                view.sample_values(batch, self.points, place, share.from..share.to);
                match weights {
                    Some(weights) => sums.mix(batch, share.frame, share.from, weights),
                    None => sums.set(batch, share.frame, share.from..share.to),
                }
            }
        }
        // At the edge of what is seen: frames that no node of the grid shows.
        if sums.has_holes(columns.clone()) {
            for view in self.others(shares, &columns) {
                view.sample_values(batch, self.points, place, columns.clone());
                sums.fill(batch, view.frame, columns.clone());
            }
        }
    }

    /// Copies the frame that each pixel of some columns of a row shows; `pixels`: of all the row.
    fn copy(
        &self,
        row: usize,
        columns: Range<usize>,
        shares: &FrameShares,
        batch: &mut PointBatch,
        sums: &mut RowAccumulator,
        pixels: &mut [u8],
    ) {
        let sources = sums.sources_mut();
        let (place, step) = ((row, self.across.len()), C + 1);
        pixels[columns.start * step..columns.end * step].fill(0);
        sources[columns.clone()].fill(NO_FRAME);
        for (share, _) in shares.iter() {
            let Some(view) = self.view(share.frame) else {
                continue;
            };
            for piece in split_at_patches(share.from..share.to) {
                let sources = &mut sources[piece.clone()];
                if view.block::<C>(row..row + 1, piece.clone(), &mut [&mut *pixels]) {
                    sources.fill(share.frame as u32);
                    continue;
                }
                let own = &mut pixels[piece.start * step..piece.end * step];
                view.copy::<C>(batch, self.points, place, piece.clone(), own);
                let seen = sources.iter_mut().zip(&batch.seen()[piece]);
                for (source, _) in seen.filter(|(_, seen)| **seen) {
                    *source = share.frame as u32;
                }
            }
        }
        // As in `mix`.
        if !sums.has_holes(columns.clone()) {
            return;
        }
        let sources = &mut sums.sources_mut()[columns.clone()];
        let pixels = &mut pixels[columns.start * step..columns.end * step];
        let mut other = [0; 4 * TILE_COLUMNS];
        for view in self.others(shares, &columns) {
            let own = &mut other[..columns.len() * step];
            view.copy::<C>(batch, self.points, place, columns.clone(), own);
            let there = pixels.chunks_exact_mut(step).zip(sources.iter_mut());
            let found = own.chunks_exact(step).zip(&batch.seen()[columns.clone()]);
            for ((pixel, source), (own, seen)) in there.zip(found) {
                if *source == NO_FRAME && *seen {
                    pixel.copy_from_slice(own);
                    *source = view.frame as u32;
                }
            }
        }
    }
}

/// Records the frame that some rows and columns show.
fn name(frame: u32, rows: &Range<usize>, columns: &Range<usize>, sources: &mut [&mut [u32]]) {
    for row in rows.clone() {
        if let Some(sources) = sources.get_mut(row) {
            sources[columns.clone()].fill(frame);
        }
    }
}

/// Set of columns of a tile, a bit each.
#[derive(Clone, Copy, Default)]
struct Columns(u128);

const _: () = assert!(TILE_COLUMNS == u128::BITS as usize);

impl Columns {
    fn add(&mut self, columns: Range<usize>) {
        if !columns.is_empty() {
            self.0 |= (u128::MAX >> (TILE_COLUMNS - columns.len())) << columns.start;
        }
    }

    /// Ranges of the columns that are missing among the first `count`.
    fn open(self, count: usize) -> impl Iterator<Item = Range<usize>> {
        let mut to = 0;
        std::iter::from_fn(move || {
            let beyond = |bits: u128, from: usize| {
                let rest = bits.checked_shr(from as u32).unwrap_or(0);
                from + rest.trailing_zeros() as usize
            };
            let from = beyond(!self.0, to).min(count);
            to = beyond(self.0, from).min(count);
            (from < count).then_some(from..to)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn open_columns_are_those_not_added() {
        let open = |added: &[(usize, usize)], count: usize| {
            let mut columns = Columns::default();
            for (from, to) in added {
                columns.add(*from..*to);
            }
            let open = columns.open(count);
            open.map(|range| (range.start, range.end))
                .collect::<Vec<_>>()
        };
        assert_eq!(open(&[], 128), [(0, 128)]);
        assert_eq!(open(&[(0, 128)], 128), []);
        let some = [(3, 7), (9, 64)];
        assert_eq!(open(&some, 100), [(0, 3), (7, 9), (64, 100)]);
        assert_eq!(open(&[(0, 5), (5, 6), (100, 128)], 128), [(6, 100)]);
        assert_eq!(open(&[(0, 5)], 5), []);
    }
}
