//! Uncertainty of integrated rotations.

/// The noise model of integrated rotations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationNoise {
    /// White noise density N, rad/√s.
    pub density_rad_sqrt_s: f64,
    /// 1-σ of the subtracted bias, about each axis, rad/s.
    pub bias_sigma_rad_s: f64,
    /// 1-σ of the sensor's scale factor, relative.
    pub scale_sigma: f64,
}

impl RotationNoise {
    /// 1-σ about each axis of a rotation by `turn_rad` during `step_s`:
    /// `σ² = N² Δt + (σ_b Δt)² + (σ_s φ)²`.
    ///
    /// This is the prior's σ over a step from frame to frame. Only the first term is independent
    /// from step to step; the errors of bias and scale persist.
    pub fn sigma_rad(&self, step_s: f64, turn_rad: f64) -> f64 {
        let white = self.density_rad_sqrt_s * step_s.sqrt();
        white
            .hypot(self.bias_sigma_rad_s * step_s)
            .hypot(self.scale_sigma * turn_rad)
    }
}
