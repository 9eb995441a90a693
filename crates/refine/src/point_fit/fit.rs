//! The fit of the wall to measured points, step by step.

use crate::parameters::shape::{Shape, ShapeModel};
use crate::parameters::shape_limits::{
    BEND_RADIUS_RADII, FIRST_FINEST_COLUMNS, MAX_PRIOR_SIGMAS, MAX_STRENGTH_SIGMAS,
};
use crate::point_fit::axis_fit::{AxisFit, AxisPrior, fit_axis};
use crate::point_fit::lattice_fit::{EvidenceLimits, fit_lattices};
use crate::point_fit::located_points::{LocatedPoint, locate_points};
use crate::point_fit::points_report::PointsReport;
use crate::point_fit::section_field::section_field;
use crate::point_fit::section_fit::{SectionFits, fit_sections};
use crate::points::error::PointsFitError;
use crate::points::observations::PointObservations;
use crate::points::wall_points::WallPoints;
use nalgebra::Vector3;
use std::sync::Arc;
use tunnelstitch_geometry::surface::{Bend, RadialField, SplineLattice, Surface, bent};

/// Columns of the lattice whose rows are the sections: a section is 0.4 radii long.
const SECTION_COLUMNS: usize = 16;
/// Fits with another bend at the most. Each leaves what is of the second order in the one before.
const MAX_BENDS: usize = 4;
/// Tilt of the axis that is possible, 1-σ: wide, where points do not tell.
const TILT_SIGMA: f64 = 0.1;

/// The points that the wall is fitted to, and prior knowledge of it.
pub struct PointFit<'p> {
    /// The points.
    pub points: &'p WallPoints,
    /// The wall as given, with the bend that is known of it.
    pub planned: &'p Arc<dyn Surface>,
    /// Its known displacement.
    pub known: Option<&'p RadialField>,
    /// True if it may turn out to bend.
    pub may_bend: bool,
    /// Chainage of the pivot of tilt and bend, metres.
    pub middle_h_m: f64,
    /// Chainages between which the wall is fitted, metres.
    pub extent_h_m: [f64; 2],
    /// 1-σ of the wall's deviation from the given shape, metres.
    pub shape_sigma_m: f64,
    /// Nominal radius, metres.
    pub radius_m: f64,
    /// Rate at which a wall as given may be found to be another.
    pub alpha: f64,
}

/// A wall that is fitted to points.
pub struct FittedWall {
    /// The bend that was found, with 1-σ of its curvature, 1/m.
    pub bend: Option<(Bend, [f64; 2])>,
    /// The displacement that was known, with size and axis by the points.
    pub displacement: RadialField,
    /// The displacement beyond it.
    pub shape: Shape,
    /// The points as observations of that.
    pub observations: Arc<PointObservations>,
    /// Draws of the errors of the shape, by the noise of the points.
    pub error_draws: Vec<RadialField>,
    /// The report.
    pub report: PointsReport,
}

/// Sections and axis of a wall.
struct Sections {
    bend: Option<(Bend, [f64; 2])>,
    nominal: Arc<dyn Surface>,
    cells: Vec<Vec<LocatedPoint>>,
    fits: SectionFits,
    axis: AxisFit,
}

impl PointFit<'_> {
    /// Fits the wall.
    ///
    /// # Errors
    /// [`PointsFitError`].
    pub fn run(&self) -> Result<FittedWall, PointsFitError> {
        let lattice = self.section_lattice();
        let Sections {
            bend,
            nominal,
            mut cells,
            fits,
            axis,
        } = self.fit_axis(&lattice)?;
        let (extent, radius_m) = (self.extent_h_m, self.radius_m);
        let sections = fits.sections.as_slice();
        let field = section_field(
            &axis,
            sections,
            nominal.as_ref(),
            &lattice,
            (extent, radius_m),
        );
        self.check_distance(&field, &axis)?;
        for point in cells.iter_mut().flatten() {
            point.distance_m -= field.at(point.wall).delta_m;
        }
        let residuals = cells.iter().zip(fits.residuals_m);
        let residuals = residuals.map(|(cell, residuals)| {
            let points = cell.iter().zip(residuals);
            let residual = |(point, residual): (&LocatedPoint, Option<f64>)| {
                residual.unwrap_or(point.distance_m)
            };
            points.map(residual).collect()
        });
        let model = ShapeModel::new(
            lattice.perimeter_m,
            lattice.origin,
            extent,
            FIRST_FINEST_COLUMNS,
            self.shape_sigma_m,
        );
        let limits = EvidenceLimits {
            most_m: MAX_STRENGTH_SIGMAS * self.shape_sigma_m,
            alpha: self.alpha,
        };
        let fitted = fit_lattices(&cells, residuals.collect(), model, limits);
        let lattices = fitted.ok_or_else(|| PointsFitError::Singular {
            file: self.points.file.clone(),
        })?;
        Ok(FittedWall {
            report: PointsReport::new(self.points, &axis, sections, &lattices),
            displacement: match self.known {
                Some(known) => known.plus(&field),
                None => field,
            },
            bend,
            shape: lattices.shape,
            observations: lattices.observations,
            error_draws: lattices.error_draws,
        })
    }

    /// The lattice whose rows are the sections.
    fn section_lattice(&self) -> SplineLattice {
        let known = self.known.map(|known| known.lattice().origin);
        SplineLattice {
            perimeter_m: self.planned.perimeter_m(),
            columns: SECTION_COLUMNS,
            origin: known.unwrap_or_default(),
        }
    }

    /// Fits sections and axis, with the bend that the axis turns out to have.
    fn fit_axis(&self, lattice: &SplineLattice) -> Result<Sections, PointsFitError> {
        let radius_m = self.radius_m;
        let bend_sigma = 1.0 / (BEND_RADIUS_RADII * radius_m);
        let mut bend: Option<(Bend, [f64; 2])> = None;
        let mut bends = 0;
        loop {
            let nominal = bent(self.planned, bend.map(|(bend, _)| bend));
            let extent = self.extent_h_m;
            let cells = locate_points(self.points, nominal.as_ref(), self.known, radius_m, extent);
            let fits = fit_sections(&cells, lattice, self.shape_sigma_m);
            let prior = AxisPrior {
                at_h_m: self.middle_h_m,
                sigma: Vector3::new(radius_m, TILT_SIGMA, bend_sigma),
                may_bend: self.may_bend,
                alpha: self.alpha,
            };
            let Some(axis) = fit_axis(&fits.sections, &prior) else {
                return Err(self.too_few(&cells));
            };
            if axis.is_bent && bends < MAX_BENDS {
                bends += 1;
                let [x, z] = bend.map_or([0.0; 2], |(bend, _)| bend.curvature_per_m);
                let [_, by_x, by_z] = &axis.modes;
                let curvature_per_m = [x + by_x.beta[2], z + by_z.beta[2]];
                let sigma_per_m = [by_x.sigma(2), by_z.sigma(2)];
                let at_h_m = self.middle_h_m;
                let found = Bend {
                    curvature_per_m,
                    at_h_m,
                };
                bend = Some((found, sigma_per_m));
                continue;
            }
            return Ok(Sections {
                bend,
                nominal,
                cells,
                fits,
                axis,
            });
        }
    }

    /// The error of a file with too few points.
    fn too_few(&self, cells: &[Vec<LocatedPoint>]) -> PointsFitError {
        let WallPoints {
            file,
            read,
            beyond,
            off_wall,
            ..
        } = self.points;
        PointsFitError::TooFew {
            file: file.clone(),
            read: *read,
            near: cells.iter().map(Vec::len).sum(),
            beyond: *beyond,
            off_wall: *off_wall,
        }
    }

    /// Checks that size and axis are not far from those given.
    fn check_distance(&self, field: &RadialField, axis: &AxisFit) -> Result<(), PointsFitError> {
        let most_m = MAX_PRIOR_SIGMAS * self.shape_sigma_m;
        let coefficients_m = field.coefficients_m().iter();
        let off_m = coefficients_m.fold(0.0, |most: f64, c| most.max(c.abs()));
        if off_m <= most_m {
            return Ok(());
        }
        let [size, x, z] = &axis.modes;
        Err(PointsFitError::TooFarOff {
            file: self.points.file.clone(),
            off_mm: 1e3 * off_m,
            most_mm: 1e3 * most_m,
            radius_m: self.radius_m + size.beta[0],
            given_m: self.radius_m,
            x_mm: 1e3 * x.beta[0],
            z_mm: 1e3 * z.beta[0],
            x_tilt: 1e3 * x.beta[1],
            z_tilt: 1e3 * z.beta[1],
        })
    }
}

impl FittedWall {
    /// The shape from which a solve with frames starts: the functions of `model`, and those of the
    /// fit with their strengths and coefficients. Frames may see what points do not.
    pub fn start(&self, model: ShapeModel) -> Shape {
        let mut start = Shape::nominal(model);
        let fitted = self.shape.model.scales.iter();
        for (scale, range) in fitted.zip(self.shape.model.ranges()) {
            let own = start.model.scales.iter();
            let mut own = own.zip(start.model.ranges()).enumerate();
            let coefficients = &self.shape.coefficients[range];
            let found = own.find(|(_, (own, _))| own.functions == scale.functions);
            match found.map(|(k, (_, range))| (k, range)) {
                Some((k, range)) => {
                    start.model.scales[k].sigma_m = scale.sigma_m;
                    start.coefficients[range].copy_from_slice(coefficients);
                }
                None => {
                    start.model.scales.push(*scale);
                    start.coefficients.extend_from_slice(coefficients);
                }
            }
        }
        start
    }
}
