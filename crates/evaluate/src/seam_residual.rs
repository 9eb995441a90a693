//! Seam residual: photometric consistency of overlapping frames, without truth.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use tunnelstitch_geometry::surface::Surface;
use tunnelstitch_render::{
    Canvas, EDGE, Interpolation, Kernel, PictureCache, Placement, Tile, tiles,
};

/// Grey-level differences between frames at common wall points.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct SeamResidual {
    /// Root mean square difference of two frames at a wall point, grey levels.
    pub rms_grey: f64,
    /// Number of wall points that at least two frames see.
    pub points: usize,
    /// Mean number of frames that see such a point.
    pub frames_per_point: f64,
}

/// Maximum number of sampled wall points, approximately.
const MAX_POINTS: usize = 300_000;

/// Border of a frame that is not sampled, pixels from the outermost pixel centres.
const MARGIN_PX: f64 = 1.0;

/// Maximum cells of the map around the section: half an hour of clock position each.
const MAX_CELLS_AROUND: u32 = 24;
/// Maximum cells of the map along the axis.
const MAX_CELLS_ALONG: u32 = 480;
/// Minimum rows of points in a cell.
const MIN_ROWS_PER_CELL: u32 = 4;

/// Map of the seam residual and of the number of frames over the unrolled wall.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct SeamMap {
    around: usize,
    along: usize,
    chainage_m: [f64; 2],
    /// Sums of the cells, one row per stretch of the axis, from θ = 0 on.
    cells: Vec<CellSums>,
}

impl SeamMap {
    /// Compares placed frames on the wall of `canvas`.
    ///
    /// At each point x of a square grid on the wall, the mean square difference over the pairs of
    /// the n frames that see it is `2/(n−1) Σ (I_i(x) − Ī(x))²`; the residual of a part of the wall
    /// is the root of its mean over the points with n ≥ 2. With true poses, noise, illumination and
    /// interpolation remain.
    ///
    /// `frames` (those in memory) and `placements` are in the same order; images are sampled
    /// bilinearly, as luma of colour.
    pub fn new(
        surface: &dyn Surface,
        frames: &PictureCache,
        placements: &[Placement],
        canvas: &Canvas,
    ) -> Self {
        let grid = canvas.coarser(MAX_POINTS);
        let around = MAX_CELLS_AROUND.min(grid.columns);
        let along = grid
            .rows
            .div_ceil(MIN_ROWS_PER_CELL)
            .clamp(1, MAX_CELLS_ALONG);
        let bands = tiles(surface, &grid, placements, EDGE);
        // Collected before they are added: the sum does not depend on the threads.
        let parts: Vec<BTreeMap<usize, CellSums>> = bands
            .par_iter()
            .flatten()
            .map(|tile| {
                let seen = sample_frames(surface, frames, placements, &grid, tile);
                let mut cells: BTreeMap<usize, CellSums> = BTreeMap::new();
                for (k, seen) in (0..).zip(&seen) {
                    let (row, column) =
                        (tile.row + k / tile.columns, tile.column + k % tile.columns);
                    let cell = |at: u32, of: u32, cells: u32| {
                        (u64::from(at) * u64::from(cells) / u64::from(of)) as usize
                    };
                    let (row, column) = (
                        cell(row, grid.rows, along),
                        cell(column, grid.columns, around),
                    );
                    let at = row * around as usize + column;
                    cells.entry(at).or_default().add(seen);
                }
                cells
            })
            .collect();
        let mut cells = vec![CellSums::default(); (along * around) as usize];
        for (cell, sums) in parts.into_iter().flatten() {
            cells[cell].merge(&sums);
        }
        Self {
            around: around as usize,
            along: along as usize,
            chainage_m: grid.chainage_m(),
            cells,
        }
    }

    /// Residual over the whole wall; `None` if no two frames overlap.
    pub fn residual(&self) -> Option<SeamResidual> {
        let mut total = CellSums::default();
        for cell in &self.cells {
            total.merge(cell);
        }
        let points = total.points as f64;
        Some(SeamResidual {
            rms_grey: total.rms_grey()?,
            points: total.points,
            frames_per_point: total.frames / points,
        })
    }

    /// Number of cells around the section and along the axis.
    pub fn size(&self) -> [usize; 2] {
        [self.around, self.along]
    }

    /// Chainage of the start of the first cell and of the end of the last, metres.
    pub fn chainage_m(&self) -> [f64; 2] {
        self.chainage_m
    }

    /// Root mean square difference of two frames in each cell, grey levels; `None` where no two
    /// overlap. A row per stretch of the axis, from θ = 0 on.
    pub fn rms_grey(&self) -> Vec<Option<f64>> {
        self.cells.iter().map(CellSums::rms_grey).collect()
    }

    /// Mean number of frames that see a point, of each cell.
    pub fn frames(&self) -> Vec<f64> {
        let mean = |cell: &CellSums| cell.observations / cell.all.max(1) as f64;
        self.cells.iter().map(mean).collect()
    }
}

/// Computes the seam residual of placed frames on the wall of `canvas` ([`SeamMap::new`]).
///
/// `None` if no two frames overlap.
pub fn seam_residual(
    surface: &dyn Surface,
    frames: &PictureCache,
    placements: &[Placement],
    canvas: &Canvas,
) -> Option<SeamResidual> {
    SeamMap::new(surface, frames, placements, canvas).residual()
}

/// Samples all frames at the points of a tile.
fn sample_frames(
    surface: &dyn Surface,
    frames: &PictureCache,
    placements: &[Placement],
    grid: &Canvas,
    tile: &Tile,
) -> Vec<RunningVariance> {
    let bilinear = Kernel::new(Interpolation::Bilinear, 1.0);
    let points = tile.points(surface, grid);
    let mut seen = vec![RunningVariance::default(); points.len()];
    for frame in &tile.frames {
        let Some(picture) = frames.picture(*frame) else {
            continue;
        };
        let pose = &placements[*frame].pose;
        let camera = placements[*frame].camera(frames.cameras().of(*frame));
        for (x_w, seen) in points.iter().zip(&mut seen) {
            let pixel = camera
                .project(&pose.to_camera(x_w))
                .filter(|pixel| camera.is_in_image(pixel, MARGIN_PX));
            if let Some(pixel) = pixel
                && picture.shows(pixel.x as f32, pixel.y as f32, &bilinear)
            {
                seen.add(f64::from(picture.grey(&pixel, &bilinear)));
            }
        }
    }
    seen
}

/// Running count, mean and sum of squares about the mean (Welford's algorithm).
#[derive(Clone, Copy, Default)]
struct RunningVariance {
    count: f64,
    mean: f64,
    squares: f64,
}

impl RunningVariance {
    fn add(&mut self, value: f64) {
        self.count += 1.0;
        let delta = value - self.mean;
        self.mean += delta / self.count;
        self.squares += delta * (value - self.mean);
    }
}

/// Sums over the points of a part of the wall.
#[derive(Clone, Copy, Debug, Default)]
struct CellSums {
    /// Sum of the mean square differences.
    squares: f64,
    /// Number of points that at least two frames see.
    points: usize,
    /// Number of observations of those points.
    frames: f64,
    /// Number of all points.
    all: usize,
    /// Number of observations of all points.
    observations: f64,
}

impl CellSums {
    fn add(&mut self, seen: &RunningVariance) {
        self.all += 1;
        self.observations += seen.count;
        if seen.count >= 2.0 {
            self.squares += 2.0 * seen.squares / (seen.count - 1.0);
            self.points += 1;
            self.frames += seen.count;
        }
    }

    fn merge(&mut self, other: &Self) {
        self.squares += other.squares;
        self.points += other.points;
        self.frames += other.frames;
        self.all += other.all;
        self.observations += other.observations;
    }

    fn rms_grey(&self) -> Option<f64> {
        (self.points > 0).then(|| (self.squares / self.points as f64).sqrt())
    }
}

#[cfg(test)]
mod tests {
    use super::super::test_pictures::pictures;
    use super::*;
    use tunnelstitch_core::test_wall::{TestWall, waves};
    use tunnelstitch_geometry::trajectory::Shutter;
    use tunnelstitch_render::{Picture, place_frames};

    #[test]
    fn true_poses_leave_rounding_noise_and_wrong_ones_much_more() {
        let wall = TestWall::ring(waves);
        let stack = pictures(&wall);
        let residual = |poses: &[tunnelstitch_geometry::trajectory::Pose]| {
            let placements =
                place_frames(&wall.circle, wall.camera, poses, &Shutter::default()).unwrap();
            let canvas = Canvas::of_placements(&wall.circle, &placements, 60.0).unwrap();
            seam_residual(&wall.circle, &stack, &placements, &canvas).unwrap()
        };
        let truth = residual(&wall.poses);
        assert!(truth.rms_grey < 0.6, "{truth:?}");
        assert!(truth.frames_per_point >= 2.0 && truth.points > 10_000);
        let mut wrong = wall.poses.clone();
        wrong[4].t_wc.y += 0.05;
        assert!(residual(&wrong).rms_grey > 3.0 * truth.rms_grey);
    }

    #[test]
    fn two_flat_frames_differ_by_their_difference() {
        let wall = TestWall::one(waves);
        let (w, h) = (wall.camera.width as usize, wall.camera.height as usize);
        let flat = |value| Picture::new(w, h, 1, vec![value; w * h]);
        let poses = vec![wall.poses[0]; 3];
        let placements =
            place_frames(&wall.circle, wall.camera, &poses, &Shutter::default()).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, 60.0).unwrap();
        let of = |values: &[u8]| {
            let pictures: Vec<Picture> = values.iter().map(|value| flat(*value)).collect();
            let stack = PictureCache::from_pictures(wall.camera, pictures);
            seam_residual(&wall.circle, &stack, &placements[..values.len()], &canvas)
        };
        assert!((of(&[100, 106]).unwrap().rms_grey - 6.0).abs() < 1e-4);
        // Pairs: 6, 6, 0.
        let three = of(&[100, 106, 106]).unwrap();
        assert!((three.rms_grey - 24f64.sqrt()).abs() < 1e-4);
        assert_eq!(three.frames_per_point, 3.0);
        assert_eq!(of(&[100]), None);
    }

    /// The map locates the one wrong frame, and is empty where no frame sees the wall.
    #[test]
    fn the_map_shows_where_frames_disagree() {
        let wall = TestWall::ring(waves);
        let mut wrong = wall.poses.clone();
        wrong[4].t_wc.y += 0.05;
        let placements =
            place_frames(&wall.circle, wall.camera, &wrong, &Shutter::default()).unwrap();
        let canvas = Canvas::of_placements(&wall.circle, &placements, 60.0).unwrap();
        let map = SeamMap::new(&wall.circle, &pictures(&wall), &placements, &canvas);
        let [around, along] = map.size();
        let (residuals, frames) = (map.rms_grey(), map.frames());
        assert_eq!(
            (residuals.len(), frames.len()),
            (around * along, around * along)
        );
        assert_eq!(map.chainage_m(), canvas.chainage_m());
        let column = |s_m: f64| {
            let share = (s_m / wall.circle.perimeter_m()).rem_euclid(1.0);
            (share * around as f64) as usize
        };
        let middle_of = |frame: usize| {
            let footprint = &placements[frame].footprint;
            column(0.5 * (footprint.s_min_m + footprint.s_max_m))
        };
        let mean = |column: usize| {
            let values: Vec<f64> = (0..along)
                .filter_map(|row| residuals[row * around + column])
                .collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        let far = (middle_of(4) + around / 2) % around;
        assert!(mean(middle_of(4)) > 3.0 * mean(far));
        assert!(frames.iter().any(|n| *n >= 2.0));
        for (residual, frames) in residuals.iter().zip(&frames) {
            assert!(residual.is_none() || *frames > 0.0);
        }
    }
}
