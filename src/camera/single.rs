//! Lenses in single precision, for loops over many points.
//!
//! A loop is written once over [`Bend`] and entered with the lens at hand, not the enum of all, so that the compiler makes vectors
//! of it.

use super::Lens;
use std::f64::consts::PI;

/// A lens in a loop.
pub trait Bend: Copy {
    /// Where a point (camera coordinates) appears at focal length 1, and whether the lens shows it. Beyond its limit the
    /// answer is finite but means nothing.
    fn bend(self, x: f32, y: f32, z: f32) -> (f32, f32, bool);
}

/// A lens in single precision.
#[derive(Clone, Copy, Debug)]
pub enum SingleLens {
    /// No distortion.
    Straight(Straight),
    /// [`super::BrownConrady`].
    Brown(Brown),
    /// [`super::KannalaBrandt`].
    Fisheye(Fisheye),
}

impl SingleLens {
    /// The same lens.
    pub fn new(lens: &Lens) -> Self {
        match lens {
            Lens::BrownConrady(lens) if lens.is_straight() => Self::Straight(Straight),
            Lens::BrownConrady(lens) => {
                let coefficients = lens.coefficients();
                Self::Brown(Brown {
                    k: coefficients.k.map(|k| k as f32),
                    p: coefficients.p.map(|p| p as f32),
                    limit: lens.limit() as f32,
                })
            }
            Lens::KannalaBrandt(lens) => {
                Self::Fisheye(Fisheye::new(|theta| lens.radius(theta).0, lens.limit_rad()))
            }
        }
    }
}

impl Bend for SingleLens {
    #[inline(always)]
    fn bend(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        match self {
            Self::Straight(lens) => lens.bend(x, y, z),
            Self::Brown(lens) => lens.bend(x, y, z),
            Self::Fisheye(lens) => lens.bend(x, y, z),
        }
    }
}

/// `(x/z, y/z)`.
#[derive(Clone, Copy, Debug)]
pub struct Straight;

impl Bend for Straight {
    #[inline(always)]
    fn bend(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / z;
        (x * inverse, y * inverse, z > 0.0)
    }
}

/// Radial and tangential distortion.
#[derive(Clone, Copy, Debug)]
pub struct Brown {
    k: [f32; 6],
    p: [f32; 2],
    limit: f32,
}

impl Bend for Brown {
    #[inline(always)]
    fn bend(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
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

/// Degree of the polynomial of a fisheye.
const DEGREE: usize = 17;
/// Nearer to 180° off the axis, `θ_d/sin θ` grows beyond what a polynomial follows.
const WIDEST_RAD: f64 = 0.75 * PI;

/// A fisheye: `p_d = G(cos θ) (x, y)/|x_c|` with `G = θ_d/sin θ`, which is smooth in `cos θ` as far as 180°.
///
/// G is interpolated at Chebyshev's nodes over the angles that the lens shows, to about the rounding of single precision as far as
/// 120° off the axis; beyond 135° nothing is shown.
#[derive(Clone, Copy, Debug)]
pub struct Fisheye {
    /// Coefficients of G in `t = cos θ · scale + offset`, which runs from −1 to 1; the lowest first.
    g: [f32; DEGREE + 1],
    scale: f32,
    offset: f32,
    least_cos: f32,
}

impl Fisheye {
    /// With θ_d = `radius(θ)` up to the angle `limit_rad`.
    fn new(radius: impl Fn(f64) -> f64, limit_rad: f64) -> Self {
        let least_cos = limit_rad.min(WIDEST_RAD).cos();
        let (middle, half) = (0.5 * (1.0 + least_cos), 0.5 * (1.0 - least_cos));
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
            least_cos: least_cos as f32,
        }
    }
}

impl Bend for Fisheye {
    #[inline(always)]
    fn bend(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let inverse = 1.0 / (x * x + y * y + z * z).sqrt();
        let cos = z * inverse;
        let t = (cos.max(self.least_cos) * self.scale + self.offset).min(1.0);
        let mut g = self.g[DEGREE];
        for c in self.g[..DEGREE].iter().rev() {
            g = g * t + c;
        }
        let stretch = g * inverse;
        (x * stretch, y * stretch, cos > self.least_cos)
    }
}

/// Coefficients (the lowest first) of the polynomial that has the values of `f` at Chebyshev's nodes in [−1, 1].
fn interpolate(f: impl Fn(f64) -> f64) -> [f64; DEGREE + 1] {
    let count = DEGREE + 1;
    let angle = |j: usize| PI * (j as f64 + 0.5) / count as f64;
    let values: Vec<f64> = (0..count).map(|j| f(angle(j).cos())).collect();
    // T_0 and T_1, and from there T_k = 2 t T_{k−1} − T_{k−2}.
    let mut before = [0.0; DEGREE + 1];
    let mut now = [0.0; DEGREE + 1];
    let mut sum = [0.0; DEGREE + 1];
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
        for place in 0..DEGREE {
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
    use crate::camera::{BrownCoefficients, BrownConrady, KannalaBrandt};
    use nalgebra::Vector3;

    fn compare(lens: &Lens, within: f64, directions: impl Iterator<Item = Vector3<f64>>) {
        let mut seen = 0;
        for x_c in directions {
            let (x, y, z) = (x_c.x as f32, x_c.y as f32, x_c.z as f32);
            let (p, q, shown) = SingleLens::new(lens).bend(x, y, z);
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

    /// Directions up to `limit` radians off the axis (and a little beyond), at distances of 0.5 to 5 m.
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
}
