//! Rolling shutter: the camera's motion during the readout of a frame, from its neighbours in time.

use super::pose::Pose;
use super::stamped_pose::StampedPose;
use crate::camera::Sweep;
use nalgebra::Vector6;
use std::ops::Range;

/// The readout times of the rows of frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shutter {
    /// Time from reading the first row to reading the last, seconds; 0 for a global shutter,
    /// negative if rows are read bottom-up.
    readout_s: f64,
    /// Number of rows of a frame.
    rows: u32,
    /// Time of the middle row of each frame, seconds.
    times_s: Vec<f64>,
}

impl Shutter {
    /// Creates the readout of frames of `rows` rows whose last row is read `readout_s` (seconds)
    /// after the first. The times of `trajectory` are those of the middle rows.
    pub fn new(readout_s: f64, rows: u32, trajectory: &[StampedPose]) -> Self {
        Self {
            readout_s,
            rows,
            times_s: trajectory.iter().map(|stamped| stamped.time_s).collect(),
        }
    }

    /// The readout of some of the frames, counted from the first of them.
    pub fn of_frames(&self, frames: &Range<usize>) -> Self {
        let last = frames.end.min(self.times_s.len());
        Self {
            times_s: self.times_s[frames.start.min(last)..last].to_vec(),
            ..self.clone()
        }
    }

    /// Time from reading the first row to reading the last, seconds.
    pub fn readout_s(&self) -> f64 {
        self.readout_s
    }

    /// The camera's motion during the readout of each frame, for a smooth trajectory through
    /// `poses`.
    pub fn sweeps(&self, poses: &[Pose]) -> Vec<Sweep> {
        let pose = |k: usize| poses.get(k).copied();
        let sweep = |k| self.rate(k, pose).scaled(self.readout_s);
        if self.readout_s == 0.0 {
            vec![Sweep::default(); poses.len()]
        } else {
            (0..poses.len()).map(sweep).collect()
        }
    }

    /// The camera's motion per second of readout at frame `frame`; zero if `pose` has no pose of
    /// the frame or of both neighbours.
    ///
    /// With `ξ₋`, `ξ₊` the tangent vectors ([`Pose::local`]) to the poses before and after, and
    /// `h₋`, `h₊` the times to them, the velocity is that of the parabola through the three,
    ///
    /// `(h₋² ξ₊ − h₊² ξ₋)/(h₋ h₊ (h₋ + h₊))`:
    ///
    /// for uniform times the central difference, i.e. the tangent of the Catmull–Rom spline. At the
    /// ends of the trajectory the velocity is that to the only neighbour. Neighbouring poses must
    /// differ by less than half a turn.
    ///
    /// Source: E. Catmull, R. Rom, "A class of local interpolating splines", Computer Aided
    /// Geometric Design, 1974; A. W. Overhauser, "Analytic definition of curves and surfaces by
    /// parabolic blending", 1968.
    pub fn rate(&self, frame: usize, pose: impl Fn(usize) -> Option<Pose>) -> Sweep {
        let Some(own) = pose(frame) else {
            return Sweep::default();
        };
        let neighbour = |k: usize| {
            let apart_s = self.times_s.get(k)? - self.times_s.get(frame)?;
            Some((apart_s.abs(), own.local(&pose(k)?)))
        };
        let before = frame.checked_sub(1).and_then(neighbour);
        let velocity = match (before, neighbour(frame + 1)) {
            (Some((h0, xi0)), Some((h1, xi1))) => {
                (xi1 * (h0 * h0) - xi0 * (h1 * h1)) / (h0 * h1 * (h0 + h1))
            }
            (Some((h0, xi0)), None) => -xi0 / h0,
            (None, Some((h1, xi1))) => xi1 / h1,
            (None, None) => Vector6::zeros(),
        };
        // The motion covers as many row intervals as the frame has rows: one more than from first
        // to last.
        let rows = f64::from(self.rows.max(2));
        let moved = velocity * (rows / (rows - 1.0));
        Sweep {
            omega_rad: moved.fixed_rows::<3>(0).into(),
            nu_m: own
                .r_wc
                .inverse_transform_vector(&moved.fixed_rows::<3>(3).into()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::so3;
    use crate::trajectory::stamped_pose::indexed;
    use nalgebra::Vector3;

    /// A screw motion: constant velocity in the camera's own coordinates for the turn, in the
    /// world's for the shift.
    fn screw(time_s: f64) -> Pose {
        let start = so3::exp(&Vector3::new(0.1, 0.7, -0.2));
        let turn = so3::exp(&(Vector3::new(0.1, 1.5, 0.05) * time_s));
        Pose::new(start * turn, Vector3::new(0.1, 0.3, -0.05) * time_s)
    }

    fn stamped(times_s: &[f64]) -> Vec<StampedPose> {
        let stamp = |time_s: &f64| StampedPose {
            time_s: *time_s,
            pose: screw(*time_s),
        };
        times_s.iter().map(stamp).collect()
    }

    #[test]
    fn a_steady_motion_is_found_whatever_the_times() {
        let trajectory = stamped(&[0.0, 0.4, 0.5, 1.1, 1.3]);
        let poses = super::super::poses_of(&trajectory);
        let sweeps = Shutter::new(0.02, 481, &trajectory).sweeps(&poses);
        let picture_s = 0.02 * 481.0 / 480.0;
        for (sweep, pose) in sweeps.iter().zip(&poses) {
            assert!((sweep.omega_rad - Vector3::new(0.1, 1.5, 0.05) * picture_s).norm() < 1e-12);
            let shift = pose.r_wc * sweep.nu_m;
            assert!((shift - Vector3::new(0.1, 0.3, -0.05) * picture_s).norm() < 1e-12);
        }
    }

    /// The velocity of an accelerated motion is the instantaneous one.
    #[test]
    fn a_motion_that_speeds_up_is_followed() {
        let at = |time_s: f64| StampedPose {
            time_s,
            pose: screw(time_s + 0.3 * time_s * time_s),
        };
        let trajectory = [at(-0.2), at(0.0), at(0.3)];
        let poses = super::super::poses_of(&trajectory);
        let sweep = Shutter::new(0.01, 101, &trajectory).sweeps(&poses)[1];
        let expected = Vector3::new(0.1, 1.5, 0.05) * 0.0101;
        assert!((sweep.omega_rad - expected).norm() < 1e-12);
    }

    #[test]
    fn a_global_shutter_and_a_lone_frame_have_no_sweep() {
        let poses = [screw(0.0), screw(0.5)];
        let times = indexed(poses);
        for shutter in [Shutter::default(), Shutter::new(0.0, 480, &times)] {
            assert!(shutter.sweeps(&poses).iter().all(Sweep::is_none));
        }
        let alone = Shutter::new(0.02, 480, &times[..1]).sweeps(&poses[..1]);
        assert!(alone[0].is_none());
    }

    /// With a bottom-up readout the first row is read last.
    #[test]
    fn a_negative_time_turns_the_sweep_around() {
        let trajectory = stamped(&[0.0, 0.4, 0.9]);
        let poses = super::super::poses_of(&trajectory);
        let down = Shutter::new(0.02, 480, &trajectory).sweeps(&poses)[1];
        let up = Shutter::new(-0.02, 480, &trajectory).sweeps(&poses)[1];
        assert_eq!(up.omega_rad, -down.omega_rad);
        assert_eq!(up.nu_m, -down.nu_m);
    }
}
