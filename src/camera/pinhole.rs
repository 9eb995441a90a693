//! The pinhole camera.

use super::Radial;
use nalgebra::{Matrix2x3, Matrix2x5, Vector2, Vector3};

/// A pinhole camera: `u = fx x/z + cx`, `v = fy y/z + cy`, pixels counted from the centre of the first, with `(x/z, y/z)`
/// distorted by the lens before ([`Radial`]).
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Pinhole {
    /// Width of the image, pixels.
    pub width: u32,
    /// Height of the image, pixels.
    pub height: u32,
    /// Focal length along u, pixels.
    pub fx: f64,
    /// Focal length along v, pixels.
    pub fy: f64,
    /// Principal point, u.
    pub cx: f64,
    /// Principal point, v.
    pub cy: f64,
    /// Distortion of the lens.
    #[serde(flatten)]
    pub radial: Radial,
}

impl Pinhole {
    /// A camera with square pixels and its principal point in the middle, from its vertical field of view
    /// (radians): `f = (height / 2) / tan(fov / 2)`.
    pub fn from_vertical_fov(width: u32, height: u32, fov_rad: f64) -> Self {
        let f = 0.5 * f64::from(height) / (0.5 * fov_rad).tan();
        Self {
            width,
            height,
            fx: f,
            fy: f,
            cx: 0.5 * (f64::from(width) - 1.0),
            cy: 0.5 * (f64::from(height) - 1.0),
            radial: Radial::default(),
        }
    }

    /// The ray of a pixel in camera coordinates, `K⁻¹ (u, v, 1)ᵀ` with the distortion undone; its z is 1.
    pub fn ray(&self, u: f64, v: f64) -> Vector3<f64> {
        let p = Vector2::new((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        if self.radial.is_none() {
            return p.push(1.0);
        }
        self.radial.undistort(&p).push(1.0)
    }

    /// `∂(x, y)/∂(ln f, cx, cy, k1, k2)` of the ray `(x, y, 1)` of a fixed pixel, with fx and fy growing alike.
    ///
    /// The pixel fixes `K p_d`, so that `∂p_d = −(p_d ∂ln f, ∂cx/fx, ∂cy/fy)`, and
    /// `∂p = (∂p_d/∂p)⁻¹ (∂p_d − p (q ∂k1 + q² ∂k2))` with p, q, p_d as in [`Radial`].
    pub fn ray_jacobian(&self, ray: &Vector3<f64>) -> Matrix2x5<f64> {
        let p = ray.xy();
        let q = p.norm_squared();
        let p_d = p * self.radial.factor(q);
        let columns = [
            -p_d,
            Vector2::new(-1.0 / self.fx, 0.0),
            Vector2::new(0.0, -1.0 / self.fy),
            -p * q,
            -p * (q * q),
        ];
        self.radial.inverse_jacobian(&p) * Matrix2x5::from_columns(&columns)
    }

    /// The pixel of a point in camera coordinates, or `None` behind the camera or where the lens would fold the picture.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        if self.radial.is_none() {
            return (x_c.z > 0.0).then(|| {
                Vector2::new(
                    self.fx * x_c.x / x_c.z + self.cx,
                    self.fy * x_c.y / x_c.z + self.cy,
                )
            });
        }
        let p = x_c.xy() / x_c.z;
        let q = p.norm_squared();
        (x_c.z > 0.0 && q < self.radial.limit()).then(|| {
            let p_d = p * self.radial.factor(q);
            Vector2::new(self.fx * p_d.x + self.cx, self.fy * p_d.y + self.cy)
        })
    }

    /// The largest `|(x/z, y/z)|²` within the picture, out to the pixels' outer corners, if the lens is one-to-one that far;
    /// else `None`.
    pub fn field(&self) -> Option<f64> {
        let limit = self.radial.limit();
        let farthest = self
            .border(1, 0.5)
            .iter()
            .map(|corner| self.ray(corner.x, corner.y).xy().norm_squared())
            .fold(0.0, f64::max);
        (farthest < limit).then_some(farthest)
    }

    /// `∂(u, v)/∂x_c`, pixels per metre, for a point in front of the camera.
    pub fn project_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        let inverse = 1.0 / x_c.z;
        let (x, y) = (x_c.x * inverse, x_c.y * inverse);
        let central = Matrix2x3::new(inverse, 0.0, -x * inverse, 0.0, inverse, -y * inverse);
        let focal = nalgebra::Matrix2::new(self.fx, 0.0, 0.0, self.fy);
        focal * self.radial.jacobian(&Vector2::new(x, y)) * central
    }

    /// Pixels of the image's shorter side.
    pub fn shorter_side(&self) -> u32 {
        self.width.min(self.height)
    }

    /// True if the pixel lies at least `margin` pixels inside the outermost pixel centres.
    pub fn sees(&self, pixel: &Vector2<f64>, margin: f64) -> bool {
        pixel.x >= margin
            && pixel.y >= margin
            && pixel.x <= f64::from(self.width - 1) - margin
            && pixel.y <= f64::from(self.height - 1) - margin
    }

    /// The same camera for an image halved `level` times (odd rows and columns dropped).
    ///
    /// A pixel of the halved image covers 2 × 2 of the one below, so centres shift by half a pixel:
    /// `u_l = (u + ½)/2^l − ½`.
    pub fn at_level(&self, level: usize) -> Self {
        let scale = 0.5f64.powi(level as i32);
        Self {
            width: self.width >> level,
            height: self.height >> level,
            fx: self.fx * scale,
            fy: self.fy * scale,
            cx: (self.cx + 0.5) * scale - 0.5,
            cy: (self.cy + 0.5) * scale - 0.5,
            radial: self.radial,
        }
    }

    /// The border of the image as pixels, clockwise from the first, `per_edge` steps an edge, along the
    /// outermost pixel centres widened by `outset` pixels (½ reaches the pixels' outer edges).
    pub fn border(&self, per_edge: usize, outset: f64) -> Vec<Vector2<f64>> {
        let (left, top) = (-outset, -outset);
        let right = f64::from(self.width - 1) + outset;
        let bottom = f64::from(self.height - 1) + outset;
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom)];
        let mut border = Vec::with_capacity(4 * per_edge);
        for k in 0..4 {
            let (a, b) = (corners[k], corners[(k + 1) % 4]);
            for step in 0..per_edge {
                let part = step as f64 / per_edge as f64;
                border.push(Vector2::new(
                    a.0 + (b.0 - a.0) * part,
                    a.1 + (b.1 - a.1) * part,
                ));
            }
        }
        border
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn camera() -> Pinhole {
        Pinhole {
            width: 640,
            height: 480,
            fx: 415.0,
            fy: 417.0,
            cx: 318.0,
            cy: 241.0,
            radial: Radial {
                k1: -0.06,
                k2: 0.01,
            },
        }
    }

    #[test]
    fn projection_inverts_the_ray() {
        for radial in [Radial::default(), camera().radial] {
            let camera = Pinhole { radial, ..camera() };
            let pixel = camera.project(&(camera.ray(100.25, 33.5) * 2.7)).unwrap();
            assert!((pixel - Vector2::new(100.25, 33.5)).norm() < 1e-10);
            assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
        }
    }

    #[test]
    fn a_lens_that_folds_the_picture_has_no_field() {
        let lens = |k1| Pinhole {
            radial: Radial { k1, k2: 0.0 },
            ..camera()
        };
        assert!(lens(-0.1).field().is_some());
        assert!(lens(-0.4).field().is_none());
        // 1 / (3 · 0.4) is less than 1.
        assert!(lens(-0.4).project(&Vector3::new(1.0, 0.0, 1.0)).is_none());
    }

    #[test]
    fn the_ray_follows_the_intrinsics_as_central_differences_do() {
        let camera = camera();
        let (u, v) = (560.0, 70.0);
        let analytic = camera.ray_jacobian(&camera.ray(u, v));
        let step = 1e-6;
        for k in 0..5 {
            let moved = |amount: f64| {
                let mut camera = camera;
                match k {
                    0 => {
                        camera.fx *= amount.exp();
                        camera.fy *= amount.exp();
                    }
                    1 => camera.cx += amount,
                    2 => camera.cy += amount,
                    3 => camera.radial.k1 += amount,
                    _ => camera.radial.k2 += amount,
                }
                camera.ray(u, v).xy()
            };
            let numeric = (moved(step) - moved(-step)) / (2.0 * step);
            assert!((numeric - analytic.column(k)).norm() < 1e-8, "column {k}");
        }
    }

    #[test]
    fn jacobian_matches_central_differences() {
        let camera = camera();
        let x_c = Vector3::new(0.4, -0.9, 2.5);
        let analytic = camera.project_jacobian(&x_c);
        let step = 1e-6;
        for k in 0..3 {
            let mut delta = Vector3::zeros();
            delta[k] = step;
            let numeric = (camera.project(&(x_c + delta)).unwrap()
                - camera.project(&(x_c - delta)).unwrap())
                / (2.0 * step);
            assert!((numeric - analytic.column(k)).norm() < 1e-6);
        }
    }

    #[test]
    fn levels_keep_the_same_rays() {
        let camera = camera();
        let coarse = camera.at_level(2);
        // The centre of the first coarse pixel is the middle of 4 × 4 fine ones.
        assert!((coarse.ray(0.0, 0.0) - camera.ray(1.5, 1.5)).norm() < 1e-12);
        assert_eq!((coarse.width, coarse.height), (160, 120));
    }

    #[test]
    fn field_of_view_is_what_was_asked_for() {
        let camera = Pinhole::from_vertical_fov(640, 480, 60f64.to_radians());
        let top = camera.ray(camera.cx, -0.5);
        assert!((top.y.abs().atan() - 30f64.to_radians()).abs() < 1e-12);
    }
}
