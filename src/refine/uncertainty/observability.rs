//! What the data tell about the shared unknowns, and what they cannot.
//!
//! After a solve, `Σ_κ` ([`crate::refine::linear::bordered_system`]) is the covariance of the free unknowns. One that is
//! hardly more certain than its prior is unobservable: it is held at the value given, and the rest
//! solved without it. The worst goes first, for without it another may be certain.

use crate::camera::Camera;
use crate::refine::linear::bordered_system::{
    BorderBlock, SchurComplement, SharedBlock, reduce_to_shared,
};
use crate::refine::linear::sparse_cholesky::FactorError;
use crate::refine::parameters::calibration::{Calibration, Kappa, SHARED_PARAMETERS};
use crate::refine::solver::gauss_newton::Solution;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// A posterior 1-σ beyond this share of the prior's is not an observation.
const MOST_UNCERTAIN: f64 = 0.5;
/// Correlation with another unknown that is worth a word.
const CLOSE_CORRELATION: f64 = 0.9;

/// An unknown that was to be estimated and cannot be.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct UnobservableParameter {
    /// Which.
    pub unknown: usize,
    /// Its 1-σ had it been estimated.
    pub sigma: f64,
    /// Why.
    pub reason: String,
}

/// The equations of κ at a solution.
#[derive(Clone, Debug)]
pub struct Posterior {
    /// `W = H_pp⁻¹ H_pκ`, a block a frame.
    pub w: Vec<BorderBlock>,
    /// S.
    schur: SharedBlock,
    /// `E Q Eᵀ`, over the square of the score's curvature ([`crate::refine::uncertainty::covariance`]).
    scatter: SharedBlock,
}

impl Posterior {
    /// At a solution; None if the shared unknowns were not estimated.
    ///
    /// # Errors
    /// [`FactorError`] if the poses' normal matrix is singular.
    pub fn at(solution: &Solution) -> Result<Option<Self>, FactorError> {
        let (problem, at) = (&solution.problem, &solution.linearisation);
        let (Some(border), Some(border_scatter)) = (&at.border, &at.border_scatter) else {
            return Ok(None);
        };
        let pattern = problem.pattern();
        let factor = problem.symbolic().factorise(pattern, &at.normal, 0.0)?;
        let SchurComplement { w, schur } = border.eliminate(&factor, 0.0);
        let (prior, prior_border) = problem.prior_information(&solution.estimates, &solution.kappa);
        let scatter = (reduce_to_shared(pattern, &at.scatter, border_scatter, &w)
            + reduce_to_shared(pattern, &prior, &prior_border, &w))
            / solution.record.curvature().powi(2);
        Ok(Some(Self { w, schur, scatter }))
    }

    /// `Σ_κ` of the `free` unknowns, zero elsewhere; None if S is singular.
    pub fn covariance(&self, free: &[bool; SHARED_PARAMETERS]) -> Option<SharedBlock> {
        let places: Vec<usize> = (0..SHARED_PARAMETERS).filter(|k| free[*k]).collect();
        let n = places.len();
        let part = |of: &SharedBlock| DMatrix::from_fn(n, n, |r, c| of[(places[r], places[c])]);
        let inverse = part(&self.schur).cholesky()?.inverse();
        let small = &inverse * part(&self.scatter) * &inverse;
        let mut covariance = SharedBlock::zeros();
        for (r, row) in places.iter().enumerate() {
            for (c, column) in places.iter().enumerate() {
                covariance[(*row, *column)] = small[(r, c)];
            }
        }
        Some(covariance)
    }

    /// Refuses what the data cannot observe, one by one, the worst first. A singular S refuses all.
    pub fn find_unobservable(&self, calibration: &Calibration) -> Vec<UnobservableParameter> {
        let mut free = calibration.free;
        let mut unobservable = Vec::new();
        while free.contains(&true) {
            let covariance = self
                .covariance(&free)
                .unwrap_or_else(|| SharedBlock::from_diagonal(&Kappa::repeat(f64::INFINITY)));
            let share = |k: usize| covariance[(k, k)].sqrt() / calibration.sigma[k];
            let worst = (0..SHARED_PARAMETERS)
                .filter(|k| free[*k])
                .max_by(|a, b| share(*a).total_cmp(&share(*b)));
            let Some(worst) = worst.filter(|k| share(*k).is_nan() || share(*k) > MOST_UNCERTAIN)
            else {
                break;
            };
            // The prior bounds it, whatever the scatter.
            let sigma = covariance[(worst, worst)].sqrt();
            unobservable.push(UnobservableParameter {
                unknown: worst,
                sigma: sigma.min(calibration.sigma[worst]),
                reason: reason(worst, &covariance, &free),
            });
            free[worst] = false;
        }
        unobservable
    }
}

fn reason(unknown: usize, covariance: &SharedBlock, free: &[bool; SHARED_PARAMETERS]) -> String {
    let mut reason = match NAMES[unknown].1 {
        Kind::Radius => "pictures stay the same when the radius and all positions grow together, and the steps of the \
                         initial poses are not sure enough to tell metres; measure the radius, or give poses with smaller \
                         [prior] translation_sigma_m"
            .to_owned(),
        Kind::Tilt | Kind::Offset => "pictures show how the cameras stand in the tunnel, whatever the frame of the initial poses; \
                         only these poses themselves can tell, and they are not sure enough"
            .to_owned(),
        Kind::Focal | Kind::Pixel | Kind::Plain | Kind::Time => {
            "the frames leave it nearly as uncertain as it was: too little overlap, texture, or width of view".to_owned()
        }
    };
    let correlation = |k: usize| {
        let variances = covariance[(k, k)] * covariance[(unknown, unknown)];
        covariance[(unknown, k)] / variances.sqrt()
    };
    let twin = (0..SHARED_PARAMETERS)
        .filter(|k| *k != unknown && free[*k])
        .map(|k| (k, correlation(k)))
        .filter(|(_, r)| r.is_finite() && r.abs() > CLOSE_CORRELATION)
        .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    if let Some((twin, r)) = twin {
        reason += &format!(
            "; it goes with {} (correlation {r:.3}): estimate one of the two",
            NAMES[twin].0
        );
    }
    reason
}

/// How an unknown is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Focal,
    Pixel,
    Plain,
    Time,
    Radius,
    Tilt,
    Offset,
}

/// Names in the report, in the order of κ.
const NAMES: [(&str, Kind); SHARED_PARAMETERS] = [
    ("focal", Kind::Focal),
    ("cx", Kind::Pixel),
    ("cy", Kind::Pixel),
    ("k1", Kind::Plain),
    ("k2", Kind::Plain),
    ("radius", Kind::Radius),
    ("axis_tilt_x", Kind::Tilt),
    ("axis_tilt_z", Kind::Tilt),
    ("axis_offset_x", Kind::Offset),
    ("axis_offset_z", Kind::Offset),
    ("readout", Kind::Time),
];

/// One shared unknown of the report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct UnknownReport {
    /// `focal` (fx), `cx`, `cy`, `k1`, `k2`, `radius`, or of the tunnel's axis in the frame of the
    /// initial poses: how far it tilts about x and z, and how far it lies off along x and z.
    pub name: &'static str,
    /// Its unit: `px`, `m`, `deg`, or `1`.
    pub unit: &'static str,
    /// The value given.
    pub initial: f64,
    /// The estimate; the value given if it cannot be observed.
    pub estimate: f64,
    /// 1-σ of the estimate; if it cannot be observed, what it would have had.
    pub sigma: f64,
    /// 1-σ of the value given.
    pub prior_sigma: f64,
    /// Whether the data observe it.
    pub observed: bool,
    /// Why not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// Self-calibration in the report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct CalibrationReport {
    /// What was to be estimated.
    pub unknowns: Vec<UnknownReport>,
    /// The camera to use with the poses.
    pub camera: Camera,
    /// The tunnel's radius to use with the poses, metres.
    pub radius_m: f64,
    /// The tunnel's axis in the frame of the initial poses: a point, metres, and the direction.
    pub axis_point_m: [f64; 3],
    /// The same: its direction.
    pub axis_direction: [f64; 3],
}

impl CalibrationReport {
    /// Reads κ with its covariance; `unobservable` are at their given values.
    pub fn new(
        calibration: &Calibration,
        kappa: &Kappa,
        covariance: &SharedBlock,
        unobservable: &[UnobservableParameter],
        given_radius_m: f64,
    ) -> Self {
        let given = &calibration.given;
        let [k1, k2] = given.lens.k1_k2();
        // The axis moves in the initial poses' frame as that frame would have to move back.
        let (point, direction) = calibration.datum(kappa).axis();
        let tilt = [direction.z, -direction.x].map(|sine| sine.asin());
        let radius_m =
            given_radius_m * kappa[crate::refine::parameters::calibration::RADIUS_INDEX].exp();
        let estimates = [
            given.fx * kappa[0].exp(),
            given.cx + kappa[1],
            given.cy + kappa[2],
            k1 + kappa[3],
            k2 + kappa[4],
            radius_m,
            tilt[0].to_degrees(),
            tilt[1].to_degrees(),
            point.x,
            point.z,
            1e3 * calibration.readout_s(kappa),
        ];
        let initial = [
            given.fx,
            given.cx,
            given.cy,
            k1,
            k2,
            given_radius_m,
            0.0,
            0.0,
            0.0,
            0.0,
            1e3 * calibration.readout_s,
        ];
        let asked =
            |k: &usize| calibration.free[*k] || unobservable.iter().any(|r| r.unknown == *k);
        let unknowns = (0..SHARED_PARAMETERS).filter(asked).map(|k| {
            let refusal = unobservable.iter().find(|refusal| refusal.unknown == k);
            let (name, kind) = NAMES[k];
            // From κ to the unit of the report.
            let (unit, scale) = match kind {
                Kind::Focal => ("px", estimates[k]),
                Kind::Pixel => ("px", 1.0),
                Kind::Plain => ("1", 1.0),
                Kind::Radius => ("m", estimates[k]),
                Kind::Tilt => ("deg", 1f64.to_degrees()),
                Kind::Offset => ("m", 1.0),
                Kind::Time => ("ms", 1e3),
            };
            let sigma = refusal.map_or(covariance[(k, k)].sqrt(), |refusal| refusal.sigma);
            UnknownReport {
                name,
                unit,
                initial: initial[k],
                estimate: estimates[k],
                sigma: scale * sigma,
                prior_sigma: scale * calibration.sigma[k],
                observed: refusal.is_none(),
                reason: refusal.map(|refusal| refusal.reason.clone()),
            }
        });
        Self {
            unknowns: unknowns.collect(),
            camera: calibration.camera(kappa).unwrap_or(*given),
            radius_m,
            axis_point_m: point.into(),
            axis_direction: direction.into(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn calibration() -> Calibration {
        Calibration {
            free: [true; SHARED_PARAMETERS],
            sigma: Kappa::repeat(0.1),
            ..Calibration::none(&Camera::from_vertical_fov(160, 120, 1.0))
        }
    }

    /// Where the scatter is what the model says.
    fn posterior(schur: SharedBlock) -> Posterior {
        Posterior {
            w: Vec::new(),
            schur,
            scatter: schur,
        }
    }

    #[test]
    fn what_the_prior_alone_knows_is_refused() {
        // The prior's information is 100.
        let mut schur = SharedBlock::identity() * 1e4;
        schur[(5, 5)] = 110.0;
        let unobservable = posterior(schur).find_unobservable(&calibration());
        assert_eq!(unobservable.len(), 1);
        assert_eq!(unobservable[0].unknown, 5);
        assert!((unobservable[0].sigma - 110f64.powf(-0.5)).abs() < 1e-12);
        assert!(unobservable[0].reason.contains("radius"));
        let sure = posterior(SharedBlock::identity() * 1e4);
        assert!(sure.find_unobservable(&calibration()).is_empty());
    }

    /// Two that the data know only together: one goes, the other stays.
    #[test]
    fn of_two_that_go_together_one_is_refused() {
        let mut schur = SharedBlock::identity() * 1e4;
        for (r, c) in [(3, 3), (3, 4), (4, 3), (4, 4)] {
            schur[(r, c)] = 1e6 + if r == c { 100.0 } else { 0.0 };
        }
        let unobservable = posterior(schur).find_unobservable(&calibration());
        assert_eq!(unobservable.len(), 1);
        assert!([3, 4].contains(&unobservable[0].unknown));
        assert!(
            unobservable[0].reason.contains("goes with k"),
            "{}",
            unobservable[0].reason
        );
    }

    #[test]
    fn a_report_is_in_the_units_of_the_files() {
        let mut kappa = Kappa::zeros();
        (kappa[0], kappa[5], kappa[8]) = (0.01, -0.02, 0.3);
        let covariance = SharedBlock::identity() * 1e-6;
        let report = CalibrationReport::new(&calibration(), &kappa, &covariance, &[], 3.0);
        let unknown = |name: &str| report.unknowns.iter().find(|u| u.name == name).unwrap();
        let focal = unknown("focal");
        assert!((focal.estimate / focal.initial - 0.01f64.exp()).abs() < 1e-12);
        assert!((focal.sigma / focal.estimate - 1e-3).abs() < 1e-12);
        assert!((unknown("radius").estimate - 3.0 * (-0.02f64).exp()).abs() < 1e-12);
        assert!((unknown("axis_offset_x").estimate + 0.3).abs() < 1e-12);
    }
}
