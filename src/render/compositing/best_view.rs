//! One frame at each place of a tile, and how one passes into the next.
//!
//! A tile is drawn in strips between two rows of the seams' nodes. What lies inside all frames that
//! share it is drawn a block at a time, patch by patch of the frames' charts; at the frames'
//! borders and round holes, row by row. (A patch at once where one frame is alone would be slower:
//! so many rows are far apart in the frame and in the panorama.)

use super::accumulator::Row;
use super::seam_grid::{Across, Between, strips};
use super::seams::Seams;
use super::shares::{Share, Shares};
use crate::numerics::simd_dispatch::prefetch_rows;
use crate::render::layout::canvas::Canvas;
use crate::render::layout::placement::NO_FRAME;
use crate::render::layout::tiles::Tile;
use crate::render::sampling::fixed_point::{self, LitBlock, PARTS, Part};
use crate::render::sampling::frame_view::View;
use crate::render::sampling::point_batch::{RUN, Run};
use crate::render::sampling::sample::Sample;
use crate::render::warp::patches::{EIGHT, PATCH, cut, of_patch, pieces};
use crate::render::warp::projection::Points;
use arrayvec::ArrayVec;
use std::ops::Range;

/// What drawing needs for a while.
#[derive(Default)]
pub struct Scratch {
    shares: Shares,
    /// Of each row of a row of patches, [`RUN`] columns each.
    corrections: Vec<f32>,
    /// How far each row of a strip lies between the nodes.
    down: Vec<f32>,
}

/// A tile about to be drawn from views, in the order of their frames, along seams; `C`: channels,
/// `L`: lanes of a correction.
pub struct BestView<'a, const C: usize, const L: usize> {
    seams: &'a Seams,
    views: &'a [View<'a>],
    /// The tile's points, if some view is rough.
    points: &'a Points,
    across: Across,
    /// Of each row.
    down: Vec<Between>,
    /// Whether every pixel is one frame's as it is.
    copies: bool,
}

impl<'a, const C: usize, const L: usize> BestView<'a, C, L> {
    pub fn new(
        seams: &'a Seams,
        (canvas, tile): (&Canvas, &Tile),
        views: &'a [View<'a>],
        points: &'a Points,
    ) -> Self {
        Self {
            seams,
            views,
            points,
            across: seams.across(canvas, tile),
            down: seams.down(canvas, tile),
            copies: seams.are_hard() && views.iter().all(View::copies),
        }
    }

    /// Draws rows of pixels, alpha last, and the frames that they show.
    pub fn draw<T: Sample>(
        &self,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        run: &mut Run,
        sums: &mut Row,
        scratch: &mut Scratch,
    ) {
        let all = self.across.len();
        // Of each patch of a row of them, the frame that it shows alone.
        let mut alone = ArrayVec::<Option<usize>, { RUN / PATCH }>::new();
        for strip in strips(&self.down) {
            let next = strip.end..(strip.end + strip.len()).min(pixels.len());
            if let Some(next) = T::bytes(&mut pixels[next]) {
                prefetch_rows(next);
            }
            if strip.start.is_multiple_of(PATCH) {
                let end = (strip.start + PATCH).min(self.down.len());
                let rows = strip.start..end;
                self.correct(&rows, &mut scratch.corrections);
                let ends = [&self.down[rows.start], &self.down[rows.end - 1]];
                let only = |columns| self.seams.only(&self.across, &columns, ends);
                alone = pieces(0..all).map(only).collect();
            }
            let Scratch {
                shares,
                corrections,
                down,
            } = &mut *scratch;
            let corrections = corrections.as_chunks::<L>().0;
            let corrections = corrections.get(strip.start % PATCH * RUN..).unwrap_or(&[]);
            let drawn = self.blocks(&strip, pixels, sources, (shares, down), corrections, &alone);
            let drawn = self.holes(&strip, pixels, sources, drawn);
            let mut corrections = corrections.chunks_exact(RUN);
            for row in strip {
                let corrections = corrections.next().unwrap_or(&[[0.0; L]; RUN]);
                for open in drawn.open(all) {
                    self.seams
                        .shares(&self.across, open.clone(), &self.down[row], shares);
                    match T::bytes(&mut pixels[row..row + 1]) {
                        Some([pixels]) if self.copies => {
                            self.copy(row, open.clone(), shares, run, sums, pixels);
                        }
                        _ => {
                            self.mix(row, open.clone(), shares, run, sums);
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

    fn view(&self, frame: usize) -> Option<&View<'a>> {
        let at = self.views.binary_search_by_key(&frame, |view| view.frame);
        Some(&self.views[at.ok()?])
    }

    /// The views but the one that some columns are given to alone, if one is.
    fn others(&self, shares: &Shares, columns: &Range<usize>) -> impl Iterator<Item = &View<'a>> {
        let alone = shares.alone(columns);
        let views = self.views.iter();
        views.filter(move |view| Some(view.frame) != alone)
    }

    fn correct(&self, rows: &Range<usize>, corrections: &mut Vec<f32>) {
        corrections.clear();
        if self.copies {
            return;
        }
        corrections.resize(rows.len() * RUN * L, 0.0);
        let corrections = corrections.as_chunks_mut::<L>().0.chunks_exact_mut(RUN);
        for (row, found) in self.down[rows.clone()].iter().zip(corrections) {
            let found = &mut found[..self.across.len()];
            self.seams.corrections(&self.across, row, found);
        }
    }

    /// Draws what lies inside all frames that show it; which columns these are. `alone`: the frames
    /// of those patches that show only one.
    fn blocks<T: Sample>(
        &self,
        strip: &Range<usize>,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        (shares, down): (&mut Shares, &mut Vec<f32>),
        corrections: &[[f32; L]],
        alone: &[Option<usize>],
    ) -> Columns {
        let mut drawn = Columns::default();
        let Some(pixels) = T::bytes(pixels) else {
            return drawn;
        };
        down.clear();
        down.extend(self.down[strip.clone()].iter().map(Between::t));
        let first = &self.down[strip.start];
        for (columns, alone) in pieces(0..self.across.len()).zip(alone) {
            shares.only(*alone, columns.clone());
            if alone.is_none() {
                self.seams.shares(&self.across, columns, first, shares);
            }
            for cell in shares.by_cells() {
                // Who shows most is found pixel by pixel.
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
                if !draw(all.clone()) && all.len() > EIGHT {
                    for eight in cut::<EIGHT>(all) {
                        draw(eight);
                    }
                }
            }
        }
        drawn
    }

    /// Clears what no frame shows, as far as that is plain for eight columns at once; the columns
    /// that are done, those in `drawn` among them.
    fn holes<T: Sample>(
        &self,
        strip: &Range<usize>,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        drawn: Columns,
    ) -> Columns {
        let mut done = drawn;
        let mut clear = |columns: &Range<usize>| {
            let hole = self.views.iter().all(|view| view.misses(strip, columns));
            if hole {
                for pixels in &mut pixels[strip.clone()] {
                    pixels[columns.start * (C + 1)..columns.end * (C + 1)].fill(T::default());
                }
                name(NO_FRAME, strip, columns, sources);
                done.add(columns.clone());
            }
            hole
        };
        for piece in drawn.open(self.across.len()).flat_map(pieces) {
            if !clear(&piece) && piece.len() > EIGHT {
                for eight in cut::<EIGHT>(piece) {
                    clear(&eight);
                }
            }
        }
        done
    }

    /// Draws what frames share in some rows and columns of a patch, or one has alone; false without
    /// doing it if one does not show all of it.
    fn block(
        &self,
        rows: &Range<usize>,
        columns: &Range<usize>,
        shares: &[Share],
        down: &[f32],
        corrections: &[[f32; L]],
        pixels: &mut [&mut [u8]],
    ) -> bool {
        let pixels = &mut pixels[rows.clone()];
        if self.copies {
            let view = self.view(shares[0].frame);
            return view.is_some_and(|view| view.block::<C>(rows.clone(), columns.clone(), pixels));
        }
        let part = |share: &Share| self.view(share.frame)?.part(rows, columns, share.corners);
        let mut parts = ArrayVec::<Part, PARTS>::new();
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
        let (first, columns) = of_patch(columns);
        let block = LitBlock {
            parts: &parts,
            row: rows.start % PATCH,
            columns,
            first,
            across: self.across.between(),
            down,
            corrections,
        };
        fixed_point::lit_block::<C, L>(&block, pixels)
    }

    /// What some columns of a row are, mixed of the frames that share them.
    fn mix(
        &self,
        row: usize,
        columns: Range<usize>,
        shares: &Shares,
        run: &mut Run,
        sums: &mut Row,
    ) {
        let place = (row, self.across.len());
        sums.clear(columns.clone());
        for (share, weights) in shares.iter() {
            if let Some(view) = self.view(share.frame) {
                view.values(run, self.points, place, share.from..share.to);
                match weights {
                    Some(weights) => sums.mix(run, share.frame, share.from, weights),
                    None => sums.set(run, share.frame, share.from..share.to),
                }
            }
        }
        // At the edge of what is seen: frames that no node of the grid shows.
        if sums.has_holes(columns.clone()) {
            for view in self.others(shares, &columns) {
                view.values(run, self.points, place, columns.clone());
                sums.fill(run, view.frame, columns.clone());
            }
        }
    }

    /// The same where every pixel is one frame's as it is; `pixels`: of all the row.
    fn copy(
        &self,
        row: usize,
        columns: Range<usize>,
        shares: &Shares,
        run: &mut Run,
        sums: &mut Row,
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
            for piece in pieces(share.from..share.to) {
                let sources = &mut sources[piece.clone()];
                if view.block::<C>(row..row + 1, piece.clone(), &mut [&mut *pixels]) {
                    sources.fill(share.frame as u32);
                    continue;
                }
                let own = &mut pixels[piece.start * step..piece.end * step];
                view.copy::<C>(run, self.points, place, piece.clone(), own);
                let seen = sources.iter_mut().zip(&run.seen()[piece]);
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
        let mut other = [0; 4 * RUN];
        for view in self.others(shares, &columns) {
            let own = &mut other[..columns.len() * step];
            view.copy::<C>(run, self.points, place, columns.clone(), own);
            let there = pixels.chunks_exact_mut(step).zip(sources.iter_mut());
            let found = own.chunks_exact(step).zip(&run.seen()[columns.clone()]);
            for ((pixel, source), (own, seen)) in there.zip(found) {
                if *source == NO_FRAME && *seen {
                    pixel.copy_from_slice(own);
                    *source = view.frame as u32;
                }
            }
        }
    }
}

/// Notes the frame that some rows and columns show.
fn name(frame: u32, rows: &Range<usize>, columns: &Range<usize>, sources: &mut [&mut [u32]]) {
    for row in rows.clone() {
        if let Some(sources) = sources.get_mut(row) {
            sources[columns.clone()].fill(frame);
        }
    }
}

/// Some columns of a tile, a bit each.
#[derive(Clone, Copy, Default)]
struct Columns(u128);

const _: () = assert!(RUN == u128::BITS as usize);

impl Columns {
    fn add(&mut self, columns: Range<usize>) {
        if !columns.is_empty() {
            self.0 |= (u128::MAX >> (RUN - columns.len())) << columns.start;
        }
    }

    /// The others among the first `count`, run by run.
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
