//! Projection of wall points into a frame, in single precision.

use nalgebra::{Matrix3, Vector3};
use tunnelstitch_geometry::camera::{Camera, LensF32, LensLoop, ProjectF32};
use tunnelstitch_geometry::numerics::simd_dispatch::dispatch_simd;
use tunnelstitch_geometry::trajectory::Pose;

/// Pixel coordinates u and v of points, and which of the points the lens shows.
pub type ProjectedPixels<'a> = (&'a mut [f32], &'a mut [f32], &'a mut [bool]);

/// Wall points in single precision, relative to an origin near them: coordinates are exact to 10⁻⁷
/// of the patch's size.
#[derive(Debug, Default)]
pub struct LocalPoints {
    /// Origin in the world, metres.
    pub origin: Vector3<f64>,
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl LocalPoints {
    /// Converts points, in their order, relative to the first.
    pub fn new(points: &[Vector3<f64>]) -> Self {
        let mut all = Self::default();
        all.set(points);
        all
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// Replaces the points by others.
    pub fn set(&mut self, points: &[Vector3<f64>]) {
        let origin = points.first().copied().unwrap_or_default();
        self.origin = origin;
        for axis in [&mut self.x, &mut self.y, &mut self.z] {
            axis.resize(points.len(), 0.0);
        }
        let axes = self.x.iter_mut().zip(&mut self.y).zip(&mut self.z);
        for (point, ((x, y), z)) in points.iter().zip(axes) {
            *x = (point.x - origin.x) as f32;
            *y = (point.y - origin.y) as f32;
            *z = (point.z - origin.z) as f32;
        }
    }
}

/// Projection of a camera at a pose for wall points relative to an origin:
/// `x_c = R_wcᵀ x + R_wcᵀ (origin − t_wc)`, then the lens and `u = fx x + cx`, `v = fy y + cy`
/// ([`Camera::project`]).
///
/// It is exact to about 10⁻⁴ px.
#[derive(Clone, Copy, Debug)]
pub struct LocalProjection {
    r_cw: [[f32; 3]; 3],
    centre: [f32; 3],
    focal: [f32; 2],
    principal: [f32; 2],
    lens: LensF32,
    limit: [f32; 2],
}

impl LocalProjection {
    /// Prepares the camera at `pose` for points relative to `origin`.
    pub fn new(camera: &Camera, pose: &Pose, origin: &Vector3<f64>) -> Self {
        let r_wc = pose.r_wc.to_rotation_matrix();
        let r_cw: Matrix3<f32> = r_wc.matrix().transpose().cast();
        Self {
            r_cw: std::array::from_fn(|row| std::array::from_fn(|k| r_cw[(row, k)])),
            centre: pose.to_camera(origin).cast().into(),
            focal: [camera.fx as f32, camera.fy as f32],
            principal: [camera.cx as f32, camera.cy as f32],
            lens: LensF32::new(camera),
            limit: [(camera.width - 1) as f32, (camera.height - 1) as f32],
        }
    }

    /// Coordinates of the last pixel centre along each axis; the first are 0.
    #[inline(always)]
    pub fn limit(&self) -> [f32; 2] {
        self.limit
    }

    /// Pixel of one of the points, within the picture or not.
    pub fn pixel(&self, points: &LocalPoints, at: usize) -> [f32; 2] {
        let (u, v, _) = self.project(self.lens, [points.x[at], points.y[at], points.z[at]]);
        [u, v]
    }

    /// Projects the points from index `start` on, as many as `u`, `v` and `shown` hold; `shown`: by
    /// the lens, within the picture or not.
    pub fn project_all(&self, points: &LocalPoints, start: usize, (u, v, shown): ProjectedPixels) {
        self.lens.run(ProjectionLoop {
            projection: self,
            points,
            start,
            pixels: (u, v, shown),
        });
    }

    fn project_through(
        &self,
        lens: impl ProjectF32,
        points: &LocalPoints,
        start: usize,
        u: &mut [f32],
        v: &mut [f32],
        shown: &mut [bool],
    ) {
        let count = u.len();
        let (x, y, z) = (
            &points.x[start..][..count],
            &points.y[start..][..count],
            &points.z[start..][..count],
        );
        let (v, shown) = (&mut v[..count], &mut shown[..count]);
        dispatch_simd(
            #[inline(always)]
            || {
                for k in 0..count {
                    (u[k], v[k], shown[k]) = self.project(lens, [x[k], y[k], z[k]]);
                }
            },
        );
    }

    /// Pixel coordinates of a point, and whether the lens shows it.
    #[inline(always)]
    fn project(&self, lens: impl ProjectF32, [x, y, z]: [f32; 3]) -> (f32, f32, bool) {
        let [a, b, c]: [f32; 3] = std::array::from_fn(|row| {
            let r = &self.r_cw[row];
            self.centre[row] + (r[0] * x + r[1] * y + r[2] * z)
        });
        let (p, q, shown) = lens.project_f32(a, b, c);
        let u = self.focal[0] * p + self.principal[0];
        let v = self.focal[1] * q + self.principal[1];
        (u, v, shown)
    }
}

/// The loop of [`LocalProjection::project_all`].
struct ProjectionLoop<'a> {
    projection: &'a LocalProjection,
    points: &'a LocalPoints,
    start: usize,
    pixels: ProjectedPixels<'a>,
}

impl LensLoop for ProjectionLoop<'_> {
    fn run(self, lens: impl ProjectF32) {
        let (u, v, shown) = self.pixels;
        let projection = self.projection;
        projection.project_through(lens, self.points, self.start, u, v, shown);
    }
}
