//! One frame at each place of a tile, and how one passes into the next.
//!
//! A tile is drawn in strips between two rows of the seams' nodes. What one frame shows alone there is drawn a block at a time, patch
//! by patch of the frame's chart; where frames meet, at their edges and round holes, row by row.

use super::draw::NO_FRAME;
use super::row::Row;
use super::run::{RUN, Run};
use super::sample::Sample;
use super::seams::{Across, Between, Seams, Shares};
use super::view::{View, pieces};
use super::warp::Points;
use super::{Canvas, Tile};
use std::ops::Range;

/// What drawing needs for a while.
#[derive(Default)]
pub struct Scratch {
    shares: Shares,
    /// Of each row of a strip, [`RUN`] columns each.
    corrections: Vec<f32>,
}

/// A tile about to be drawn from views, in the order of their frames, along seams; `C`: channels, `L`: lanes of a correction.
pub struct BestView<'a, const C: usize, const L: usize> {
    seams: &'a Seams,
    canvas: &'a Canvas,
    tile: &'a Tile,
    views: &'a [View<'a>],
    /// The tile's points, if some view is rough.
    points: &'a Points,
    across: Across,
    /// Whether every pixel is one frame's as it is.
    copies: bool,
}

impl<'a, const C: usize, const L: usize> BestView<'a, C, L> {
    pub fn new(
        seams: &'a Seams,
        (canvas, tile): (&'a Canvas, &'a Tile),
        views: &'a [View<'a>],
        points: &'a Points,
    ) -> Self {
        Self {
            seams,
            canvas,
            tile,
            views,
            points,
            across: seams.across(canvas, tile),
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
        for strip in self.seams.strips(self.canvas, self.tile) {
            self.correct(&strip, &mut scratch.corrections);
            let drawn = self.blocks(&strip, pixels, sources, scratch);
            let Scratch {
                shares,
                corrections,
            } = &mut *scratch;
            let mut corrections = corrections.as_chunks::<L>().0.chunks_exact(RUN);
            for row in strip {
                let corrections = corrections.next().unwrap_or(&[[0.0; L]; RUN]);
                for open in drawn.open(self.across.len()) {
                    let pixels = &mut pixels[row][open.start * (C + 1)..open.end * (C + 1)];
                    self.seams
                        .shares(&self.across, open.clone(), &self.between(row), shares);
                    match T::bytes(&mut [&mut *pixels]) {
                        Some([pixels]) if self.copies => {
                            self.copy(row, open.clone(), shares, run, sums, pixels);
                        }
                        _ => {
                            self.mix(row, open.clone(), shares, run, sums);
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

    fn between(&self, row: usize) -> Between {
        self.seams.row_of(self.canvas, self.tile.row + row as u32)
    }

    fn view(&self, frame: usize) -> Option<&View<'a>> {
        let at = self.views.binary_search_by_key(&frame, |view| view.frame);
        Some(&self.views[at.ok()?])
    }

    fn correct(&self, strip: &Range<usize>, corrections: &mut Vec<f32>) {
        if self.copies {
            return;
        }
        corrections.resize(strip.len() * RUN * L, 0.0);
        let rows = corrections.as_chunks_mut::<L>().0.chunks_exact_mut(RUN);
        for (row, found) in strip.clone().zip(rows) {
            let found = &mut found[..self.across.len()];
            self.seams
                .corrections(&self.across, &self.between(row), found);
        }
    }

    /// Draws what one frame shows alone in whole patches of its chart; which columns these are.
    fn blocks<T: Sample>(
        &self,
        strip: &Range<usize>,
        pixels: &mut [&mut [T]],
        sources: &mut [&mut [u32]],
        scratch: &mut Scratch,
    ) -> Columns {
        let mut drawn = Columns::default();
        let Some(pixels) = T::bytes(pixels) else {
            return drawn;
        };
        let Scratch {
            shares,
            corrections,
        } = scratch;
        let corrections = (!self.copies).then_some(corrections.as_chunks::<L>().0);
        let first = self.between(strip.start);
        self.seams
            .shares(&self.across, 0..self.across.len(), &first, shares);
        for (share, _) in shares.iter().filter(|(_, weights)| weights.is_none()) {
            let Some(view) = self.view(share.frame) else {
                continue;
            };
            for piece in pieces(share.from..share.to) {
                if view.block::<C, L>(strip.clone(), piece.clone(), corrections, pixels) {
                    for row in strip.clone() {
                        if let Some(sources) = sources.get_mut(row) {
                            sources[piece.clone()].fill(share.frame as u32);
                        }
                    }
                    drawn.add(piece);
                }
            }
        }
        drawn
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
            for view in self.views {
                view.values(run, self.points, place, columns.clone());
                sums.fill(run, view.frame, columns.clone());
            }
        }
    }

    /// The same where every pixel is one frame's as it is.
    fn copy(
        &self,
        row: usize,
        columns: Range<usize>,
        shares: &Shares,
        run: &mut Run,
        sums: &mut Row,
        pixels: &mut [u8],
    ) {
        let sources = &mut sums.sources_mut()[columns.clone()];
        let (place, step) = ((row, self.across.len()), C + 1);
        pixels.fill(0);
        sources.fill(NO_FRAME);
        for (share, _) in shares.iter() {
            let Some(view) = self.view(share.frame) else {
                continue;
            };
            let (from, to) = (share.from - columns.start, share.to - columns.start);
            let own = &mut pixels[from * step..to * step];
            view.copy::<C>(run, self.points, place, share.from..share.to, own);
            let seen = &run.seen()[share.from..share.to];
            for (source, _) in sources[from..to]
                .iter_mut()
                .zip(seen)
                .filter(|(_, seen)| **seen)
            {
                *source = share.frame as u32;
            }
        }
        if !sources.contains(&NO_FRAME) {
            return;
        }
        let mut other = [0; 4 * RUN];
        for view in self.views {
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
        let open = |added: &[Range<usize>], count: usize| {
            let mut columns = Columns::default();
            for range in added {
                columns.add(range.clone());
            }
            columns.open(count).collect::<Vec<_>>()
        };
        assert_eq!(open(&[], 128), [0..128]);
        assert_eq!(open(&[0..128], 128), []);
        assert_eq!(open(&[3..7, 9..64], 100), [0..3, 7..9, 64..100]);
        assert_eq!(open(&[0..5, 5..6, 100..128], 128), [6..100]);
        assert_eq!(open(&[0..5], 5), []);
    }
}
