//! The relation of a rig's cameras as the refined poses show it.
//!
//! Every moment m gives the error `e_m` of a camera's place relative to the first one around the
//! given relation ([`crate::model::prior_terms::relation_error`]). The correction is their mean
//! over the moments at which both frames are photometric, its 1-σ their scatter over √n.

use crate::model::prior_terms::relation_error;
use nalgebra::Vector6;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::trajectory::{Pose, Rig};

/// Fewest moments that a correction is the mean of.
const MIN_MOMENTS: usize = 3;

/// The place of a camera relative to the first one, less the given one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct MountReport {
    /// Number of the camera, from 1 on; camera 0 is the one that others are relative to.
    pub camera: usize,
    /// Number of moments that show it.
    pub moments: usize,
    /// Rotation vector in the axes of the camera, degrees.
    pub rotation_deg: [f64; 3],
    /// 1-σ of each component, degrees.
    pub rotation_sigma_deg: f64,
    /// Translation along the axes of camera 0, millimetres.
    pub translation_mm: [f64; 3],
    /// 1-σ of each component, millimetres.
    pub translation_sigma_mm: f64,
}

impl MountReport {
    /// The reports of all cameras but the first that enough moments show; `poses`: refined, metres.
    pub fn of_rig(rig: &Rig, poses: &[Pose], photometric: &[bool]) -> Vec<Self> {
        let of_camera = |camera| Self::of_camera(rig, camera, poses, photometric);
        (1..rig.cameras()).filter_map(of_camera).collect()
    }

    fn of_camera(rig: &Rig, camera: usize, poses: &[Pose], photometric: &[bool]) -> Option<Self> {
        let firsts = (0..poses.len()).step_by(rig.cameras());
        let shown = firsts.filter(|k| photometric[*k] && photometric[k + camera]);
        let errors: Vec<Vector6<f64>> = shown
            .map(|k| {
                relation_error(
                    &rig.relation(k, k + camera),
                    &poses[k],
                    &poses[k + camera],
                    1.0,
                )
                .0
            })
            .collect();
        if errors.len() < MIN_MOMENTS {
            return None;
        }
        let count = errors.len() as f64;
        let mean = errors.iter().sum::<Vector6<f64>>() / count;
        let square = |from: usize| -> f64 {
            let left = errors
                .iter()
                .map(|e| (e - mean).fixed_rows::<3>(from).norm_squared());
            left.sum()
        };
        let sigma = |from: usize| (square(from) / (3.0 * (count - 1.0) * count)).sqrt();
        let part =
            |from: usize, unit: f64| -> [f64; 3] { (mean.fixed_rows::<3>(from) * unit).into() };
        Some(Self {
            camera,
            moments: errors.len(),
            rotation_deg: part(0, 1f64.to_degrees()),
            rotation_sigma_deg: sigma(0).to_degrees(),
            translation_mm: part(3, 1e3),
            translation_sigma_mm: 1e3 * sigma(3),
        })
    }

    /// The correction in a sentence without its full stop.
    pub fn sentence(&self) -> String {
        let size = |v: &[f64; 3]| v.iter().map(|x| x * x).sum::<f64>().sqrt();
        format!(
            "camera {} is turned by {:.4} ± {:.4}° and moved by {:.2} ± {:.2} mm against camera 0, \
             relative to the given mounts ({} moments)",
            self.camera,
            size(&self.rotation_deg),
            self.rotation_sigma_deg,
            size(&self.translation_mm),
            self.translation_sigma_mm,
            self.moments
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::prior_terms::tests::pose;
    use nalgebra::Vector3;
    use tunnelstitch_geometry::trajectory::so3;

    /// A second camera that is turned against its mount is found, frames on the prior apart.
    #[test]
    fn a_turned_mount_is_found() {
        let mounts = vec![pose(0.2), pose(0.5)];
        let turn = Pose::new(so3::exp(&Vector3::new(1e-3, 0.0, 0.0)), Vector3::zeros());
        let true_mounts = [mounts[0], mounts[1].after(&turn)];
        let rig = Rig::new(mounts, 1e-3, 1e-3).unwrap();
        let bodies = (0..6).map(|k| pose(0.3 * f64::from(k)));
        let mut poses: Vec<Pose> = bodies
            .flat_map(|body| true_mounts.map(|mount| body.after(&mount)))
            .collect();
        poses[7] = pose(3.0);
        let photometric: Vec<bool> = (0..12).map(|k| k != 7).collect();
        let found = MountReport::of_rig(&rig, &poses, &photometric);
        assert_eq!((found.len(), found[0].camera, found[0].moments), (1, 1, 5));
        let [x, y, z] = found[0].rotation_deg.map(f64::to_radians);
        assert!((x - 1e-3).abs() < 1e-9 && y.abs() < 1e-9 && z.abs() < 1e-9);
        assert!(found[0].translation_mm.iter().all(|x| x.abs() < 1e-9));
        assert!(MountReport::of_rig(&rig, &poses, &[false; 12]).is_empty());
    }
}
