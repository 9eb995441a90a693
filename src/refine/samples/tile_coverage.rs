//! The wall in stretches along the tunnel, each with the frames that see it.
//!
//! The wall is worked through stretch by stretch, so that memory for samples and frames does not
//! grow with the tunnel's length.

use crate::camera::Camera;
use crate::frames::{FrameCache, FrameError, Pyramid};
use crate::refine::parameters::frame_estimate::FrameEstimate;
use crate::refine::samples::observer_marks::ObserverMarks;
use crate::refine::samples::tile_selection::most_informative;
use crate::refine::samples::visibility::{Exclusions, PosedFrame, Visibility, rows_of};
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{BLOCK, WallGrid};
use crate::surface::Surface;
use rayon::prelude::*;
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

/// Observations of a stretch: enough work for all threads, little enough to hold in memory.
const STRETCH_OBSERVATIONS: f64 = 1e6;
/// Frames of a stretch, apart from those that reach over from its neighbours, or as many as there
/// is room for: at coarse levels so many observations would be more.
const STRETCH_FRAMES: f64 = 256.0;
/// Observations whose visibility is kept from one linearisation to the next; beyond, it is found
/// anew each time.
const KEPT_OBSERVATIONS: usize = 16_000_000;

/// A stretch of the wall that is worked on at once.
#[derive(Clone, Debug)]
struct Stretch {
    /// Rows of tiles.
    rows: Range<i64>,
    /// Compared participants that see some of them.
    frames: Vec<usize>,
}

/// The participants' pictures.
#[derive(Clone, Copy, Debug)]
pub struct FrameImages<'a> {
    /// All frames.
    pub frames: &'a FrameCache,
    /// The frame that is the first participant.
    pub first: usize,
    /// Pyramid level.
    pub level: usize,
}

impl FrameImages<'_> {
    /// The pictures of some participants.
    pub fn of(&self, participants: &[usize]) -> Result<Vec<Arc<Pyramid>>, FrameError> {
        let participants = participants.par_iter();
        participants
            .map(|k| self.frames.get(self.first + k))
            .collect()
    }
}

/// Which frames see which tiles, stretch by stretch.
#[derive(Debug)]
pub struct TileCoverage<'a> {
    surface: &'a dyn Surface,
    grid: WallGrid,
    /// Of the level.
    camera: Camera,
    pictures: FrameImages<'a>,
    hidden: Exclusions<'a>,
    /// Share of the information that the tiles compared hold.
    information: f64,
    /// Where the participants stood when the samples were chosen; None for those that are not
    /// compared.
    placed: Vec<Option<PosedFrame>>,
    stretches: Vec<Stretch>,
    kept: Vec<Option<Visibility>>,
    /// Which observers are left out, stretch by stretch; empty where none is.
    left_out: Vec<ObserverMarks>,
    /// Number of tiles that are compared.
    pub tiles: usize,
    /// Number of tiles there are.
    pub all_tiles: usize,
    /// Participants that see wall in common: pairs in ascending order, each once, a frame with
    /// itself included.
    pub pairs: Vec<(usize, usize)>,
}

impl<'a> TileCoverage<'a> {
    /// Finds the tiles of all participants' frames, and chooses those that hold a share
    /// `information` of what they tell if it is less than 1.
    ///
    /// # Errors
    /// [`FrameError`] of a picture that is needed to choose.
    pub fn new(
        surface: &'a dyn Surface,
        grid: WallGrid,
        camera: Camera,
        pictures: FrameImages<'a>,
        hidden: Exclusions<'a>,
        information: f64,
        placed: Vec<Option<PosedFrame>>,
    ) -> Result<Self, FrameError> {
        let mut coverage = Self {
            stretches: stretches(&grid, &placed, pictures.frames.room()),
            surface,
            grid,
            camera,
            pictures,
            hidden,
            information,
            placed,
            kept: Vec::new(),
            left_out: Vec::new(),
            tiles: 0,
            all_tiles: 0,
            pairs: Vec::new(),
        };
        let mut observations = 0;
        for stretch in 0..coverage.stretches.len() {
            let (visibility, all_tiles) = coverage.find(stretch)?;
            coverage.all_tiles += all_tiles;
            coverage.tiles += visibility.tiles.len();
            let pairs = coverage.pairs_of(stretch, &visibility);
            coverage.pairs.extend(pairs);
            observations += visibility.observers.len();
            let keep = observations <= KEPT_OBSERVATIONS;
            coverage.kept.push(keep.then_some(visibility));
        }
        coverage.pairs.sort_unstable();
        coverage.pairs.dedup();
        Ok(coverage)
    }

    /// Which participants are compared.
    pub fn compared(&self) -> Vec<bool> {
        self.placed.iter().map(Option::is_some).collect()
    }

    /// Number of stretches.
    pub fn len(&self) -> usize {
        self.stretches.len()
    }

    /// The participants whose frames see some of a stretch; a [`Visibility`]'s frames are places in
    /// this list.
    pub fn frames(&self, stretch: usize) -> &[usize] {
        &self.stretches[stretch].frames
    }

    /// The observations of a stretch: those kept, or found anew (the same, from the same poses).
    ///
    /// # Errors
    /// [`FrameError`].
    pub fn visibility(&self, stretch: usize) -> Result<Cow<'_, Visibility>, FrameError> {
        Ok(match &self.kept[stretch] {
            Some(visibility) => Cow::Borrowed(visibility),
            None => {
                let all = self.find(stretch)?.0;
                Cow::Owned(match self.left_out.get(stretch) {
                    Some(marks) => all.without(marks),
                    None => all,
                })
            }
        })
    }

    /// Leaves out the observers that are marked, stretch by stretch.
    pub fn leave_out(&mut self, marks: Vec<ObserverMarks>) {
        for (kept, marks) in self.kept.iter_mut().zip(&marks) {
            if let Some(kept) = kept {
                *kept = kept.without(marks);
            }
        }
        self.left_out = marks;
    }

    /// The observations of a stretch, and the number of tiles they are chosen from.
    fn find(&self, stretch: usize) -> Result<(Visibility, usize), FrameError> {
        let Stretch { rows, frames } = &self.stretches[stretch];
        let placed: Vec<PosedFrame> = frames.iter().filter_map(|k| self.placed[*k]).collect();
        let all = Visibility::find(
            self.surface,
            &self.grid,
            &self.camera,
            self.pictures.frames.shading().as_deref(),
            &self.hidden,
            &placed,
            rows,
        );
        if self.information >= 1.0 {
            let count = all.tiles.len();
            return Ok((all, count));
        }
        let pictures = self.pictures.of(frames)?;
        let views: Vec<SampledFrame> = pictures
            .iter()
            .zip(&placed)
            .map(|(picture, placed)| {
                let picture = picture.level(self.pictures.level);
                let camera = self.camera.sweeping(&placed.sweep);
                SampledFrame::new(picture, camera, &FrameEstimate::at(placed.pose))
            })
            .collect();
        let chosen = most_informative(&all, self.information, &self.grid, self.surface, &views);
        Ok((chosen, all.tiles.len()))
    }

    fn pairs_of(&self, stretch: usize, visibility: &Visibility) -> Vec<(usize, usize)> {
        let frames = self.frames(stretch);
        let mut pairs = Vec::new();
        for block in &visibility.blocks {
            let seen = visibility.frames(block).into_iter().map(|k| frames[k]);
            let seen: Vec<usize> = seen.collect();
            for (n, a) in seen.iter().enumerate() {
                pairs.extend(seen[n..].iter().map(|b| (*a, *b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// Cuts the lattice's rows into stretches of about [`STRETCH_OBSERVATIONS`] or [`STRETCH_FRAMES`].
fn stretches(grid: &WallGrid, placed: &[Option<PosedFrame>], room: usize) -> Vec<Stretch> {
    let most_frames = STRETCH_FRAMES.min(room as f64);
    let rows: Vec<Option<Range<i64>>> = placed
        .iter()
        .map(|frame| frame.as_ref().map(|frame| rows_of(grid, &frame.footprint)))
        .collect();
    let Some(first) = rows.iter().flatten().map(|r| r.start).min() else {
        return Vec::new();
    };
    let last = rows.iter().flatten().map(|r| r.end).max().unwrap_or(first);
    // Whole blocks of rows, so that no block is cut.
    let (first, last) = (first.div_euclid(BLOCK), (last - 1).div_euclid(BLOCK));
    // Shares of a stretch.
    let mut load = vec![0.0; (last - first + 1) as usize];
    let (width, _) = grid.tile_size_m();
    for (frame, rows) in placed.iter().flatten().zip(rows.iter().flatten()) {
        let columns = (frame.footprint.s_max_m - frame.footprint.s_min_m) / width;
        let blocks = rows.start.div_euclid(BLOCK)..(rows.end - 1).div_euclid(BLOCK) + 1;
        let of_frames = 1.0 / (most_frames * (blocks.end - blocks.start) as f64);
        let of_observations = columns * BLOCK as f64 / STRETCH_OBSERVATIONS;
        for row in blocks {
            load[(row - first) as usize] += of_observations.max(of_frames);
        }
    }
    let mut stretches: Vec<Stretch> = Vec::new();
    let (mut start, mut sum) = (first, 0.0);
    for (k, load) in load.iter().enumerate() {
        let end = first + k as i64 + 1;
        sum += load;
        if sum >= 1.0 || end == last + 1 {
            let span = start * BLOCK..end * BLOCK;
            let meets = |rows: &Range<i64>| rows.start < span.end && span.start < rows.end;
            let frames: Vec<usize> = (0..rows.len())
                .filter(|k| rows[*k].as_ref().is_some_and(meets))
                .collect();
            stretches.push(Stretch { rows: span, frames });
            (start, sum) = (end, 0.0);
        }
    }
    stretches
}
