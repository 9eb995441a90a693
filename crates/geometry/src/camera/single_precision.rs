//! Lens models in single precision, for loops over many points.
//!
//! A loop is generic over [`ProjectF32`] and instantiated per lens model, not over the enum, so
//! that the compiler can vectorise it.

use super::lens::Lens;
use super::projection::Camera;
use super::sweep::MAX_SHARE;
use std::f64::consts::PI;

/// Projection through a lens in single precision.
pub trait ProjectF32: Copy {
    /// Projects a point (camera coordinates) to the image plane at focal length 1; the flag is true
    /// if the point lies within the lens's limit. Beyond the limit the coordinates are finite but
    /// meaningless.
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool);
}

/// A lens model in single precision.
#[derive(Clone, Copy, Debug)]
pub enum LensF32 {
    /// No distortion.
    Pinhole(PinholeF32),
    /// [`crate::camera::BrownConrady`].
    BrownConrady(BrownConradyF32),
    /// [`crate::camera::KannalaBrandt`].
    KannalaBrandt(KannalaBrandtF32),
    /// No distortion, with a rolling shutter.
    RollingPinhole(RollingShutter<PinholeF32>),
    /// [`crate::camera::BrownConrady`], with a rolling shutter.
    RollingBrownConrady(RollingShutter<BrownConradyF32>),
    /// [`crate::camera::KannalaBrandt`], with a rolling shutter.
    RollingKannalaBrandt(RollingShutter<KannalaBrandtF32>),
}

impl LensF32 {
    /// Converts the lens and the sweep of a camera.
    pub fn new(camera: &Camera) -> Self {
        let lens = Self::at_rest(&camera.lens);
        if camera.sweep.is_none() {
            return lens;
        }
        match lens {
            Self::Pinhole(lens) => Self::RollingPinhole(RollingShutter::new(lens, camera)),
            Self::BrownConrady(lens) => {
                Self::RollingBrownConrady(RollingShutter::new(lens, camera))
            }
            Self::KannalaBrandt(lens) => {
                Self::RollingKannalaBrandt(RollingShutter::new(lens, camera))
            }
            rolling => rolling,
        }
    }

    fn at_rest(lens: &Lens) -> Self {
        match lens {
            Lens::BrownConrady(lens) if lens.is_distortion_free() => Self::Pinhole(PinholeF32),
            Lens::BrownConrady(lens) => {
                let coefficients = lens.coefficients();
                Self::BrownConrady(BrownConradyF32 {
                    k: coefficients.k.map(|k| k as f32),
                    p: coefficients.p.map(|p| p as f32),
                    limit: lens.limit() as f32,
                })
            }
            Lens::KannalaBrandt(lens) => Self::KannalaBrandt(KannalaBrandtF32::new(
                |theta| lens.radius(theta).0,
                lens.limit_rad(),
            )),
        }
    }
}

impl ProjectF32 for LensF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        match self {
            Self::Pinhole(lens) => lens.project_f32(x, y, z),
            Self::BrownConrady(lens) => lens.project_f32(x, y, z),
            Self::KannalaBrandt(lens) => lens.project_f32(x, y, z),
            Self::RollingPinhole(lens) => lens.project_f32(x, y, z),
            Self::RollingBrownConrady(lens) => lens.project_f32(x, y, z),
            Self::RollingKannalaBrandt(lens) => lens.project_f32(x, y, z),
        }
    }
}

/// A lens with a rolling shutter: the camera moves while its rows are read
/// ([`crate::camera::Sweep`]).
///
/// The motion is expanded to the second order in the share τ of the readout time,
/// `x_c(τ) ≈ x − τ a + τ²/2 ω × (a + ν)` with `a = ω × x + ν`, which is off by `f |ω τ|³/6`: 0.0003
/// px at 90 °/s over 20 ms with a focal length of 415 px. The row is found by two fixed-point steps
/// `τ ← share(v(x_c(τ)))` and one step of Aitken's Δ² process, whose error is the square of that of
/// a third step.
#[derive(Clone, Copy, Debug)]
pub struct RollingShutter<L> {
    lens: L,
    omega: [f32; 3],
    nu: [f32; 3],
    /// `τ = slope q + offset` of a point that appears at q.
    slope: f32,
    offset: f32,
}

impl<L> RollingShutter<L> {
    fn new(lens: L, camera: &Camera) -> Self {
        let height = f64::from(camera.height);
        Self {
            lens,
            omega: camera.sweep.omega_rad.cast().into(),
            nu: camera.sweep.nu_m.cast().into(),
            slope: (camera.fy / height) as f32,
            offset: ((camera.cy - 0.5 * (height - 1.0)) / height) as f32,
        }
    }

    #[inline(always)]
    fn share(&self, q: f32) -> f32 {
        // `max` first: a NaN becomes an end.
        (self.slope * q + self.offset)
            .max(-MAX_SHARE as f32)
            .min(MAX_SHARE as f32)
    }
}

#[inline(always)]
fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    ]
}

/// Added to the denominator of Aitken's step, which vanishes in the middle row.
const MIN_SQUARED_SHARE: f32 = 1e-12;

impl<L: ProjectF32> ProjectF32 for RollingShutter<L> {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let turned = cross(self.omega, [x, y, z]);
        let a: [f32; 3] = std::array::from_fn(|k| turned[k] + self.nu[k]);
        let b = cross(self.omega, std::array::from_fn(|k| a[k] + self.nu[k]));
        let at = |share: f32| {
            let point = |x: f32, k: usize| x + share * (0.5 * share * b[k] - a[k]);
            self.lens.project_f32(point(x, 0), point(y, 1), point(z, 2))
        };
        let first = self.share(self.lens.project_f32(x, y, z).1);
        let second = self.share(at(first).1);
        let change = second - first;
        let slope = change * first / (first * first + MIN_SQUARED_SHARE);
        at(second + change * slope / (1.0 - slope))
    }
}

/// Pinhole projection `(x/z, y/z)`.
#[derive(Clone, Copy, Debug)]
pub struct PinholeF32;

impl ProjectF32 for PinholeF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / z;
        (x * inverse, y * inverse, z > 0.0)
    }
}

/// Brown–Conrady projection: radial and tangential distortion.
#[derive(Clone, Copy, Debug)]
pub struct BrownConradyF32 {
    k: [f32; 6],
    p: [f32; 2],
    limit: f32,
}

impl ProjectF32 for BrownConradyF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let [k1, k2, k3, k4, k5, k6] = self.k;
        let [p1, p2] = self.p;
        let inverse = 1.0 / z;
        let (x, y) = (x * inverse, y * inverse);
        let square = x * x + y * y;
        let q = square.min(self.limit);
        let factor = (1.0 + q * (k1 + q * (k2 + q * k3))) / (1.0 + q * (k4 + q * (k5 + q * k6)));
        let mixed = 2.0 * x * y;
        (
            x * factor + p1 * mixed + p2 * (q + 2.0 * x * x),
            y * factor + p2 * mixed + p1 * (q + 2.0 * y * y),
            (z > 0.0) & (square < self.limit),
        )
    }
}

/// Degree of the polynomial that approximates a fisheye.
const POLYNOMIAL_DEGREE: usize = 17;
/// Largest angle off the axis that the polynomial covers: nearer to 180°, `θ_d/sin θ` diverges.
const MAX_ANGLE_RAD: f64 = 0.75 * PI;

/// Kannala–Brandt projection `p_d = G(cos θ) (x, y)/|x_c|` with `G = θ_d/sin θ`, which is smooth in
/// `cos θ` as far as 180°.
///
/// G is interpolated at Chebyshev nodes over the lens's field of view, to about the rounding of
/// single precision up to 120° off the axis. Points beyond 135° count as outside.
#[derive(Clone, Copy, Debug)]
pub struct KannalaBrandtF32 {
    /// Coefficients of G in `t = cos θ · scale + offset ∈ [−1, 1]`, lowest degree first.
    g: [f32; POLYNOMIAL_DEGREE + 1],
    scale: f32,
    offset: f32,
    min_cos: f32,
}

impl KannalaBrandtF32 {
    /// Approximates θ_d = `radius(θ)` up to the angle `limit_rad`.
    fn new(radius: impl Fn(f64) -> f64, limit_rad: f64) -> Self {
        let min_cos = limit_rad.min(MAX_ANGLE_RAD).cos();
        let (middle, half) = (0.5 * (1.0 + min_cos), 0.5 * (1.0 - min_cos));
        let g = interpolate(|t| {
            let theta = (middle + half * t).min(1.0).acos();
            if theta < 1e-6 {
                1.0
            } else {
                radius(theta) / theta.sin()
            }
        });
        Self {
            g: g.map(|c| c as f32),
            scale: (1.0 / half) as f32,
            offset: (-middle / half) as f32,
            min_cos: min_cos as f32,
        }
    }
}

impl ProjectF32 for KannalaBrandtF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let cos = z * inverse;
        let t = (cos.max(self.min_cos) * self.scale + self.offset).min(1.0);
        let mut g = self.g[POLYNOMIAL_DEGREE];
        for c in self.g[..POLYNOMIAL_DEGREE].iter().rev() {
            g = g * t + c;
        }
        let stretch = g * inverse;
        (x * stretch, y * stretch, cos > self.min_cos)
    }
}

/// Coefficients (lowest degree first) of the polynomial that interpolates `f` at the Chebyshev
/// nodes of [−1, 1].
fn interpolate(f: impl Fn(f64) -> f64) -> [f64; POLYNOMIAL_DEGREE + 1] {
    let count = POLYNOMIAL_DEGREE + 1;
    let angle = |j: usize| PI * (j as f64 + 0.5) / count as f64;
    let values: Vec<f64> = (0..count).map(|j| f(angle(j).cos())).collect();
    // T_0 and T_1, and from there T_k = 2 t T_{k−1} − T_{k−2}.
    let mut before = [0.0; POLYNOMIAL_DEGREE + 1];
    let mut now = [0.0; POLYNOMIAL_DEGREE + 1];
    let mut sum = [0.0; POLYNOMIAL_DEGREE + 1];
    now[0] = 1.0;
    for k in 0..count {
        let projected: f64 = (values.iter().enumerate())
            .map(|(j, value)| value * (k as f64 * angle(j)).cos())
            .sum();
        let share = if k == 0 { 1.0 } else { 2.0 } / count as f64;
        for (sum, now) in sum.iter_mut().zip(&now) {
            *sum += share * projected * now;
        }
        let mut next = before.map(|b: f64| -b);
        let twice = if k == 0 { 1.0 } else { 2.0 };
        for place in 0..POLYNOMIAL_DEGREE {
            next[place + 1] += twice * now[place];
        }
        if k == 0 {
            next[0] = 0.0;
        }
        (before, now) = (now, next);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use crate::camera::sweep::Sweep;
    use nalgebra::Vector3;

    fn compare(lens: &Lens, within: f64, directions: impl Iterator<Item = Vector3<f64>>) {
        let mut seen = 0;
        for x_c in directions {
            let (x, y, z) = (x_c.x as f32, x_c.y as f32, x_c.z as f32);
            let (p, q, shown) = LensF32::at_rest(lens).project_f32(x, y, z);
            let exact = lens.project(&Vector3::new(f64::from(x), f64::from(y), f64::from(z)));
            assert_eq!(shown, exact.is_some(), "{lens:?} {x_c}");
            if let Some(exact) = exact {
                let error = (f64::from(p) - exact.x).hypot(f64::from(q) - exact.y);
                assert!(error < within, "{lens:?} {x_c}: {error}");
                seen += 1;
            }
        }
        assert!(seen > 100);
    }

    /// Directions up to `limit` radians off the axis (and a little beyond), at distances of 0.5 to
    /// 5 m.
    fn directions(limit: f64) -> impl Iterator<Item = Vector3<f64>> {
        (0..1000).map(move |k| {
            let theta = limit * 1.05 * f64::from(k) / 1000.0;
            let turn = 2.4 * f64::from(k);
            let (sin, cos) = theta.sin_cos();
            Vector3::new(sin * turn.cos(), sin * turn.sin(), cos) * (0.5 + f64::from(k % 10) * 0.5)
        })
    }

    #[test]
    fn single_precision_projects_as_double_does() {
        compare(&Lens::default(), 1e-6, directions(1.0));
        let brown = |k, p| Lens::BrownConrady(BrownConrady::new(BrownCoefficients { k, p }));
        compare(&Lens::radial(-0.28, 0.07), 1e-6, directions(1.0));
        let tangential = brown([-0.3, 0.1, -0.02, 0.0, 0.0, 0.0], [1e-3, -2e-3]);
        compare(&tangential, 1e-6, directions(0.8));
        let rational = brown([4.1, 2.0, 0.1, 4.4, 3.1, 0.45], [-4e-4, 6e-4]);
        compare(&rational, 3e-6, directions(1.1));
        let fisheye = |k| Lens::KannalaBrandt(KannalaBrandt::new(k));
        compare(&fisheye([0.0; 4]), 1e-6, directions(2.0));
        let real = [-0.01, 0.005, -0.004, 0.0007];
        compare(&fisheye(real), 1e-6, directions(1.6));
        let narrow = KannalaBrandt::new(real).limited_to(1.2);
        compare(&Lens::KannalaBrandt(narrow), 1e-6, directions(1.2));
    }
    /// Compares the expansion with the exact pose of the row: a wall at 1 to 5 m, 90 °/s over 20 ms
    /// about any axis, 640 × 480 px.
    #[test]
    fn a_moving_camera_projects_to_a_thousandth_of_a_pixel() {
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        for lens in [
            Lens::default(),
            Lens::radial(-0.1, 0.02),
            Lens::KannalaBrandt(fisheye),
        ] {
            for k in 0..200 {
                let direction = |salt: f64| {
                    let number = |axis: f64| (12.9898 * f64::from(k) + 78.233 * axis + salt).sin();
                    Vector3::new(number(1.0), number(2.0), number(3.0)).normalize()
                };
                let camera = Camera {
                    lens,
                    sweep: Sweep {
                        omega_rad: direction(0.1) * 0.0314,
                        nu_m: direction(0.2) * 0.01,
                    },
                    ..Camera::from_vertical_fov(640, 480, 60f64.to_radians())
                };
                let single = LensF32::new(&camera);
                for (u, v) in [
                    (0.0, 0.0),
                    (639.0, 10.0),
                    (320.0, 239.5),
                    (5.0, 479.0),
                    (500.0, 300.0),
                ] {
                    let far = 1.0 + f64::from(k % 5);
                    let x_c = camera.origin(v) + camera.ray(u, v).unwrap() * far;
                    let (p, q, shown) =
                        single.project_f32(x_c.x as f32, x_c.y as f32, x_c.z as f32);
                    let (du, dv) = (
                        camera.fx * f64::from(p) + camera.cx - u,
                        camera.fy * f64::from(q) + camera.cy - v,
                    );
                    assert!(shown && du.hypot(dv) < 1e-3, "{lens:?} {u} {v}: {du} {dv}");
                }
            }
        }
    }

    #[test]
    fn a_camera_at_rest_has_the_lens_itself() {
        let camera = Camera::from_vertical_fov(640, 480, 1.0);
        assert!(matches!(LensF32::new(&camera), LensF32::Pinhole(_)));
    }
}
