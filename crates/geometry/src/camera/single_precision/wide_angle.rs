//! The lens models besides Brown–Conrady and Kannala–Brandt, in single precision.

use super::angle::{FovF32, ThinPrismFisheyeF32};
use super::polynomial::OcamF32;
use super::project::{LensLoop, ProjectF32};
use super::rolling_shutter::RollingShutter;
use super::sphere::{DoubleSphereF32, EucmF32, MeiF32};

/// One of the models of wide-angle lenses.
#[derive(Clone, Copy, Debug)]
pub enum WideAngleF32 {
    /// [`crate::camera::Mei`].
    Mei(MeiF32),
    /// [`crate::camera::DoubleSphere`].
    DoubleSphere(DoubleSphereF32),
    /// [`crate::camera::Eucm`].
    Eucm(EucmF32),
    /// [`crate::camera::Fov`].
    Fov(FovF32),
    /// [`crate::camera::ThinPrismFisheye`].
    ThinPrismFisheye(ThinPrismFisheyeF32),
    /// [`crate::camera::Ocam`].
    Ocam(OcamF32),
}

impl WideAngleF32 {
    /// Runs a loop with the lens model.
    #[inline(always)]
    pub fn run(self, work: impl LensLoop) {
        match self {
            Self::Mei(lens) => work.run(lens),
            Self::DoubleSphere(lens) => work.run(lens),
            Self::Eucm(lens) => work.run(lens),
            Self::Fov(lens) => work.run(lens),
            Self::ThinPrismFisheye(lens) => work.run(lens),
            Self::Ocam(lens) => work.run(lens),
        }
    }
}

impl ProjectF32 for WideAngleF32 {
    #[inline(always)]
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool) {
        match self {
            Self::Mei(lens) => lens.project_f32(x, y, z),
            Self::DoubleSphere(lens) => lens.project_f32(x, y, z),
            Self::Eucm(lens) => lens.project_f32(x, y, z),
            Self::Fov(lens) => lens.project_f32(x, y, z),
            Self::ThinPrismFisheye(lens) => lens.project_f32(x, y, z),
            Self::Ocam(lens) => lens.project_f32(x, y, z),
        }
    }
}

impl RollingShutter<WideAngleF32> {
    /// Runs a loop with the lens model and its rolling shutter.
    #[inline(always)]
    pub fn run(self, work: impl LensLoop) {
        match self.lens {
            WideAngleF32::Mei(lens) => work.run(self.with_lens(lens)),
            WideAngleF32::DoubleSphere(lens) => work.run(self.with_lens(lens)),
            WideAngleF32::Eucm(lens) => work.run(self.with_lens(lens)),
            WideAngleF32::Fov(lens) => work.run(self.with_lens(lens)),
            WideAngleF32::ThinPrismFisheye(lens) => work.run(self.with_lens(lens)),
            WideAngleF32::Ocam(lens) => work.run(self.with_lens(lens)),
        }
    }
}
