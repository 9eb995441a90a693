//! Continuous camera motion through the true poses, for rolling-shutter frames.

use tunnelstitch_geometry::trajectory::Pose;

/// Smooth path of the camera through the true poses of the frames, equally spaced in time.
///
/// It is a Catmull–Rom spline, evaluated by Barry and Goldman's pyramid of linear interpolations
/// (spherical ones for rotations). Between the poses P_k and P_{k+1}, at the share s of the
/// interval,
///
/// `A_i = P_{k+i−2} → P_{k+i−1} at s + 2 − i` for i = 1, 2, 3, `B_1 = A_1 → A_2 at (s + 1)/2`,
/// `B_2 = A_2 → A_3 at s/2`, `B_1 → B_2 at s`.
///
/// Motion of constant velocity is reproduced exactly. Beyond the first and the last pose the
/// motion is extrapolated with the velocity of the outermost interval.
///
/// Source: P. J. Barry, R. N. Goldman, "A recursive evaluation algorithm for a class of Catmull–Rom
/// splines", SIGGRAPH 1988.
pub(super) struct CameraPath {
    poses: Vec<Pose>,
    /// Readout time from the first row to the last, over the time between frames.
    readout_share: f64,
    /// Rows of a frame.
    rows: u32,
}

impl CameraPath {
    /// The path through `poses`; reading the `rows` rows of a frame takes `readout_share` of the
    /// time between frames.
    pub fn new(poses: Vec<Pose>, readout_share: f64, rows: u32) -> Self {
        Self {
            poses,
            readout_share,
            rows,
        }
    }

    /// The poses of the frames, at the time of their middle rows.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The camera's pose while row `v` of frame `frame` is read, after a delay that is given as a
    /// share of the time between frames.
    pub fn pose_at_row(&self, frame: usize, v: f64, delay: f64) -> Pose {
        if self.readout_share == 0.0 && delay == 0.0 {
            return self.poses[frame];
        }
        let last = f64::from(self.rows - 1);
        let s = self.readout_share * (v / last - 0.5) + delay;
        let whole = s.floor();
        self.interpolate(frame as i64 + whole as i64, s - whole)
    }

    /// The pose at the share `s` of the interval from pose `k` to the next.
    fn interpolate(&self, k: i64, s: f64) -> Pose {
        let [before, from, to, after] = [k - 1, k, k + 1, k + 2].map(|k| self.pose(k));
        let a = [
            lerp_pose(&before, &from, s + 1.0),
            lerp_pose(&from, &to, s),
            lerp_pose(&to, &after, s - 1.0),
        ];
        let b = [
            lerp_pose(&a[0], &a[1], 0.5 * (s + 1.0)),
            lerp_pose(&a[1], &a[2], 0.5 * s),
        ];
        lerp_pose(&b[0], &b[1], s)
    }

    /// Pose `k`, extrapolated linearly beyond the ends.
    fn pose(&self, k: i64) -> Pose {
        let last = self.poses.len() as i64 - 1;
        let end = k.clamp(0, last);
        let inward = if k < 0 { end + 1 } else { end - 1 };
        let (at_end, inner) = (self.poses[end as usize], inward.clamp(0, last) as usize);
        if k == end {
            at_end
        } else {
            lerp_pose(&self.poses[inner], &at_end, 1.0 + (k - end).abs() as f64)
        }
    }
}

/// Linear interpolation between two poses, or extrapolation for `s` outside 0–1.
fn lerp_pose(from: &Pose, to: &Pose, s: f64) -> Pose {
    let turn = from.r_wc.inverse() * to.r_wc;
    Pose::new(
        from.r_wc * turn.powf(s),
        from.t_wc + (to.t_wc - from.t_wc) * s,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use tunnelstitch_geometry::trajectory::spiral;

    fn distance(a: &Pose, b: &Pose) -> f64 {
        a.r_wc.angle_to(&b.r_wc) + (a.t_wc - b.t_wc).norm()
    }

    #[test]
    fn constant_velocity_is_reproduced_up_to_the_ends() {
        let turn = 30f64.to_radians();
        let path = CameraPath::new(spiral(5, 0.1, turn), 0.06, 121);
        for frame in 0..5 {
            for row in [0.0, 30.0, 60.0, 120.0] {
                let along = frame as f64 + 0.06 * (row / 120.0 - 0.5);
                let pose = path.pose_at_row(frame, row, 0.0);
                let turned = Vector3::y() * (turn * along);
                let expected = Pose::new(
                    nalgebra::UnitQuaternion::from_scaled_axis(turned),
                    Vector3::y() * (0.1 * along),
                );
                assert!(distance(&pose, &expected) < 1e-12, "{frame} {row}");
                // A delay is time, as is the row.
                let later = path.pose_at_row(frame, 60.0, 0.06 * (row / 120.0 - 0.5));
                assert!(distance(&later, &pose) < 1e-12, "{frame} {row}");
            }
        }
    }

    /// The path passes through the poses, continuous in position and velocity.
    #[test]
    fn the_path_through_uneven_poses_is_smooth() {
        let mut poses = spiral(6, 0.1, 0.5);
        for (k, pose) in poses.iter_mut().enumerate() {
            let k = k as f64;
            let nudge = Vector3::new((3.0 * k).sin(), (5.0 * k).sin(), (7.0 * k).sin());
            *pose = pose.retract(&nalgebra::Vector6::new(
                0.04 * nudge.x,
                0.04 * nudge.y,
                0.04 * nudge.z,
                0.02 * nudge.z,
                0.02 * nudge.x,
                0.02 * nudge.y,
            ));
        }
        let path = CameraPath::new(poses.clone(), 0.1, 101);
        for k in 1..5 {
            assert!(distance(&path.pose_at_row(k, 50.0, 0.0), &poses[k]) < 1e-12);
            let step = 1e-5;
            let at = |s: f64| path.pose_at_row(k, 50.0 + 1000.0 * s, 0.0);
            let (before, after) = (at(0.0).local(&at(-step)), at(0.0).local(&at(step)));
            assert!((before + after).norm() / step < 1e-3);
            // The tangent of a Catmull–Rom spline.
            let pose = &poses[k];
            let tangent = (pose.local(&poses[k + 1]) - pose.local(&poses[k - 1])) * 0.5;
            assert!((after / step - tangent).norm() < 1e-3);
        }
    }
}
