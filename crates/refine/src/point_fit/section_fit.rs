//! Robust fit of single sections to their points.
//!
//! Distances of the points of a section, one stretch of the tunnel, are
//!
//! `y = Σ_k a_k m_k(s) + Σ_m (b_m cos mθ + c_m sin mθ) + noise`,
//!
//! with the modes of size and position m ([`section_modes`]) and the harmonics m = 2, 3, which
//! would pass for these where points do not go all around. Solved by iteratively reweighted least
//! squares with a weak prior.
//!
//! [`section_modes`]: crate::point_fit::located_points::section_modes

use crate::point_fit::located_points::{LocatedPoint, SECTION_MODES};
use crate::point_fit::robust::{Weighting, huber_weight, robust_sigma_m, tukey_weight};
use nalgebra::{SMatrix, SVector};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use tunnelstitch_geometry::numerics::median::upper_median;
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::SplineLattice;

/// Unknowns of a section: the modes, and cosine and sine of two harmonics.
const UNKNOWNS: usize = SECTION_MODES + 4;
/// Points of a section at the least: twice its unknowns.
const MIN_POINTS: usize = 2 * UNKNOWNS;
/// Iterations with each kind of weights; the weights settle to a per cent in about ten.
const ITERATIONS: usize = 10;
/// 1-σ of size and position before the points are seen, in multiples of that of the shape: wide,
/// only where points do not determine them does it matter.
const MODE_SIGMAS: f64 = 30.0;
/// 1-σ of the harmonics before the points are seen, in the same multiples.
const HARMONIC_SIGMAS: f64 = 3.0;

/// A fitted section.
#[derive(Clone, Copy, Debug)]
pub struct SectionFit {
    /// Row of the lattice that it belongs to.
    pub row: i64,
    /// Mean chainage of its points, metres.
    pub h_m: f64,
    /// Change of the radius, shift of the section along x and z, metres.
    pub modes_m: [f64; SECTION_MODES],
    /// Variances of these by the noise of the points, m².
    pub variances_m2: [f64; SECTION_MODES],
    /// Points that were used.
    pub used: usize,
    /// Points that are too far off.
    pub outliers: usize,
    /// Root mean square residual of the points that were used, metres.
    pub rms_m: f64,
}

/// Fits of all sections, and the residuals of the points about them.
pub struct SectionFits {
    /// Sections with enough points, in order.
    pub sections: Vec<SectionFit>,
    /// Residuals by cell and point, metres; None in sections with too few points.
    pub residuals_m: Vec<Vec<Option<f64>>>,
}

type Unknowns = SVector<f64, UNKNOWNS>;

/// A point with its row of the design matrix.
struct Row {
    design: Unknowns,
    distance_m: f64,
    h_m: f64,
}

/// Fits the sections around the rows of `lattice`, each with the points nearest to its row.
/// `sigma_m`: 1-σ of the wall's shape, metres.
pub fn fit_sections(
    cells: &[Vec<LocatedPoint>],
    lattice: &SplineLattice,
    sigma_m: f64,
) -> SectionFits {
    let mut rows: BTreeMap<i64, Vec<(usize, usize)>> = BTreeMap::new();
    for (c, cell) in cells.iter().enumerate() {
        for (k, point) in cell.iter().enumerate() {
            let row = (point.wall.h_m - lattice.origin.h_m) / lattice.spacing_m();
            rows.entry(row.round() as i64).or_default().push((c, k));
        }
    }
    let rows: Vec<(i64, Vec<(usize, usize)>)> = rows.into_iter().collect();
    let fitted = rows.par_map(|(row, points)| {
        let of_points = points
            .iter()
            .map(|(c, k)| design_row(&cells[*c][*k], lattice));
        fit_section(*row, &of_points.collect::<Vec<Row>>(), sigma_m)
    });
    let mut residuals_m: Vec<Vec<Option<f64>>> =
        cells.iter().map(|cell| vec![None; cell.len()]).collect();
    let mut sections = Vec::new();
    for ((_, points), fitted) in rows.iter().zip(fitted) {
        let Some((section, residuals)) = fitted else {
            continue;
        };
        sections.push(section);
        for ((c, k), residual_m) in points.iter().zip(residuals) {
            residuals_m[*c][*k] = Some(residual_m);
        }
    }
    SectionFits {
        sections,
        residuals_m,
    }
}

/// The row of a point.
fn design_row(point: &LocatedPoint, lattice: &SplineLattice) -> Row {
    let theta = TAU * point.wall.s_m / lattice.perimeter_m;
    let design = Unknowns::from_fn(|k, _| match k {
        0..SECTION_MODES => point.modes[k],
        3 => (2.0 * theta).cos(),
        4 => (2.0 * theta).sin(),
        5 => (3.0 * theta).cos(),
        _ => (3.0 * theta).sin(),
    });
    Row {
        design,
        distance_m: point.distance_m,
        h_m: point.wall.h_m,
    }
}

/// Fits a section; also returns the residuals of its points, metres. None if it has too few.
fn fit_section(row: i64, rows: &[Row], shape_sigma_m: f64) -> Option<(SectionFit, Vec<f64>)> {
    if rows.len() < MIN_POINTS {
        return None;
    }
    let prior = Unknowns::from_fn(|k, _| {
        let sigmas = if k < SECTION_MODES {
            MODE_SIGMAS
        } else {
            HARMONIC_SIGMAS
        };
        (sigmas * shape_sigma_m).powi(-2)
    });
    let mut unknowns = Unknowns::zeros();
    // The median distance, so that the first weights are those about the wall.
    unknowns[0] = upper_median(rows.iter().map(|row| row.distance_m).collect())?;
    let residual = |unknowns: &Unknowns, row: &Row| row.distance_m - row.design.dot(unknowns);
    let mut covariance = SMatrix::zeros();
    let mut sigma_m = 0.0;
    for weight in [huber_weight as Weighting, tukey_weight] {
        for _ in 0..ITERATIONS {
            sigma_m = robust_sigma_m(rows.iter().map(|row| residual(&unknowns, row)));
            let mut normal = SMatrix::<f64, UNKNOWNS, UNKNOWNS>::from_diagonal(&prior);
            let mut right = Unknowns::zeros();
            for row in rows {
                let w = weight(residual(&unknowns, row), sigma_m) / (sigma_m * sigma_m);
                normal += row.design * row.design.transpose() * w;
                right += row.design * (w * row.distance_m);
            }
            let factor = normal.cholesky()?;
            unknowns = factor.solve(&right);
            covariance = factor.inverse();
        }
    }
    let residuals: Vec<f64> = rows.iter().map(|row| residual(&unknowns, row)).collect();
    let inliers = rows
        .iter()
        .zip(&residuals)
        .filter(|(_, residual)| tukey_weight(**residual, sigma_m) > 0.0);
    let (mut used, mut h_m, mut square) = (0, 0.0, 0.0);
    for (row, residual) in inliers {
        used += 1;
        h_m += row.h_m;
        square += residual * residual;
    }
    let section = SectionFit {
        row,
        h_m: h_m / used as f64,
        modes_m: std::array::from_fn(|k| unknowns[k]),
        variances_m2: std::array::from_fn(|k| covariance[(k, k)]),
        used,
        outliers: rows.len() - used,
        rms_m: (square / used as f64).sqrt(),
    };
    (used > 0).then_some((section, residuals))
}
