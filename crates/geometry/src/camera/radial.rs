//! Radial projection: the distance from the centre of distortion is a function of the angle off
//! the axis.

use nalgebra::{Matrix2, Matrix2x3, RowVector3, Vector2, Vector3};

/// Smallest ratio of the distance from the axis to z that is divided by.
const MIN_RADIAL_RATIO: f64 = 1e-9;

/// True if the point lies so near to the axis that its direction around it is not defined.
pub fn is_on_axis(x_c: &Vector3<f64>) -> bool {
    x_c.xy().norm() <= MIN_RADIAL_RATIO * x_c.z
}

/// Projects a point to `r(θ) (x, y)/ρ`, `ρ = √(x² + y²)`; None at the angle `limit_rad` and beyond.
/// `axis_scale`: the slope of r at 0.
pub fn project_radial(
    x_c: &Vector3<f64>,
    limit_rad: f64,
    axis_scale: f64,
    radius: impl FnOnce(f64) -> f64,
) -> Option<Vector2<f64>> {
    let rho = x_c.xy().norm();
    let theta = rho.atan2(x_c.z);
    if theta >= limit_rad || !theta.is_finite() {
        return None;
    }
    if is_on_axis(x_c) {
        return (x_c.z > 0.0).then(|| x_c.xy() / x_c.z * axis_scale);
    }
    Some(x_c.xy() * (radius(theta) / rho))
}

/// `∂p/∂x_c = r′ e ∂θ/∂x_c + (r/ρ) (I − e eᵀ) ∂(x, y)/∂x_c` of [`project_radial`], with
/// `e = (x, y)/ρ`, `∂θ/∂x_c = (z eᵀ, −ρ)/(ρ² + z²)`; `radius` returns r and its slope r′.
pub fn radial_jacobian(
    x_c: &Vector3<f64>,
    axis_scale: f64,
    radius: impl FnOnce(f64) -> (f64, f64),
) -> Matrix2x3<f64> {
    if is_on_axis(x_c) {
        return Matrix2x3::identity() / x_c.z * axis_scale;
    }
    let rho = x_c.xy().norm();
    let e = x_c.xy() / rho;
    let (radius, slope) = radius(rho.atan2(x_c.z));
    let theta = RowVector3::new(x_c.z * e.x, x_c.z * e.y, -rho) / x_c.norm_squared();
    let around = (Matrix2::identity() - e * e.transpose()) * (radius / rho);
    let mut jacobian = e * theta * slope;
    let mut across = jacobian.fixed_columns_mut::<2>(0);
    across += around;
    jacobian
}

/// The unit vector at the angle `theta` off the axis, in the direction of `p` around it.
pub fn radial_ray(p: &Vector2<f64>, theta: f64) -> Vector3<f64> {
    let radius = p.norm();
    let e = if radius > 0.0 {
        p / radius
    } else {
        Vector2::zeros()
    };
    let (sin, cos) = theta.sin_cos();
    (e * sin).push(cos)
}
