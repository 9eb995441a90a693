//! How far integrated rotations may be off.

/// What makes integrated rotations err.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationNoise {
    /// White noise density N, rad/√s.
    pub density_rad_sqrt_s: f64,
    /// 1-σ of the bias that was taken off, about each axis, rad/s.
    pub bias_sigma_rad_s: f64,
    /// 1-σ of the sensor's scale, as a share.
    pub scale_sigma: f64,
}

impl RotationNoise {
    /// 1-σ about each axis of the rotation over `step_s` in which the camera turns by `turn_rad`:
    /// `σ² = N² Δt + (σ_b Δt)² + (σ_s φ)²`.
    ///
    /// Over a step from frame to frame it is the prior's. From step to step only the first part is
    /// independent: bias and scale err the same way all along.
    pub fn sigma_rad(&self, step_s: f64, turn_rad: f64) -> f64 {
        let white = self.density_rad_sqrt_s * step_s.sqrt();
        white
            .hypot(self.bias_sigma_rad_s * step_s)
            .hypot(self.scale_sigma * turn_rad)
    }
}
