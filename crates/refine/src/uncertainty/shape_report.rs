//! The wall's shape of the result, with its uncertainty.

use crate::model::context::{EstimationContext, total_displacement};
use crate::parameters::shape::{Scale, Shape, ShapeModel};
use crate::parameters::shape_functions::Functions;
use crate::uncertainty::pixel_jacobians::PointJacobians;
use crate::uncertainty::total_covariance::TotalCovariance;
use nalgebra::Vector2;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::{RadialField, WallPoint};

/// An estimated shape of the wall.
#[derive(Clone, Debug)]
pub struct EstimatedShape {
    /// The displacement from the nominal wall.
    pub field: RadialField,
    /// 1-σ of the displacement at each node of the field, in the order of its coefficients, metres;
    /// NaN where it is unknown.
    pub sigma_m: Vec<f64>,
    /// Draws of the displacement's errors, by pixels, prior, lens and model errors, with all their
    /// correlations; none if they are unknown. With 128 of them a 1-σ of any figure that is
    /// computed from the field is known to 6 %.
    pub error_draws: Vec<RadialField>,
    /// 1-σ of the displacement by its prior, before the frames were seen, metres: root mean square
    /// around the tunnel; 0 if nothing was estimated.
    pub prior_sigma_m: f64,
    /// Chainage between which the frames see the wall, metres; None if nothing was estimated.
    pub extent_h_m: Option<[f64; 2]>,
}

/// The shape in the report.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ShapeReport {
    /// Scales at which the wall deviates from the nominal one; empty if it is not seen to.
    pub scales: Vec<ScaleReport>,
    /// Scales at which it is not seen to.
    #[serde(default)]
    pub unseen: Vec<UnseenScaleReport>,
    /// Displacement over the wall, root mean square, millimetres.
    pub rms_mm: f64,
    /// 1-σ of the displacement, root mean square over the wall, millimetres.
    pub sigma_mm: f64,
}

/// One scale of the shape.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct ScaleReport {
    /// Distance of the nodes of its lattice, metres; none for harmonics, which are constant along
    /// the tunnel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// First and last order m of its harmonics cos mθ and sin mθ, 2 being the ovality; none for a
    /// lattice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub harmonics: Option<[usize; 2]>,
    /// Its strength: 1-σ of its coefficients, as learned from the frames, millimetres.
    pub sigma_mm: f64,
}

/// A scale at which no deformation is seen.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct UnseenScaleReport {
    /// Distance of the nodes of its lattice, metres; none for harmonics.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// First and last order of its harmonics; none for a lattice.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub harmonics: Option<[usize; 2]>,
    /// Displacement over the wall, root mean square, millimetres, that would have been seen: less
    /// than the false-alarm rate of all such walls show nothing.
    pub below_mm: f64,
}

impl EstimatedShape {
    /// The known displacement of a context plus the estimated one, with its uncertainty; None if
    /// there is neither. `first_slot`: slot of the shape's first block in `covariance`.
    pub fn new(
        context: &EstimationContext,
        shape: Option<&Shape>,
        covariance: Option<&TotalCovariance>,
        first_slot: usize,
    ) -> Option<Self> {
        let field = total_displacement(context.displacement, shape.and_then(Shape::field))?;
        let model = shape.map(|shape| &shape.model);
        let (rows, lattice) = (field.rows(), *field.lattice());
        let sigma_m = (0..field.coefficients_m().len()).par_map(|k| {
            let node = lattice.node(
                rows.start + (k / lattice.columns) as i64,
                k % lattice.columns,
            );
            model
                .zip(covariance)
                .map_or(f64::NAN, |(model, covariance)| {
                    sigma_at(model, covariance, first_slot, node)
                })
        });
        Some(Self {
            sigma_m,
            error_draws: shape
                .zip(covariance)
                .map_or_else(Vec::new, |(shape, covariance)| {
                    error_draws(shape, covariance, first_slot)
                }),
            prior_sigma_m: model.map_or(0.0, |model| prior_sigma_m(model, &field)),
            extent_h_m: model.map(ShapeModel::extent_h_m),
            field,
        })
    }

    /// The displacement of a context whose shape was held, with draws of its errors; `model`: its
    /// functions. None if there is none.
    pub fn held(
        context: &EstimationContext,
        model: &ShapeModel,
        error_draws: Vec<RadialField>,
    ) -> Option<Self> {
        let field = context.displacement?.clone();
        let (rows, lattice) = (field.rows(), *field.lattice());
        let sigma_m = (0..field.coefficients_m().len()).par_map(|k| {
            let row = rows.start + (k / lattice.columns) as i64;
            let node = lattice.node(row, k % lattice.columns);
            let square = |draw: &RadialField| draw.at(node).delta_m.powi(2);
            let sum: f64 = error_draws.iter().map(square).sum();
            (sum / error_draws.len() as f64).sqrt()
        });
        Some(Self {
            sigma_m,
            error_draws,
            prior_sigma_m: prior_sigma_m(model, &field),
            extent_h_m: Some(model.extent_h_m()),
            field,
        })
    }

    /// The shape moved on the unrolled wall and scaled with all of it.
    pub fn moved(self, by: WallPoint, scale: f64) -> Self {
        let moved = |field: RadialField| field.moved(by).scaled(scale);
        Self {
            field: moved(self.field),
            sigma_m: self.sigma_m.iter().map(|sigma_m| sigma_m * scale).collect(),
            error_draws: self.error_draws.into_iter().map(moved).collect(),
            prior_sigma_m: self.prior_sigma_m * scale,
            extent_h_m: self
                .extent_h_m
                .map(|h_m| h_m.map(|h_m| (h_m + by.h_m) * scale)),
        }
    }
}

/// Draws of the errors of a shape, as fields.
fn error_draws(shape: &Shape, covariance: &TotalCovariance, first_slot: usize) -> Vec<RadialField> {
    let draws = covariance.error_draws(first_slot);
    let fields = draws.par_map(|coefficients| shape.model.field_of(coefficients.clone()));
    let unseen = &covariance.unseen.draws;
    let sum = |(k, field): (usize, RadialField)| match unseen.get(k % unseen.len().max(1)) {
        Some(unseen) => field.plus(&unseen.displacement),
        None => field,
    };
    fields.into_iter().flatten().enumerate().map(sum).collect()
}

/// 1-σ of the displacement by the prior alone, root mean square over a row in the middle of the
/// field, metres.
fn prior_sigma_m(model: &ShapeModel, field: &RadialField) -> f64 {
    let sigmas_m = model.block_sigmas_m();
    let (rows, lattice) = (field.rows(), field.lattice());
    let variance = |column: usize| -> f64 {
        let wall = lattice.node((rows.start + rows.end) / 2, column);
        let functions = model.functions_at(wall).into_iter();
        functions
            .map(|f| (f.value * sigmas_m[f.block]).powi(2))
            .sum()
    };
    let sum: f64 = (0..lattice.columns).map(variance).sum();
    (sum / lattice.columns as f64).sqrt()
}

/// 1-σ of the displacement at a point of the wall, metres.
fn sigma_at(
    model: &ShapeModel,
    covariance: &TotalCovariance,
    first_slot: usize,
    wall: WallPoint,
) -> f64 {
    let mut displacement = PointJacobians::default();
    displacement.add_wall(Vector2::x(), wall, Some(model), first_slot);
    covariance.variance(&displacement).sqrt()
}

impl ShapeReport {
    /// Deformation of any scale that would have been seen if there were one, root mean square,
    /// millimetres; None if one is seen, or if none was looked for.
    pub fn none_above_mm(&self) -> Option<f64> {
        let limits = self.unseen.iter().map(|scale| scale.below_mm);
        limits
            .max_by(f64::total_cmp)
            .filter(|_| self.scales.is_empty())
    }

    /// Reports the scales of a model and the shape estimated with them.
    pub fn new(model: &ShapeModel, estimated: Option<&EstimatedShape>) -> Self {
        let spacing_m = |scale: &Scale| match scale.functions {
            Functions::Harmonics { .. } => None,
            Functions::Lattice { columns, .. } => Some(model.spacing_m(columns)),
        };
        let harmonics = |scale: &Scale| match scale.functions {
            Functions::Harmonics {
                first_order,
                orders,
            } => Some([first_order, first_order + orders - 1]),
            Functions::Lattice { .. } => None,
        };
        let scale = |scale: &Scale| ScaleReport {
            spacing_m: spacing_m(scale),
            harmonics: harmonics(scale),
            sigma_mm: 1e3 * scale.sigma_m,
        };
        let unseen = |scale: &Scale| UnseenScaleReport {
            spacing_m: spacing_m(scale),
            harmonics: harmonics(scale),
            below_mm: 1e3 * scale.functions.rms() * scale.sigma_m,
        };
        let rms_mm = |values: &[f64]| {
            let known = values.iter().filter(|value| value.is_finite());
            let (sum, count) = known.fold((0.0, 0.0), |(sum, n), v| (sum + v * v, n + 1.0));
            1e3 * f64::sqrt(sum / f64::max(count, 1.0))
        };
        Self {
            scales: model.scales.iter().map(scale).collect(),
            unseen: model.dropped.iter().map(unseen).collect(),
            rms_mm: estimated.map_or(0.0, |shape| rms_mm(shape.field.coefficients_m())),
            sigma_mm: estimated.map_or(0.0, |shape| rms_mm(&shape.sigma_m)),
        }
    }
}
