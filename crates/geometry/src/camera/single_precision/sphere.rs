//! Lens models that project through spheres or an ellipsoid, in single precision.

use super::perspective::BrownConradyF32;
use super::project::ProjectF32;
use crate::camera::double_sphere::DoubleSphere;
use crate::camera::eucm::Eucm;
use crate::camera::mei::Mei;

/// Smallest denominator per distance of the point; it is smaller outside the field of view alone.
const MIN_DENOMINATOR: f32 = 1e-6;

/// Unified projection with distortion ([`Mei`]).
#[derive(Clone, Copy, Debug)]
pub struct MeiF32 {
    xi: f32,
    distortion: BrownConradyF32,
    min_cos: f32,
}

impl MeiF32 {
    pub(super) fn new(lens: &Mei) -> Self {
        Self {
            xi: lens.xi() as f32,
            distortion: BrownConradyF32::new(lens.distortion()),
            min_cos: lens.field_of_view().limit_rad().cos() as f32,
        }
    }
}

impl ProjectF32 for MeiF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let distance = (x * x + y * y + z * z).sqrt();
        let inverse = 1.0 / (z + self.xi * distance).max(MIN_DENOMINATOR * distance);
        let (x, y, shown) = self.distortion.distort(x * inverse, y * inverse);
        (x, y, shown & (z > self.min_cos * distance))
    }
}

/// Double sphere projection ([`DoubleSphere`]).
#[derive(Clone, Copy, Debug)]
pub struct DoubleSphereF32 {
    xi: f32,
    alpha: f32,
    min_cos: f32,
}

impl DoubleSphereF32 {
    pub(super) fn new(lens: &DoubleSphere) -> Self {
        let [xi, alpha] = lens.parameters();
        Self {
            xi: xi as f32,
            alpha: alpha as f32,
            min_cos: lens.field_of_view().limit_rad().cos() as f32,
        }
    }
}

impl ProjectF32 for DoubleSphereF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let square = x * x + y * y;
        let d1 = (square + z * z).sqrt();
        let k = self.xi * d1 + z;
        let d2 = (square + k * k).sqrt();
        let denominator = self.alpha * d2 + (1.0 - self.alpha) * k;
        let inverse = 1.0 / denominator.max(MIN_DENOMINATOR * d1);
        (x * inverse, y * inverse, z > self.min_cos * d1)
    }
}

/// Enhanced unified projection ([`Eucm`]).
#[derive(Clone, Copy, Debug)]
pub struct EucmF32 {
    alpha: f32,
    beta: f32,
    min_cos: f32,
}

impl EucmF32 {
    pub(super) fn new(lens: &Eucm) -> Self {
        let [alpha, beta] = lens.parameters();
        Self {
            alpha: alpha as f32,
            beta: beta as f32,
            min_cos: lens.field_of_view().limit_rad().cos() as f32,
        }
    }
}

impl ProjectF32 for EucmF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        let (square, depth) = (x * x + y * y, z * z);
        let distance = (square + depth).sqrt();
        let d = (self.beta * square + depth).sqrt();
        let denominator = self.alpha * d + (1.0 - self.alpha) * z;
        let inverse = 1.0 / denominator.max(MIN_DENOMINATOR * distance);
        (x * inverse, y * inverse, z > self.min_cos * distance)
    }
}
