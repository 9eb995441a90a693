//! The tunnel's axis along the straight line of the cameras, for poses of structure from motion.
//!
//! Programs of structure from motion place a model anywhere, along any axis. In a straight tunnel,
//! a camera that moves along it, or that revolves about its axis, tells where the axis is.

use super::pose_validation::{extend_along, line_of_revolving};
use alphanumeric_sort::compare_str;
use nalgebra::Vector3;
use tunnelstitch_geometry::trajectory::{
    Convention, Pose, PoseEntry, PoseFile, StraightPath, TunnelAxis,
};

/// Name of the file of the tunnel's axis, beside `survey.toml`.
pub const AXIS_FILE: &str = "axis.json";
/// Largest angle between the line and the world's y of poses that are in the frame of a tunnel.
const MAX_TILT_RAD: f64 = 5.0 * std::f64::consts::PI / 180.0;
/// Smallest length of the mean of the cameras' upward directions that all point the same way.
const MIN_MEAN_UP: f64 = 0.9;
/// Smallest sine of the angle between the cameras' upward direction and the axis.
const MIN_UP_SINE: f64 = 0.5;

/// A tunnel's axis, found in the poses.
#[derive(Clone, Debug, PartialEq)]
pub struct FoundAxis {
    /// The axis, metres.
    pub axis: TunnelAxis,
    /// The line through the camera centres, in the unit of the poses.
    pub path: StraightPath,
    /// Number of the poses.
    pub poses: usize,
}

impl FoundAxis {
    /// The tunnel's axis if poses are of structure from motion and on a straight line, or of
    /// cameras that revolve, and the line is not the world's y axis already. `unit_m` is the length
    /// of a unit of the poses, metres, 1 if it is not known; `radius_m` the tunnel's radius, if it
    /// is known.
    pub(super) fn of(file: &PoseFile, unit_m: Option<f64>, radius_m: Option<f64>) -> Option<Self> {
        if !file.format.has_arbitrary_world() {
            return None;
        }
        let has_scale = unit_m.is_some() || !file.format.has_no_scale();
        let unit_m = unit_m.unwrap_or(1.0);
        let poses = world_poses(file);
        let centres: Vec<Vector3<f64>> = poses.iter().map(|pose| pose.t_wc).collect();
        let straight = StraightPath::of(&centres);
        // Cameras that revolve show the axis by their way, even where they drift about it.
        let drifting = || StraightPath::along(&centres, line_of_revolving(&poses)?);
        let is_along_y = match &straight {
            Some(path) => path.direction.y.abs() > MAX_TILT_RAD.cos(),
            None => extend_along(&centres, &Vector3::y()),
        };
        let found = Self::on(straight.or_else(drifting)?, &poses, unit_m);
        let is_inside = |distance: f64| radius_m.is_none_or(|r| distance * unit_m < r);
        let off_y = poses.iter().map(|pose| pose.t_wc.xz().norm());
        let is_in_tunnel = is_along_y && is_inside(off_y.fold(0.0, f64::max));
        let is_possible = !has_scale || is_inside(found.path.max_distance);
        (!is_in_tunnel && is_possible).then_some(found)
    }

    /// The axis on the line through poses in their order; chainage 0 is at the first one.
    fn on(path: StraightPath, poses: &[Pose], unit_m: f64) -> Self {
        Self {
            axis: TunnelAxis {
                point_m: rounded(path.start * unit_m),
                axis: rounded(path.direction),
                theta_zero: upward(poses, &path.direction).map(rounded),
            },
            path,
            poses: poses.len(),
        }
    }
}

/// The poses of a file in its world, camera to world, in the order of their frames' names.
fn world_poses(file: &PoseFile) -> Vec<Pose> {
    let mut entries: Vec<&PoseEntry> = file.entries.iter().collect();
    if file.has_names() {
        let name = |entry: &&PoseEntry| entry.name.clone().unwrap_or_default();
        entries.sort_by(|a, b| compare_str(name(a), name(b)));
    }
    let convention = Convention::of(file.format);
    let in_world = |entry: &&PoseEntry| convention.to_world(&entry.pose);
    entries.iter().map(in_world).collect()
}

/// The mean direction of the upper edges of the pictures, if they agree and are not along the axis.
fn upward(poses: &[Pose], axis: &Vector3<f64>) -> Option<Vector3<f64>> {
    let sum: Vector3<f64> = poses.iter().map(|pose| pose.r_wc * -Vector3::y()).sum();
    let mean = sum / poses.len() as f64;
    let is_clear = mean.norm() > MIN_MEAN_UP && mean.cross(axis).norm() > MIN_UP_SINE;
    is_clear.then(|| mean.normalize())
}

/// Coordinates to a millionth; no negative zero.
fn rounded(v: Vector3<f64>) -> [f64; 3] {
    let digits = |value: f64| (value * 1e6).round() / 1e6 + 0.0;
    [digits(v.x), digits(v.y), digits(v.z)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::survey::discover::Discovery;
    use nalgebra::UnitQuaternion;
    use std::path::Path;
    use tunnelstitch_geometry::trajectory::{CameraAxes, PoseFormat, spiral};

    /// Poses of nerfstudio: a camera that looks along the tunnel, which lies anywhere.
    fn elsewhere(frame: &Pose, scale: f64) -> PoseFile {
        let turn = UnitQuaternion::from_scaled_axis(-Vector3::x() * std::f64::consts::FRAC_PI_2);
        let entry = |k: u32| {
            let sway = 0.002 * f64::from(k % 3);
            let centre = Vector3::new(sway, 0.1 * f64::from(k), 0.0);
            let pose = frame.after(&Pose::new(turn, centre));
            PoseEntry {
                camera: None,
                name: Some(format!("f{k}.png")),
                time_s: None,
                pose: CameraAxes::OpenGl.turn(&Pose::new(pose.r_wc, pose.t_wc * scale)),
            }
        };
        PoseFile {
            path: "transforms.json".into(),
            format: PoseFormat::Nerfstudio,
            // As some programs write them: in no order.
            entries: (0..30).rev().map(entry).collect(),
            conflicts: Vec::new(),
        }
    }

    fn found(poses: PoseFile, unit_m: Option<f64>, radius_m: Option<f64>) -> Discovery {
        let mut found = Discovery {
            poses: vec![(Path::new("transforms.json").into(), poses)],
            ..Discovery::default()
        };
        found.find_axis(unit_m, radius_m);
        found
    }

    #[test]
    fn the_line_of_the_cameras_is_the_axis() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
        let frame = Pose::new(rotation, Vector3::new(5.0, -3.0, 2.0));
        let discovery = found(elsewhere(&frame, 4.0), Some(0.25), Some(0.15));
        let axis = discovery.axis.clone().unwrap().axis;
        let mended = frame.inverse().after(&axis.frame().unwrap());
        // θ = 0 is up: the camera's upper edge, the tunnel's z.
        assert!(mended.r_wc.angle() < 1e-3, "{mended:?}");
        assert!(mended.t_wc.norm() < 0.005, "{mended:?}");
        let text = discovery.survey_toml(Some(0.15));
        assert!(
            text.contains("\ntunnel_frame = \"axis.json\"") && text.contains("\nunit_m = 0.25")
        );
        assert!(!discovery.lacks_scale());
    }

    #[test]
    fn without_a_scale_the_axis_is_in_units_of_the_poses() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
        let frame = Pose::new(rotation, Vector3::new(5.0, -3.0, 2.0));
        let poses = elsewhere(&frame, 400.0);
        let discovery = found(poses.clone(), None, Some(0.15));
        assert!(discovery.lacks_scale() && discovery.axis.is_some());
        assert!(discovery.survey_toml(None).contains("# unit_m"));
        // With a unit, cameras outside of the tunnel show that the line is not the axis.
        assert_eq!(found(poses, Some(1.0), Some(0.15)).axis, None);
    }

    /// Poses in a tunnel's frame, of a format that has its own world, and on no line.
    #[test]
    fn other_poses_stay_as_they_are() {
        let in_tunnel = elsewhere(&Pose::identity(), 1.0);
        assert_eq!(found(in_tunnel.clone(), None, Some(0.15)).axis, None);
        let aside = Pose::new(UnitQuaternion::identity(), Vector3::x());
        assert!(
            found(elsewhere(&aside, 1.0), None, Some(0.15))
                .axis
                .is_some()
        );
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::x());
        let mut tum = elsewhere(&Pose::new(rotation, Vector3::zeros()), 1.0);
        tum.format = PoseFormat::Tum;
        assert_eq!(found(tum, None, None).axis, None);
        let mut revolving = in_tunnel;
        for (entry, pose) in revolving.entries.iter_mut().zip(spiral(30, 0.1, 0.5)) {
            let arm = pose.r_wc * Vector3::z();
            entry.pose = Pose::new(pose.r_wc, pose.t_wc.zxy() + arm.zxy());
        }
        assert_eq!(found(revolving, None, None).axis, None);
    }

    /// A camera that revolves and drifts off the axis as it advances.
    fn revolving(frame: &Pose) -> PoseFile {
        let mut poses = elsewhere(frame, 1.0);
        let drift = |k: usize| Vector3::new(0.05, 0.0, -0.08) * (k as f64 / 5.0).sin();
        for (k, (entry, own)) in poses
            .entries
            .iter_mut()
            .zip(spiral(30, 0.1, 0.5))
            .enumerate()
        {
            let pose = frame.after(&Pose::new(own.r_wc, own.t_wc + drift(k)));
            entry.pose = CameraAxes::OpenGl.turn(&pose);
            entry.name = Some(format!("f{k}.png"));
        }
        poses
    }

    #[test]
    fn revolving_cameras_show_the_axis_by_their_way() {
        let rotation = UnitQuaternion::from_scaled_axis(Vector3::new(0.7, -1.1, 2.0));
        let frame = Pose::new(rotation, Vector3::new(5.0, -3.0, 2.0));
        let discovery = found(revolving(&frame), Some(1.0), Some(3.0));
        let axis = discovery.axis.unwrap().axis;
        let direction = rotation.inverse() * Vector3::from(axis.axis);
        // From one end of the drift, 0.094 m, to the other over 2.9 m, and no more.
        let slope = direction.xz().norm() / direction.y;
        assert!((0.0..2.0 * 0.094 / 2.9).contains(&slope), "{direction}");
        let local = frame.inverse();
        let point = local.r_wc * Vector3::from(axis.point_m) + local.t_wc;
        assert!(point.xz().norm() < 0.2, "{point}");
        // In the frame of a tunnel they stay as they are, though their line is tilted.
        assert_eq!(
            found(revolving(&Pose::identity()), None, Some(3.0)).axis,
            None
        );
    }
}
