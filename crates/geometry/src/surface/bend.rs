//! A constant curvature of a tunnel that was planned straight.

use super::gauge::GaugeMotion;
use crate::trajectory::{Pose, so3};
use nalgebra::{UnitQuaternion, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Angle below which `sin φ/φ` is 1 to the last bit.
const SMALL_ANGLE_RAD: f64 = 1e-8;

/// A constant curvature c of a tunnel along the world's y axis: its axis is an arc of radius
/// `1/|c|` that touches the y axis at the chainage `h_0` and turns towards c.
///
/// With `φ = |c| (h − h_0)` and the unit vector u along c, in the x–z plane, the axis is
///
/// `C(h) = (0, h_0, 0) + y sin φ/|c| + u (1 − cos φ)/|c|`,  `Q(h) = exp(φ y × u)`,
///
/// and a straight tunnel's point at chainage h and `a` across goes to `C(h) + Q(h) a`. Q is the
/// rotation-minimising frame of the arc.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bend {
    /// Curvature along x and z, 1/m.
    pub curvature_per_m: [f64; 2],
    /// `h_0`, metres.
    pub at_h_m: f64,
}

/// Axis and frame of a bend at a chainage.
#[derive(Clone, Copy, Debug)]
pub(super) struct BendFrame {
    /// `C`, metres.
    pub point: Vector3<f64>,
    /// `Q`.
    pub frame: UnitQuaternion<f64>,
}

impl Bend {
    /// The curvature as a vector in the world.
    fn curvature(&self) -> Vector3<f64> {
        Vector3::new(self.curvature_per_m[0], 0.0, self.curvature_per_m[1])
    }

    /// Radius of the arc, metres; infinite without curvature.
    pub fn radius_m(&self) -> f64 {
        1.0 / Vector2::from(self.curvature_per_m).norm()
    }

    /// `y × c`: the rotation vector of the frame per metre of chainage.
    pub(super) fn turn_per_m(&self) -> Vector3<f64> {
        Vector3::y().cross(&self.curvature())
    }

    pub(super) fn at(&self, h_m: f64) -> BendFrame {
        let along_m = h_m - self.at_h_m;
        let turn = self.turn_per_m() * along_m;
        let phi = turn.norm();
        let half = sinc(0.5 * phi);
        let y = self.at_h_m + along_m * sinc(phi);
        let across = self.curvature() * (0.5 * along_m * along_m * half * half);
        BendFrame {
            point: Vector3::new(across.x, y, across.z),
            frame: so3::exp(&turn),
        }
    }

    /// The bend after a motion of everything about and along the world's y axis.
    pub fn moved(&self, motion: &GaugeMotion) -> Self {
        let curvature = motion.rotation() * self.curvature();
        Self {
            curvature_per_m: [curvature.x, curvature.z],
            at_h_m: self.at_h_m + motion.shift_m,
        }
    }

    /// Chainage of the section that contains a point, metres.
    pub fn chainage_m(&self, point: &Vector3<f64>) -> f64 {
        let along_m = point.y - self.at_h_m;
        let (c, k) = (self.curvature(), 1.0 / self.radius_m());
        if k * along_m.abs() < SMALL_ANGLE_RAD {
            return self.at_h_m + along_m / (1.0 - c.dot(point));
        }
        self.at_h_m + (k * along_m).atan2(1.0 - c.dot(point)) / k
    }

    /// Moves a pose in the bent tunnel to its place in the straight one: `Qᵀ R`,
    /// `Qᵀ (t − C) + (0, h, 0)`.
    pub fn straightened(&self, pose: &Pose) -> Pose {
        let h_m = self.chainage_m(&pose.t_wc);
        let at = self.at(h_m);
        let inverse = at.frame.inverse();
        let across = inverse * (pose.t_wc - at.point);
        Pose::new(inverse * pose.r_wc, Vector3::new(across.x, h_m, across.z))
    }

    /// Moves a pose in the straight tunnel to its place in the bent one: the inverse of
    /// [`Bend::straightened`].
    pub fn bent(&self, pose: &Pose) -> Pose {
        let t = pose.t_wc;
        let at = self.at(t.y);
        Pose::new(
            at.frame * pose.r_wc,
            at.point + at.frame * Vector3::new(t.x, 0.0, t.z),
        )
    }
}

/// `sin x/x`.
fn sinc(x: f64) -> f64 {
    if x.abs() < SMALL_ANGLE_RAD {
        1.0
    } else {
        x.sin() / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn straightening_undoes_a_bend(
            x in -0.02f64..0.02, z in -0.02f64..0.02, y in -20.0f64..20.0, a in -2.0f64..2.0,
            b in -2.0f64..2.0,
        ) {
            let bend = Bend { curvature_per_m: [x, z], at_h_m: 3.0 };
            let rotation = so3::exp(&Vector3::new(a, 0.3, b));
            let pose = Pose::new(rotation, Vector3::new(a, y, b));
            let back = bend.straightened(&bend.bent(&pose));
            prop_assert!((back.t_wc - pose.t_wc).norm() < 1e-11);
            prop_assert!(back.r_wc.angle_to(&pose.r_wc) < 1e-7);
        }
    }

    #[test]
    fn a_quarter_of_a_circle_ends_beside_its_centre() {
        let bend = Bend {
            curvature_per_m: [0.0, 0.1],
            at_h_m: 1.0,
        };
        let quarter_m = 5.0 * std::f64::consts::PI;
        let at = bend.at(1.0 + quarter_m);
        assert!((at.point - Vector3::new(0.0, 11.0, 10.0)).norm() < 1e-12);
        assert!((at.frame * Vector3::y() - Vector3::z()).norm() < 1e-12);
        assert!((bend.chainage_m(&at.point) - 1.0 - quarter_m).abs() < 1e-12);
    }

    #[test]
    fn what_is_moved_is_moved_with_the_bend() {
        let bend = Bend {
            curvature_per_m: [0.01, 0.02],
            at_h_m: 1.0,
        };
        let motion = GaugeMotion::about_y(0.7, 2.0);
        let pose = Pose::new(so3::exp(&Vector3::x()), Vector3::new(0.5, 7.0, -0.25));
        let a = motion.apply(&bend.bent(&pose));
        let b = bend.moved(&motion).bent(&motion.apply(&pose));
        assert!((a.t_wc - b.t_wc).norm() < 1e-12);
        assert!(a.r_wc.angle_to(&b.r_wc) < 1e-7);
    }

    #[test]
    fn no_curvature_changes_nothing() {
        let bend = Bend {
            curvature_per_m: [0.0, 0.0],
            at_h_m: 1.0,
        };
        let pose = Pose::new(so3::exp(&Vector3::x()), Vector3::new(0.5, 7.0, -0.25));
        assert_eq!(bend.bent(&pose), pose);
        assert_eq!(bend.straightened(&pose), pose);
        assert_eq!(bend.radius_m(), f64::INFINITY);
    }
}
