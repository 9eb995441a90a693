//! Interpolation of rigid motions in SE(3).

use super::pose::Pose;
use super::so3;
use nalgebra::{Matrix3, Vector3};

/// Largest rotation between two poses that are interpolated, radians; beyond it, the direction of
/// rotation is ambiguous.
pub const MAX_ROTATION_RAD: f64 = 170.0 * std::f64::consts::PI / 180.0;

/// The pose on the geodesic of SE(3) from `from` (share 0) to `to` (share 1): the one screw motion
/// that leads from one to the other, `T(s) = T₀ Exp(s Log(T₀⁻¹ T₁))`.
///
/// With `(φ, ρ) = Log(T)`: `φ = Log(R)`, `ρ = V(φ)⁻¹ t`, and V of [`left_jacobian`]. The result
/// does not depend on which rigid part of the carrier is followed (body or camera), nor on whether
/// poses or their inverses are given.
///
/// Returns `None` if the rotation between the two is more than [`MAX_ROTATION_RAD`].
///
/// Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", eqs.
/// 172–174.
pub fn between(from: &Pose, to: &Pose, share: f64) -> Option<Pose> {
    let step = from.inverse().after(to);
    let phi = so3::log(&step.r_wc);
    if phi.norm() > MAX_ROTATION_RAD {
        return None;
    }
    // V⁻¹ is the inverse of the left Jacobian: the right one's of −φ.
    let rho = so3::right_jacobian_inverse(&-phi) * step.t_wc;
    let part = phi * share;
    Some(from.after(&Pose::new(
        so3::exp(&part),
        left_jacobian(&part) * rho * share,
    )))
}

/// `V(φ) = I + (1 − cos|φ|)/|φ|² [φ]ₓ + (|φ| − sin|φ|)/|φ|³ [φ]ₓ²`.
fn left_jacobian(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let cross = so3::skew(phi);
    let (first, second) = if angle < 1e-4 {
        (0.5, 1.0 / 6.0)
    } else {
        let square = angle * angle;
        (
            (1.0 - angle.cos()) / square,
            (angle - angle.sin()) / (square * angle),
        )
    };
    Matrix3::identity() + cross * first + cross * cross * second
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::plan::spiral;
    use proptest::prelude::*;

    fn pose(a: f64, b: f64, c: f64) -> Pose {
        Pose::new(
            so3::exp(&Vector3::new(a, b, c)),
            Vector3::new(3.0 * b, -c, 2.0 * a),
        )
    }

    proptest! {
        #[test]
        fn it_leads_from_one_to_the_other_whatever_moves_along(
            a in -0.8f64..0.8, b in -0.8f64..0.8, c in -0.8f64..0.8, d in -0.8f64..0.8,
            share in 0.0f64..1.0,
        ) {
            let (from, to, arm) = (pose(a, b, c), pose(d, a, b), pose(b, c, d));
            let part = between(&from, &to, share).unwrap();
            for (share, end) in [(0.0, &from), (1.0, &to)] {
                prop_assert!(between(&from, &to, share).unwrap().local(end).norm() < 1e-9);
            }
            let of_arm = between(&from.after(&arm), &to.after(&arm), share).unwrap();
            prop_assert!(part.after(&arm).local(&of_arm).norm() < 1e-9);
            let of_world = between(&arm.after(&from), &arm.after(&to), share).unwrap();
            prop_assert!(arm.after(&part).local(&of_world).norm() < 1e-9);
            let of_inverse = between(&from.inverse(), &to.inverse(), share).unwrap();
            prop_assert!(part.inverse().local(&of_inverse).norm() < 1e-9);
        }
    }

    /// A carrier with constant advance and rotation follows a screw motion.
    #[test]
    fn a_spiral_is_met_exactly() {
        let fine = spiral(9, 0.05, 0.2);
        for k in 0..4 {
            let middle = between(&fine[2 * k], &fine[2 * k + 2], 0.5).unwrap();
            assert!(middle.local(&fine[2 * k + 1]).norm() < 1e-12);
        }
    }

    #[test]
    fn half_a_turn_has_two_ways() {
        let to = Pose::new(so3::exp(&Vector3::new(0.0, 3.1, 0.0)), Vector3::y());
        assert!(between(&Pose::identity(), &to, 0.5).is_none());
    }
}
