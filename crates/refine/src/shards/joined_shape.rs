//! The wall's shape of all stretches.
//!
//! Each stretch has learned strengths of its own, and its lattices lie where its gauge has put
//! them. Where all are solved together, they have the lattices of the survey: every scale that any
//! stretch has kept, with the root mean square of its strengths, and coefficients where the fields
//! of the stretches are. The last solve learns the strengths anew.

use crate::parameters::shape::{Scale, Shape, ShapeModel};
use crate::parameters::shape_functions::{Functions, ShapeStep};
use tunnelstitch_geometry::surface::{RadialField, SplineLattice, WallPoint};

/// Points around the tunnel by which harmonics are found, so many that those of the highest order
/// are far from the half.
const HARMONIC_POINTS: usize = 64;

/// A stretch of the wall, and its shape.
pub struct WallStretch<'s> {
    /// Its shape, in its own gauge.
    pub shape: &'s Shape,
    /// Displacement on the unrolled wall to the gauge of all.
    pub by: WallPoint,
    /// Chainage between which it is the stretch's own, in the gauge of all, metres.
    pub own_h_m: [f64; 2],
    /// Share of its frames that are its own.
    pub own_share: f64,
}

/// The stretch to which a chainage (metres) is nearest, by the chainages that are their own.
pub fn nearest(own_h_m: impl Iterator<Item = [f64; 2]>, h_m: f64) -> usize {
    let distance_m = |[from, to]: [f64; 2]| (from - h_m).max(h_m - to).max(0.0);
    let distances = own_h_m.map(distance_m).enumerate();
    distances
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map_or(0, |(k, _)| k)
}

/// Joins the shapes of stretches in a model without functions.
pub fn join_shapes(empty: ShapeModel, stretches: &[WallStretch], origin: WallPoint) -> Shape {
    let mut model = empty;
    let mut coefficients = Vec::new();
    let kept = |stretch: &WallStretch| stretch.shape.model.scales.clone();
    for kind in kinds(stretches, kept) {
        let sigmas_m = stretches.iter().map(|stretch| strength_m(stretch, kind));
        let square: f64 = sigmas_m.map(|sigma_m| sigma_m * sigma_m).sum();
        let functions = functions_of(&model, kind);
        model.add(functions, (square / stretches.len() as f64).sqrt());
        let fields: Vec<Option<RadialField>> =
            stretches.iter().map(|s| field_of_scale(s, kind)).collect();
        let scale = Scale {
            functions,
            sigma_m: 1.0,
        };
        coefficients.extend(match functions {
            Functions::Harmonics { .. } => {
                vec![harmonics(&model.with_only(scale), stretches, &fields)]
            }
            Functions::Lattice { .. } => lattice(&model, functions, stretches, &fields, origin),
        });
    }
    let seen: Vec<Functions> = kinds(stretches, kept);
    let dropped = |stretch: &WallStretch| stretch.shape.model.dropped.clone();
    for kind in kinds(stretches, dropped)
        .into_iter()
        .filter(|kind| !seen.contains(kind))
    {
        // The evidence of all falls by the sum of what it falls by in each, as the fourth power.
        let falls = stretches.iter().flat_map(|stretch| {
            let limits = stretch.shape.model.dropped.iter();
            let limits = limits.filter(|scale| kind_of(scale) == kind);
            limits.map(|scale| stretch.own_share * scale.sigma_m.powi(-4))
        });
        let sum: f64 = falls.sum();
        let functions = functions_of(&model, kind);
        model.dropped.push(Scale {
            functions,
            sigma_m: sum.powf(-0.25),
        });
    }
    Shape {
        model,
        coefficients,
    }
}

/// The functions of a scale, wherever along the tunnel: a lattice has no rows.
fn kind_of(scale: &Scale) -> Functions {
    match scale.functions {
        Functions::Lattice { columns, .. } => Functions::Lattice {
            columns,
            first_row: 0,
            rows: 0,
        },
        harmonics => harmonics,
    }
}

/// The kinds of scales that any stretch has ([`kind_of`]), harmonics first, then lattices by
/// ascending columns.
fn kinds(stretches: &[WallStretch], scales: impl Fn(&WallStretch) -> Vec<Scale>) -> Vec<Functions> {
    let all = stretches.iter().flat_map(scales);
    let mut kinds: Vec<Functions> = all.map(|scale| kind_of(&scale)).collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds
}

/// The functions of a kind over all of the wall.
fn functions_of(model: &ShapeModel, kind: Functions) -> Functions {
    match kind {
        Functions::Lattice { columns, .. } => model.lattice_functions(columns as f64),
        harmonics => harmonics,
    }
}

/// Strength of a kind in a stretch, metres; 0 if it has none.
fn strength_m(stretch: &WallStretch, kind: Functions) -> f64 {
    let mut scales = stretch.shape.model.scales.iter();
    let scale = scales.find(|scale| kind_of(scale) == kind);
    scale.map_or(0.0, |scale| scale.sigma_m)
}

/// The displacement of a stretch by the functions of one kind, in the gauge of all.
fn field_of_scale(stretch: &WallStretch, kind: Functions) -> Option<RadialField> {
    let Shape {
        model,
        coefficients,
    } = stretch.shape;
    let mut scales = model.scales.iter().zip(model.ranges());
    let (scale, range) = scales.find(|(scale, _)| kind_of(scale) == kind)?;
    let alone = Shape {
        model: model.with_only(*scale),
        coefficients: coefficients[range].to_vec(),
    };
    Some(alone.field()?.moved(stretch.by))
}

/// Coefficients of the harmonics, the only functions of `model`: the mean of those of stretches.
fn harmonics(
    model: &ShapeModel,
    stretches: &[WallStretch],
    fields: &[Option<RadialField>],
) -> ShapeStep {
    let mut mean = ShapeStep::zeros();
    for (stretch, field) in stretches.iter().zip(fields) {
        let Some(field) = field else { continue };
        let h_m = 0.5 * (stretch.own_h_m[0] + stretch.own_h_m[1]);
        for k in 0..HARMONIC_POINTS {
            let around = field.lattice().perimeter_m * k as f64 / HARMONIC_POINTS as f64;
            let wall = WallPoint { s_m: around, h_m };
            let delta_m = field.at(wall).delta_m;
            for function in model.functions_at(wall) {
                // The mean square of a harmonic is a half.
                mean[function.component] += 2.0 * function.value * delta_m;
            }
        }
    }
    mean / (HARMONIC_POINTS * stretches.len().max(1)) as f64
}

/// Coefficients of a lattice, at every node those of the nearest stretch.
fn lattice(
    model: &ShapeModel,
    functions: Functions,
    stretches: &[WallStretch],
    fields: &[Option<RadialField>],
    origin: WallPoint,
) -> Vec<ShapeStep> {
    let Functions::Lattice {
        columns,
        first_row,
        rows,
    } = functions
    else {
        return Vec::new();
    };
    let lattice = SplineLattice {
        perimeter_m: model.spacing_m(columns) * columns as f64,
        columns,
        origin,
    };
    let rows = first_row..first_row + rows as i64;
    let value_m = |wall: WallPoint| {
        let own_h_m = stretches.iter().map(|stretch| stretch.own_h_m);
        let field = fields[nearest(own_h_m, wall.h_m)].as_ref();
        field.map_or(0.0, |field| field.at(wall).delta_m)
    };
    let field = RadialField::through(lattice, rows, value_m);
    let blocks = field.coefficients_m().chunks(ShapeStep::zeros().len());
    blocks.map(ShapeStep::from_column_slice).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::shape_functions::OVALITY;
    use std::f64::consts::TAU;

    const PERIMETER_M: f64 = 3.0 * TAU;

    fn model(extent_h_m: [f64; 2]) -> ShapeModel {
        ShapeModel::empty(PERIMETER_M, WallPoint::default(), extent_h_m)
    }

    /// A smooth shape on the lattices of a stretch that is displaced by `by`.
    fn shape(extent_h_m: [f64; 2], by: WallPoint) -> Shape {
        let mut model = model(extent_h_m);
        model.add(OVALITY, 0.004);
        model.add(model.lattice_functions(32.0), 0.002);
        let Functions::Lattice {
            first_row, rows, ..
        } = model.scales[1].functions
        else {
            panic!("no lattice");
        };
        let theta = TAU * by.s_m / PERIMETER_M;
        let ovality = [(2.0 * theta).cos(), (2.0 * theta).sin()];
        let mut coefficients = vec![ShapeStep::zeros(); 1];
        // cos 2(θ + Δ) = cos 2Δ cos 2θ − sin 2Δ sin 2θ.
        coefficients[0][0] = 0.005 * ovality[0];
        coefficients[0][1] = -0.005 * ovality[1];
        let lattice = SplineLattice {
            perimeter_m: PERIMETER_M,
            columns: 32,
            origin: WallPoint::default(),
        };
        let field = RadialField::through(lattice, first_row..first_row + rows as i64, |wall| {
            undulation_m(WallPoint {
                s_m: wall.s_m + by.s_m,
                h_m: wall.h_m + by.h_m,
            })
        });
        let blocks = field.coefficients_m().chunks(8);
        coefficients.extend(blocks.map(ShapeStep::from_column_slice));
        Shape {
            model,
            coefficients,
        }
    }

    fn undulation_m(wall: WallPoint) -> f64 {
        0.003 * (3.0 * TAU * wall.s_m / PERIMETER_M).sin() * (TAU * wall.h_m / 7.0).cos()
    }

    #[test]
    fn stretches_in_gauges_of_their_own_make_one_wall() {
        let by = WallPoint {
            s_m: 4.321,
            h_m: 1.234,
        };
        let first = shape([-1.0, 13.0], WallPoint::default());
        let second = shape([9.0 - by.h_m, 21.0 - by.h_m], by);
        let stretches = [
            WallStretch {
                shape: &first,
                by: WallPoint::default(),
                own_h_m: [0.0, 10.0],
                own_share: 1.0,
            },
            WallStretch {
                shape: &second,
                by,
                own_h_m: [10.1, 20.0],
                own_share: 1.0,
            },
        ];
        let joined = join_shapes(model([-1.0, 21.0]), &stretches, WallPoint::default());
        assert_eq!(joined.model.scales.len(), 2);
        assert!((joined.model.scales[1].sigma_m - 0.002).abs() < 1e-12);
        let field = joined.field().unwrap();
        for k in 0..200 {
            let wall = WallPoint {
                s_m: (k as f64 * 1.73) % PERIMETER_M,
                h_m: 1.0 + (k as f64 * 0.377) % 18.0,
            };
            let ovality_m = 0.005 * (2.0 * TAU * wall.s_m / PERIMETER_M).cos();
            let error_m = field.at(wall).delta_m - ovality_m - undulation_m(wall);
            assert!(error_m.abs() < 1e-4, "{wall:?}: {error_m}");
        }
    }

    #[test]
    fn scales_that_no_stretch_sees_are_smaller_than_in_each() {
        let mut unseen = Shape::nominal(model([0.0, 9.0]));
        let functions = unseen.model.lattice_functions(16.0);
        unseen.model.dropped.push(Scale {
            functions,
            sigma_m: 0.001,
        });
        let stretch = |own_h_m| WallStretch {
            shape: &unseen,
            by: WallPoint::default(),
            own_h_m,
            own_share: 1.0,
        };
        let stretches = [stretch([0.0, 4.0]), stretch([4.0, 8.0])];
        let joined = join_shapes(model([0.0, 9.0]), &stretches, WallPoint::default());
        assert!(joined.model.scales.is_empty() && joined.coefficients.is_empty());
        let [limit] = &joined.model.dropped[..] else {
            panic!("{:?}", joined.model.dropped);
        };
        assert!((limit.sigma_m - 0.001 * 2f64.powf(-0.25)).abs() < 1e-12);
    }
}
