//! Displacements of known form, for tests.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use std::f64::consts::TAU;
use tunnelstitch_geometry::surface::{RadialField, SplineLattice, WallPoint};

/// Radius of the tests' tunnel, metres.
pub(super) const RADIUS_M: f64 = 3.0;
/// Nodes around it.
pub(super) const COLUMNS: usize = 64;
/// Rows of the fields.
pub(super) const ROWS: usize = 12;

/// The field that is about the given function of the angle (radians) in every row.
pub(super) fn field_of(delta_m: impl Fn(f64) -> f64) -> RadialField {
    let lattice = SplineLattice {
        perimeter_m: RADIUS_M * TAU,
        columns: COLUMNS,
        origin: WallPoint { s_m: 0.1, h_m: 2.0 },
    };
    let coefficient = |k: usize| {
        let column = (k % COLUMNS) as f64;
        delta_m((0.1 + column * lattice.spacing_m()) / RADIUS_M)
    };
    let coefficients = (0..ROWS * COLUMNS).map(coefficient).collect();
    RadialField::new(lattice, -2, coefficients)
}

/// Draws of fields with errors of mean, first and second harmonic of the given 1-σ, metres, and of
/// the nodes by themselves.
pub(super) fn error_draws(count: u64, sigmas_m: [f64; 3], node_sigma_m: f64) -> Vec<RadialField> {
    let draw = |seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        // A sum of twelve uniform numbers is normal enough.
        let mut normal = || (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>();
        let [mean, first, second] = sigmas_m;
        let (a, b, c) = (mean * normal(), first * normal(), first * normal());
        let (d, e) = (second * normal(), second * normal());
        let smooth =
            |t: f64| a + b * t.sin() + c * t.cos() + d * (2.0 * t).cos() + e * (2.0 * t).sin();
        let field = field_of(smooth);
        let coefficients = field.coefficients_m().iter();
        let coefficients = coefficients.map(|c| c + node_sigma_m * normal()).collect();
        RadialField::new(*field.lattice(), field.rows().start, coefficients)
    };
    (0..count).map(draw).collect()
}
