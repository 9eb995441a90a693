//! What no picture of the wall can tell: the motions that map the tunnel onto itself.

use crate::trajectory::{Pose, so3};
use nalgebra::{Vector3, Vector6};
use serde::{Deserialize, Serialize};

/// The rigid motions that leave a tunnel's shape unchanged. Moving all poses by one of them changes no
/// picture, so they are fixed by the prior and removed (and only they) before errors are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Gauge {
    /// Turning about the axis.
    pub turn: bool,
    /// Shifting along the axis.
    pub shift: bool,
}

impl Gauge {
    /// The steps `ξ` ([`Pose::retract`]) by which `pose` moves along each freedom, per radian and per metre:
    /// `(Rᵀŷ, ŷ × t)` for the turn and `(0, ŷ)` for the shift.
    pub fn directions(&self, pose: &Pose) -> Vec<Vector6<f64>> {
        let mut directions = Vec::with_capacity(2);
        if self.turn {
            let omega = pose.r_wc.inverse_transform_vector(&Vector3::y());
            let rho = Vector3::y().cross(&pose.t_wc);
            directions.push(Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z));
        }
        if self.shift {
            directions.push(Vector6::new(0.0, 0.0, 0.0, 0.0, 1.0, 0.0));
        }
        directions
    }

    /// The motion that best carries `from` onto `to`, pose by pose, in closed form.
    ///
    /// Turn: the α that minimises `Σ |R_to − R_y(α) R_from|²`. With `M = Σ R_to R_fromᵀ`,
    /// `α = atan2(M_02 − M_20, M_00 + M_22)`. Shift: the mean difference of `t_y`. Freedoms that the shape
    /// does not have stay zero.
    pub fn align(&self, from: &[Pose], to: &[Pose]) -> GaugeMotion {
        let (mut sine, mut cosine, mut shift) = (0.0, 0.0, 0.0);
        for (from, to) in from.iter().zip(to) {
            let m = (to.r_wc * from.r_wc.inverse()).to_rotation_matrix();
            sine += m[(0, 2)] - m[(2, 0)];
            cosine += m[(0, 0)] + m[(2, 2)];
            shift += to.t_wc.y - from.t_wc.y;
        }
        GaugeMotion {
            turn_rad: if self.turn { sine.atan2(cosine) } else { 0.0 },
            shift_m: if self.shift {
                shift / from.len().max(1) as f64
            } else {
                0.0
            },
        }
    }
}

/// A motion along the gauge: a turn about the axis, then a shift along it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct GaugeMotion {
    /// Turn about the axis, radians.
    pub turn_rad: f64,
    /// Shift along the axis, metres.
    pub shift_m: f64,
}

impl GaugeMotion {
    /// The moved pose: `R ← R_y(α) R`, `t ← R_y(α) t + d ŷ`.
    pub fn apply(&self, pose: &Pose) -> Pose {
        let turn = so3::exp(&(Vector3::y() * self.turn_rad));
        Pose::new(
            turn * pose.r_wc,
            turn * pose.t_wc + Vector3::y() * self.shift_m,
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
    use crate::surface::{Circle, Surface, wall_jacobian};
    use proptest::prelude::*;

    const BOTH: Gauge = Gauge {
        turn: true,
        shift: true,
    };

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
            let motion = GaugeMotion { turn_rad, shift_m };
            let moved: Vec<_> = truth.iter().map(|pose| motion.apply(pose)).collect();
            let back = BOTH.align(&moved, &truth);
            for (moved, truth) in moved.iter().zip(&truth) {
                prop_assert!(truth.local(&back.apply(moved)).norm() < 1e-9);
            }
        }
    }

    #[test]
    fn directions_are_the_derivatives_of_the_motion() {
        let pose = poses()[4];
        let directions = BOTH.directions(&pose);
        let step = 1e-6;
        for (k, direction) in directions.iter().enumerate() {
            let motion = |amount: f64| GaugeMotion {
                turn_rad: if k == 0 { amount } else { 0.0 },
                shift_m: if k == 1 { amount } else { 0.0 },
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
