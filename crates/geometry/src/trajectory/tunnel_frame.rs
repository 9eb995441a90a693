//! The tunnel's frame in the world of the poses.

use super::error::PoseError;
use super::pose::Pose;
use super::{mount, text};
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A tunnel's axis: the point of chainage 0 and the direction of increasing chainage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TunnelAxis {
    /// The point of chainage 0, metres.
    pub point_m: [f64; 3],
    /// Direction of the axis, of any length.
    pub axis: [f64; 3],
    /// The direction of θ = 0, projected perpendicular to the axis. The default is the world's z,
    /// or its x for an axis along z.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub theta_zero: Option<[f64; 3]>,
}

/// Smallest sine of the angle between two directions that span a plane.
const MIN_SINE: f64 = 1e-3;

impl TunnelAxis {
    /// The tunnel's frame, `x_world = T x_tunnel`: y along the axis, z towards θ = 0, x = y × z.
    ///
    /// # Errors
    /// Numbers that are not finite, an axis of length zero, a θ = 0 along the axis.
    pub fn frame(&self) -> Result<Pose, String> {
        let point = Vector3::from(self.point_m);
        if !point.iter().all(|value| value.is_finite()) {
            return Err("point_m is not finite".to_owned());
        }
        let unit = |name: &str, [x, y, z]: [f64; 3]| {
            Vector3::new(x, y, z)
                .try_normalize(1e-12)
                .filter(|direction| direction.iter().all(|value| value.is_finite()))
                .ok_or_else(|| {
                    format!("{name} has no direction; it must be three numbers, not all zero")
                })
        };
        let y = unit("axis", self.axis)?;
        let towards = match self.theta_zero {
            Some(direction) => unit("theta_zero", direction)?,
            None if y.z.abs() < 0.9 => Vector3::z(),
            None => Vector3::x(),
        };
        let z = (towards - y * towards.dot(&y))
            .try_normalize(MIN_SINE)
            .ok_or("theta_zero is the axis's own direction; it must point away from it")?;
        let r = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[y.cross(&z), y, z]));
        Ok(Pose::new(UnitQuaternion::from_rotation_matrix(&r), point))
    }
}

/// Reads the tunnel's frame in the world of the poses, `x_world = T x_tunnel`.
///
/// The file is either a 4 × 4 matrix of text, one row per line, whose columns are the tunnel's x, y
/// (the axis) and z (θ = 0) and its origin in the world; or JSON:
/// `{"point_m": [x, y, z], "axis": [x, y, z]}` and optionally `"theta_zero": [x, y, z]`.
///
/// # Errors
/// An unreadable file; a matrix that is no rigid motion; JSON with other keys, or without
/// directions.
pub fn read_tunnel_frame(path: &Path) -> Result<Pose, PoseError> {
    let text = text::read(path)?;
    if !text.trim_start().starts_with('{') {
        return mount::read_matrix(path, &text);
    }
    let fail = |what: String| PoseError::file(path, what);
    let axis: TunnelAxis = serde_json::from_str(&text).map_err(|error| fail(error.to_string()))?;
    axis.frame().map_err(fail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_text(text: &str) -> Result<Pose, PoseError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frame");
        std::fs::write(&path, text).unwrap();
        read_tunnel_frame(&path)
    }

    #[test]
    fn an_axis_and_a_matrix_say_the_same() {
        // Along the world's x, θ = 0 upwards (the world's z).
        let axis =
            read_text(r#"{"point_m": [5, 1, 2], "axis": [2, 0, 0], "theta_zero": [3, 0, 1]}"#);
        let matrix = read_text("0 1 0 5\n-1 0 0 1\n0 0 1 2\n0 0 0 1\n").unwrap();
        assert!(axis.unwrap().local(&matrix).norm() < 1e-12);
        let chainage = matrix.to_camera(&Vector3::new(8.0, 1.0, 2.0));
        assert!((chainage - Vector3::new(0.0, 3.0, 0.0)).norm() < 1e-12);
    }

    #[test]
    fn the_tunnels_own_axis_changes_nothing() {
        let frame = read_text(r#"{"point_m": [0, 0, 0], "axis": [0, 1, 0]}"#).unwrap();
        assert!(frame.local(&Pose::identity()).norm() < 1e-15);
        let vertical = read_text(r#"{"point_m": [0, 0, 0], "axis": [0, 0, 1]}"#).unwrap();
        assert!((vertical.r_wc * Vector3::y() - Vector3::z()).norm() < 1e-12);
    }

    #[test]
    fn bad_files_say_what_is_wrong() {
        for (text, expected) in [
            (
                r#"{"point_m": [0, 0, 0], "axis": [0, 0, 0]}"#,
                "axis has no direction",
            ),
            (
                r#"{"point_m": [0, 0, 0], "axis": [0, 0, 1], "theta_zero": [0, 0, 2]}"#,
                "axis's own direction",
            ),
            (
                r#"{"point_m": [0, 0, 0], "direction": [0, 0, 1]}"#,
                "unknown field",
            ),
            (r#"{"point_m": [0, 0, 1e999], "axis": [0, 0, 1]}"#, "line 1"),
            ("2 0 0 0\n0 2 0 0\n0 0 2 0\n0 0 0 1\n", "scaled by 2"),
            ("", "0 rows"),
        ] {
            let message = read_text(text).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
