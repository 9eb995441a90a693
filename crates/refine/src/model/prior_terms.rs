//! Errors of the prior and their Jacobians.
//!
//! Errors are 6-vectors `e = (rotation (rad), translation (m))`. The initial poses `R̂, t̂` have
//! been transformed to the tunnel ([`Datum::to_tunnel`]); estimated positions are multiplied by the
//! datum's scale. Pose steps are those of [`Pose::retract`].

use crate::parameters::calibration::{DATUM_PARAMETERS, Datum};
use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};
use tunnelstitch_geometry::trajectory::{Pose, so3};

/// Derivative of an error by the datum parameters `(ln r, τ_x, τ_z, o_x, o_z)`.
pub type DatumJacobian = SMatrix<f64, 6, DATUM_PARAMETERS>;

/// An error of two poses, and its derivatives by the steps of the earlier and the later one.
pub type RelativeError = (Vector6<f64>, Matrix6<f64>, Matrix6<f64>);

/// Error of a pose around its initial value, `e = (Log(R̂ᵀR), scale · t − t̂)`, and its derivative
/// by the pose's step.
pub fn absolute_error(initial: &Pose, pose: &Pose, scale: f64) -> (Vector6<f64>, Matrix6<f64>) {
    let e = initial.local(&Pose::new(pose.r_wc, pose.t_wc * scale));
    let mut j = Matrix6::identity() * scale;
    j.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&so3::right_jacobian_inverse(&e.fixed_rows::<3>(0).into()));
    (e, j)
}

/// Derivative of [`absolute_error`] by the datum.
pub fn absolute_error_by_datum(
    datum: &Datum,
    initial: &Pose,
    pose: &Pose,
    e: &Vector6<f64>,
) -> DatumJacobian {
    // The initial attitude changes by exp(Jδτ) on the left, so the error changes by exp(−RᵀJδτ) on
    // the right.
    let tilt = datum.tilt_jacobian();
    let r_cw = pose.r_wc.inverse().to_rotation_matrix();
    let right = so3::right_jacobian_inverse(&e.fixed_rows::<3>(0).into());
    let rotation = -(right * r_cw.matrix() * tilt);
    let mut j = by_scale_and_tilt(datum, &datum.lever_arm(initial), &pose.t_wc);
    for (column, axis) in [(1, 0), (2, 2)] {
        j.fixed_view_mut::<3, 1>(0, column)
            .copy_from(&rotation.column(axis));
    }
    (j[(3, 3)], j[(5, 4)]) = (-1.0, -1.0);
    j
}

/// Derivative of `scale · t − R_G t̂` by scale and tilt, with `arm = R_G t̂`.
fn by_scale_and_tilt(datum: &Datum, arm: &Vector3<f64>, t: &Vector3<f64>) -> DatumJacobian {
    let by_tilt: Matrix3<f64> = so3::skew(arm) * datum.tilt_jacobian();
    let mut j = DatumJacobian::zeros();
    j.fixed_view_mut::<3, 1>(3, 0).copy_from(&(t * datum.scale));
    for (column, axis) in [(1, 0), (2, 2)] {
        j.fixed_view_mut::<3, 1>(3, column)
            .copy_from(&by_tilt.column(axis));
    }
    j
}

/// Error of the step between two poses around the initial step, and its derivatives by the steps
/// of the earlier and the later pose.
///
/// `e = (Log(ΔR̂ᵀ R_{k−1}ᵀ R_k), scale · (t_k − t_{k−1}) − (t̂_k − t̂_{k−1}))`,
/// `ΔR̂ = R̂_{k−1}ᵀ R̂_k`.
pub fn relative_error(
    initial_before: &Pose,
    initial: &Pose,
    before: &Pose,
    pose: &Pose,
    scale: f64,
) -> RelativeError {
    let initial_rotation = initial_before.r_wc.inverse() * initial.r_wc;
    let rotation = before.r_wc.inverse() * pose.r_wc;
    let omega = so3::log(&(initial_rotation.inverse() * rotation));
    let rho = (pose.t_wc - before.t_wc) * scale - (initial.t_wc - initial_before.t_wc);
    let e = Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z);
    let right = so3::right_jacobian_inverse(&omega);
    let mut j = Matrix6::identity() * scale;
    j.fixed_view_mut::<3, 3>(0, 0).copy_from(&right);
    let mut j_before = -Matrix6::identity() * scale;
    j_before
        .fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(-right * rotation.inverse().to_rotation_matrix().matrix()));
    (e, j_before, j)
}

/// Derivative of [`relative_error`] by the datum; the offsets cancel.
pub fn relative_error_by_datum(
    datum: &Datum,
    (initial_before, initial): (&Pose, &Pose),
    (before, pose): (&Pose, &Pose),
) -> DatumJacobian {
    by_scale_and_tilt(
        datum,
        &(initial.t_wc - initial_before.t_wc),
        &(pose.t_wc - before.t_wc),
    )
}

/// The pose of another camera of a rig by the pose of one and the `relation` of both
/// ([`tunnelstitch_geometry::trajectory::Rig::relation`], metres), and its derivative by a step of
/// the one; positions of poses are metres over `scale`.
///
/// `R = R_a M_R`, `t = t_a + R_a M_t / scale`.
pub fn transferred(pose: &Pose, relation: &Pose, scale: f64) -> (Pose, Matrix6<f64>) {
    let m_t = relation.t_wc / scale;
    let mut j = Matrix6::identity();
    let m_r = relation.r_wc.to_rotation_matrix();
    j.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&m_r.matrix().transpose());
    j.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&(-(pose.r_wc.to_rotation_matrix().matrix() * so3::skew(&m_t))));
    (pose.after(&Pose::new(relation.r_wc, m_t)), j)
}

/// Error of the place of a camera `b` of a rig relative to another one, `a`, around their
/// `relation` M, metres, and its derivatives by the steps of `a` and `b`.
///
/// `e = (Log(M_Rᵀ R_aᵀ R_b), scale · R_aᵀ (t_b − t_a) − M_t)`. It is the same wherever the rig is
/// and however it is turned.
pub fn relation_error(relation: &Pose, a: &Pose, b: &Pose, scale: f64) -> RelativeError {
    let rotation = a.r_wc.inverse() * b.r_wc;
    let omega = so3::log(&(relation.r_wc.inverse() * rotation));
    let place = scale * a.r_wc.inverse_transform_vector(&(b.t_wc - a.t_wc));
    let rho = place - relation.t_wc;
    let e = Vector6::new(omega.x, omega.y, omega.z, rho.x, rho.y, rho.z);
    let right = so3::right_jacobian_inverse(&omega);
    let r_aw = scale * a.r_wc.inverse().to_rotation_matrix().matrix();
    let (mut j_a, mut j_b) = (Matrix6::zeros(), Matrix6::zeros());
    j_a.fixed_view_mut::<3, 3>(0, 0)
        .copy_from(&(-right * rotation.inverse().to_rotation_matrix().matrix()));
    j_a.fixed_view_mut::<3, 3>(3, 0)
        .copy_from(&so3::skew(&place));
    j_a.fixed_view_mut::<3, 3>(3, 3).copy_from(&-r_aw);
    j_b.fixed_view_mut::<3, 3>(0, 0).copy_from(&right);
    j_b.fixed_view_mut::<3, 3>(3, 3).copy_from(&r_aw);
    (e, j_a, j_b)
}

/// Derivative of [`relation_error`] by the datum: the relation is of the rig, whatever the frame of
/// the initial poses.
pub fn relation_error_by_datum(datum: &Datum, (a, b): (&Pose, &Pose)) -> DatumJacobian {
    let place = datum.scale * a.r_wc.inverse_transform_vector(&(b.t_wc - a.t_wc));
    let mut j = DatumJacobian::zeros();
    j.fixed_view_mut::<3, 1>(3, 0).copy_from(&place);
    j
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::parameters::calibration::{Calibration, INTRINSIC_PARAMETERS, Kappa};
    use tunnelstitch_geometry::camera::Camera;

    pub fn pose(seed: f64) -> Pose {
        Pose::new(
            so3::exp(&Vector3::new(0.3 * seed, -0.7 + seed, 0.2 * seed)),
            Vector3::new(0.1 * seed, seed, -0.2),
        )
    }

    fn numeric(error: impl Fn(&Vector6<f64>) -> Vector6<f64>) -> Matrix6<f64> {
        let step = 1e-6;
        let mut j = Matrix6::zeros();
        for k in 0..6 {
            let mut xi = Vector6::zeros();
            xi[k] = step;
            j.set_column(k, &((error(&xi) - error(&-xi)) / (2.0 * step)));
        }
        j
    }

    /// A datum with tilt, offset and scale.
    pub fn kappa() -> Kappa {
        let mut kappa = Kappa::zeros();
        let datum = [0.03, 0.05, -0.08, 0.2, -0.1];
        kappa
            .fixed_rows_mut::<5>(INTRINSIC_PARAMETERS)
            .copy_from_slice(&datum);
        kappa
    }

    pub fn calibration() -> Calibration {
        Calibration {
            middle_h_m: 0.4,
            ..Calibration::none(Camera::from_vertical_fov(16, 16, 1.0))
        }
    }

    #[test]
    fn jacobians_match_central_differences() {
        let (a, b, c, d) = (pose(0.1), pose(0.5), pose(0.2), pose(0.8));
        let s = 1.1;
        let (_, j) = absolute_error(&a, &c, s);
        assert!((numeric(|xi| absolute_error(&a, &c.retract(xi), s).0) - j).norm() < 1e-7);
        let (_, j_before, j) = relative_error(&a, &b, &c, &d, s);
        assert!((numeric(|xi| relative_error(&a, &b, &c, &d.retract(xi), s).0) - j).norm() < 1e-7);
        let expected = numeric(|xi| relative_error(&a, &b, &c.retract(xi), &d, s).0);
        assert!((expected - j_before).norm() < 1e-7);
        let (_, j_a, j_b) = relation_error(&a, &c, &d, s);
        let expected = numeric(|xi| relation_error(&a, &c.retract(xi), &d, s).0);
        assert!((expected - j_a).norm() < 1e-7);
        assert!((numeric(|xi| relation_error(&a, &c, &d.retract(xi), s).0) - j_b).norm() < 1e-7);
        let (moved, j) = transferred(&c, &a, s);
        let expected = numeric(|xi| moved.local(&transferred(&c.retract(xi), &a, s).0));
        assert!((expected - j).norm() < 1e-7);
    }

    /// A rig that turns carries its cameras along.
    #[test]
    fn a_relation_has_no_error_however_the_rig_is_turned() {
        let (relation, rig) = (pose(0.7), pose(0.3));
        let other = transferred(&rig, &relation, 1.1).0;
        assert!(relation_error(&relation, &rig, &other, 1.1).0.norm() < 1e-12);
    }

    #[test]
    fn datum_jacobians_match_central_differences() {
        let (a, b, c, d) = (pose(0.1), pose(0.5), pose(0.2), pose(0.8));
        let at = |kappa: &Kappa| {
            let datum = calibration().datum(kappa);
            let (a, b) = (datum.to_tunnel(&a), datum.to_tunnel(&b));
            let alone = absolute_error(&a, &c, datum.scale).0;
            (alone, relative_error(&a, &b, &c, &d, datum.scale).0)
        };
        let datum = calibration().datum(&kappa());
        let (e, _) = at(&kappa());
        let (in_tunnel_a, in_tunnel_b) = (datum.to_tunnel(&a), datum.to_tunnel(&b));
        let alone = absolute_error_by_datum(&datum, &in_tunnel_a, &c, &e);
        let step = relative_error_by_datum(&datum, (&in_tunnel_a, &in_tunnel_b), (&c, &d));
        for k in 0..DATUM_PARAMETERS {
            let moved = |amount: f64| {
                let mut kappa = kappa();
                kappa[INTRINSIC_PARAMETERS + k] += amount;
                at(&kappa)
            };
            let (plus, minus) = (moved(1e-6), moved(-1e-6));
            let numeric = [(plus.0, minus.0), (plus.1, minus.1)].map(|(p, m)| (p - m) / 2e-6);
            assert!((numeric[0] - alone.column(k)).norm() < 1e-7, "absolute {k}");
            assert!((numeric[1] - step.column(k)).norm() < 1e-7, "relative {k}");
        }
    }
}
