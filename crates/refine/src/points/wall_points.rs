//! Points of a file, thinned to some for every cell of the wall.

use crate::thresholds::wall_points::{MAX_OFF_WALL_SHARE, MAX_POINTS_PER_CELL};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::collections::BTreeMap;
use std::path::Path;
use tunnelstitch_core::points::{PointsError, read_points};
use tunnelstitch_core::survey::{Survey, SurveyError};
use tunnelstitch_geometry::files::printed;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{Surface, from_axis};
use tunnelstitch_geometry::trajectory::Pose;

/// Cells around the section: those of the finest lattice of the wall's shape.
const COLUMNS: f64 = 64.0;
/// Points whose places are found at once.
const BATCH: usize = 1 << 16;
/// Points of these that a thread takes at once.
const PART: usize = 1 << 10;

/// Measured points of a wall, in the frame of the tunnel.
#[derive(Clone, Debug)]
pub struct WallPoints {
    /// The file, as given.
    pub file: String,
    /// Points near the wall, metres, cell by cell.
    pub cells: Vec<Vec<Vector3<f64>>>,
    /// Points of the file.
    pub read: u64,
    /// Of these, points outside the chainages that frames can see.
    pub beyond: u64,
    /// Points that are too far from the nominal wall to be of it.
    pub off_wall: u64,
    /// Points that were left out because there are enough beside them.
    pub thinned: u64,
}

/// Points of a cell of the wall.
#[derive(Default)]
struct Cell {
    /// Number of points so far.
    seen: u64,
    /// Those that are kept.
    kept: Vec<Vector3<f64>>,
}

/// The cell of a point, or the reason for which it has none.
enum CellOf {
    /// Row along the tunnel and column around it.
    Cell(i64, u32),
    Beyond,
    OffWall,
}

/// Sorts points into the cells of a wall.
struct Thinning<'s> {
    surface: &'s dyn Surface,
    range_h_m: [f64; 2],
    cells: BTreeMap<(i64, u32), Cell>,
    rng: ChaCha8Rng,
    points: WallPoints,
}

impl WallPoints {
    /// Reads the points that a survey names (`tunnel.points`), as far as they are of wall that its
    /// frames may see; None if it names none.
    ///
    /// # Errors
    /// [`SurveyError::Points`]; a tunnel's frame that cannot be read any more.
    pub fn of_survey(survey: &Survey) -> Result<Option<Self>, SurveyError> {
        let Some(file) = &survey.file.tunnel.points else {
            return Ok(None);
        };
        let surface = survey.nominal.as_ref();
        let initial = survey.initial.iter();
        let h_m = initial.map(|stamped| surface.chainage_m(&stamped.pose.t_wc));
        let [from, to] = h_m.fold([f64::INFINITY, f64::NEG_INFINITY], |[from, to], h_m| {
            [from.min(h_m), to.max(h_m)]
        });
        let reach_m = surface.perimeter_m();
        let points = Self::read(
            &survey.folder.join(file),
            survey.tunnel_in_world()?.as_ref(),
            surface,
            [from - reach_m, to + reach_m],
        )?;
        Ok(Some(Self {
            file: printed(file).to_string(),
            ..points
        }))
    }

    /// Reads a file of points ([`read_points`]) in the world of the poses.
    ///
    /// `tunnel_in_world`: the tunnel's frame there; None if it is the world. `surface`: the wall as
    /// planned; `range_h_m`: chainages between which points are kept, metres. Of a cell with more
    /// than `MAX_POINTS_PER_CELL` points, a random choice is kept: always the same.
    ///
    /// # Errors
    /// [`PointsError`].
    pub fn read(
        path: &Path,
        tunnel_in_world: Option<&Pose>,
        surface: &dyn Surface,
        range_h_m: [f64; 2],
    ) -> Result<Self, PointsError> {
        let world_in_tunnel = tunnel_in_world.map(Pose::inverse);
        let mut thinning = Thinning::new(printed(path).to_string(), surface, range_h_m);
        let mut batch = Vec::with_capacity(BATCH);
        read_points(path, &mut |point| {
            batch.push(match &world_in_tunnel {
                Some(pose) => pose.to_world(&point),
                None => point,
            });
            if batch.len() == BATCH {
                thinning.add(&batch);
                batch.clear();
            }
        })?;
        thinning.add(&batch);
        Ok(thinning.finish())
    }

    /// Takes points that are in memory, in the frame of the tunnel, metres; the others are as for
    /// [`WallPoints::read`].
    pub fn of_points(
        name: &str,
        points: &[Vector3<f64>],
        surface: &dyn Surface,
        range_h_m: [f64; 2],
    ) -> Self {
        let mut thinning = Thinning::new(name.to_owned(), surface, range_h_m);
        for batch in points.chunks(BATCH) {
            thinning.add(batch);
        }
        thinning.finish()
    }
}

impl<'s> Thinning<'s> {
    /// Before the first point.
    fn new(file: String, surface: &'s dyn Surface, range_h_m: [f64; 2]) -> Self {
        Self {
            surface,
            range_h_m,
            cells: BTreeMap::new(),
            rng: ChaCha8Rng::seed_from_u64(0),
            points: WallPoints {
                file,
                cells: Vec::new(),
                read: 0,
                beyond: 0,
                off_wall: 0,
                thinned: 0,
            },
        }
    }

    /// The cell of a point.
    fn cell_of(&self, point: &Vector3<f64>) -> CellOf {
        let [from, to] = self.range_h_m;
        let (h_m, outwards) = from_axis(self.surface, point);
        if !(from..=to).contains(&h_m) {
            return CellOf::Beyond;
        }
        let Ok(hit) = self.surface.hit(&(point - outwards), &outwards) else {
            return CellOf::OffWall;
        };
        // The wall is at `range` times the distance of the point from the axis.
        if !((1.0 - MAX_OFF_WALL_SHARE)..=(1.0 + MAX_OFF_WALL_SHARE)).contains(&(1.0 / hit.range)) {
            return CellOf::OffWall;
        }
        let perimeter_m = self.surface.perimeter_m();
        let share = (hit.wall.s_m / perimeter_m).rem_euclid(1.0);
        CellOf::Cell(
            (COLUMNS * hit.wall.h_m / perimeter_m).floor() as i64,
            (COLUMNS * share) as u32,
        )
    }

    /// Sorts points into the cells: of each cell every choice of points is equally probable.
    fn add(&mut self, batch: &[Vector3<f64>]) {
        let parts: Vec<&[Vector3<f64>]> = batch.chunks(PART).collect();
        let cells = parts.par_map(|part| part.iter().map(|p| self.cell_of(p)).collect::<Vec<_>>());
        self.points.read += batch.len() as u64;
        for (cell, point) in cells.into_iter().flatten().zip(batch) {
            let (row, column) = match cell {
                CellOf::Cell(row, column) => (row, column),
                CellOf::Beyond => {
                    self.points.beyond += 1;
                    continue;
                }
                CellOf::OffWall => {
                    self.points.off_wall += 1;
                    continue;
                }
            };
            let cell = self.cells.entry((row, column)).or_default();
            cell.seen += 1;
            if cell.kept.len() < MAX_POINTS_PER_CELL {
                cell.kept.push(*point);
                continue;
            }
            self.points.thinned += 1;
            let place = self.rng.random_range(0..cell.seen) as usize;
            if let Some(kept) = cell.kept.get_mut(place) {
                *kept = *point;
            }
        }
    }

    /// The points that are kept.
    fn finish(self) -> WallPoints {
        WallPoints {
            cells: self.cells.into_values().map(|cell| cell.kept).collect(),
            ..self.points
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::surface::{Circle, WallPoint};

    #[test]
    fn points_are_thinned_and_counted() {
        let circle = Circle::new(3.0).unwrap();
        let at = |s_m: f64, h_m: f64, out_m: f64| {
            let frame = circle.frame(WallPoint { s_m, h_m });
            frame.x_w + frame.normal() * out_m
        };
        let mut points = vec![at(1.0, -5.0, 0.0), at(1.0, 9.0, 0.0), at(2.0, 1.0, -1.2)];
        points.push(at(2.0, 1.0, 2.0));
        points.push(at(2.0, 1.0, 0.3));
        points.extend((0..100).map(|k| at(4.0, 2.0, 1e-4 * f64::from(k))));
        let thinned = WallPoints::of_points("a", &points, &circle, [-2.0, 4.0]);
        assert_eq!(
            (thinned.read, thinned.beyond, thinned.off_wall),
            (105, 2, 2)
        );
        assert_eq!(thinned.thinned, 84);
        let sizes: Vec<usize> = thinned.cells.iter().map(Vec::len).collect();
        assert_eq!(sizes, [1, MAX_POINTS_PER_CELL]);
        // Not only the first are kept.
        let farthest = thinned.cells[1].iter().map(|p| p.xz().norm());
        assert!(farthest.fold(0.0, f64::max) > 3.005);
    }

    #[test]
    fn points_are_carried_into_the_frame_of_the_tunnel() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.xyz");
        std::fs::write(&path, "13 1 0\n").unwrap();
        let circle = Circle::new(3.0).unwrap();
        let tunnel_in_world = Pose::new(Default::default(), Vector3::new(10.0, 0.0, 0.0));
        let points = WallPoints::read(&path, Some(&tunnel_in_world), &circle, [0.0, 2.0]).unwrap();
        assert_eq!(points.cells, [[Vector3::new(3.0, 1.0, 0.0)]]);
    }
}
