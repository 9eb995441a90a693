//! Lens models: projection of a point in camera coordinates to the image plane at focal length 1.

use super::brown_conrady::BrownConrady;
use super::double_sphere::DoubleSphere;
use super::eucm::Eucm;
use super::fov::Fov;
use super::kannala_brandt::KannalaBrandt;
use super::mei::Mei;
use super::ocam::Ocam;
use super::thin_prism::ThinPrismFisheye;
use nalgebra::{Matrix2, Matrix2x3, Vector2, Vector3};
use std::f64::consts::{FRAC_PI_2, PI};

/// A lens model. Its image point `p_d` becomes a pixel by `u = fx p_d.x + cx`, `v = fy p_d.y + cy`
/// ([`super::Camera`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Lens {
    /// Perspective camera with or without radial and tangential distortion.
    BrownConrady(BrownConrady),
    /// Fisheye.
    KannalaBrandt(KannalaBrandt),
    /// Unified model with radial and tangential distortion.
    Mei(Mei),
    /// Double sphere.
    DoubleSphere(DoubleSphere),
    /// Enhanced unified model.
    Eucm(Eucm),
    /// Fisheye with one coefficient.
    Fov(Fov),
    /// Fisheye with tangential and thin-prism distortion.
    ThinPrismFisheye(ThinPrismFisheye),
    /// Polynomial of OCamCalib.
    Ocam(Ocam),
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

    /// Name of the model, as in `camera.json`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::BrownConrady(lens) if lens.is_distortion_free() => "pinhole",
            Self::BrownConrady(_) => "brown-conrady",
            Self::KannalaBrandt(_) => "kannala-brandt",
            Self::Mei(_) => "mei",
            Self::DoubleSphere(_) => "double-sphere",
            Self::Eucm(_) => "eucm",
            Self::Fov(_) => "fov",
            Self::ThinPrismFisheye(_) => "thin-prism-fisheye",
            Self::Ocam(_) => "ocam",
        }
    }

    /// The largest angle off the axis to be used, radians; None if only the model limits it.
    pub fn max_angle_rad(&self) -> Option<f64> {
        let (angle, all) = match self {
            Self::BrownConrady(lens) => (lens.max_angle_rad(), FRAC_PI_2),
            Self::Fov(lens) => (lens.max_angle_rad(), FRAC_PI_2),
            Self::KannalaBrandt(lens) => (lens.field_of_view().max_angle_rad(), PI),
            Self::Mei(lens) => (lens.field_of_view().max_angle_rad(), PI),
            Self::DoubleSphere(lens) => (lens.field_of_view().max_angle_rad(), PI),
            Self::Eucm(lens) => (lens.field_of_view().max_angle_rad(), PI),
            Self::ThinPrismFisheye(lens) => (lens.field_of_view().max_angle_rad(), PI),
            Self::Ocam(lens) => (lens.field_of_view().max_angle_rad(), PI),
        };
        (angle < all).then_some(angle)
    }

    /// This lens, limited to `max_angle_rad` off its axis.
    pub fn limited_to(self, max_angle_rad: f64) -> Self {
        match self {
            Self::BrownConrady(lens) => Self::BrownConrady(lens.limited_to(max_angle_rad)),
            Self::KannalaBrandt(lens) => Self::KannalaBrandt(lens.limited_to(max_angle_rad)),
            Self::Mei(lens) => Self::Mei(lens.limited_to(max_angle_rad)),
            Self::DoubleSphere(lens) => Self::DoubleSphere(lens.limited_to(max_angle_rad)),
            Self::Eucm(lens) => Self::Eucm(lens.limited_to(max_angle_rad)),
            Self::Fov(lens) => Self::Fov(lens.limited_to(max_angle_rad)),
            Self::ThinPrismFisheye(lens) => Self::ThinPrismFisheye(lens.limited_to(max_angle_rad)),
            Self::Ocam(lens) => Self::Ocam(lens.limited_to(max_angle_rad)),
        }
    }

    /// Distance from the image's centre at which a point at a small angle off the axis appears, per
    /// radian: the focal length of the lens in units of fx and fy.
    pub fn axis_scale(&self) -> f64 {
        match self {
            Self::BrownConrady(_)
            | Self::KannalaBrandt(_)
            | Self::Eucm(_)
            | Self::ThinPrismFisheye(_)
            | Self::Ocam(_) => 1.0,
            Self::Mei(lens) => lens.axis_scale(),
            Self::DoubleSphere(lens) => lens.axis_scale(),
            Self::Fov(lens) => lens.axis_scale(),
        }
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
            Self::Mei(lens) => lens.project(x_c),
            Self::DoubleSphere(lens) => lens.project(x_c),
            Self::Eucm(lens) => lens.project(x_c),
            Self::Fov(lens) => lens.project(x_c),
            Self::ThinPrismFisheye(lens) => lens.project(x_c),
            Self::Ocam(lens) => lens.project(x_c),
        }
    }

    /// Back-projects `p_d` to a direction, with z = 1 for Brown–Conrady and unit length for the
    /// others; None outside the field of view.
    pub fn ray(&self, p_d: &Vector2<f64>) -> Option<Vector3<f64>> {
        match self {
            Self::BrownConrady(lens) => lens.undistort(p_d).map(|p| p.push(1.0)),
            Self::KannalaBrandt(lens) => lens.ray(p_d),
            Self::Mei(lens) => lens.ray(p_d),
            Self::DoubleSphere(lens) => lens.ray(p_d),
            Self::Eucm(lens) => lens.ray(p_d),
            Self::Fov(lens) => lens.ray(p_d),
            Self::ThinPrismFisheye(lens) => lens.ray(p_d),
            Self::Ocam(lens) => lens.ray(p_d),
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
            Self::Mei(lens) => lens.jacobian(x_c),
            Self::DoubleSphere(lens) => lens.jacobian(x_c),
            Self::Eucm(lens) => lens.jacobian(x_c),
            Self::Fov(lens) => lens.jacobian(x_c),
            Self::ThinPrismFisheye(lens) => lens.jacobian(x_c),
            Self::Ocam(lens) => lens.jacobian(x_c),
        }
    }

    /// True if the model has the coefficients k1 and k2, which self-calibration estimates.
    pub fn has_k1_k2(&self) -> bool {
        match self {
            Self::BrownConrady(_)
            | Self::KannalaBrandt(_)
            | Self::Mei(_)
            | Self::ThinPrismFisheye(_) => true,
            Self::DoubleSphere(_) | Self::Eucm(_) | Self::Fov(_) | Self::Ocam(_) => false,
        }
    }

    /// The coefficients k1 and k2; 0 for a model without them ([`Lens::has_k1_k2`]).
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
            Self::Mei(lens) => lens.k(),
            Self::ThinPrismFisheye(lens) => {
                let [k1, k2, ..] = lens.coefficients().k;
                [k1, k2]
            }
            Self::DoubleSphere(_) | Self::Eucm(_) | Self::Fov(_) | Self::Ocam(_) => [0.0; 2],
        }
    }

    /// This lens with k1 and k2 replaced; unchanged if the model does not have them.
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
                Self::KannalaBrandt(
                    KannalaBrandt::new(k).limited_to(lens.field_of_view().max_angle_rad()),
                )
            }
            Self::Mei(lens) => Self::Mei(lens.with_k([k1, k2])),
            Self::ThinPrismFisheye(lens) => Self::ThinPrismFisheye(lens.with_k1_k2(k1, k2)),
            Self::DoubleSphere(_) | Self::Eucm(_) | Self::Fov(_) | Self::Ocam(_) => *self,
        }
    }

    /// `∂p_d/∂(k1, k2)` of the point `x_c`; 0 for a model without them.
    pub fn coefficient_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2<f64> {
        match self {
            Self::BrownConrady(lens) => lens.coefficient_jacobian(&(x_c.xy() / x_c.z)),
            Self::KannalaBrandt(lens) => lens.coefficient_jacobian(x_c),
            Self::Mei(lens) => lens.coefficient_jacobian(x_c),
            Self::ThinPrismFisheye(lens) => lens.coefficient_jacobian(x_c),
            Self::DoubleSphere(_) | Self::Eucm(_) | Self::Fov(_) | Self::Ocam(_) => {
                Matrix2::zeros()
            }
        }
    }
}
