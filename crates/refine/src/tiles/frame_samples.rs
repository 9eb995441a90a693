//! Values of a frame at the wall samples of a tile, and its Jacobians there.

use crate::parameters::calibration::{BEND_PARAMETERS, INTRINSIC_PARAMETERS, PIXEL_PARAMETERS};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::tiles::grid::{Plane, TilePoints, ZERO};
use crate::tiles::interpolation::{Interpolation, cubic_weights};
use nalgebra::{Matrix2x6, Matrix3, SMatrix, Vector3};
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::{Camera, LensF32, LensLoop, ProjectF32, Sweep};
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::surface::{Surface, bend_jacobian, lens_jacobian, wall_jacobian};
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_super_resolve::{PosedCamera, Reading};

/// 2²³: added to a non-negative float, it rounds it to an integer in the last bits of the sum.
/// Unlike a cast, which saturates, this vectorises.
const ROUNDING: f32 = 8_388_608.0;

/// `C = ∂(s, h)/∂κ` for the shared parameters that pixels depend on
/// ([`crate::parameters::calibration::PIXEL_INDICES`]).
pub type SharedJacobian = SMatrix<f64, 2, PIXEL_PARAMETERS>;

/// For every sample of a tile, the index of the pixel to its upper left in an image.
type Indices = [u32; ZERO.len()];

/// A frame at one pyramid level with its current estimate, prepared for sampling.
pub struct SampledFrame<'a> {
    image: &'a GreyImage,
    camera: Camera,
    /// `fx, fy, cx, cy`.
    intrinsics: [f32; 4],
    lens: LensF32,
    pose: Pose,
    /// The pose in the straight tunnel, if the curvature is estimated.
    straightened: Option<Pose>,
    r_cw: Matrix3<f32>,
    gain: f32,
    bias: f32,
    interpolation: Interpolation,
}

impl<'a> SampledFrame<'a> {
    /// A frame's `image`, taken by `camera` (of the same level).
    pub fn new(image: &'a GreyImage, camera: Camera, estimate: &FrameEstimate) -> Self {
        let r_wc = estimate.pose.r_wc.to_rotation_matrix();
        Self {
            image,
            camera,
            intrinsics: [camera.fx, camera.fy, camera.cx, camera.cy].map(|v| v as f32),
            lens: LensF32::new(&camera),
            pose: estimate.pose,
            straightened: None,
            r_cw: r_wc.matrix().transpose().cast(),
            gain: estimate.log_gain.exp() as f32,
            bias: estimate.bias as f32,
            interpolation: Interpolation::Bilinear,
        }
    }

    /// Replaces the interpolation, which is bilinear at first.
    pub fn with_interpolation(self, interpolation: Interpolation) -> Self {
        Self {
            interpolation,
            ..self
        }
    }

    /// Adds the pose in the straight tunnel, for the derivative by the tunnel's curvature.
    pub fn with_straightened(self, surface: &dyn Surface) -> Self {
        Self {
            straightened: Some(surface.straightened(&self.pose)),
            ..self
        }
    }

    /// Camera and pose, for the search of pixel footprints.
    pub fn view(&self) -> PosedCamera<'_> {
        PosedCamera {
            camera: self.camera,
            pose: &self.pose,
        }
    }

    /// The wall's grey value that a pixel (row-major index) observes where the shading is `shade`,
    /// with noise of `sigma` grey levels; without weight if the pixel has no value.
    #[inline(always)]
    pub fn reading(&self, pixel: u32, shade: f32, sigma: f32) -> Reading {
        let value = (self.image.data()[pixel as usize] - self.bias / shade) / self.gain;
        if value.is_finite() {
            Reading {
                value,
                inverse_sigma: self.gain * shade / sigma,
            }
        } else {
            Reading::default()
        }
    }

    /// The gain `a`.
    pub fn gain(&self) -> f32 {
        self.gain
    }

    /// `A = ∂(s, h)/∂ξ` at the centre of a tile.
    ///
    /// The motion during the readout is neglected: the ray starts a few millimetres away, which
    /// changes A by a thousandth.
    pub fn wall_jacobian(&self, points: &TilePoints) -> Matrix2x6<f64> {
        wall_jacobian(&self.pose, &points.centre)
    }

    /// `C = ∂(s, h)/∂(ln f, cx, cy, k1, k2, ρ, c_x, c_z)` at the centre of a tile, for the `camera`
    /// at full size; `a`: the pose's Jacobian there, `rate`: the motion of the frame's camera
    /// during a readout of one second.
    ///
    /// A row that is read at the share u of the readout sees the wall as from the pose moved by
    /// `(ω u, R ν u)`, with ω and ν proportional to the readout time ρ:
    /// `∂(s, h)/∂ρ = A (ω, R ν) u`. The columns of the curvature are zero unless it is estimated.
    pub fn shared_jacobian(
        &self,
        points: &TilePoints,
        a: &Matrix2x6<f64>,
        camera: &Camera,
        rate: &Sweep,
    ) -> SharedJacobian {
        let x_c = self.pose.to_camera(&points.centre.x_w);
        let lens = lens_jacobian(&self.pose, a, camera, &x_c);
        let share = (camera.project(&x_c)).map_or(0.0, |pixel| camera.share(pixel.y));
        let shift = self.pose.r_wc * rate.nu_m;
        let by_readout = a.fixed_columns::<3>(0) * rate.omega_rad + a.fixed_columns::<3>(3) * shift;
        let mut c = SharedJacobian::zeros();
        c.fixed_columns_mut::<INTRINSIC_PARAMETERS>(0)
            .copy_from(&lens);
        c.set_column(INTRINSIC_PARAMETERS, &(by_readout * share));
        if let Some(straightened) = &self.straightened {
            let by_bend = bend_jacobian(&self.pose, straightened, a, &x_c);
            c.fixed_columns_mut::<BEND_PARAMETERS>(INTRINSIC_PARAMETERS + 1)
                .copy_from(&by_bend);
        }
        c
    }

    /// Writes the values `z = (I/V − b/V)/exp(α)` of the samples into `values`; the image holds
    /// `I/V`, and `shade` is V at the tile.
    ///
    /// NaN where an interpolated pixel has no value. Samples that a step has moved out of the image
    /// repeat its border.
    #[inline(always)]
    pub fn sample(&self, points: &TilePoints, shade: f32, values: &mut Plane) {
        match self.lens {
            LensF32::Pinhole(lens) => self.sample_through(lens, points, shade, values),
            LensF32::BrownConrady(lens) => self.sample_through(lens, points, shade, values),
            LensF32::KannalaBrandt(lens) => self.sample_through(lens, points, shade, values),
            LensF32::WideAngle(_) | LensF32::RollingWideAngle(_) => {
                self.sample_wide_angle(points, shade, values);
            }
            LensF32::RollingPinhole(lens) => self.sample_through(lens, points, shade, values),
            LensF32::RollingBrownConrady(lens) => self.sample_through(lens, points, shade, values),
            LensF32::RollingKannalaBrandt(lens) => self.sample_through(lens, points, shade, values),
        }
    }

    /// Samples through one kind of lens.
    #[inline(always)]
    fn sample_through(
        &self,
        lens: impl ProjectF32,
        points: &TilePoints,
        shade: f32,
        values: &mut Plane,
    ) {
        let centre = self.centre_in_camera(points);
        let project = |k: usize| self.project_sample(lens, points, &centre, k);
        self.sample_projected(project, shade, values);
    }

    /// Samples through one of the rarer models, whose projection is a loop of its own, so that the
    /// sampling is compiled once for all of them.
    fn sample_wide_angle(&self, points: &TilePoints, shade: f32, values: &mut Plane) {
        let mut projected = [(0.0, 0.0); ZERO.len()];
        self.lens.run(TileProjection {
            frame: self,
            points,
            projected: &mut projected,
        });
        self.sample_projected(|k| projected[k], shade, values);
    }

    /// The centre of a tile in camera coordinates.
    #[inline(always)]
    fn centre_in_camera(&self, points: &TilePoints) -> Vector3<f32> {
        self.pose.to_camera(&points.centre.x_w).cast()
    }

    /// Projects sample `k` of a tile, whose centre has the camera coordinates `c`.
    #[inline(always)]
    fn project_sample(
        &self,
        lens: impl ProjectF32,
        points: &TilePoints,
        c: &Vector3<f32>,
        k: usize,
    ) -> (f32, f32) {
        let r = &self.r_cw;
        let (dx, dy, dz) = (points.dx[k], points.dy[k], points.dz[k]);
        let x = c.x + r[(0, 0)] * dx + r[(0, 1)] * dy + r[(0, 2)] * dz;
        let y = c.y + r[(1, 0)] * dx + r[(1, 1)] * dy + r[(1, 2)] * dz;
        let z = c.z + r[(2, 0)] * dx + r[(2, 1)] * dy + r[(2, 2)] * dz;
        let (p, q, _) = lens.project_f32(x, y, z);
        (p, q)
    }

    /// Samples where `project` has a sample at focal length 1.
    #[inline(always)]
    fn sample_projected(
        &self,
        project: impl Fn(usize) -> (f32, f32),
        shade: f32,
        values: &mut Plane,
    ) {
        let [fx, fy, cx, cy] = self.intrinsics;
        let (width, height) = (self.image.width(), self.image.height());
        // The cubic needs one more pixel on either side.
        let margin = match self.interpolation {
            Interpolation::Bicubic if width.min(height) >= 4 => 1,
            _ => 0,
        };
        let first = margin as f32;
        let (last_u, last_v) = ((width - 2 - margin) as f32, (height - 2 - margin) as f32);
        let mut index: Indices = [0; ZERO.len()];
        let (mut fu, mut fv) = (ZERO, ZERO);
        for k in 0..ZERO.len() {
            let (p, q) = project(k);
            let (u, v) = (fx * p + cx, fy * q + cy);
            // `max` first: a NaN (a sample behind the camera) becomes the first pixel.
            let x0 = (u - 0.5).max(first).min(last_u) + ROUNDING;
            let y0 = (v - 0.5).max(first).min(last_v) + ROUNDING;
            fu[k] = (u - (x0 - ROUNDING)).clamp(0.0, 1.0);
            fv[k] = (v - (y0 - ROUNDING)).clamp(0.0, 1.0);
            index[k] = (y0.to_bits() - ROUNDING.to_bits()) * width as u32
                + (x0.to_bits() - ROUNDING.to_bits());
        }
        match margin {
            0 => self.bilinear(&index, [&fu, &fv], values),
            _ => self.bicubic(&index, [&fu, &fv], values),
        }
        let (inverse_gain, bias) = (1.0 / self.gain, self.bias / shade);
        for value in values.iter_mut() {
            *value = (*value - bias) * inverse_gain;
        }
    }

    /// Bilinear interpolation at the fractions `fu`, `fv` from the pixels at `index` to the next.
    #[inline(always)]
    fn bilinear(&self, index: &Indices, [fu, fv]: [&Plane; 2], values: &mut Plane) {
        let (data, width) = (self.image.data(), self.image.width());
        let (mut upper, mut lower) = ([[0.0f32; 2]; ZERO.len()], [[0.0f32; 2]; ZERO.len()]);
        for k in 0..ZERO.len() {
            let top = index[k] as usize;
            upper[k].copy_from_slice(&data[top..top + 2]);
            lower[k].copy_from_slice(&data[top + width..top + width + 2]);
        }
        for k in 0..ZERO.len() {
            let a = upper[k][0] + fu[k] * (upper[k][1] - upper[k][0]);
            let b = lower[k][0] + fu[k] * (lower[k][1] - lower[k][0]);
            values[k] = a + fv[k] * (b - a);
        }
    }

    /// Bicubic interpolation, over four rows first and then over four columns.
    #[inline(always)]
    fn bicubic(&self, index: &Indices, [fu, fv]: [&Plane; 2], values: &mut Plane) {
        let (data, width) = (self.image.data(), self.image.width());
        let (mut across, mut down) = ([ZERO; 4], [ZERO; 4]);
        for k in 0..ZERO.len() {
            let (u, v) = (cubic_weights(fu[k]), cubic_weights(fv[k]));
            for i in 0..4 {
                (across[i][k], down[i][k]) = (u[i], v[i]);
            }
        }
        let mut columns = [[0.0f32; 4]; ZERO.len()];
        for k in 0..ZERO.len() {
            let start = index[k] as usize - width - 1;
            for (row, weights) in down.iter().enumerate() {
                let at = start + row * width;
                let pixels: &[f32] = &data[at..at + 4];
                for i in 0..4 {
                    columns[k][i] += weights[k] * pixels[i];
                }
            }
        }
        for k in 0..ZERO.len() {
            let [a, b, c, d] = columns[k];
            let left = across[0][k] * a + across[1][k] * b;
            values[k] = left + (across[2][k] * c + across[3][k] * d);
        }
    }
}

/// The projection of the samples of a tile.
struct TileProjection<'a, 'f> {
    frame: &'a SampledFrame<'f>,
    points: &'a TilePoints,
    projected: &'a mut [(f32, f32); ZERO.len()],
}

impl LensLoop for TileProjection<'_, '_> {
    fn run(self, lens: impl ProjectF32) {
        let (frame, points, projected) = (self.frame, self.points, self.projected);
        let centre = frame.centre_in_camera(points);
        dispatch_simd(
            #[inline(always)]
            || {
                for (k, projected) in projected.iter_mut().enumerate() {
                    *projected = frame.project_sample(lens, points, &centre, k);
                }
            },
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::{Calibration, INTRINSIC_PARAMETERS, Kappa};
    use crate::tiles::grid::{AREA, SIDE, TileId, WallGrid};
    use tunnelstitch_geometry::camera::{DoubleSphere, KannalaBrandt, Lens};
    use tunnelstitch_geometry::surface::{Circle, Surface, WallPoint};
    use tunnelstitch_geometry::trajectory::so3;

    /// Central differences over the camera's parameters and the readout time.
    #[test]
    fn shared_jacobian_matches_central_differences() {
        let circle = Circle::new(3.0).unwrap();
        let calibration = Calibration::none(Camera {
            lens: Lens::radial(-0.1, 0.02),
            ..Camera::from_vertical_fov(160, 120, 60f64.to_radians())
        });
        let image = GreyImage::new(160, 120, vec![0.0; 160 * 120]);
        let estimate = FrameEstimate::at(Pose::new(
            so3::exp(&Vector3::new(0.05, 0.3, -0.1)),
            Vector3::new(0.4, 10.0, -0.2),
        ));
        let pose = estimate.pose;
        let camera = *calibration.given.of(0);
        let rate = Sweep {
            omega_rad: Vector3::new(0.1, 0.5, -0.2),
            nu_m: Vector3::new(0.3, -0.1, 0.2),
        };
        let frame = SampledFrame::new(&image, camera.at_level(1), &estimate);
        let grid = WallGrid::new(&circle, 3.0 / camera.fy, 1.0);
        let wall_of = |camera: &Camera, pixel: &nalgebra::Vector2<f64>| {
            let ray = pose.r_wc * camera.ray(pixel.x, pixel.y).unwrap();
            let start = pose.to_world(&camera.origin(pixel.y));
            circle.hit(&start, &ray).unwrap().wall
        };
        let observed = wall_of(&camera, &nalgebra::Vector2::new(130.0, 25.0));
        let (width, height) = grid.tile_size_m();
        let tile = TileId {
            column: (observed.s_m / width) as i64,
            row: (observed.h_m / height) as i64,
        };
        let points = TilePoints::new(&grid, &circle, tile, &mut Vec::new());
        let pixel = camera.project(&pose.to_camera(&points.centre.x_w)).unwrap();
        let analytic =
            frame.shared_jacobian(&points, &frame.wall_jacobian(&points), &camera, &rate);
        let step = 1e-6;
        for k in 0..=INTRINSIC_PARAMETERS {
            let moved = |amount: f64| {
                let mut kappa = Kappa::zeros();
                if k < INTRINSIC_PARAMETERS {
                    kappa[k] = amount;
                }
                let camera = *calibration.cameras(&kappa).unwrap().of(0);
                let readout_s = if k == INTRINSIC_PARAMETERS {
                    amount
                } else {
                    0.0
                };
                wall_of(&camera.with_sweep(&rate.scaled(readout_s)), &pixel)
            };
            let (plus, minus) = (moved(step), moved(-step));
            let s = (plus.s_m - minus.s_m) / (2.0 * step);
            let h = (plus.h_m - minus.h_m) / (2.0 * step);
            let expected = nalgebra::Vector2::new(s, h);
            assert!((expected - analytic.column(k)).norm() < 1e-7, "column {k}");
        }
    }

    /// A frame whose grey value is a linear function of the pixel, which both interpolations
    /// reproduce exactly.
    #[test]
    fn samples_are_taken_where_the_camera_projects_them() {
        let straight = Camera::from_vertical_fov(160, 120, 60f64.to_radians());
        assert_sampled_where_projected(straight);
        let fisheye = KannalaBrandt::new([-0.01, 0.005, -0.004, 0.0007]);
        let wide = DoubleSphere::new(-0.2, 0.6).unwrap();
        for lens in [
            Lens::radial(-0.1, 0.02),
            Lens::KannalaBrandt(fisheye),
            Lens::DoubleSphere(wide),
        ] {
            let camera = Camera { lens, ..straight };
            assert_sampled_where_projected(camera);
            assert_sampled_where_projected(camera.with_sweep(&Sweep {
                omega_rad: Vector3::new(0.01, 0.03, -0.01),
                nu_m: Vector3::new(0.001, -0.002, 0.001),
            }));
        }
    }

    fn assert_sampled_where_projected(camera: Camera) {
        for interpolation in [Interpolation::Bilinear, Interpolation::Bicubic] {
            assert_interpolated_where_projected(camera, interpolation);
        }
    }

    fn assert_interpolated_where_projected(camera: Camera, interpolation: Interpolation) {
        let circle = Circle::new(3.0).unwrap();
        let data = (0..160 * 120)
            .map(|k| 0.5 * (k % 160) as f32 + 1.5 * (k / 160) as f32)
            .collect();
        let image = GreyImage::new(160, 120, data);
        let mut estimate = FrameEstimate::at(Pose::new(
            so3::exp(&Vector3::new(0.05, 0.3, -0.1)),
            Vector3::new(0.4, 10.0, -0.2),
        ));
        estimate.log_gain = 0.2;
        estimate.bias = 3.0;
        let frame = SampledFrame::new(&image, camera, &estimate).with_interpolation(interpolation);
        let grid = WallGrid::new(&circle, 3.0 / camera.fy, 1.0);
        let hit = circle
            .hit(&estimate.pose.t_wc, &(estimate.pose.r_wc * Vector3::z()))
            .unwrap();
        let (width, height) = grid.tile_size_m();
        let tile = TileId {
            column: (hit.wall.s_m / width) as i64,
            row: (hit.wall.h_m / height) as i64,
        };
        let points = TilePoints::new(&grid, &circle, tile, &mut Vec::new());
        let mut values = ZERO;
        let shade = 0.5;
        frame.sample(&points, shade, &mut values);
        let centre = grid.centre(tile);
        for (k, value) in values[..AREA].iter().enumerate() {
            let (i, j) = ((k % SIDE) as f64 - 4.5, (k / SIDE) as f64 - 4.5);
            let wall = WallPoint {
                s_m: centre.s_m + i * grid.spacing_s_m,
                h_m: centre.h_m + j * grid.spacing_h_m,
            };
            let x_w = circle.frame(wall).x_w;
            let pixel = camera.project(&estimate.pose.to_camera(&x_w)).unwrap();
            let grey = 0.5 * pixel.x + 1.5 * pixel.y;
            let bias = estimate.bias / f64::from(shade);
            let expected = (grey - bias) / estimate.log_gain.exp();
            assert!((f64::from(*value) - expected).abs() < 2e-3);
        }
    }
}
