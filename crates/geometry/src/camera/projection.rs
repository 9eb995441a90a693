//! The camera model: projection, back-projection and their Jacobians.

use super::lens::Lens;
use super::sweep::MAX_SHARE;
use super::sweep::Sweep;
use nalgebra::{Matrix2, Matrix2x3, Matrix2x5, Vector2, Vector3};

/// A camera: `u = fx p_d.x + cx`, `v = fy p_d.y + cy`, pixels counted from the centre of the first,
/// with p_d the distorted image point of the lens model ([`Lens`]).
///
/// With a [`Sweep`], the camera's coordinates are those of the middle row, a point is projected
/// with the pose of the row it appears in, and rays start at the camera centre of their row
/// ([`Camera::origin`]).
///
/// Serialises as its calibration file ([`super::format_calibration`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
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
    /// The lens model.
    pub lens: Lens,
    /// The camera's motion during the readout of an image, different for each frame of a survey.
    pub sweep: Sweep,
    /// Distance from the camera up to which the wall is used, metres; beyond, a pixel shows too
    /// much of it to tell anything.
    pub max_range_m: f64,
}

/// Bisection steps that find the edge of the lens's field of view towards a border pixel.
const MAX_BISECTION_ITERATIONS: usize = 50;
/// Pixels along each side of the grid on which the visible fraction is counted.
const VISIBILITY_GRID: usize = 33;
/// Fixed-point iterations that find the row of a point.
const MAX_SHARE_ITERATIONS: usize = 30;
const SHARE_TOLERANCE: f64 = 1e-13;

impl Camera {
    /// A camera at rest that is given no range: its image's width and height, focal lengths and
    /// principal point, all in pixels, and its lens.
    pub fn at_rest(
        [width, height]: [u32; 2],
        [fx, fy]: [f64; 2],
        [cx, cy]: [f64; 2],
        lens: Lens,
    ) -> Self {
        Self {
            width,
            height,
            fx,
            fy,
            cx,
            cy,
            lens,
            sweep: Sweep::default(),
            max_range_m: f64::INFINITY,
        }
    }

    /// A pinhole camera with square pixels and a central principal point, from its vertical field
    /// of view (radians): `f = (height / 2) / tan(fov / 2)`.
    pub fn from_vertical_fov(width: u32, height: u32, fov_rad: f64) -> Self {
        Self::central_pinhole(
            [width, height],
            0.5 * f64::from(height) / (0.5 * fov_rad).tan(),
        )
    }

    /// A pinhole camera with square pixels and a central principal point, from its horizontal field
    /// of view (radians): `f = (width / 2) / tan(fov / 2)`.
    pub fn from_horizontal_fov(width: u32, height: u32, fov_rad: f64) -> Self {
        Self::central_pinhole(
            [width, height],
            0.5 * f64::from(width) / (0.5 * fov_rad).tan(),
        )
    }

    /// A pinhole camera with square pixels, a focal length of `f` pixels and a central principal
    /// point.
    fn central_pinhole(size: [u32; 2], f: f64) -> Self {
        let [cx, cy] = size.map(|pixels| 0.5 * (f64::from(pixels) - 1.0));
        Self::at_rest(size, [f, f], [cx, cy], Lens::default())
    }

    /// This camera with pictures of `size` in which a pixel's width and height are those of its own
    /// over `factors` s: the centre of a pixel moves from u to `s (u + ½) − ½`.
    pub fn resampled(&self, size: [u32; 2], factors: [f64; 2]) -> Self {
        let ([width, height], [x, y]) = (size, factors);
        Self {
            width,
            height,
            fx: self.fx * x,
            fy: self.fy * y,
            cx: (self.cx + 0.5) * x - 0.5,
            cy: (self.cy + 0.5) * y - 0.5,
            ..*self
        }
    }

    /// This camera with pictures of another size that were scaled from its own. None where the
    /// sides ask for factors that differ by more than a pixel of rounding, as those of cropped
    /// pictures do.
    pub fn scaled_to(&self, [width, height]: [u32; 2]) -> Option<Self> {
        let own = [self.width, self.height].map(f64::from);
        let [x, y] = [f64::from(width) / own[0], f64::from(height) / own[1]];
        let is_scaled = (x - y).abs() < 1.0 / own[0] + 1.0 / own[1];
        is_scaled.then(|| self.resampled([width, height], [x, y]))
    }

    /// This camera with a rolling-shutter motion.
    #[inline]
    pub fn with_sweep(&self, sweep: &Sweep) -> Self {
        Self {
            sweep: *sweep,
            ..*self
        }
    }

    /// The share τ of the readout time at which row `v` is read ([`Sweep`]).
    #[inline]
    pub fn share(&self, v: f64) -> f64 {
        let height = f64::from(self.height);
        ((v - 0.5 * (height - 1.0)) / height).clamp(-MAX_SHARE, MAX_SHARE)
    }

    /// Back-projects a pixel to a direction in camera coordinates (z = 1 for a pinhole with
    /// or without distortion, unit length for the others); None outside the lens's field of view.
    pub fn ray(&self, u: f64, v: f64) -> Option<Vector3<f64>> {
        let ray = self.lens.ray(&Vector2::new(
            (u - self.cx) / self.fx,
            (v - self.cy) / self.fy,
        ))?;
        if self.sweep.is_none() {
            Some(ray)
        } else {
            Some(self.sweep.rotation_at(self.share(v)) * ray)
        }
    }

    /// The origin of the rays of row `v`, in camera coordinates, metres: 0 without a sweep.
    #[inline]
    pub fn origin(&self, v: f64) -> Vector3<f64> {
        if self.sweep.is_none() {
            Vector3::zeros()
        } else {
            self.sweep.nu_m * self.share(v)
        }
    }

    /// Projects a point in camera coordinates to a pixel, inside the image or not; None outside the
    /// lens's field of view.
    pub fn project(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        if self.sweep.is_none() {
            self.project_at(x_c)
        } else {
            self.project_at(&self.sweep.point_at(x_c, self.share_of(x_c)?))
        }
    }

    /// The share of the readout time at which a point appears: the solution of
    /// `τ = share(v(x_c(τ)))`.
    ///
    /// Fixed-point iteration from the middle row. If the camera moves a point by n pixels during
    /// the readout, each step reduces the error by the factor n/H. None if an iterate leaves the
    /// lens's field of view.
    fn share_of(&self, x_c: &Vector3<f64>) -> Option<f64> {
        let mut share = 0.0;
        for _ in 0..MAX_SHARE_ITERATIONS {
            let next = self.share(self.project_at(&self.sweep.point_at(x_c, share))?.y);
            let change = next - share;
            share = next;
            if change.abs() < SHARE_TOLERANCE {
                break;
            }
        }
        Some(share)
    }

    /// Projects a point given in the coordinates of its own row.
    fn project_at(&self, x_c: &Vector3<f64>) -> Option<Vector2<f64>> {
        let p_d = self.lens.project(x_c)?;
        Some(Vector2::new(
            self.fx * p_d.x + self.cx,
            self.fy * p_d.y + self.cy,
        ))
    }

    /// `∂(u, v)/∂x_c`, pixels per metre, for a point in the lens's field of view.
    ///
    /// With a sweep, a change of the row changes the pose: with J the Jacobian in the row's
    /// coordinates, `g = J ∂x_c(τ)/∂τ/H` and `e = (0, 1)`,
    /// `∂(u, v)/∂x_c = (I − g eᵀ)⁻¹ J Exp(−ω τ)`.
    pub fn project_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        if self.sweep.is_none() {
            return self.jacobian_at(x_c);
        }
        let share = self.share_of(x_c).unwrap_or_default();
        let at = self.sweep.point_at(x_c, share);
        let turned = self.jacobian_at(&at) * self.sweep.rotation_at(-share).matrix();
        self.feedback(&at, share) * turned
    }

    /// `J = ∂(u, v)/∂x_c` of a point in the coordinates of its own row, with the row held fixed.
    fn jacobian_at(&self, x_c: &Vector3<f64>) -> Matrix2x3<f64> {
        Matrix2::new(self.fx, 0.0, 0.0, self.fy) * self.lens.jacobian(x_c)
    }

    /// `(I − g eᵀ)⁻¹` of a point that lies at `at` in the coordinates of its own row.
    fn feedback(&self, at: &Vector3<f64>, share: f64) -> Matrix2<f64> {
        let g = self.jacobian_at(at) * self.sweep.point_rate(at, share) / f64::from(self.height);
        let inverse = 1.0 / (1.0 - g.y);
        Matrix2::new(1.0, g.x * inverse, 0.0, inverse)
    }

    /// `∂(u, v)/∂(ln f, cx, cy, k1, k2)` of a point in the lens's field of view; fx and fy scale
    /// together.
    pub fn intrinsics_jacobian(&self, x_c: &Vector3<f64>) -> Matrix2x5<f64> {
        if self.sweep.is_none() {
            return self.intrinsics_jacobian_at(x_c);
        }
        let share = self.share_of(x_c).unwrap_or_default();
        let at = self.sweep.point_at(x_c, share);
        self.feedback(&at, share) * self.intrinsics_jacobian_at(&at)
    }

    /// `∂(u, v)/∂(ln f, cx, cy, k1, k2)` of a point in the coordinates of its own row, with the row
    /// held fixed.
    fn intrinsics_jacobian_at(&self, x_c: &Vector3<f64>) -> Matrix2x5<f64> {
        let focal = Matrix2::new(self.fx, 0.0, 0.0, self.fy);
        let p_d = self.lens.project(x_c).unwrap_or_default();
        let lens = focal * self.lens.coefficient_jacobian(x_c);
        Matrix2x5::from_columns(&[
            focal * p_d,
            Vector2::x(),
            Vector2::y(),
            lens.column(0).into(),
            lens.column(1).into(),
        ])
    }

    /// Fraction of the image within the lens's field of view: 1 if the distortion is invertible out
    /// to the outermost pixels.
    pub fn visible_fraction(&self) -> f64 {
        let place =
            |k: usize, size: u32| f64::from(size - 1) * k as f64 / (VISIBILITY_GRID - 1) as f64;
        let shown = (0..VISIBILITY_GRID * VISIBILITY_GRID).filter(|k| {
            let (column, row) = (k % VISIBILITY_GRID, k / VISIBILITY_GRID);
            let (u, v) = (place(column, self.width), place(row, self.height));
            self.ray(u, v).is_some()
        });
        shown.count() as f64 / (VISIBILITY_GRID * VISIBILITY_GRID) as f64
    }

    /// Length of the image's shorter side, pixels.
    pub fn shorter_side(&self) -> u32 {
        self.width.min(self.height)
    }

    /// True if the pixel lies at least `margin` pixels inside the outermost pixel centres.
    #[inline]
    pub fn is_in_image(&self, pixel: &Vector2<f64>, margin: f64) -> bool {
        pixel.x >= margin
            && pixel.y >= margin
            && pixel.x <= f64::from(self.width - 1) - margin
            && pixel.y <= f64::from(self.height - 1) - margin
    }

    /// The camera of an image halved `level` times (odd rows and columns dropped).
    ///
    /// A pixel of the halved image covers 2 × 2 pixels of the level below, so centres shift by half
    /// a pixel: `u_l = (u + ½)/2^l − ½`.
    pub fn at_level(&self, level: usize) -> Self {
        let size = [self.width, self.height].map(|side| side >> level);
        self.resampled(size, [0.5f64.powi(level as i32); 2])
    }

    /// The camera of an image with `times` as many pixels along each axis.
    pub fn upsampled(&self, times: u32) -> Self {
        let scale = f64::from(times);
        Self {
            width: times * self.width,
            height: times * self.height,
            fx: scale * self.fx,
            fy: scale * self.fy,
            cx: scale * self.cx + 0.5 * (scale - 1.0),
            cy: scale * self.cy + 0.5 * (scale - 1.0),
            lens: self.lens,
            sweep: self.sweep,
            max_range_m: self.max_range_m,
        }
    }

    /// Rays along the optical axis and through the four corners that lie within the lens's field of
    /// view. Their wall points bound the displacement of a frame.
    pub fn corner_and_centre_rays(&self) -> Vec<Vector3<f64>> {
        let corners = self.border(1, 0.0).into_iter();
        corners
            .filter_map(|pixel| self.ray(pixel.x, pixel.y))
            .chain([Vector3::z()])
            .collect()
    }

    /// Focal length on the axis, pixels: the geometric mean of fx and fy times the lens's scale
    /// there ([`Lens::axis_scale`]).
    pub fn focal_px(&self) -> f64 {
        (self.fx * self.fy).sqrt() * self.lens.axis_scale()
    }

    /// Focal length on the axis along v, pixels: fy times the lens's scale there.
    pub fn vertical_focal_px(&self) -> f64 {
        self.fy * self.lens.axis_scale()
    }

    /// Rays through a regular grid of 9 × 7 pixels, the image's border included, without those
    /// outside the lens's field of view.
    pub fn grid_rays(&self) -> Vec<Vector3<f64>> {
        const COLUMNS: u32 = 9;
        const ROWS: u32 = 7;
        let place = |k, count, pixels| f64::from((pixels - 1) * k) / f64::from(count - 1);
        let pixels = (0..ROWS).flat_map(|j| (0..COLUMNS).map(move |i| (i, j)));
        let rays = pixels.filter_map(|(i, j)| {
            let u = place(i, COLUMNS, self.width);
            self.ray(u, place(j, ROWS, self.height))
        });
        rays.collect()
    }

    /// The border of the image as pixels, clockwise from the first pixel, `per_edge` points per
    /// edge, along the outermost pixel centres moved outwards by `outset` pixels (½ reaches the
    /// pixels' outer edges). Where the lens's field of view ends earlier, the border follows its
    /// edge.
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
                border.push(self.shown_towards(Vector2::new(
                    a.0 + (b.0 - a.0) * part,
                    a.1 + (b.1 - a.1) * part,
                )));
            }
        }
        border
    }

    /// The last pixel within the lens's field of view from the principal point towards `pixel`.
    fn shown_towards(&self, pixel: Vector2<f64>) -> Vector2<f64> {
        let shown = |pixel: &Vector2<f64>| self.ray(pixel.x, pixel.y).is_some();
        if shown(&pixel) {
            return pixel;
        }
        let centre = Vector2::new(self.cx, self.cy);
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..MAX_BISECTION_ITERATIONS {
            let middle = 0.5 * (low + high);
            if shown(&(centre + (pixel - centre) * middle)) {
                low = middle;
            } else {
                high = middle;
            }
        }
        centre + (pixel - centre) * low
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::brown_conrady::{BrownCoefficients, BrownConrady};
    use crate::camera::kannala_brandt::KannalaBrandt;
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    fn camera() -> Camera {
        Camera::at_rest(
            [640, 480],
            [415.0, 417.0],
            [318.0, 241.0],
            Lens::radial(-0.06, 0.01),
        )
    }

    /// Cameras at rest and in motion.
    fn moving_cameras() -> impl Iterator<Item = Camera> {
        let sweeps = sweeps();
        let moving = cameras()
            .into_iter()
            .flat_map(move |camera| sweeps.map(|sweep| camera.with_sweep(&sweep)));
        cameras().into_iter().chain(moving)
    }

    fn cameras() -> [Camera; 4] {
        let tangential = BrownCoefficients {
            k: [-0.06, 0.01, 0.002, 0.0, 0.0, 0.0],
            p: [1e-3, -2e-3],
        };
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        [
            Lens::default(),
            camera().lens,
            Lens::BrownConrady(BrownConrady::new(tangential)),
            Lens::KannalaBrandt(fisheye),
        ]
        .map(|lens| Camera { lens, ..camera() })
    }

    #[test]
    fn projection_inverts_the_ray() {
        for camera in cameras() {
            let ray = camera.ray(100.25, 33.5).unwrap();
            let pixel = camera.project(&(ray * 2.7)).unwrap();
            assert!((pixel - Vector2::new(100.25, 33.5)).norm() < 1e-9);
            assert!(camera.project(&Vector3::new(0.0, 0.0, -1.0)).is_none());
        }
    }

    fn sweeps() -> [Sweep; 3] {
        let sweep = |omega_rad: [f64; 3], nu_m: [f64; 3]| Sweep {
            omega_rad: omega_rad.into(),
            nu_m: nu_m.into(),
        };
        // 90 °/s about y over 20 ms, a fast rotation about all axes, and a bottom-up readout.
        [
            sweep([0.0, 0.0314, 0.0], [0.0, 0.002, 0.0]),
            sweep([0.05, -0.1, 0.07], [0.02, -0.03, 0.01]),
            sweep([0.01, -0.03, 0.02], [0.0, -0.002, 0.001]),
        ]
    }

    proptest! {
        /// A point anywhere on the ray of a pixel appears in that pixel again.
        #[test]
        fn rays_of_a_moving_camera_lead_back_to_their_pixels(
            lens in 0usize..4, sweep in 0usize..3, u in 0.0..639.0f64, v in 0.0..479.0f64,
            far in 0.5..9.0f64,
        ) {
            let camera = cameras()[lens].with_sweep(&sweeps()[sweep]);
            let x_c = camera.origin(v) + camera.ray(u, v).unwrap() * far;
            let pixel = camera.project(&x_c).unwrap();
            prop_assert!((pixel - Vector2::new(u, v)).norm() < 1e-8, "{pixel}");
        }
    }

    /// Compares each row with a camera at rest at the pose of that row.
    #[test]
    fn rows_of_a_moving_camera_are_those_of_cameras_at_rest() {
        for (rest, sweep) in cameras().iter().zip(sweeps().iter().cycle()) {
            let camera = rest.with_sweep(sweep);
            for (u, v) in [(0.0, 0.0), (320.0, 100.0), (639.0, 479.0)] {
                let x_c = camera.origin(v) + camera.ray(u, v).unwrap() * 2.0;
                let share = (v - 239.5) / 480.0;
                let turned = Rotation3::new(sweep.omega_rad * share);
                let own = turned.inverse() * (x_c - sweep.nu_m * share);
                let seen = rest.project(&own).unwrap();
                assert!((seen - Vector2::new(u, v)).norm() < 1e-9);
                assert!((rest.project(&x_c).unwrap() - seen).norm() > 1e-2 || v == 239.5);
            }
        }
    }

    #[test]
    fn what_the_lens_does_not_show_has_no_ray() {
        let lens = |k1| Camera {
            lens: Lens::radial(k1, 0.0),
            ..camera()
        };
        assert_eq!(lens(-0.1).visible_fraction(), 1.0);
        let folding = lens(-0.4);
        assert!((0.3..0.9).contains(&folding.visible_fraction()));
        assert!(folding.ray(0.0, 0.0).is_none());
        // 1 / (3 · 0.4) is less than 1.
        assert!(folding.project(&Vector3::new(1.0, 0.0, 1.0)).is_none());
        // The border coincides with the last valid rays.
        for pixel in folding.border(8, 0.0) {
            assert!(folding.ray(pixel.x, pixel.y).is_some());
            let outwards = pixel - Vector2::new(folding.cx, folding.cy);
            let beyond = pixel + outwards * 1e-6;
            assert!(
                !folding.is_in_image(&beyond, 0.0) || folding.ray(beyond.x, beyond.y).is_none()
            );
        }
    }

    #[test]
    fn the_pixel_follows_the_intrinsics_as_central_differences_do() {
        for camera in moving_cameras() {
            let x_c = Vector3::new(0.9, -0.7, 1.5);
            let analytic = camera.intrinsics_jacobian(&x_c);
            let step = 1e-6;
            for k in 0..5 {
                let moved = |amount: f64| {
                    let mut camera = camera;
                    let [k1, k2] = camera.lens.k1_k2();
                    match k {
                        0 => {
                            camera.fx *= amount.exp();
                            camera.fy *= amount.exp();
                        }
                        1 => camera.cx += amount,
                        2 => camera.cy += amount,
                        3 => camera.lens = camera.lens.with_k1_k2(k1 + amount, k2),
                        _ => camera.lens = camera.lens.with_k1_k2(k1, k2 + amount),
                    }
                    camera.project(&x_c).unwrap()
                };
                let numeric = (moved(step) - moved(-step)) / (2.0 * step);
                assert!((numeric - analytic.column(k)).norm() < 1e-5, "column {k}");
            }
        }
    }

    #[test]
    fn jacobian_matches_central_differences() {
        for camera in moving_cameras() {
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
    }

    #[test]
    fn levels_keep_the_same_rays() {
        for camera in moving_cameras() {
            let coarse = camera.at_level(2);
            // The centre of the first coarse pixel is the middle of 4 × 4 fine ones.
            let (a, b) = (coarse.ray(0.0, 0.0), camera.ray(1.5, 1.5));
            assert!((a.unwrap() - b.unwrap()).norm() < 1e-12);
            assert!((coarse.origin(0.0) - camera.origin(1.5)).norm() < 1e-12);
            assert_eq!((coarse.width, coarse.height), (160, 120));
        }
    }

    #[test]
    fn field_of_view_is_what_was_asked_for() {
        let camera = Camera::from_vertical_fov(640, 480, 60f64.to_radians());
        let top = camera.ray(camera.cx, -0.5).unwrap();
        assert!((top.y.abs().atan() - 30f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn rays_go_across_all_of_the_picture() {
        let camera = Camera::from_vertical_fov(160, 120, 1.0);
        let rays = camera.grid_rays();
        assert_eq!(rays.len(), 63);
        let corners = [(0, (0.0, 0.0)), (8, (159.0, 0.0)), (62, (159.0, 119.0))];
        for (k, (u, v)) in corners {
            let pixel = camera.project(&rays[k]).unwrap();
            assert!((pixel - Vector2::new(u, v)).norm() < 1e-9);
        }
    }
}
