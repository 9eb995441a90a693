//! The points in the report.

use crate::point_fit::axis_fit::AxisFit;
use crate::point_fit::lattice_fit::LatticeFit;
use crate::point_fit::section_fit::SectionFit;
use crate::points::wall_points::WallPoints;
use serde::{Deserialize, Serialize};

/// Measured points of the wall, and their fit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PointsReport {
    /// The file, as given.
    pub file: String,
    /// Points of the file.
    pub read: u64,
    /// Of these, points that lie along the tunnel where no frame looks.
    pub beyond: u64,
    /// Points that are too far from the given wall to be of it.
    pub off_wall: u64,
    /// Points that were left out because there are enough beside them.
    pub thinned: u64,
    /// Points that the fit uses.
    pub used: usize,
    /// Points that it leaves out as outliers.
    pub outliers: usize,
    /// Residuals of the points used about the fitted wall, root mean square, millimetres.
    pub rms_mm: f64,
    /// Noise of a point, 1-σ by the median of the residuals, millimetres.
    pub sigma_mm: f64,
    /// Displacement of the wall by the points beyond size and axis, root mean square at the points,
    /// millimetres.
    pub shape_mm: f64,
    /// 1-σ of it by the points alone, root mean square at the points, millimetres.
    pub shape_sigma_mm: f64,
    /// Mean radius less the given one, with 1-σ, millimetres.
    pub radius_change_mm: f64,
    /// 1-σ of it, millimetres.
    pub radius_change_sigma_mm: f64,
    /// The axis by the points.
    pub axis: PointsAxis,
    /// The sections, with their own residuals.
    pub sections: Vec<PointsSection>,
}

/// The axis of the tunnel by the points, from the given one, along x (3 o'clock) and z (12
/// o'clock).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PointsAxis {
    /// Chainage at which the offset is stated, metres.
    pub at_h_m: f64,
    /// Offset, millimetres.
    pub offset_mm: [f64; 2],
    /// 1-σ of it, millimetres.
    pub offset_sigma_mm: [f64; 2],
    /// Tilt: change of the offset along the tunnel, millimetres per metre.
    pub tilt_mm_per_m: [f64; 2],
    /// 1-σ of it, millimetres per metre.
    pub tilt_sigma_mm_per_m: [f64; 2],
    /// Scatter of the sections about the axis, 1-σ beyond their noise, millimetres.
    pub scatter_mm: [f64; 2],
}

/// A section of the points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct PointsSection {
    /// Mean chainage of its points, metres.
    pub chainage_m: f64,
    /// Points used.
    pub used: usize,
    /// Points left out as outliers.
    pub outliers: usize,
    /// Residuals about the section's best-fit outline, root mean square, millimetres.
    pub rms_mm: f64,
    /// Radius less the given one, millimetres.
    pub radius_change_mm: f64,
    /// Position of its centre from the given axis along x and z, millimetres.
    pub centre_mm: [f64; 2],
}

impl PointsReport {
    /// Reports a fit.
    pub fn new(
        points: &WallPoints,
        axis: &AxisFit,
        sections: &[SectionFit],
        lattices: &LatticeFit,
    ) -> Self {
        let [size, x, z] = &axis.modes;
        let field = lattices.shape.field();
        let walls = || lattices.observations.cells.iter().flatten().map(|o| o.wall);
        let rms_mm = |values: &mut dyn Iterator<Item = f64>| {
            let (sum, n) = values.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
            1e3 * f64::sqrt(sum / f64::max(n, 1.0))
        };
        let shape_mm = field.map_or(0.0, |field| {
            rms_mm(&mut walls().map(|wall| field.at(wall).delta_m))
        });
        let draws = &lattices.error_draws;
        let errors = walls().enumerate().filter_map(|(k, wall)| {
            // A draw for each point: their mean square is over both.
            let draw = draws.get(k % draws.len().max(1))?;
            Some(draw.at(wall).delta_m)
        });
        let shape_sigma_mm = rms_mm(&mut errors.into_iter());
        Self {
            file: points.file.clone(),
            read: points.read,
            beyond: points.beyond,
            off_wall: points.off_wall,
            thinned: points.thinned,
            used: lattices.counts[0],
            outliers: lattices.counts[1],
            rms_mm: 1e3 * lattices.rms_m,
            sigma_mm: 1e3 * lattices.sigma_m,
            shape_mm,
            shape_sigma_mm,
            radius_change_mm: 1e3 * size.beta[0],
            radius_change_sigma_mm: 1e3 * size.sigma(0),
            axis: PointsAxis {
                at_h_m: axis.at_h_m,
                offset_mm: [x, z].map(|r| 1e3 * r.beta[0]),
                offset_sigma_mm: [x, z].map(|r| 1e3 * r.sigma(0)),
                tilt_mm_per_m: [x, z].map(|r| 1e3 * r.beta[1]),
                tilt_sigma_mm_per_m: [x, z].map(|r| 1e3 * r.sigma(1)),
                scatter_mm: [x, z].map(|r| 1e3 * r.between_m2.sqrt()),
            },
            sections: sections.iter().map(PointsSection::new).collect(),
        }
    }
}

impl PointsReport {
    /// The fit in words, without a capital and a full stop.
    pub fn sentence(&self) -> String {
        let [x, z] = self.axis.offset_mm;
        let [x_sigma, z_sigma] = self.axis.offset_sigma_mm;
        format!(
            "the wall fits {} points of {} to {:.1} mm (root mean square), {} are outliers; by \
             them the radius is {:+.2} ± {:.2} mm from the given one and the axis ({x:+.2} ± \
             {x_sigma:.2}, {z:+.2} ± {z_sigma:.2}) mm off along x and z (1-σ)",
            self.used,
            self.file,
            self.rms_mm,
            self.outliers,
            self.radius_change_mm,
            self.radius_change_sigma_mm,
        )
    }
}

impl PointsSection {
    /// Reports a section.
    fn new(section: &SectionFit) -> Self {
        let [size, x, z] = section.modes_m;
        Self {
            chainage_m: section.h_m,
            used: section.used,
            outliers: section.outliers,
            rms_mm: 1e3 * section.rms_m,
            radius_change_mm: 1e3 * size,
            centre_mm: [1e3 * x, 1e3 * z],
        }
    }
}
