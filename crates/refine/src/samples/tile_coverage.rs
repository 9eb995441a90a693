//! Tile coverage: the wall in stretches along the tunnel, each with the frames that observe it.
//!
//! The wall is processed stretch by stretch, so that memory for samples and frames does not grow
//! with the tunnel's length.

use crate::samples::observer_marks::ObserverMarks;
use crate::samples::tile_candidates::covered_rows;
use crate::samples::visibility::{Exclusions, PosedFrame, Visibility};
use crate::tiles::grid::{BLOCK, WallGrid};
use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;
use tunnelstitch_core::frames::{FrameCache, FrameError, Pyramid};
use tunnelstitch_geometry::camera::Cameras;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::Surface;

/// Observations per stretch of the wall: work for all threads at once, within little memory.
const MAX_STRETCH_OBSERVATIONS: f64 = 1e6;
/// Frames per stretch of the wall, apart from those that reach over from its neighbours: bounds the
/// memory at coarse levels.
const MAX_STRETCH_FRAMES: f64 = 256.0;
/// Observations whose visibility is kept from one linearisation to the next; further ones are
/// computed anew each time. Bounds the memory on long surveys.
const MAX_KEPT_OBSERVATIONS: usize = 6_000_000;

/// A stretch of the wall that is processed at once.
#[derive(Clone, Debug)]
struct Stretch {
    /// Rows of tiles.
    rows: Range<i64>,
    /// Compared participants whose footprints meet these rows.
    frames: Vec<usize>,
}

/// Access to the participants' images.
#[derive(Clone, Copy, Debug)]
pub struct FrameImages<'a> {
    /// All frames.
    pub frames: &'a FrameCache,
    /// Index of the first participant among all frames.
    pub first: usize,
}

impl FrameImages<'_> {
    /// Loads the images of some participants.
    pub fn load(&self, participants: &[usize]) -> Result<Vec<Arc<Pyramid>>, FrameError> {
        let pyramids = participants.par_map(|k| self.frames.get(self.first + k));
        pyramids.into_iter().collect()
    }
}

/// The observations of a window of frames, stretch by stretch.
#[derive(Debug)]
pub struct TileCoverage<'a> {
    surface: Arc<dyn Surface>,
    grid: WallGrid,
    /// The cameras at the pyramid level.
    cameras: Cameras,
    images: FrameImages<'a>,
    exclusions: Exclusions<'a>,
    /// Poses of the participants at which the tiles are selected; None for those that are not
    /// compared.
    posed: Vec<Option<PosedFrame>>,
    stretches: Vec<Stretch>,
    /// Observations of the stretches that are kept in memory.
    kept: Vec<Option<Visibility>>,
    /// Excluded observers, stretch by stretch; empty if there are none.
    excluded: Vec<ObserverMarks>,
    /// Number of tiles.
    pub tiles: usize,
    /// Pairs of participants that observe common tiles, in ascending order, each once, a frame with
    /// itself included.
    pub pairs: Vec<(usize, usize)>,
}

impl<'a> TileCoverage<'a> {
    /// Finds the tiles of all participants.
    pub fn new(
        surface: Arc<dyn Surface>,
        grid: WallGrid,
        cameras: Cameras,
        images: FrameImages<'a>,
        exclusions: Exclusions<'a>,
        posed: Vec<Option<PosedFrame>>,
    ) -> Self {
        let mut coverage = Self {
            stretches: divide_into_stretches(&grid, &posed, images.frames.pyramid_capacity()),
            surface,
            grid,
            cameras,
            images,
            exclusions,
            posed,
            kept: Vec::new(),
            excluded: Vec::new(),
            tiles: 0,
            pairs: Vec::new(),
        };
        let mut observations = 0;
        for stretch in 0..coverage.stretches.len() {
            let visibility = coverage.find(stretch);
            coverage.tiles += visibility.tiles.len();
            let pairs = coverage.pairs_of(stretch, &visibility);
            coverage.pairs.extend(pairs);
            observations += visibility.observers.len();
            let keep = observations <= MAX_KEPT_OBSERVATIONS;
            coverage.kept.push(keep.then_some(visibility));
        }
        coverage.pairs.sort_unstable();
        coverage.pairs.dedup();
        coverage
    }

    /// True for the participants that are compared.
    pub fn compared(&self) -> Vec<bool> {
        self.posed.iter().map(Option::is_some).collect()
    }

    /// Number of stretches.
    pub fn len(&self) -> usize {
        self.stretches.len()
    }

    /// The participants that may observe a stretch; the frames of its [`Visibility`] are indices
    /// into this list.
    pub fn frames(&self, stretch: usize) -> &[usize] {
        &self.stretches[stretch].frames
    }

    /// The observations of a stretch: those kept in memory, or computed anew from the same poses.
    pub fn visibility(&self, stretch: usize) -> Cow<'_, Visibility> {
        match &self.kept[stretch] {
            Some(visibility) => Cow::Borrowed(visibility),
            None => {
                let all = self.find(stretch);
                Cow::Owned(match self.excluded.get(stretch) {
                    Some(marks) => all.exclude(marks),
                    None => all,
                })
            }
        }
    }

    /// Excludes the marked observers, stretch by stretch.
    pub fn exclude(&mut self, marks: Vec<ObserverMarks>) {
        for (kept, marks) in self.kept.iter_mut().zip(&marks) {
            if let Some(kept) = kept {
                *kept = kept.exclude(marks);
            }
        }
        self.excluded = marks;
    }

    /// Gives back the memory of all observations; they are computed anew if they are needed.
    pub fn release(&mut self) {
        self.kept.fill(None);
    }

    /// Computes the observations of a stretch.
    fn find(&self, stretch: usize) -> Visibility {
        let Stretch { rows, frames } = &self.stretches[stretch];
        let posed: Vec<PosedFrame> = frames.iter().filter_map(|k| self.posed[*k]).collect();
        Visibility::find(
            self.surface.as_ref(),
            &self.grid,
            &self.cameras,
            self.images.frames.camera_light().as_deref(),
            &self.exclusions,
            &posed,
            rows,
        )
    }

    /// Pairs of participants that observe common blocks of a stretch.
    fn pairs_of(&self, stretch: usize, visibility: &Visibility) -> Vec<(usize, usize)> {
        let frames = self.frames(stretch);
        let mut pairs = Vec::new();
        for block in &visibility.blocks {
            let observers = visibility.frames(block).into_iter().map(|k| frames[k]);
            let observers: Vec<usize> = observers.collect();
            for (n, a) in observers.iter().enumerate() {
                pairs.extend(observers[n..].iter().map(|b| (*a, *b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        pairs
    }
}

/// Divides the lattice's rows into stretches of about [`MAX_STRETCH_OBSERVATIONS`] or
/// [`MAX_STRETCH_FRAMES`] (at most `room`, the frames that fit into memory).
fn divide_into_stretches(
    grid: &WallGrid,
    posed: &[Option<PosedFrame>],
    room: usize,
) -> Vec<Stretch> {
    let max_frames = MAX_STRETCH_FRAMES.min(room as f64);
    let rows: Vec<Option<Range<i64>>> = posed
        .iter()
        .map(|frame| {
            frame
                .as_ref()
                .map(|frame| covered_rows(grid, &frame.footprint))
        })
        .collect();
    let Some(first) = rows.iter().flatten().map(|r| r.start).min() else {
        return Vec::new();
    };
    let last = rows.iter().flatten().map(|r| r.end).max().unwrap_or(first);
    // Whole blocks of rows, so that no block is divided.
    let (first, last) = (first.div_euclid(BLOCK), (last - 1).div_euclid(BLOCK));
    // Load of each row of blocks, as a share of a stretch.
    let mut load = vec![0.0; (last - first + 1) as usize];
    let (width, _) = grid.tile_size_m();
    for (frame, rows) in posed.iter().flatten().zip(rows.iter().flatten()) {
        let columns = (frame.footprint.s_max_m - frame.footprint.s_min_m) / width;
        let blocks = rows.start.div_euclid(BLOCK)..(rows.end - 1).div_euclid(BLOCK) + 1;
        let of_frames = 1.0 / (max_frames * (blocks.end - blocks.start) as f64);
        let of_observations = columns * BLOCK as f64 / MAX_STRETCH_OBSERVATIONS;
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
