//! The fit on points of walls that are known.

use crate::parameters::shape::ShapeModel;
use crate::point_fit::fit::{FittedWall, PointFit};
use crate::points::error::PointsFitError;
use crate::points::wall_points::WallPoints;
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use std::sync::{Arc, LazyLock};
use tunnelstitch_geometry::surface::{Bend, Circle, Surface, WallPoint, bent};

const RADIUS_M: f64 = 3.0;

/// A wall that is measured: its displacement, and how it is measured.
struct Measured {
    delta_m: fn(f64, f64) -> f64,
    bend: Option<Bend>,
    extent_h_m: [f64; 2],
    count: usize,
    noise_m: f64,
    outliers: f64,
}

fn circle() -> Arc<dyn Surface> {
    Arc::new(Circle::new(RADIUS_M).unwrap())
}

impl Measured {
    /// Points at random places, of which a share is inside the tunnel, up to 0.4 m off the wall.
    fn points(&self) -> WallPoints {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let wall = bent(&circle(), self.bend);
        let [from, to] = self.extent_h_m;
        let mut point = |_| {
            let at = WallPoint {
                s_m: rng.random_range(0.0..wall.perimeter_m()),
                h_m: rng.random_range(from..to),
            };
            let frame = wall.frame(at);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let mut out_m = (self.delta_m)(at.s_m / RADIUS_M, at.h_m) + self.noise_m * noise;
            if rng.random_bool(self.outliers) {
                out_m -= rng.random_range(0.05..0.4);
            }
            frame.x_w + frame.normal() * out_m
        };
        let points: Vec<Vector3<f64>> = (0..self.count).map(&mut point).collect();
        WallPoints::of_points(
            "scan.ply",
            &points,
            circle().as_ref(),
            [from - 1.0, to + 1.0],
        )
    }

    fn fit(&self) -> Result<FittedWall, PointsFitError> {
        PointFit {
            points: &self.points(),
            planned: &circle(),
            known: None,
            may_bend: true,
            middle_h_m: 0.5 * (self.extent_h_m[0] + self.extent_h_m[1]),
            extent_h_m: self.extent_h_m,
            shape_sigma_m: 0.01,
            radius_m: RADIUS_M,
            alpha: 1e-3,
        }
        .run()
    }
}

/// Root mean square error of the displacement, away from the ends, millimetres.
fn error_mm(fit: &FittedWall, measured: &Measured) -> f64 {
    let shape = fit.shape.field();
    let [from, to] = measured.extent_h_m;
    let (mut sum, mut count) = (0.0, 0.0);
    for k in 0..1000 {
        let share = f64::from(k) / 1000.0;
        let at = WallPoint {
            s_m: 18.8 * (share * 37.0).fract(),
            h_m: from + (to - from) * (0.05 + 0.9 * share),
        };
        let beyond_m = shape.as_ref().map_or(0.0, |shape| shape.at(at).delta_m);
        let found_m = fit.displacement.at(at).delta_m + beyond_m;
        sum += (found_m - (measured.delta_m)(at.s_m / RADIUS_M, at.h_m)).powi(2);
        count += 1.0;
    }
    1e3 * f64::sqrt(sum / count)
}

const OVAL: Measured = Measured {
    delta_m: |theta, h_m| {
        let axis = (0.004 + 0.001 * (h_m - 2.0)) * theta.sin() - 0.006 * theta.cos();
        let undulation = 0.002 * (3.0 * theta + 0.8 * h_m).sin();
        0.005 + axis + 0.008 * (2.0 * theta - 0.4).cos() + undulation
    },
    bend: None,
    extent_h_m: [0.0, 4.0],
    count: 4000,
    noise_m: 0.004,
    outliers: 0.1,
};

static OVAL_FIT: LazyLock<FittedWall> = LazyLock::new(|| OVAL.fit().unwrap());

#[test]
fn an_oval_is_found_within_its_sigma() {
    let fit = &*OVAL_FIT;
    let report = &fit.report;
    assert_eq!(report.read, 4000);
    let near = report.used + report.outliers;
    assert_eq!(
        near as u64 + report.beyond + report.off_wall + report.thinned,
        4000
    );
    let share = report.outliers as f64 / near as f64;
    assert!((0.08..0.12).contains(&share), "{share}");
    assert!((3.8..4.2).contains(&report.sigma_mm), "{report:?}");
    assert!((3.5..4.3).contains(&report.rms_mm), "{report:?}");
    let radius = (report.radius_change_mm - 5.0) / report.radius_change_sigma_mm;
    assert!(radius.abs() < 4.0, "{report:?}");
    let axis = &report.axis;
    for (found, sigma, truth) in [
        (axis.offset_mm[0], axis.offset_sigma_mm[0], 4.0),
        (axis.offset_mm[1], axis.offset_sigma_mm[1], -6.0),
        (axis.tilt_mm_per_m[0], axis.tilt_sigma_mm_per_m[0], 1.0),
        (axis.tilt_mm_per_m[1], axis.tilt_sigma_mm_per_m[1], 0.0),
    ] {
        assert!(((found - truth) / sigma).abs() < 4.0, "{axis:?}");
        assert!(sigma < 0.5, "{axis:?}");
    }
    assert!(fit.bend.is_none());
    let error_mm = error_mm(fit, &OVAL);
    assert!(error_mm < 1.0, "{error_mm}");
    let ratio = error_mm / report.shape_sigma_mm;
    assert!(
        (0.5..1.6).contains(&ratio),
        "{error_mm} {}",
        report.shape_sigma_mm
    );
}

#[test]
fn a_wall_as_given_has_no_shape() {
    let measured = Measured {
        delta_m: |_, _| 0.0,
        ..OVAL
    };
    let fit = measured.fit().unwrap();
    assert!(fit.shape.model.scales.is_empty(), "{:?}", fit.shape.model);
    let error_mm = error_mm(&fit, &measured);
    assert!(error_mm < 0.4, "{error_mm}");
    // Frames may see what the points do not.
    let [from, to] = measured.extent_h_m;
    let model = ShapeModel::new(18.0, WallPoint::default(), [from, to], 32, 0.01);
    assert_eq!(fit.start(model.clone()).model, model);
}

#[test]
fn a_bend_is_found() {
    let measured = Measured {
        delta_m: |theta, _| 0.003 * (2.0 * theta).cos(),
        bend: Some(Bend {
            curvature_per_m: [1.0 / 250.0, -1.0 / 400.0],
            at_h_m: 4.5,
        }),
        extent_h_m: [0.0, 9.0],
        count: 5000,
        noise_m: 0.005,
        outliers: 0.05,
    };
    let fit = measured.fit().unwrap();
    let (bend, sigma_per_m) = fit.bend.unwrap();
    let truth = measured.bend.unwrap().curvature_per_m;
    for k in 0..2 {
        let error = (bend.curvature_per_m[k] - truth[k]) / sigma_per_m[k];
        assert!(error.abs() < 4.0, "{bend:?} {sigma_per_m:?}");
    }
    let error_mm = error_mm(&fit, &measured);
    assert!(error_mm < 1.0, "{error_mm}");
}

#[test]
fn points_of_another_wall_are_refused() {
    let off = Measured {
        delta_m: |theta, _| 0.2 * theta.sin(),
        ..OVAL
    };
    let error = off.fit().err().unwrap().to_string();
    for text in ["scan.ply", "3.00", "(200, ", "tunnel_frame"] {
        assert!(error.contains(text), "{error}");
    }
    let few = Measured { count: 10, ..OVAL };
    let error = few.fit().err().unwrap().to_string();
    assert!(error.contains("of 10 points"), "{error}");
}

/// The start of a solve has all functions of its model, and those of the fit as they are there.
#[test]
fn a_solve_starts_from_the_fit() {
    let fit = &*OVAL_FIT;
    let fitted = &fit.shape.model;
    let [from, to] = fitted.extent_h_m();
    let perimeter_m = circle().perimeter_m();
    let model = ShapeModel::new(perimeter_m, WallPoint::default(), [from, to], 16, 0.01);
    let start = fit.start(model);
    assert_eq!(start.coefficients.len(), start.model.blocks());
    let (a, b) = (start.field().unwrap(), fit.shape.field().unwrap());
    for (s_m, h_m) in [(0.0, 1.0), (7.0, 4.0), (12.0, 2.5)] {
        let at = WallPoint { s_m, h_m };
        assert!((a.at(at).delta_m - b.at(at).delta_m).abs() < 1e-12);
    }
}
