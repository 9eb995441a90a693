//! Shares that frames have in a row of a tile.

use std::ops::Range;

/// Shares of frames in a row of a tile.
#[derive(Debug, Default)]
pub struct FrameShares {
    pub list: Vec<FrameShare>,
    pub weights: Vec<f32>,
}

/// Share of a frame in the columns `from..to`.
#[derive(Clone, Copy, Debug)]
pub struct FrameShare {
    /// The frame.
    pub frame: usize,
    /// First column.
    pub from: usize,
    /// The column after the last.
    pub to: usize,
    /// Weights at the corners of its cell, 1 at those that are its own, else 0: the upper two, then
    /// the lower two.
    pub corners: [f32; 4],
    /// Index of its first weight; none where it is alone.
    pub weights: Option<usize>,
}

impl FrameShares {
    pub fn clear(&mut self) {
        self.list.clear();
        self.weights.clear();
    }

    /// Replaces the shares by that of a frame that has its columns alone, if there is one; else by
    /// none.
    pub fn set_sole(&mut self, frame: Option<usize>, columns: Range<usize>) {
        self.clear();
        if let Some(frame) = frame {
            self.add_whole(frame, columns.start, columns.end);
        }
    }

    /// Adds columns that one frame has alone.
    pub fn add_whole(&mut self, frame: usize, from: usize, to: usize) {
        match self.list.last_mut() {
            Some(last) if last.weights.is_none() && last.frame == frame && last.to == from => {
                last.to = to;
            }
            _ => self.list.push(FrameShare {
                frame,
                from,
                to,
                corners: [1.0; 4],
                weights: None,
            }),
        }
    }

    /// Frame that has some columns alone, if there is one.
    pub fn sole_frame(&self, columns: &Range<usize>) -> Option<usize> {
        let all = |share: &&FrameShare| {
            share.weights.is_none() && share.from <= columns.start && share.to >= columns.end
        };
        Some(self.list.iter().find(all)?.frame)
    }

    /// Shares, those of one cell together.
    pub fn by_cells(&self) -> impl Iterator<Item = &[FrameShare]> {
        let same = |a: &FrameShare, b: &FrameShare| a.weights.is_some() && a.from == b.from;
        self.list.chunk_by(same)
    }

    /// Shares, each with its weights, or none if it is alone.
    pub fn iter(&self) -> impl Iterator<Item = (&FrameShare, Option<&[f32]>)> {
        self.list.iter().map(|share| {
            let weights = share
                .weights
                .map(|start| &self.weights[start..][..share.to - share.from]);
            (share, weights)
        })
    }
}
