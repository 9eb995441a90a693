//! Lens models: projection of a point in camera coordinates to the image plane at focal length 1.

use super::brown_conrady::BrownConrady;
use super::kannala_brandt::KannalaBrandt;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};

/// A lens model. Its image point `p_d` becomes a pixel by `u = fx p_d.x + cx`, `v = fy p_d.y + cy`
/// ([`super::Camera`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Perspective camera with or without radial and tangential distortion.
    BrownConrady(BrownConrady),
    /// Fisheye.
    KannalaBrandt(KannalaBrandt),
}

impl Default for Lens {
    fn default() -> Self {
        Self::radial(0.0, 0.0)
    }
}

impl Lens {
    /// A pinhole with the radial distortion `1 + k1 q + k2 q²`.
    pub fn radial(k1: f64, k2: f64) -> Self {
        Self::BrownConrady(BrownConrady::radial(k1, k2))
    }

    /// True for a pinhole without distortion and without a limit of the field of view.
    pub fn is_distortion_free(&self) -> bool {
        matches!(self, Self::BrownConrady(lens) if lens.is_distortion_free())
    }

    /// Projects the point `x_c`; None outside the field of view.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        match self {
            Self::BrownConrady(lens) => {
                if x_c.z <= 0.0 {
                    return None;
                }
                let p = x_c.xy() / x_c.z;
                if lens.is_distortion_free() {
                    return Some(p);
                }
                (p.norm_squared() < lens.limit()).then(|| lens.distort(&p))
            }
            Self::KannalaBrandt(lens) => lens.project(x_c),
        }
    }

    /// Back-projects `p_d` to a direction, with z = 1 for Brown–Conrady and unit length for
    /// Kannala–Brandt; None outside the field of view.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        match self {
            Self::BrownConrady(lens) => lens.undistort(p_d).map(|p| p.push(1.0)),
            Self::KannalaBrandt(lens) => lens.ray(p_d),
        }
    }

    /// `∂p_d/∂x_c`, 1/m.
    pub fn jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        match self {
            Self::BrownConrady(lens) => {
                let inverse = 1.0 / x_c.z;
                let p = x_c.xy() * inverse;
                let central =
                    Matrix2x3::new(inverse, 0.0, -p.x * inverse, 0.0, inverse, -p.y * inverse);
                lens.jacobian(&p) * central
            }
            Self::KannalaBrandt(lens) => lens.jacobian(x_c),
        }
    }

    /// The coefficients k1 and k2, which self-calibration estimates.
    pub fn k1_k2(&self) -> [f64; 2] {
        match self {
            Self::BrownConrady(lens) => {
                let [k1, k2, ..] = lens.coefficients().k;
                [k1, k2]
            }
            Self::KannalaBrandt(lens) => {
                let [k1, k2, ..] = *lens.coefficients();
                [k1, k2]
            }
        }
    }

    /// This lens with k1 and k2 replaced.
    pub fn with_k1_k2(&self, k1: f64, k2: f64) -> Self {
        if self.k1_k2() == [k1, k2] {
            return *self;
        }
        match self {
            Self::BrownConrady(lens) => {
                let mut coefficients = *lens.coefficients();
                [coefficients.k[0], coefficients.k[1]] = [k1, k2];
                let other = BrownConrady::new(coefficients);
                Self::BrownConrady(other.limited_to(lens.max_angle_rad()))
            }
            Self::KannalaBrandt(lens) => {
                let mut k = *lens.coefficients();
                [k[0], k[1]] = [k1, k2];
                Self::KannalaBrandt(KannalaBrandt::new(k).limited_to(lens.max_angle_rad()))
            }
        }
    }

    /// `∂p_d/∂(k1, k2)` of the point `x_c`.
    pub fn coefficient_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2<f64> {
        match self {
            Self::BrownConrady(lens) => lens.coefficient_jacobian(&(x_c.xy() / x_c.z)),
            Self::KannalaBrandt(lens) => lens.coefficient_jacobian(x_c),
        }
    }
}
