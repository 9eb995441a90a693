//! A rig of several cameras on the carrier.

use crate::error::{SimulateError, check_option};
use nalgebra::Vector3;
use serde::Serialize;
use tunnelstitch_geometry::camera::Camera;
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Distance of a camera from the axis of the rig, in its direction of view, metres.
const ARM_M: f64 = 0.04;
/// Distance of a camera from the one before it along the axis of the rig, metres.
const SPACING_M: f64 = 0.03;
/// Tilt and roll of the cameras from one to the next, degrees: no mount is exact.
const TILT_DEG: [f64; 2] = [0.7, -0.5];
/// Focal length of a camera over that of the one before it, less 1.
const FOCAL_STEP: f64 = 0.004;
/// Principal point of a camera less that of the one before it, shares of the width and height.
const CENTRE_STEP: [f64; 2] = [0.004, -0.003];

/// Several cameras, spread by equal angles about the y axis of the first: that of the carrier, if
/// it looks at the wall beside it.
///
/// The body of the rig has the pose that a single camera would have.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RigOptions {
    /// Number of cameras.
    pub cameras: u32,
    /// Angle between the first and the last camera, degrees; by default they are spread all around.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub spread_deg: Option<f64>,
}

impl RigOptions {
    /// Checks every value.
    ///
    /// # Errors
    /// [`SimulateError::Option`].
    pub(super) fn validate(&self) -> Result<(), SimulateError> {
        check_option(
            (2..=16).contains(&self.cameras),
            "a rig must have 2 to 16 cameras",
        )?;
        check_option(
            self.spread_deg
                .is_none_or(|deg| (0.0..=360.0).contains(&deg)),
            "the angle between the first and the last camera of a rig must lie between 0 and 360 \
             degrees",
        )
    }

    /// Angle from one camera to the next, degrees.
    fn step_deg(&self) -> f64 {
        match self.spread_deg {
            Some(spread_deg) => spread_deg / f64::from(self.cameras - 1),
            None => 360.0 / f64::from(self.cameras),
        }
    }

    /// The cameras: the given one first, the others a little different.
    pub(super) fn cameras(&self, first: &Camera) -> Vec<Camera> {
        let camera = |k: u32| {
            let focal = 1.0 + FOCAL_STEP * f64::from(k);
            let [right, down] = CENTRE_STEP.map(|share| share * f64::from(k));
            Camera {
                fx: first.fx * focal,
                fy: first.fy * focal,
                cx: first.cx + right * f64::from(first.width),
                cy: first.cy + down * f64::from(first.height),
                ..*first
            }
        };
        (0..self.cameras).map(camera).collect()
    }

    /// The poses of the cameras in the body, whose y axis is that of the carrier.
    pub(super) fn mounts(&self) -> Vec<Pose> {
        let mount = |k: u32| {
            let k = f64::from(k);
            let about = so3::exp(&(Vector3::y() * (self.step_deg() * k).to_radians()));
            let [tilt, roll] = TILT_DEG.map(|deg| (deg * k).to_radians());
            let place = about * Vector3::new(0.0, 0.0, ARM_M) + Vector3::y() * (SPACING_M * k);
            let turned =
                about * so3::exp(&(Vector3::x() * tilt)) * so3::exp(&(Vector3::z() * roll));
            Pose::new(turned, place)
        };
        (0..self.cameras).map(mount).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cameras_are_spread_about_the_axis() {
        let rig = |cameras, spread_deg| RigOptions {
            cameras,
            spread_deg,
        };
        let angles = |rig: RigOptions| -> Vec<f64> {
            let mounts = rig.mounts().into_iter();
            let views = mounts.map(|mount| mount.r_wc * Vector3::z());
            views
                .map(|view| view.x.atan2(view.z).to_degrees().round())
                .collect()
        };
        assert_eq!(angles(rig(3, None)), [0.0, 120.0, -120.0]);
        assert_eq!(angles(rig(3, Some(90.0))), [0.0, 45.0, 90.0]);
        let first = Camera::from_vertical_fov(64, 48, 1.0);
        let cameras = rig(2, None).cameras(&first);
        assert_eq!(cameras[0], first);
        assert!(cameras[1].fx > first.fx && cameras[1].cx > first.cx);
        assert!(rig(1, None).validate().is_err());
        assert!(rig(2, Some(400.0)).validate().is_err());
    }
}
