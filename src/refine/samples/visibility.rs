//! Which frames see which tiles of the wall.

use crate::camera::{Camera, Sweep};
use crate::frames::{HalvedMask, Shading};
use crate::refine::samples::observer_marks::ObserverMarks;
use crate::refine::tiles::frame_samples::SampledFrame;
use crate::refine::tiles::grid::{BLOCK, SIDE, TileId, WallGrid};
use crate::refine::tiles::tile::TileObservation;
use crate::surface::{Footprint, Patches, Surface};
use crate::trajectory::Pose;
use nalgebra::{Vector2, Vector3};
use rayon::prelude::*;
use std::collections::HashSet;
use std::ops::Range;

/// Pixels that a tile must stay away from the frame's border and from what is masked: room for the
/// steps to come.
const MARGIN_PX: f64 = 1.0;

/// Area of a tile between its outermost samples, in samples.
const SAMPLES_BETWEEN_CORNERS: f64 = ((SIDE - 1) * (SIDE - 1)) as f64;

/// Least area of a sample in a frame over that where the lattice was made for: a tile seen more
/// obliquely, or from farther away, is left out.
const LEAST_PIXELS: f64 = 0.05;

/// A frame that sees all of a tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Observer {
    /// The frame, counted among those of the [`Visibility`].
    pub frame: u32,
    /// Pixels that a sample of the tile stands for in this frame, q: the weight that makes every
    /// pixel count once, however obliquely it sees the wall. It stays as it is while the poses
    /// move; otherwise a step could lower the cost by looking at the wall more obliquely.
    pub pixels: f32,
    /// The camera's shading V at the tile's middle; it stays as it is, too.
    pub shade: f32,
}

impl Observer {
    /// As the work on its tile wants it; `views` are those of the [`Visibility`]'s frames.
    #[inline(always)]
    pub fn seen<'v>(&self, views: &'v [SampledFrame<'v>]) -> TileObservation<'v> {
        TileObservation {
            view: &views[self.frame as usize],
            pixels: self.pixels,
            shade: self.shade,
        }
    }
}

/// A tile and the frames that see all of it.
#[derive(Clone, Debug)]
pub struct Tile {
    /// Which tile.
    pub id: TileId,
    /// Where its observers stand in [`Visibility::observers`].
    pub observers: Range<usize>,
}

/// A frame as it is placed when the samples are chosen.
#[derive(Clone, Copy, Debug)]
pub struct PosedFrame {
    /// Its pose.
    pub pose: Pose,
    /// Its motion while the rows are read.
    pub sweep: Sweep,
    /// What it sees of the wall.
    pub footprint: Footprint,
    /// True if it is to be estimated.
    pub active: bool,
}

/// What of the wall and of the frames is not compared.
#[derive(Clone, Debug)]
pub struct Exclusions<'a> {
    /// Parts of the wall.
    pub ignored: &'a Patches,
    /// Which pixels show the wall, at the frames' level; all if there is none.
    pub mask: Option<HalvedMask>,
}

#[cfg(test)]
impl Exclusions<'_> {
    /// Nothing.
    pub const NOTHING: Exclusions<'static> = Exclusions {
        ignored: &Patches::NONE,
        mask: None,
    };
}

/// The observations of a set of frames: every tile that at least two frames see, one of them
/// active.
///
/// A frame either sees a whole tile (with the ring its gradients need) or does not count there at
/// all: every sample of a tile averages the same frames, and the set stays the same while the poses
/// move, so that costs before and after a step are of the same points.
#[derive(Clone, Debug, Default)]
pub struct Visibility {
    /// Tiles, block by block.
    pub tiles: Vec<Tile>,
    /// Observers, ascending by frame within a tile.
    pub observers: Vec<Observer>,
    /// Runs of tiles of one block: the units of parallel work.
    pub blocks: Vec<Range<usize>>,
    /// What [`Visibility::without`] has taken out: tiles and frames.
    left_out: HashSet<(TileId, u32)>,
}

impl Visibility {
    /// Finds the tiles in `rows` of the lattice that the frames `placed` see.
    pub fn find(
        surface: &dyn Surface,
        grid: &WallGrid,
        camera: &Camera,
        shading: Option<&Shading>,
        hidden: &Exclusions,
        placed: &[PosedFrame],
        rows: &Range<i64>,
    ) -> Self {
        let cells = Cells::over(grid, rows);
        let fields: Vec<Field> = placed
            .iter()
            .map(|frame| Field::of(grid, &frame.footprint, rows))
            .collect();
        let corners = cells.corners(surface, &fields, hidden.ignored);
        let seen: Vec<Vec<(usize, Observer)>> = placed
            .par_iter()
            .zip(&fields)
            .enumerate()
            .map(|(k, (frame, field))| {
                let camera = &camera.sweeping(&frame.sweep);
                let mut tiles = Vec::new();
                let mask = hidden.mask.as_ref();
                for tile in cells.of(field) {
                    let Some(corners) = &corners[tile] else {
                        continue;
                    };
                    if let Some(seen) = project_tile(grid, camera, mask, &frame.pose, corners) {
                        tiles.push((tile, seen.observer(k, camera, shading)));
                    }
                }
                tiles
            })
            .collect();
        // Sorted by counting; the frames come in order.
        let mut starts = vec![0; cells.count() + 1];
        for (tile, _) in seen.iter().flatten() {
            starts[tile + 1] += 1;
        }
        for tile in 0..cells.count() {
            starts[tile + 1] += starts[tile];
        }
        let nobody = Observer {
            frame: 0,
            pixels: 0.0,
            shade: 1.0,
        };
        let (mut sorted, mut next) = (vec![nobody; starts[cells.count()]], starts.clone());
        for (tile, observer) in seen.iter().flatten() {
            sorted[next[*tile]] = *observer;
            next[*tile] += 1;
        }

        let mut visibility = Self::default();
        for tile in 0..cells.count() {
            let group = &sorted[starts[tile]..starts[tile + 1]];
            if group.len() < 2 || !group.iter().any(|o| placed[o.frame as usize].active) {
                continue;
            }
            visibility.push(cells.id(tile), group.iter().copied());
        }
        visibility.find_blocks();
        visibility
    }

    /// Adds a tile; the blocks are found when all are there.
    fn push(&mut self, id: TileId, observers: impl Iterator<Item = Observer>) {
        let start = self.observers.len();
        self.observers.extend(observers);
        self.tiles.push(Tile {
            id,
            observers: start..self.observers.len(),
        });
    }

    fn find_blocks(&mut self) {
        let mut start = 0;
        for run in self.tiles.chunk_by(|a, b| a.id.block() == b.id.block()) {
            self.blocks.push(start..start + run.len());
            start += run.len();
        }
    }

    /// Nothing but the tiles `kept`, which are given block by block, ascending.
    pub fn only(&self, kept: &[Vec<usize>]) -> Self {
        let mut visibility = Self::default();
        for tile in kept.iter().flatten().map(|k| &self.tiles[*k]) {
            visibility.push(tile.id, self.observers(tile).iter().copied());
        }
        visibility.find_blocks();
        visibility
    }

    /// Without the observers that are marked, and the tiles of which fewer than two are left.
    pub fn without(&self, marks: &ObserverMarks) -> Self {
        let mut visibility = Self::default();
        for tile in &self.tiles {
            let marked = tile.observers.clone().filter(|k| marks.has(*k));
            let frames = marked.map(|k| (tile.id, self.observers[k].frame));
            visibility.left_out.extend(frames);
            let left = tile.observers.clone().filter(|k| !marks.has(*k));
            if left.clone().nth(1).is_some() {
                visibility.push(tile.id, left.map(|k| self.observers[k]));
            }
        }
        visibility.find_blocks();
        visibility
    }

    /// The frames that see some tile of a run, ascending.
    pub fn frames(&self, tiles: &Range<usize>) -> Vec<usize> {
        let tiles = self.tiles[tiles.clone()].iter();
        let observers = tiles.flat_map(|tile| self.observers(tile));
        let mut frames: Vec<usize> = observers.map(|o| o.frame as usize).collect();
        frames.sort_unstable();
        frames.dedup();
        frames
    }

    /// The tile of that name with its place in [`Visibility::tiles`], if it is among these.
    pub fn tile(&self, id: TileId) -> Option<(usize, &Tile)> {
        let of = |block: &Range<usize>| self.tiles[block.start].id.block();
        let block = self.blocks.partition_point(|block| of(block) < id.block());
        let block = self.blocks.get(block)?.clone();
        let tiles = &self.tiles[block.clone()];
        let place = (id.row, id.column);
        let found = tiles.binary_search_by_key(&place, |tile| (tile.id.row, tile.id.column));
        found.ok().map(|k| (block.start + k, &tiles[k]))
    }

    /// True if a frame sees a tile but does not show the wall there.
    pub fn leaves_out(&self, tile: TileId, frame: usize) -> bool {
        self.left_out.contains(&(tile, frame as u32))
    }

    /// The frames that see `tile`.
    pub fn observers(&self, tile: &Tile) -> &[Observer] {
        &self.observers[tile.observers.clone()]
    }
}

/// Rows of tiles that a footprint reaches.
pub fn rows_of(grid: &WallGrid, footprint: &Footprint) -> Range<i64> {
    let (_, height) = grid.tile_size_m();
    (footprint.h_min_m / height).floor() as i64..(footprint.h_max_m / height).floor() as i64 + 1
}

/// All tiles in some rows of the lattice, numbered block by block: neighbours in order are
/// neighbours on the wall.
struct Cells<'g> {
    grid: &'g WallGrid,
    /// First row of blocks.
    first: i64,
    /// Rows and columns of blocks.
    rows: i64,
    columns: i64,
}

/// Tiles in a block.
const CELLS: i64 = BLOCK * BLOCK;

impl<'g> Cells<'g> {
    fn over(grid: &'g WallGrid, rows: &Range<i64>) -> Self {
        let first = rows.start.div_euclid(BLOCK);
        Self {
            grid,
            first,
            rows: (rows.end - 1).div_euclid(BLOCK) + 1 - first,
            columns: (grid.columns - 1) / BLOCK + 1,
        }
    }

    fn count(&self) -> usize {
        (self.rows * self.columns * CELLS) as usize
    }

    fn place(&self, tile: TileId) -> usize {
        let (row, column) = tile.block();
        let block = (row - self.first) * self.columns + column;
        let (row, column) = (tile.row.rem_euclid(BLOCK), tile.column.rem_euclid(BLOCK));
        (block * CELLS + row * BLOCK + column) as usize
    }

    fn id(&self, place: usize) -> TileId {
        let (block, within) = (place as i64 / CELLS, place as i64 % CELLS);
        TileId {
            column: block % self.columns * BLOCK + within % BLOCK,
            row: (self.first + block / self.columns) * BLOCK + within / BLOCK,
        }
    }

    /// The places of a field's tiles.
    fn of(&self, field: &Field) -> impl Iterator<Item = usize> {
        let columns = field.columns.clone();
        field.rows.clone().flat_map(move |row| {
            columns.clone().map(move |column| {
                let column = column.rem_euclid(self.grid.columns);
                self.place(TileId { column, row })
            })
        })
    }

    /// The corners of all tiles that some frame may see, ring included, row by row; each is
    /// computed once for all frames. None for tiles with wall that is ignored.
    fn corners(
        &self,
        surface: &dyn Surface,
        fields: &[Field],
        ignored: &Patches,
    ) -> Vec<Option<[Vector3<f64>; 4]>> {
        let mut wanted = vec![false; self.count()];
        for tile in fields.iter().flat_map(|field| self.of(field)) {
            wanted[tile] = true;
        }
        let corners = wanted
            .par_iter()
            .enumerate()
            .map_init(Vec::new, |scratch, (k, wanted)| {
                if !*wanted || ignored.meet(&self.grid.area(self.id(k))) {
                    return None;
                }
                self.grid.corners(surface, self.id(k), scratch);
                match scratch[..] {
                    [a, b, c, d] => Some([a, b, c, d]),
                    _ => None,
                }
            });
        corners.collect()
    }
}

/// The rows and columns of tiles that a frame may see; columns may go on around the section.
struct Field {
    rows: Range<i64>,
    columns: Range<i64>,
}

impl Field {
    fn of(grid: &WallGrid, footprint: &Footprint, rows: &Range<i64>) -> Self {
        let (width, _) = grid.tile_size_m();
        let first = (footprint.s_min_m / width).floor() as i64;
        let last = (footprint.s_max_m / width).floor() as i64;
        let own = rows_of(grid, footprint);
        Self {
            rows: own.start.max(rows.start)..own.end.min(rows.end),
            columns: first..(last + 1).min(first + grid.columns),
        }
    }
}

/// A tile as a frame sees it.
struct TileProjection {
    /// Where its middle appears.
    middle: Vector2<f64>,
    /// See [`Observer::pixels`].
    pixels: f64,
}

/// The tile with these corners as a frame at `pose` sees it, if it sees all of it.
fn project_tile(
    grid: &WallGrid,
    camera: &Camera,
    mask: Option<&HalvedMask>,
    pose: &Pose,
    corners: &[Vector3<f64>; 4],
) -> Option<TileProjection> {
    let pixel = |x_w: &Vector3<f64>| {
        camera
            .project(&pose.to_camera(x_w))
            .filter(|pixel| camera.sees(pixel, MARGIN_PX))
    };
    let (a, b) = (pixel(&corners[0])?, pixel(&corners[1])?);
    let (c, d) = (pixel(&corners[2])?, pixel(&corners[3])?);
    // Half the cross product of the diagonals; the corners come row by row.
    let area = 0.5 * (d - a).perp(&(c - b)).abs();
    let pixels = area / SAMPLES_BETWEEN_CORNERS;
    if pixels < LEAST_PIXELS * grid.density.powi(-2) {
        return None;
    }
    let middle = 0.25 * (a + b + c + d);
    if let Some(mask) = mask {
        let off = [a, b, c, d].map(|corner| (corner - middle).amax());
        let reach = off
            .iter()
            .fold(MARGIN_PX, |most, off| most.max(off + MARGIN_PX));
        if !mask.is_clear(middle.x as f32, middle.y as f32, reach as f32) {
            return None;
        }
    }
    Some(TileProjection { middle, pixels })
}

impl TileProjection {
    /// Frame `frame` as the observer of the tile.
    fn observer(&self, frame: usize, camera: &Camera, shading: Option<&Shading>) -> Observer {
        let shade = shading.map_or(1.0, |shading| shading.at_level(&self.middle, camera));
        Observer {
            frame: frame as u32,
            pixels: self.pixels as f32,
            shade: shade as f32,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refine::test_scene::placed_spiral;

    #[test]
    fn every_tile_is_seen_by_an_active_frame_and_another() {
        let (circle, camera, grid, mut placed) = placed_spiral(24);
        let active = 20..24;
        for (k, frame) in placed.iter_mut().enumerate() {
            frame.active = active.contains(&k);
        }
        let everywhere = -1000..1000;
        let found = Visibility::find(
            &circle,
            &grid,
            &camera,
            None,
            &Exclusions::NOTHING,
            &placed,
            &everywhere,
        );
        assert!(!found.tiles.is_empty());
        for tile in &found.tiles {
            let observers = found.observers(tile);
            assert!(observers.len() >= 2);
            assert!(
                observers
                    .windows(2)
                    .all(|pair| pair[0].frame < pair[1].frame)
            );
            // At about the distance the grid was made for, a sample is about a pixel.
            assert!(observers.iter().all(|o| (0.4..2.0).contains(&o.pixels)));
            assert!(
                observers
                    .iter()
                    .any(|o| active.contains(&(o.frame as usize)))
            );
        }
        let tiles: usize = found.blocks.iter().map(|block| block.len()).sum();
        assert_eq!(tiles, found.tiles.len());
    }

    /// Every tile is found by its name, and who was left out of it is known.
    #[test]
    fn tiles_are_found_by_name_and_what_is_left_out_is_known() {
        let (circle, camera, grid, placed) = placed_spiral(6);
        let hidden = Exclusions::NOTHING;
        let rows = -1000..1000;
        let all = Visibility::find(&circle, &grid, &camera, None, &hidden, &placed, &rows);
        for (k, tile) in all.tiles.iter().enumerate() {
            assert_eq!(all.tile(tile.id).map(|(found, _)| found), Some(k));
        }
        let nowhere = TileId {
            column: 0,
            row: 900,
        };
        assert!(all.tile(nowhere).is_none());
        let (tile, first) = (&all.tiles[17], all.tiles[17].observers.start);
        let mut marks = ObserverMarks::none(all.observers.len());
        marks.set(first);
        let without = all.without(&marks);
        let frames = all.observers(tile).iter().map(|o| o.frame as usize);
        for (n, frame) in frames.enumerate() {
            assert_eq!(without.leaves_out(tile.id, frame), n == 0);
            assert!(!without.leaves_out(all.tiles[18].id, frame));
        }
    }

    /// Looked at in pieces, the wall has the same tiles.
    #[test]
    fn pieces_make_up_the_whole() {
        let (circle, camera, grid, placed) = placed_spiral(12);
        let find = |rows| {
            Visibility::find(
                &circle,
                &grid,
                &camera,
                None,
                &Exclusions::NOTHING,
                &placed,
                &rows,
            )
        };
        let (all, below, above) = (find(-100..100), find(-100..0), find(0..100));
        assert_eq!(all.observers, [below.observers, above.observers].concat());
    }
}
