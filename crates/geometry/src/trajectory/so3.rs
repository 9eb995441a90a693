//! The rotation group SO(3): exponential and logarithm, and their Jacobian.

use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// The skew-symmetric matrix `[a]ₓ` with `[a]ₓ b = a × b`.
pub fn skew(a: &Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -a.z, a.y, a.z, 0.0, -a.x, -a.y, a.x, 0.0)
}

/// Exponential map: rotation vector (radians) to rotation.
pub fn exp(omega: &Vector3<f64>) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(*omega)
}

/// Logarithm: rotation to rotation vector, angle in `[0, π]` radians.
pub fn log(rotation: &UnitQuaternion<f64>) -> Vector3<f64> {
    rotation.scaled_axis()
}

/// Inverse of the right Jacobian: `Log(Exp(φ) Exp(δ)) ≈ φ + J_r⁻¹(φ) δ`.
///
/// `J_r⁻¹(φ) = I + ½[φ]ₓ + (1/|φ|² − (1 + cos|φ|)/(2|φ| sin|φ|)) [φ]ₓ²`.
///
/// Source: Solà, Deray, Atchuthan, "A micro Lie theory for state estimation in robotics", eq. 144.
pub fn right_jacobian_inverse(phi: &Vector3<f64>) -> Matrix3<f64> {
    let angle = phi.norm();
    let cross = skew(phi);
    let factor = if angle < 1e-4 {
        1.0 / 12.0
    } else {
        1.0 / (angle * angle) - (1.0 + angle.cos()) / (2.0 * angle * angle.sin())
    };
    Matrix3::identity() + cross * 0.5 + cross * cross * factor
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn right_jacobian_inverse_matches_central_differences() {
        for phi in [
            Vector3::new(0.3, -0.7, 0.2),
            Vector3::new(1e-6, 2e-6, -1e-6),
            Vector3::new(-1.5, 0.4, 1.1),
        ] {
            let analytic = right_jacobian_inverse(&phi);
            let step = 1e-6;
            for k in 0..3 {
                let mut delta = Vector3::zeros();
                delta[k] = step;
                let plus = log(&(exp(&phi) * exp(&delta)));
                let minus = log(&(exp(&phi) * exp(&-delta)));
                let numeric = (plus - minus) / (2.0 * step);
                assert!((numeric - analytic.column(k)).norm() < 1e-8);
            }
        }
    }

    #[test]
    fn skew_is_the_cross_product() {
        let (a, b) = (Vector3::new(1.0, 2.0, 3.0), Vector3::new(-4.0, 0.5, 2.0));
        assert_eq!(skew(&a) * b, a.cross(&b));
    }
}
