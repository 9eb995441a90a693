//! Limits of the wall's shape: of bend, coefficients, strengths and lattices.

use crate::parameters::shape::Shape;
use crate::parameters::shape_functions::ShapeStep;

/// Radius of the bend that a tunnel may have which is planned straight, 1-σ of the curvature, in
/// multiples of its own radius: 90 m for one of 3 m.
pub const BEND_RADIUS_RADII: f64 = 30.0;
/// Coefficient beyond which a shape is not believed, 1-σ of the prior: a thirtieth of the radius,
/// if the survey does not say how exact the wall is.
pub const MAX_PRIOR_SIGMAS: f64 = 10.0;
/// Largest strength of a scale, 1-σ of the prior. The residuals of a wall that is not smooth would
/// be explained by shapes that pixels hardly see.
pub const MAX_STRENGTH_SIGMAS: f64 = 3.0;
/// Columns of the finest lattice before anything is known: nodes a fifth of the radius apart.
pub const FIRST_FINEST_COLUMNS: usize = 32;
/// Columns of the finest lattice at the most: nodes a tenth of the radius apart. Twice as many
/// would cost eight times the time.
const MAX_COLUMNS: usize = 64;
/// Strength of a finer lattice over that of the one before, before it is learned.
const FINER_STRENGTH: f64 = 0.5;

/// The shape with a lattice of half the spacing added, if its finest lattice is still of use.
pub fn with_finer_lattice(shape: Shape) -> Shape {
    let finest = shape.model.finest_lattice();
    match finest.filter(|(columns, _)| 2 * columns <= MAX_COLUMNS) {
        Some((columns, sigma_m)) if columns >= FIRST_FINEST_COLUMNS => {
            let model = shape.model.refined(FINER_STRENGTH * sigma_m);
            let mut coefficients = shape.coefficients;
            coefficients.resize(model.blocks(), ShapeStep::zeros());
            Shape {
                model,
                coefficients,
            }
        }
        _ => shape,
    }
}
