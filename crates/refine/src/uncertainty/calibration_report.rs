//! Report of the self-calibration, in the units of the files.

use crate::linear::bordered_system::SharedBlock;
use crate::parameters::calibration::{
    BEND_INDEX, Calibration, Kappa, RADIUS_INDEX, SHARED_PARAMETERS,
};
use crate::uncertainty::observability::UnobservableParameter;
use crate::uncertainty::shared_parameter_names::{PARAMETERS, ParameterKind};
use serde::Serialize;
use tunnelstitch_geometry::camera::Camera;

/// One shared parameter of the report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct UnknownReport {
    /// `focal` (fx), `cx`, `cy`, `k1`, `k2`, `radius`, or of the tunnel's axis in the frame of the
    /// initial poses: how far it tilts about x and z, and how far it lies off along x and z; its
    /// curvature along x and z.
    pub name: &'static str,
    /// Its unit: `px`, `m`, `deg`, `1/m`, or `1`.
    pub unit: &'static str,
    /// The value given.
    pub initial: f64,
    /// The estimate; the value given if it cannot be observed.
    pub estimate: f64,
    /// 1-σ of the estimate, or of what would be estimated if it cannot be observed.
    pub sigma: f64,
    /// 1-σ of the value given.
    pub prior_sigma: f64,
    /// True if the data observe it.
    pub observed: bool,
    /// The reason if they do not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
}

/// The self-calibration of the report.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct CalibrationReport {
    /// The parameters that were to be estimated.
    pub unknowns: Vec<UnknownReport>,
    /// The camera to use with the poses; of a rig, whose cameras are as given, its first.
    pub camera: Camera,
    /// The tunnel's radius to use with the poses, metres.
    pub radius_m: f64,
    /// A point of the tunnel's axis in the frame of the initial poses, metres.
    pub axis_point_m: [f64; 3],
    /// The direction of the tunnel's axis in the frame of the initial poses.
    pub axis_direction: [f64; 3],
}

impl CalibrationReport {
    /// Reports κ with its covariance; `unobservable`: parameters at their given values.
    pub fn new(
        calibration: &Calibration,
        kappa: &Kappa,
        covariance: &SharedBlock,
        unobservable: &[UnobservableParameter],
        given_radius_m: f64,
    ) -> Self {
        let given = calibration.given.of(0);
        let [k1, k2] = given.lens.k1_k2();
        // The axis moves in the initial poses' frame as that frame would have to move back.
        let (point, direction) = calibration.datum(kappa).axis();
        let tilt = [direction.z, -direction.x].map(|sine| sine.asin());
        let radius_m = given_radius_m * kappa[RADIUS_INDEX].exp();
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
            kappa[BEND_INDEX],
            kappa[BEND_INDEX + 1],
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
            0.0,
            0.0,
        ];
        let is_asked_for =
            |k: &usize| calibration.free[*k] || unobservable.iter().any(|r| r.unknown == *k);
        let unknowns = (0..SHARED_PARAMETERS).filter(is_asked_for).map(|k| {
            let unobserved = unobservable.iter().find(|one| one.unknown == k);
            let (name, kind) = PARAMETERS[k];
            // From κ to the unit of the report.
            let (unit, scale) = match kind {
                ParameterKind::Focal => ("px", estimates[k]),
                ParameterKind::Pixel => ("px", 1.0),
                ParameterKind::Plain => ("1", 1.0),
                ParameterKind::Radius => ("m", estimates[k]),
                ParameterKind::Tilt => ("deg", 1f64.to_degrees()),
                ParameterKind::Offset => ("m", 1.0),
                ParameterKind::Time => ("ms", 1e3),
                ParameterKind::Curvature => ("1/m", 1.0),
            };
            let sigma = unobserved.map_or(covariance[(k, k)].sqrt(), |one| one.sigma);
            UnknownReport {
                name,
                unit,
                initial: initial[k],
                estimate: estimates[k],
                sigma: scale * sigma,
                prior_sigma: scale * calibration.sigma[k],
                observed: unobserved.is_none(),
                reason: unobserved.map(|one| one.reason.clone()),
            }
        });
        Self {
            unknowns: unknowns.collect(),
            camera: (calibration.cameras(kappa)).map_or(*given, |cameras| *cameras.of(0)),
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
            ..Calibration::none(Camera::from_vertical_fov(160, 120, 1.0))
        }
    }

    #[test]
    fn report_is_in_the_units_of_the_files() {
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
