//! Lens models with a rolling shutter, in single precision.

use super::project::ProjectF32;
use crate::camera::projection::Camera;
use crate::camera::sweep::MAX_SHARE;

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
    pub(super) lens: L,
    omega: [f32; 3],
    nu: [f32; 3],
    /// `τ = slope q + offset` of a point that appears at q.
    slope: f32,
    offset: f32,
}

impl<L> RollingShutter<L> {
    pub(super) fn new(lens: L, camera: &Camera) -> Self {
        let height = f64::from(camera.height);
        Self {
            lens,
            omega: camera.sweep.omega_rad.cast().into(),
            nu: camera.sweep.nu_m.cast().into(),
            slope: (camera.fy / height) as f32,
            offset: ((camera.cy - 0.5 * (height - 1.0)) / height) as f32,
        }
    }

    /// Replaces the lens.
    #[inline(always)]
    pub(super) fn with_lens<M>(&self, lens: M) -> RollingShutter<M> {
        RollingShutter {
            lens,
            omega: self.omega,
            nu: self.nu,
            slope: self.slope,
            offset: self.offset,
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
