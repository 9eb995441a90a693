//! The interface of lens models in single precision.

/// Projection through a lens in single precision.
pub trait ProjectF32: Copy {
    /// Projects a point (camera coordinates) to the image plane at focal length 1; the flag is true
    /// if the point lies within the lens's limit. Beyond the limit the coordinates are finite but
    /// meaningless.
    fn project_f32(self, x: f32, y: f32, z: f32) -> (f32, f32, bool);
}

/// A loop over many points that is compiled for each lens model.
pub trait LensLoop {
    /// Runs the loop with this lens.
    fn run(self, lens: impl ProjectF32);
}
