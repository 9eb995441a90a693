//! Radial lens distortion.

use nalgebra::{Matrix2, Vector2};

/// Radial distortion after Brown and Conrady, in OpenCV's convention: the point `p = (x/z, y/z)` before the camera
/// appears at `p_d = p (1 + k1 q + k2 q²)` with `q = |p|²`.
///
/// Source: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37(8), 1971.
///
/// The way outwards, `ρ (1 + k1 ρ² + k2 ρ⁴)`, rises only up to [`Radial::limit`]; beyond, the picture would fold back on
/// itself. No point there is seen; where a formula needs an answer all the same, the factor stays what it is at the limit.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Radial {
    /// k1.
    pub k1: f64,
    /// k2.
    pub k2: f64,
}

/// Steps of the inverse: bisection alone would end at rounding.
const STEPS: usize = 60;

impl Radial {
    /// True for a lens without distortion.
    pub fn is_none(&self) -> bool {
        self.k1 == 0.0 && self.k2 == 0.0
    }

    /// The largest q up to which the distorted radius rises: the smallest positive root of `1 + 3 k1 q + 5 k2 q²`.
    pub fn limit(&self) -> f64 {
        let (a, b) = (5.0 * self.k2, 3.0 * self.k1);
        let discriminant = b * b - 4.0 * a;
        if discriminant < 0.0 {
            return f64::INFINITY;
        }
        // 2 / (−b ± √…): the same roots as usual, without a division by k2.
        let root = discriminant.sqrt();
        [root - b, -root - b]
            .into_iter()
            .map(|divisor| 2.0 / divisor)
            .filter(|q| *q > 0.0)
            .fold(f64::INFINITY, f64::min)
    }

    /// `1 + k1 q + k2 q²`.
    fn factor_at(&self, q: f64) -> f64 {
        1.0 + q * (self.k1 + q * self.k2)
    }

    /// By how much `p` with `q = |p|²` is drawn out.
    pub fn factor(&self, q: f64) -> f64 {
        self.factor_at(q.min(self.limit()))
    }

    /// `∂p_d/∂p = f I + 2 f′ p pᵀ` with f the factor and f′ its derivative by q, within the limit.
    pub fn jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let (f, twice_slope) = self.factor_and_twice_slope(p);
        Matrix2::identity() * f + p * p.transpose() * twice_slope
    }

    /// `(∂p_d/∂p)⁻¹`, by Sherman and Morrison's formula.
    pub fn inverse_jacobian(&self, p: &Vector2<f64>) -> Matrix2<f64> {
        let (f, twice_slope) = self.factor_and_twice_slope(p);
        let share = twice_slope / (f + twice_slope * p.norm_squared());
        (Matrix2::identity() - p * p.transpose() * share) / f
    }

    fn factor_and_twice_slope(&self, p: &Vector2<f64>) -> (f64, f64) {
        let q = p.norm_squared();
        (self.factor_at(q), 2.0 * (self.k1 + 2.0 * q * self.k2))
    }

    /// The point p that appears at `p_d`.
    ///
    /// Newton's method for `ρ (1 + k1 ρ² + k2 ρ⁴) = |p_d|`, kept between bounds that close in on the root.
    pub fn undistort(&self, p_d: &Vector2<f64>) -> Vector2<f64> {
        let target = p_d.norm();
        let limit = self.limit();
        let end = limit.sqrt();
        if self.is_none() || target == 0.0 {
            return *p_d;
        }
        if end.is_finite() && end * self.factor_at(limit) <= target {
            return p_d / self.factor_at(limit);
        }
        let (mut low, mut high) = (0.0, end);
        let mut rho = target.min(end);
        for _ in 0..STEPS {
            let q = rho * rho;
            let error = rho * self.factor_at(q) - target;
            if error > 0.0 {
                high = rho;
            } else {
                low = rho;
            }
            let slope = 1.0 + q * (3.0 * self.k1 + 5.0 * q * self.k2);
            let newton = rho - error / slope;
            let next = if newton > low && newton < high {
                newton
            } else if high.is_finite() {
                0.5 * (low + high)
            } else {
                2.0 * rho
            };
            if (next - rho).abs() <= 1e-15 * rho {
                break;
            }
            rho = next;
        }
        p_d * (rho / target)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LENSES: [Radial; 6] = [
        Radial { k1: -0.05, k2: 0.0 },
        Radial { k1: 0.1, k2: 0.0 },
        Radial {
            k1: -0.28,
            k2: 0.07,
        },
        Radial { k1: 0.2, k2: -0.1 },
        Radial { k1: 0.0, k2: -0.02 },
        Radial { k1: 0.0, k2: 0.0 },
    ];

    #[test]
    fn undistorting_inverts_up_to_the_limit() {
        for lens in LENSES {
            let end = lens.limit().sqrt().min(3.0);
            for k in 0..40 {
                let rho = end * f64::from(k) / 40.0;
                let p = Vector2::new(0.6, -0.8) * rho;
                let back = lens.undistort(&(p * lens.factor(rho * rho)));
                assert!((back - p).norm() < 1e-9 * (1.0 + rho), "{lens:?} at {rho}");
            }
        }
    }

    #[test]
    fn the_limit_is_where_the_distorted_radius_stops_rising() {
        for lens in LENSES {
            let radius = |q: f64| q.sqrt() * lens.factor_at(q);
            let limit = lens.limit();
            if limit.is_finite() {
                assert!(radius(limit) > radius(0.98 * limit), "{lens:?}");
                assert!(radius(limit) > radius(1.02 * limit), "{lens:?}");
            } else {
                assert!((1..1000).all(|k| {
                    let q = 0.02 * f64::from(k);
                    radius(q + 0.02) > radius(q)
                }));
            }
        }
        assert!((Radial { k1: -0.05, k2: 0.0 }.limit() - 1.0 / 0.15).abs() < 1e-12);
    }

    #[test]
    fn jacobians_match_central_differences() {
        let step = 1e-6;
        for lens in LENSES {
            let p = Vector2::new(0.3, -0.5);
            let jacobian = lens.jacobian(&p);
            for k in 0..2 {
                let mut delta = Vector2::zeros();
                delta[k] = step;
                let distorted = |p: Vector2<f64>| p * lens.factor(p.norm_squared());
                let numeric = (distorted(p + delta) - distorted(p - delta)) / (2.0 * step);
                assert!((numeric - jacobian.column(k)).norm() < 1e-8);
            }
            let product = jacobian * lens.inverse_jacobian(&p);
            assert!((product - Matrix2::identity()).norm() < 1e-12);
        }
    }
}
