//! Values of a frame at the wall samples of a tile, and its Jacobians there.

use crate::parameters::calibration::{BEND_PARAMETERS, INTRINSIC_PARAMETERS, PIXEL_PARAMETERS};
use crate::parameters::frame_estimate::FrameEstimate;
use crate::tiles::grid::{Plane, TilePoints};
use crate::tiles::interpolation::Interpolation;
use crate::tiles::sample_kernels::{SamplePositions, TileProjection, interpolate};
use nalgebra::{Matrix2x6, SMatrix, Vector3};
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::{Camera, LensF32, Sweep};
use tunnelstitch_geometry::surface::{Surface, bend_jacobian, lens_jacobian, wall_jacobian};
use tunnelstitch_geometry::trajectory::Pose;
use tunnelstitch_super_resolve::{PosedCamera, Reading};

/// `C = ∂(s, h)/∂κ` for the shared parameters that pixels depend on
/// ([`crate::parameters::calibration::PIXEL_INDICES`]).
pub type SharedJacobian = SMatrix<f64, 2, PIXEL_PARAMETERS>;

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
    /// Rotation from the world to the camera, row by row.
    r_cw: [[f32; 3]; 3],
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
            // The columns of the inverse rotation are the rows.
            r_cw: r_wc.matrix().cast::<f32>().into(),
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
    pub fn sample(&self, points: &TilePoints, shade: f32, values: &mut Plane) {
        let (width, height) = (self.image.width(), self.image.height());
        // The cubic needs one more pixel on either side.
        let (interpolation, margin) = match self.interpolation {
            Interpolation::Bicubic if width.min(height) >= 4 => (Interpolation::Bicubic, 1),
            _ => (Interpolation::Bilinear, 0),
        };
        let centre: Vector3<f32> = self.pose.to_camera(&points.centre.x_w).cast();
        let projection = TileProjection {
            intrinsics: self.intrinsics,
            r_cw: self.r_cw,
            centre: centre.into(),
            offsets: [&points.dx, &points.dy, &points.dz],
            image: self.image,
            margin,
        };
        let mut positions = SamplePositions::NONE;
        projection.project(self.lens, &mut positions);
        let light = (self.bias / shade, 1.0 / self.gain);
        interpolate(interpolation, self.image, &positions, light, values);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::calibration::{Calibration, INTRINSIC_PARAMETERS, Kappa};
    use crate::tiles::grid::{AREA, SIDE, TileId, WallGrid, ZERO};
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
