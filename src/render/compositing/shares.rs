//! The parts that frames have in a row of a tile.

use std::ops::Range;

/// What a row of a tile is made of.
#[derive(Debug, Default)]
pub struct Shares {
    pub list: Vec<Share>,
    pub weights: Vec<f32>,
}

/// A frame's part in the columns `from..to`.
#[derive(Clone, Copy, Debug)]
pub struct Share {
    /// The frame.
    pub frame: usize,
    /// First column.
    pub from: usize,
    /// The column after the last.
    pub to: usize,
    /// 1 at those corners of its cell that are its own, else 0: the upper two, then the lower two.
    pub corners: [f32; 4],
    /// Where its weights begin; none where it is alone.
    pub weights: Option<usize>,
}

impl Shares {
    pub fn clear(&mut self) {
        self.list.clear();
        self.weights.clear();
    }

    /// Makes them the one of a frame that is alone in its columns, if there is one; else none.
    pub fn only(&mut self, frame: Option<usize>, columns: Range<usize>) {
        self.clear();
        if let Some(frame) = frame {
            self.whole(frame, columns.start, columns.end);
        }
    }

    /// Columns that are one frame's.
    pub fn whole(&mut self, frame: usize, from: usize, to: usize) {
        match self.list.last_mut() {
            Some(last) if last.weights.is_none() && last.frame == frame && last.to == from => {
                last.to = to;
            }
            _ => self.list.push(Share {
                frame,
                from,
                to,
                corners: [1.0; 4],
                weights: None,
            }),
        }
    }

    /// The frame that some columns are given to alone, if there is one.
    pub fn alone(&self, columns: &Range<usize>) -> Option<usize> {
        let all = |share: &&Share| {
            share.weights.is_none() && share.from <= columns.start && share.to >= columns.end
        };
        Some(self.list.iter().find(all)?.frame)
    }

    /// All of them, those of one cell together.
    pub fn by_cells(&self) -> impl Iterator<Item = &[Share]> {
        let same = |a: &Share, b: &Share| a.weights.is_some() && a.from == b.from;
        self.list.chunk_by(same)
    }

    /// All of them, each with its weights or none if it is alone.
    pub fn iter(&self) -> impl Iterator<Item = (&Share, Option<&[f32]>)> {
        self.list.iter().map(|share| {
            let weights = share
                .weights
                .map(|start| &self.weights[start..][..share.to - share.from]);
            (share, weights)
        })
    }
}
