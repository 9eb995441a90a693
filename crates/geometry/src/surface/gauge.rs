//! Gauge freedoms: the rigid motions that map the tunnel onto itself, which images cannot observe.

use crate::trajectory::{Pose, so3};
use nalgebra::{UnitQuaternion, Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// A directed line in the world.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// A point on it, metres.
    pub point: Vector3<f64>,
    /// Its direction, a unit vector.
    pub direction: Vector3<f64>,
}

impl Default for Axis {
    /// The world's y axis, the axis of a straight tunnel.
    fn default() -> Self {
        Self {
            point: Vector3::zeros(),
            direction: Vector3::y(),
        }
    }
}

impl Axis {
    fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// The rigid motions that leave a tunnel's shape unchanged. Applied to all poses, they change no
/// image; the prior fixes them, and exactly they are removed before errors are computed.
///
/// They rotate about an axis and translate along it. A straight round tunnel allows both, a
/// straight one of another section the translation, a straight round one of varying radius the
/// rotation, a bend of constant curvature the rotation about the bend's axis (a motion along the
/// tunnel), a helix the screw motion of its pitch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gauge {
    /// The axis.
    pub axis: Axis,
    /// True if the rotation about the axis is free; it includes a translation by `pitch_m` per
    /// radian.
    pub turn: bool,
    /// Translation coupled to the rotation, metres per radian.
    pub pitch_m: f64,
    /// True if the translation along the axis is free by itself.
    pub shift: bool,
}

impl Gauge {
    /// The gauge of a straight round tunnel along the world's y axis.
    pub fn round() -> Self {
        Self {
            turn: true,
            shift: true,
            ..Self::default()
        }
    }

    /// The gauge of any other straight tunnel along the world's y axis.
    pub fn straight() -> Self {
        Self {
            shift: true,
            ..Self::default()
        }
    }

    /// The gauge of a surface of revolution about the world's y axis that is no cylinder.
    pub fn revolved() -> Self {
        Self {
            turn: true,
            ..Self::default()
        }
    }

    /// Number of gauge freedoms.
    pub fn degrees_of_freedom(&self) -> usize {
        usize::from(self.turn) + usize::from(self.shift)
    }

    /// The tangent vectors `ξ` ([`Pose::retract`]) of `pose` along each freedom, per radian and per
    /// metre: `(Rᵀn, n × (t − p) + pitch n)` for the turn about the axis through p along n and
    /// `(0, n)` for the shift.
    pub fn directions(&self, pose: &Pose) -> Vec<Vector6<f64>> {
        let Axis { point, direction } = self.axis;
        let mut directions = Vec::with_capacity(2);
        if self.turn {
            let omega = pose.r_wc.inverse_transform_vector(&direction);
            let rho = direction.cross(&(pose.t_wc - point)) + direction * self.pitch_m;
            directions.push(Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z));
        }
        if self.shift {
            let n = direction;
            directions.push(Vector6::new(0.0, 0.0, 0.0, n.x, n.y, n.z));
        }
        directions
    }

    /// The gauge motion by `turn_rad` and `shift_m`; components that are not free are zero.
    pub fn motion(&self, turn_rad: f64, shift_m: f64) -> GaugeMotion {
        let turn_rad = if self.turn { turn_rad } else { 0.0 };
        let shift_m = if self.shift { shift_m } else { 0.0 };
        GaugeMotion {
            turn_rad,
            shift_m: shift_m + self.pitch_m * turn_rad,
            axis: self.axis,
        }
    }

    /// The gauge motion that best aligns `from` to `to`, in closed form.
    ///
    /// Turn: the α that minimises `Σ |R_to − R_n(α) R_from|²`. With `M = Σ R_to R_fromᵀ` and the
    /// axis n, `α = atan2(nᵀ(M − Mᵀ)ᵛ, tr M − nᵀ M n)`. Shift: the mean difference of `nᵀt`.
    /// Components that are not free are zero.
    ///
    /// If only the rotation is free, it may move cameras along the tunnel, where positions
    /// determine it better than rotations: the cost then includes `Σ |t_to − R_n(α) t_from|²`
    /// across the axis, with one radian weighted like one metre.
    pub fn align(&self, from: &[Pose], to: &[Pose]) -> GaugeMotion {
        let Axis {
            point,
            direction: n,
        } = self.axis;
        let (mut sine, mut cosine, mut shift) = (0.0, 0.0, 0.0);
        for (from, to) in from.iter().zip(to) {
            let m = (to.r_wc * from.r_wc.inverse()).to_rotation_matrix();
            let m = m.matrix();
            let odd = Vector3::new(
                m[(2, 1)] - m[(1, 2)],
                m[(0, 2)] - m[(2, 0)],
                m[(1, 0)] - m[(0, 1)],
            );
            sine += n.dot(&odd);
            cosine += m.trace() - n.dot(&(m * n));
            shift += (to.t_wc - from.t_wc).dot(&n);
            if !self.shift {
                let across = |t: &Vector3<f64>| {
                    let arm = t - point;
                    arm - n * arm.dot(&n)
                };
                let (from, to) = (across(&from.t_wc), across(&to.t_wc));
                // |R_to − R_from|² is twice the square of a small angle between them.
                sine += 2.0 * from.cross(&to).dot(&n);
                cosine += 2.0 * from.dot(&to);
            }
        }
        self.motion(sine.atan2(cosine), shift / from.len().max(1) as f64)
    }
}

/// A gauge motion: a rotation about the axis, then a translation along it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugeMotion {
    /// Rotation about the axis, radians.
    pub turn_rad: f64,
    /// Translation along the axis, metres.
    pub shift_m: f64,
    /// The axis.
    #[serde(default, skip_serializing_if = "Axis::is_default")]
    pub axis: Axis,
}

impl GaugeMotion {
    /// A motion about and along the world's y axis.
    pub fn about_y(turn_rad: f64, shift_m: f64) -> Self {
        Self {
            turn_rad,
            shift_m,
            axis: Axis::default(),
        }
    }

    /// True for the identity.
    pub fn is_none(&self) -> bool {
        self.turn_rad == 0.0 && self.shift_m == 0.0
    }

    /// The motion that undoes it.
    pub fn reversed(&self) -> Self {
        Self::default().plus(-1.0, self)
    }

    /// This and then `times` another about the same axis; they commute.
    pub fn plus(&self, times: f64, other: &Self) -> Self {
        Self {
            turn_rad: self.turn_rad + times * other.turn_rad,
            shift_m: self.shift_m + times * other.shift_m,
            axis: if self.is_none() {
                other.axis
            } else {
                self.axis
            },
        }
    }

    /// The turn, as a rotation of the world.
    pub fn rotation(&self) -> UnitQuaternion<f64> {
        so3::exp(&(self.axis.direction * self.turn_rad))
    }

    /// The moved pose: `R ← R_n(α) R`, `t ← R_n(α) (t − p) + p + d n`.
    pub fn apply(&self, pose: &Pose) -> Pose {
        let Axis { point, direction } = self.axis;
        let turn = self.rotation();
        Pose::new(
            turn * pose.r_wc,
            turn * (pose.t_wc - point) + point + direction * self.shift_m,
        )
    }

    /// The moved poses.
    pub fn apply_all(&self, poses: &[Pose]) -> Vec<Pose> {
        poses.iter().map(|pose| self.apply(pose)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::circle::Circle;
    use crate::surface::displacement::wall_jacobian;
    use crate::surface::shape::Surface;
    use proptest::prelude::*;

    fn poses() -> Vec<Pose> {
        (0..9)
            .map(|k| {
                let k = f64::from(k);
                Pose::new(
                    so3::exp(&Vector3::new(0.1 * k.sin(), 0.5 * k, 0.2 * k.cos())),
                    Vector3::new(0.2 * k.cos(), 0.1 * k, -0.3 * k.sin()),
                )
            })
            .collect()
    }

    proptest! {
        #[test]
        fn aligning_undoes_any_gauge_motion(turn_rad in -3.0f64..3.0, shift_m in -50.0f64..50.0) {
            let truth = poses();
            let motion = GaugeMotion::about_y(turn_rad, shift_m);
            let moved: Vec<_> = truth.iter().map(|pose| motion.apply(pose)).collect();
            let back = Gauge::round().align(&moved, &truth);
            for (moved, truth) in moved.iter().zip(&truth) {
                prop_assert!(truth.local(&back.apply(moved)).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn directions_are_the_derivatives_of_the_motion() {
        let pose = poses()[4];
        let directions = Gauge::round().directions(&pose);
        let step = 1e-6;
        for (k, direction) in directions.iter().enumerate() {
            let motion = |amount: f64| match k {
                0 => GaugeMotion::about_y(amount, 0.0),
                _ => GaugeMotion::about_y(0.0, amount),
            };
            let numeric = pose.local(&motion(step).apply(&pose)) / step;
            assert!((numeric - direction).norm() < 1e-5);
        }
    }

    /// The freedoms shift the whole wall of a circular tunnel rigidly, whatever the pose.
    #[test]
    fn the_gauge_moves_every_wall_point_alike() {
        let circle = Circle::new(3.0).unwrap();
        for pose in poses() {
            let directions = circle.gauge().directions(&pose);
            for d in [Vector3::z(), Vector3::new(0.4, -0.5, 1.0)] {
                let hit = circle.hit(&pose.t_wc, &(pose.r_wc * d)).unwrap();
                let jacobian = wall_jacobian(&pose, &circle.frame(hit.wall));
                let turned = jacobian * directions[0];
                assert!((turned.x - 3.0).abs() < 1e-9 && turned.y.abs() < 1e-9);
                let shifted = jacobian * directions[1];
                assert!(shifted.x.abs() < 1e-12 && (shifted.y - 1.0).abs() < 1e-12);
            }
        }
    }
}
