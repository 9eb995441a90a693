//! Deviation of the wall from the best-fit circles of its sections, with its uncertainty.

use super::best_fit_circle::{CircleFit, circle_row};
use super::functional::{Functional, SectionSamples};
use super::outline::is_circle;
use super::shape_estimate::ShapeEstimate;
use nalgebra::Vector3;
use std::f64::consts::TAU;
use tunnelstitch_core::survey::{MaskedWall, Survey, SurveyError};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{RadialField, Surface, WallPoint};

/// Largest 1-σ of a deviation that is determined, in units of that before any frame was seen.
/// Higher: more of the wall is shown, with larger errors. Chosen by: frames that halve it tell
/// three times as much as was known before.
pub const MAX_SIGMA_SHARE: f64 = 0.5;

/// 1-σ of the deviation from the best-fit circle at each node of the field (of δ itself where the
/// section is no circle), row by row, metres; None where the frames do not determine it, see
/// [`MAX_SIGMA_SHARE`], or do not see the row. Empty if no errors are known.
///
/// The circle is fitted to all nodes of the row.
pub fn deviation_sigmas_m(shape: &ShapeEstimate) -> Vec<Option<f64>> {
    if shape.error_draws.is_empty() {
        return Vec::new();
    }
    let max_m = MAX_SIGMA_SHARE * shape.prior_sigma_m;
    let rows: Vec<i64> = shape.field.rows().collect();
    let sigmas = rows.par_map(|row| {
        let walls = nodes(shape.field, *row);
        let samples = SectionSamples::new(shape.field, shape.error_draws, &walls);
        let h_m = walls.first().map_or(0.0, |wall| wall.h_m);
        if !shape.sees(h_m) {
            return vec![None; walls.len()];
        }
        let fit = is_circle(shape.nominal, h_m)
            .then(|| CircleFit::new(&angles_rad(&walls, shape.field), &vec![true; walls.len()]))
            .flatten();
        let of_node = |k: usize| {
            let at = Functional::sparse(walls.len(), 0.0, [(k, 1.0)]);
            let deviation = match &fit {
                Some(fit) => without_circle(&at, fit, angle_rad(walls[k], shape.field)),
                None => at,
            };
            samples.measure(&deviation).sigma
        };
        let of_row = (0..shape.columns()).map(of_node);
        of_row
            .map(|sigma| sigma.filter(|sigma_m| *sigma_m <= max_m))
            .collect::<Vec<_>>()
    });
    sigmas.concat()
}

/// A displacement less that of the circle at the angle, radians.
fn without_circle(at: &Functional, fit: &CircleFit, angle_rad: f64) -> Functional {
    let row = circle_row(angle_rad);
    let parts = [&fit.radius, &fit.x, &fit.z].into_iter().zip(row.iter());
    parts.fold(at.clone(), |rest, (part, share)| {
        rest.combined(1.0, part, -share)
    })
}

/// The nodes of a row.
pub(super) fn nodes(field: &RadialField, row: i64) -> Vec<WallPoint> {
    let lattice = field.lattice();
    (0..lattice.columns)
        .map(|column| lattice.node(row, column))
        .collect()
}

/// The angle of a point of a round wall from twelve o'clock, radians.
fn angle_rad(wall: WallPoint, field: &RadialField) -> f64 {
    TAU * wall.s_m / field.lattice().perimeter_m
}

/// The angles of points of a round wall from twelve o'clock, radians.
pub(super) fn angles_rad(walls: &[WallPoint], field: &RadialField) -> Vec<f64> {
    walls.iter().map(|wall| angle_rad(*wall, field)).collect()
}

/// Map of the deviation of a wall from the best-fit circles of its sections; from the nominal wall
/// where these are no circles.
///
/// Without known σ all nodes but those of the first and the last row count as determined.
#[derive(Clone, Debug)]
pub struct DeviationMap {
    field: RadialField,
    /// 1-σ at the nodes, metres; empty if unknown.
    sigmas_m: Vec<Option<f64>>,
    /// Displacement `(a, x, z)` of the best-fit circle of each row; None where it is not
    /// determined.
    circles: Vec<Option<Vector3<f64>>>,
    /// The wall that was left out: what frames show there is no deformation.
    masked: Option<MaskedWall>,
}

/// Deviation at a point of the wall.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Deviation {
    /// The deviation, metres, positive outwards.
    pub value_m: f64,
    /// Its 1-σ, metres; NaN if it is unknown.
    pub sigma_m: f64,
}

impl DeviationMap {
    /// The map of a survey's wall, but for what was left out of it; None if it has no displacement.
    ///
    /// # Errors
    /// A shape file, or a file of the masked wall beside it, that cannot be read.
    pub fn of_survey(survey: &Survey) -> Result<Option<Self>, SurveyError> {
        let file = survey.shape_file()?;
        let map = file.and_then(|file| {
            let field = file.displacement()?;
            let nominal = survey.nominal.as_ref();
            Some(Self::new(nominal, field, file.deviation_sigma_m))
        });
        let Some(map) = map else {
            return Ok(None);
        };
        Ok(Some(map.without(survey.masked_wall()?)))
    }

    /// The map without the places where half of the frames or more were left out.
    pub fn without(self, masked: Option<MaskedWall>) -> Self {
        Self { masked, ..self }
    }

    /// The map of a field over the nominal wall, with 1-σ at its nodes as [`deviation_sigmas_m`]
    /// has them.
    pub fn new(nominal: &dyn Surface, field: RadialField, sigmas_m: Vec<Option<f64>>) -> Self {
        let columns = field.lattice().columns;
        let rows: Vec<(usize, i64)> = field.rows().enumerate().collect();
        let circles = rows.par_map(|(index, row)| {
            let walls = nodes(&field, *row);
            if !is_circle(nominal, walls.first()?.h_m) {
                return Some(Vector3::zeros());
            }
            let is_known = |k: usize| {
                sigmas_m.is_empty()
                    || sigmas_m
                        .get(index * columns + k)
                        .is_some_and(Option::is_some)
            };
            let determined: Vec<bool> = (0..columns).map(is_known).collect();
            let fit = CircleFit::new(&angles_rad(&walls, &field), &determined)?;
            let samples = SectionSamples::new(&field, &[], &walls);
            let value = |function: &Functional| samples.measure(function).value;
            Some(Vector3::new(
                value(&fit.radius),
                value(&fit.x),
                value(&fit.z),
            ))
        });
        Self {
            field,
            sigmas_m,
            circles,
            masked: None,
        }
    }

    /// 1-σ at a node, by its row from the first on, metres; None where it is not determined.
    fn sigma_m(&self, row: i64, column: usize) -> Option<f64> {
        let row = usize::try_from(row).ok()?;
        if row >= self.circles.len() {
            return None;
        }
        if self.sigmas_m.is_empty() {
            // Beyond the first and the last row the spline goes to zero.
            let is_inner = (1..self.circles.len() - 1).contains(&row);
            return is_inner.then_some(f64::NAN);
        }
        let columns = self.field.lattice().columns;
        *self.sigmas_m.get(row * columns + column % columns)?
    }

    /// True where the nearest node is determined, and the wall was not left out.
    pub fn is_determined(&self, wall: WallPoint) -> bool {
        let masked = self.masked.as_ref();
        if masked.is_some_and(|masked| masked.is_hidden_at(wall)) {
            return false;
        }
        let [u, v] = self.position(wall);
        let columns = self.field.lattice().columns as i64;
        let column = (u.round() as i64).rem_euclid(columns) as usize;
        self.sigma_m(v.round() as i64, column).is_some()
    }

    /// Position on the lattice: columns, and rows from the first on.
    fn position(&self, wall: WallPoint) -> [f64; 2] {
        let lattice = self.field.lattice();
        let spacing_m = lattice.spacing_m();
        let first_row = self.field.rows().start as f64;
        [
            (wall.s_m - lattice.origin.s_m) / spacing_m,
            (wall.h_m - lattice.origin.h_m) / spacing_m - first_row,
        ]
    }

    /// Deviation and its 1-σ at a point of the wall, millimetres; NaN where they are not known.
    pub fn at_mm(&self, wall: WallPoint) -> [f32; 2] {
        self.at(wall).map_or([f32::NAN; 2], |at| {
            [at.value_m, at.sigma_m].map(|value_m| (1e3 * value_m) as f32)
        })
    }

    /// Length of the section's outline, metres.
    pub fn perimeter_m(&self) -> f64 {
        self.field.lattice().perimeter_m
    }

    /// The chainage between which a row is determined at some node, metres; None without one.
    pub fn chainage_m(&self) -> Option<[f64; 2]> {
        let columns = self.field.lattice().columns;
        let rows = (0..self.circles.len() as i64)
            .filter(|row| (0..columns).any(|column| self.sigma_m(*row, column).is_some()));
        let (first, last) = rows.fold(None, |found: Option<(i64, i64)>, row| {
            Some((found.map_or(row, |(first, _)| first), row))
        })?;
        let start = self.field.rows().start;
        let h_m = |row: i64| self.field.lattice().node(start + row, 0).h_m;
        Some([h_m(first), h_m(last)])
    }

    /// The deviation at a point of the wall; None where it is not determined.
    ///
    /// The circle is interpolated linearly between the rows of the field, 1-σ between its nodes.
    pub fn at(&self, wall: WallPoint) -> Option<Deviation> {
        if !self.is_determined(wall) {
            return None;
        }
        let [u, v] = self.position(wall);
        let (column, row) = (u.floor(), v.floor());
        let (along_s, along_h) = (u - column, v - row);
        let columns = self.field.lattice().columns as i64;
        let mut circle = (Vector3::zeros(), 0.0);
        let mut sigma = (0.0, 0.0);
        for (row, weight) in [(row as i64, 1.0 - along_h), (row as i64 + 1, along_h)] {
            let known = usize::try_from(row)
                .ok()
                .and_then(|row| *self.circles.get(row)?);
            if let Some(known) = known {
                circle.0 += known * weight;
                circle.1 += weight;
            }
            let pair = [(column as i64, 1.0 - along_s), (column as i64 + 1, along_s)];
            for (column, share) in pair {
                let column = column.rem_euclid(columns) as usize;
                if let Some(known) = self.sigma_m(row, column) {
                    sigma.0 += known * weight * share;
                    sigma.1 += weight * share;
                }
            }
        }
        if circle.1 <= 0.0 || sigma.1 <= 0.0 {
            return None;
        }
        let row = circle_row(angle_rad(wall, &self.field));
        let of_circle = row.dot(&circle.0) / circle.1;
        Some(Deviation {
            value_m: self.field.at(wall).delta_m - of_circle,
            sigma_m: sigma.0 / sigma.1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_core::survey::MaskedTile;
    use tunnelstitch_geometry::surface::{Circle, SplineLattice};

    /// No deviation is known where half of the frames were left out; beside it, where fewer were,
    /// one is.
    #[test]
    fn what_was_left_out_is_no_deformation() {
        let circle = Circle::new(3.0).unwrap();
        let perimeter_m = circle.perimeter_m();
        let lattice = SplineLattice {
            perimeter_m,
            columns: 16,
            origin: WallPoint::default(),
        };
        let field = RadialField::new(lattice, -2, vec![0.01; 16 * 8]);
        let tile = |column, left_out| MaskedTile {
            row: 3,
            column,
            frames: 4,
            left_out,
        };
        let tiles = vec![tile(10, 2), tile(11, 1)];
        let masked = MaskedWall::new(perimeter_m, (180, 0.1), vec![(3, 0, 180)], tiles);
        let map = DeviationMap::new(&circle, field, Vec::new());
        let at = |map: &DeviationMap, column: f64| {
            let s_m = column * perimeter_m / 180.0;
            map.at(WallPoint { s_m, h_m: 0.35 }).is_some()
        };
        assert!(at(&map, 10.5) && at(&map, 11.5));
        let map = map.without(Some(masked));
        assert!(!at(&map, 10.5) && at(&map, 11.5));
    }
}
