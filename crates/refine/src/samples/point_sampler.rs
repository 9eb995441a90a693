//! Projection and bilinear sampling of single wall points in a frame.

use nalgebra::{Matrix3, Vector3};
use tunnelstitch_core::frames::GreyImage;
use tunnelstitch_geometry::camera::{Camera, LensF32, ProjectF32};
use tunnelstitch_geometry::trajectory::Pose;

/// A camera at a pose, prepared to project wall points relative to an origin near them.
pub struct PointSampler {
    r_cw: Matrix3<f32>,
    centre: Vector3<f32>,
    focal: (f32, f32),
    principal: (f32, f32),
    lens: LensF32,
    limit: (f32, f32),
    width: usize,
}

/// A position between four pixels of an image.
#[derive(Clone, Copy, Debug)]
pub struct ImagePoint {
    /// Index of the upper left pixel.
    index: usize,
    width: usize,
    /// Fractions from it to the right and down, 0 to 1.
    fu: f32,
    fv: f32,
}

impl PointSampler {
    /// The `camera` at `pose`, for points relative to `origin`.
    pub fn new(camera: &Camera, pose: &Pose, origin: &Vector3<f64>) -> Self {
        let r_wc = pose.r_wc.to_rotation_matrix();
        Self {
            r_cw: r_wc.matrix().transpose().cast(),
            centre: pose.to_camera(origin).cast(),
            focal: (camera.fx as f32, camera.fy as f32),
            principal: (camera.cx as f32, camera.cy as f32),
            lens: LensF32::new(camera),
            limit: ((camera.width - 1) as f32, (camera.height - 1) as f32),
            width: camera.width as usize,
        }
    }

    /// Projects a wall point (relative to the origin, metres); None outside the image.
    #[inline]
    pub fn project(&self, point: &[f32; 3]) -> Option<ImagePoint> {
        let r = &self.r_cw;
        let dot =
            |row: usize| r[(row, 0)] * point[0] + r[(row, 1)] * point[1] + r[(row, 2)] * point[2];
        let (x, y) = (self.centre.x + dot(0), self.centre.y + dot(1));
        let z = self.centre.z + dot(2);
        let (p, q, shown) = self.lens.project_f32(x, y, z);
        let u = self.focal.0 * p + self.principal.0;
        let v = self.focal.1 * q + self.principal.1;
        if !(shown && u >= 0.0 && v >= 0.0 && u < self.limit.0 && v < self.limit.1) {
            return None;
        }
        let (x, y) = (u as usize, v as usize);
        Some(ImagePoint {
            index: y * self.width + x,
            width: self.width,
            fu: u - x as f32,
            fv: v - y as f32,
        })
    }
}

impl ImagePoint {
    /// Bilinear value of an image of the camera's size; NaN if a pixel has no value.
    #[inline]
    pub fn sample(&self, image: &GreyImage) -> f32 {
        let data = &image.data()[self.index..][..self.width + 2];
        let a = data[0] + self.fu * (data[1] - data[0]);
        let b = data[self.width] + self.fu * (data[self.width + 1] - data[self.width]);
        a + self.fv * (b - a)
    }

    /// Bilinear value as [`ImagePoint::sample`]; None if a pixel has no value.
    #[inline]
    pub fn sample_valid(&self, image: &GreyImage) -> Option<f32> {
        let value = self.sample(image);
        (!value.is_nan()).then_some(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tunnelstitch_geometry::camera::{Lens, Sweep};
    use tunnelstitch_geometry::trajectory::so3;

    /// Images of the pixel coordinates, sampled where the camera itself projects a point, lens
    /// included.
    #[test]
    fn points_are_sampled_where_the_camera_projects_them() {
        let mut camera = Camera::from_vertical_fov(64, 48, 1.0);
        camera.lens = Lens::radial(-0.1, 0.02);
        assert_sampled_where_projected(&camera);
        assert_sampled_where_projected(&camera.with_sweep(&Sweep {
            omega_rad: Vector3::new(0.01, 0.03, -0.01),
            nu_m: Vector3::new(0.001, -0.002, 0.001),
        }));
    }

    fn assert_sampled_where_projected(camera: &Camera) {
        let pose = Pose::new(
            so3::exp(&Vector3::new(0.1, 0.4, -0.2)),
            Vector3::new(0.3, 5.0, 0.1),
        );
        let across = (0..64 * 48).map(|k| (k % 64) as f32).collect();
        let down = (0..64 * 48).map(|k| (k / 64) as f32).collect();
        let across = GreyImage::new(64, 48, across);
        let down = GreyImage::new(64, 48, down);
        let origin = pose.to_world(&Vector3::new(0.1, -0.1, 2.0));
        let sampler = PointSampler::new(camera, &pose, &origin);
        let mut inside_count = 0;
        for k in 0..400 {
            let offset = Vector3::new(
                0.2 * f64::from(k % 20) - 2.0,
                0.2 * f64::from(k / 20) - 2.0,
                0.1,
            );
            let point = offset.cast::<f32>().into();
            let pixel = camera.project(&pose.to_camera(&(origin + offset)));
            let Some(image_point) = sampler.project(&point) else {
                let inside = pixel.is_some_and(|p| camera.is_in_image(&p, 0.001));
                assert!(!inside, "{pixel:?}");
                continue;
            };
            let pixel = pixel.unwrap();
            assert!((f64::from(image_point.sample(&across)) - pixel.x).abs() < 1e-3);
            assert!((f64::from(image_point.sample(&down)) - pixel.y).abs() < 1e-3);
            inside_count += 1;
        }
        assert!(inside_count > 50, "{inside_count}");
    }
}
