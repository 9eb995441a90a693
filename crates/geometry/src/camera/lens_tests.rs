//! Properties that every model of a wide-angle lens has, and reference values.
//!
//! The reference values follow the construction of each model (spheres, ellipsoid, roots of the
//! polynomial) rather than its closed form; they were computed with 30 digits by mpmath.

use super::double_sphere::DoubleSphere;
use super::eucm::Eucm;
use super::fov::Fov;
use super::kannala_brandt::KannalaBrandt;
use super::lens::Lens;
use super::mei::Mei;
use super::ocam::Ocam;
use super::thin_prism::{ThinPrismCoefficients, ThinPrismFisheye};
use nalgebra::{Vector2, Vector3};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::sync::LazyLock;

const KANNALA_BRANDT: [f64; 4] = [-0.01, 0.005, -0.004, 0.0007];

fn mei(xi: f64, k: [f64; 2], p: [f64; 2]) -> Lens {
    Lens::Mei(Mei::new(xi, k, p).unwrap())
}

fn double_sphere(xi: f64, alpha: f64) -> Lens {
    Lens::DoubleSphere(DoubleSphere::new(xi, alpha).unwrap())
}

fn eucm(alpha: f64, beta: f64) -> Lens {
    Lens::Eucm(Eucm::new(alpha, beta).unwrap())
}

fn fov(omega: f64) -> Lens {
    Lens::Fov(Fov::new(omega).unwrap())
}

fn thin_prism(k: [f64; 4], p: [f64; 2], s: [f64; 2]) -> Lens {
    let coefficients = ThinPrismCoefficients { k, p, s };
    Lens::ThinPrismFisheye(ThinPrismFisheye::new(coefficients).unwrap())
}

fn ocam(polynomial: [f64; 4], affine: [f64; 3]) -> Lens {
    let mut all = [0.0; 8];
    all[..4].copy_from_slice(&polynomial);
    Lens::Ocam(Ocam::new(all, affine).unwrap())
}

/// Lenses of all models, with typical and with extreme parameters.
pub fn wide_angle_lenses() -> &'static [Lens] {
    static ALL: LazyLock<Vec<Lens>> = LazyLock::new(create_lenses);
    &ALL
}

fn create_lenses() -> Vec<Lens> {
    vec![
        mei(0.9, [-0.2, 0.03], [1e-3, -2e-3]),
        mei(3.2, [1.1, 12.5], [-8e-4, 7e-4]),
        mei(1.0, [0.0; 2], [0.0; 2]),
        mei(0.3, [-0.3, 0.0], [0.0; 2]),
        double_sphere(-0.24, 0.567),
        double_sphere(0.3, 0.3),
        double_sphere(1.4, 0.6),
        double_sphere(-0.6, 0.9),
        eucm(0.63, 1.04),
        eucm(0.3, 0.8),
        eucm(0.8, 2.5),
        fov(0.93),
        fov(2.4),
        fov(1e-3),
        thin_prism(KANNALA_BRANDT, [1e-3, -2e-3], [3e-4, -5e-4]),
        thin_prism([-0.12, 0.0, 0.0, 0.0], [0.01, 0.0], [0.0, 0.02]),
        thin_prism(KANNALA_BRANDT, [0.0; 2], [0.0; 2]),
        ocam([-1.7468, 3.1979, -1.9847, 0.0], [1.0, 0.0, 0.0]),
        ocam([-0.31, -0.02, 0.0, 0.01], [1.01, 0.002, -0.003]),
        ocam([0.2, 0.0, 0.0, 0.0], [0.99, 0.0, 0.001]),
        fov(0.93).limited_to(1.1),
        double_sphere(-0.24, 0.567).limited_to(1.3),
        eucm(0.63, 1.04).limited_to(1.9),
        mei(0.9, [-0.2, 0.03], [1e-3, -2e-3]).limited_to(0.6),
        thin_prism(KANNALA_BRANDT, [1e-3, -2e-3], [3e-4, -5e-4]).limited_to(1.2),
        ocam([-1.7468, 3.1979, -1.9847, 0.0], [1.0, 0.0, 0.0]).limited_to(1.5),
    ]
}

/// Number of the lenses.
const LENSES: usize = 26;

/// The largest angle off the axis that the lens shows, radians.
pub fn limit_rad(lens: &Lens) -> f64 {
    match lens {
        Lens::BrownConrady(lens) => lens.limit().sqrt().atan(),
        Lens::KannalaBrandt(lens) => lens.field_of_view().limit_rad(),
        Lens::Mei(lens) => lens.field_of_view().limit_rad(),
        Lens::DoubleSphere(lens) => lens.field_of_view().limit_rad(),
        Lens::Eucm(lens) => lens.field_of_view().limit_rad(),
        Lens::Fov(lens) => lens.max_angle_rad(),
        Lens::ThinPrismFisheye(lens) => lens.field_of_view().limit_rad(),
        Lens::Ocam(lens) => lens.field_of_view().limit_rad(),
    }
}

fn direction(theta: f64, turn: f64) -> Vector3<f64> {
    let (sin, cos) = theta.sin_cos();
    Vector3::new(sin * turn.cos(), sin * turn.sin(), cos)
}

proptest! {
    #[test]
    fn the_ray_inverts_the_projection(
        which in 0..LENSES, share in 0.0f64..0.99, turn in 0.0..TAU, far in 0.1f64..30.0,
    ) {
        let lens = wide_angle_lenses()[which];
        let ray = direction(limit_rad(&lens) * share, turn);
        let p_d = lens.project(&(ray * far));
        let back = p_d.and_then(|p_d| lens.ray(&p_d));
        prop_assert!(
            back.is_some_and(|back| (back - ray).norm() < 1e-9),
            "{lens:?}: {ray} {p_d:?} {back:?}"
        );
    }

    /// From any point of the image that has a ray, back to the point.
    #[test]
    fn the_projection_inverts_the_ray(
        which in 0..LENSES, x in -2.0f64..2.0, y in -2.0f64..2.0,
    ) {
        let lens = wide_angle_lenses()[which];
        let p_d = Vector2::new(x, y);
        if let Some(ray) = lens.ray(&p_d) {
            prop_assert!((ray.norm() - 1.0).abs() < 1e-12);
            let back = lens.project(&ray);
            prop_assert!(
                back.is_some_and(|back| (back - p_d).norm() < 1e-8),
                "{lens:?}: {p_d} {ray} {back:?}"
            );
        }
    }

    #[test]
    fn jacobians_match_central_differences(
        which in 0..LENSES, share in 0.0f64..0.95, turn in 0.0..TAU, far in 0.5f64..3.0,
    ) {
        let (lens, step) = (wide_angle_lenses()[which], 1e-6);
        let x_c = direction(limit_rad(&lens) * share, turn) * far;
        let jacobian = lens.jacobian(&x_c);
        let tolerance = 1e-6 * (1.0 + jacobian.norm().powi(3));
        let numeric = |plus: Option<Vector2<f64>>, minus: Option<Vector2<f64>>| {
            (plus.unwrap() - minus.unwrap()) / (2.0 * step)
        };
        for axis in 0..3 {
            let mut delta = Vector3::zeros();
            delta[axis] = step;
            let numeric = numeric(lens.project(&(x_c + delta)), lens.project(&(x_c - delta)));
            let error = (numeric - jacobian.column(axis)).norm();
            prop_assert!(error < tolerance, "{lens:?} {x_c} {axis}: {error}");
        }
        let by_coefficient = lens.coefficient_jacobian(&x_c);
        let [k1, k2] = lens.k1_k2();
        let moved = |a: f64, b: f64| lens.with_k1_k2(k1 + a, k2 + b).project(&x_c);
        if share < 0.8 {
            let by_k1 = numeric(moved(step, 0.0), moved(-step, 0.0));
            let by_k2 = numeric(moved(0.0, step), moved(0.0, -step));
            prop_assert!((by_k1 - by_coefficient.column(0)).norm() < 1e-6);
            prop_assert!((by_k2 - by_coefficient.column(1)).norm() < 1e-6);
        }
    }
}

/// Along any direction the image point moves outwards up to the limit, and there is none beyond.
#[test]
fn no_lens_folds_the_image() {
    for lens in wide_angle_lenses() {
        let limit = limit_rad(lens);
        assert!(limit > 0.4 && limit <= PI, "{lens:?}: {limit}");
        for turn in [0.0, 1.1, 2.9, 4.4] {
            let mut before = -1.0;
            for k in 0..2000 {
                let theta = PI * (f64::from(k) + 0.5) / 2000.0;
                let p_d = lens.project(&direction(theta, turn));
                assert_eq!(p_d.is_some(), theta < limit, "{lens:?} {theta}");
                let Some(p_d) = p_d else { continue };
                let determinant = lens.jacobian(&direction(theta, turn));
                let determinant = (determinant * determinant.transpose()).determinant();
                assert!(determinant > 0.0, "{lens:?} {theta}");
                if lens.k1_k2() == [0.0; 2] {
                    assert!(p_d.norm() > before, "{lens:?} {theta}");
                }
                before = p_d.norm();
            }
        }
    }
}

/// Within 0.1 % of the limit the radius rises, and beyond it the formula falls or ends.
#[test]
fn the_field_of_view_is_not_larger_than_it_has_to_be() {
    let radius = |xi: f64, alpha: f64, theta: f64| {
        let (sin, cos) = theta.sin_cos();
        let k = xi + cos;
        sin / (alpha * sin.hypot(k) + (1.0 - alpha) * k)
    };
    for (xi, alpha) in [
        (-0.24, 0.567),
        (0.3, 0.3),
        (1.4, 0.6),
        (-0.6, 0.9),
        (0.9, 0.2),
    ] {
        let limit = limit_rad(&double_sphere(xi, alpha));
        let at = |share: f64| radius(xi, alpha, limit * share);
        assert!(at(0.999) > at(0.998), "{xi} {alpha}");
        assert!(at(1.001) < at(1.0005) || at(1.001) < 0.0, "{xi} {alpha}");
    }
    // Closed forms by hand: a sphere seen along parallel rays, and through its far pole.
    assert!((limit_rad(&eucm(1.0, 1.0)) - FRAC_PI_2).abs() < 1e-12);
    assert!((limit_rad(&double_sphere(0.0, 1.0)) - FRAC_PI_2).abs() < 1e-12);
    assert!((limit_rad(&eucm(0.5, 1.0)) - PI).abs() < 1e-12);
    let two = mei(2.0, [0.0; 2], [0.0; 2]);
    assert!((limit_rad(&two) - 120f64.to_radians()).abs() < 1e-12);
    // z = 1 + a ρ²: the angle is largest where 1 = a ρ², at 1/√a over 2.
    let parabola = ocam([0.25, 0.0, 0.0, 0.0], [1.0, 0.0, 0.0]);
    assert!((limit_rad(&parabola) - FRAC_PI_2 / 2.0).abs() < 1e-9);
}

#[test]
fn the_axis_itself_is_the_middle() {
    for lens in wide_angle_lenses() {
        let on_axis = Vector3::new(0.0, 0.0, 2.0);
        assert_eq!(lens.project(&on_axis), Some(Vector2::zeros()));
        let ray = lens.ray(&Vector2::zeros()).unwrap();
        assert!((ray - Vector3::z()).norm() < 1e-15);
        let beside = Vector3::new(1e-5, 0.0, 2.0);
        assert!((lens.jacobian(&on_axis) - lens.jacobian(&beside)).norm() < 1e-4);
        let slope = 2.0 * lens.jacobian(&on_axis)[(0, 0)];
        assert!((slope - lens.axis_scale()).abs() < 1e-12, "{lens:?}");
        for behind in [Vector3::new(0.0, 0.0, -1.0), Vector3::repeat(f64::NAN)] {
            assert!(lens.project(&behind).is_none(), "{lens:?}");
        }
    }
}

#[test]
fn without_other_distortion_models_agree_with_simpler_ones() {
    let fisheye = Lens::KannalaBrandt(KannalaBrandt::new(KANNALA_BRANDT));
    let pairs = [
        (thin_prism(KANNALA_BRANDT, [0.0; 2], [0.0; 2]), fisheye),
        (mei(0.0, [-0.1, 0.01], [0.0; 2]), Lens::radial(-0.1, 0.01)),
        (eucm(0.0, 1.0), Lens::default()),
        (double_sphere(0.0, 0.0), Lens::default()),
        (ocam([0.0; 4], [1.0, 0.0, 0.0]), Lens::default()),
        // The unified model with the sphere of the double sphere's second.
        (double_sphere(0.0, 0.6), eucm(0.6, 1.0)),
    ];
    for (lens, simple) in pairs {
        for k in 0..100 {
            let x_c = direction(0.012 * f64::from(k), 2.4 * f64::from(k));
            let apart = lens.project(&x_c).unwrap() - simple.project(&x_c).unwrap();
            assert!(apart.norm() < 1e-12, "{lens:?} {x_c}");
        }
    }
}

#[test]
fn projections_agree_with_reference_values() {
    let points = [
        [0.3, -0.2, 1.0],
        [-1.2, 0.7, 0.9],
        [0.8, 1.1, 0.1],
        [2.0, -1.0, -0.4],
    ];
    let references: [(Lens, [Option<[f64; 2]>; 4]); 6] = [
        (
            mei(0.9, [-0.2, 0.03], [1e-3, -2e-3]),
            [
                Some([0.15208921327022223, -0.10140412679710582]),
                Some([-0.4719011955388116, 0.2752193731192657]),
                Some([0.49349403859201824, 0.6824913952364526]),
                Some([0.8801187504299779, -0.44005937521498895]),
            ],
        ),
        (
            mei(3.2, [1.1, 12.5], [-8e-4, 7e-4]),
            [
                Some([0.06871387404181978, -0.04581148597884325]),
                Some([-0.21034040842890211, 0.1226788873283669]),
                Some([0.2168432414522309, 0.29799584692406395]),
                Some([0.36623440682549574, -0.18316488987959073]),
            ],
        ),
        (
            double_sphere(-0.25, 0.57),
            [
                Some([0.3836396901293948, -0.25575979341959654]),
                Some([-1.145021576822067, 0.6679292531462058]),
                Some([1.1700270666901498, 1.608787216698956]),
                Some([2.0562492292136376, -1.0281246146068188]),
            ],
        ),
        (
            eucm(0.63, 1.04),
            [
                Some([0.28811847846703775, -0.1920789856446918]),
                Some([-0.8630457507158723, 0.5034433545842588]),
                Some([0.8761070038887261, 1.2046471303469983]),
                Some([1.5260704920033137, -0.7630352460016568]),
            ],
        ),
        (
            fov(0.93),
            [
                Some([0.3105659284320429, -0.20704395228802858]),
                Some([-0.926458920219622, 0.5404343701281128]),
                Some([0.9471799912389279, 1.302372487953526]),
                None,
            ],
        ),
        (
            thin_prism(KANNALA_BRANDT, [1e-3, -2e-3], [3e-4, -5e-4]),
            [
                Some([0.28695664792735603, -0.19138027265454333]),
                Some([-0.8587099844350888, 0.5004264700948048]),
                Some([0.854212128134729, 1.180903996566799]),
                Some([1.4880984649913094, -0.7451184257786831]),
            ],
        ),
    ];
    for (lens, expected) in references {
        for (x_c, expected) in points.map(Vector3::from).iter().zip(expected) {
            let found = lens.project(x_c);
            assert_eq!(found.is_some(), expected.is_some(), "{lens:?} {x_c}");
            if let (Some(found), Some(expected)) = (found, expected) {
                assert!(
                    (found - Vector2::from(expected)).norm() < 1e-14,
                    "{lens:?} {x_c}"
                );
            }
        }
    }
}

#[test]
fn impossible_parameters_are_refused_by_name() {
    let message = |result: Result<(), super::LensParameterError>| result.unwrap_err().to_string();
    let errors = [
        message(Mei::new(-1.0, [0.0; 2], [0.0; 2]).map(drop)),
        message(DoubleSphere::new(0.0, 1.5).map(drop)),
        message(Eucm::new(0.5, 0.0).map(drop)),
        message(Fov::new(0.0).map(drop)),
        message(Ocam::new([f64::NAN; 8], [1.0, 0.0, 0.0]).map(drop)),
        message(Ocam::new([0.0; 8], [-1.0, 0.0, 0.0]).map(drop)),
    ];
    for (error, name) in errors
        .iter()
        .zip(["xi", "alpha", "beta", "omega", "a2", "c"])
    {
        assert!(error.starts_with(&format!("{name} is ")), "{error}");
    }
}
