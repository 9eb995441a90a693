//! Priors of the photometric calibration.

/// 1-σ of the shading's coefficients around what is known, for [`Priors`]: it keeps terms that the
/// overlaps do not determine near 0.
pub const SHADING_SIGMA: f64 = 0.5;

/// Standard deviations of the unknowns around 0 beforehand.
#[derive(Clone, Copy, Debug)]
pub struct Priors {
    /// Of α, the logarithm of a frame's gain.
    pub log_gain_sigma: f64,
    /// Of β, a frame's bias, grey levels.
    pub bias_sigma_grey: f64,
    /// Of the shading's coefficients `c_k`.
    pub shading_sigma: f64,
}
