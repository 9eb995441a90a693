//! Priors of the photometric calibration.

/// Standard deviations of the unknowns around 0 beforehand. The defaults suit refining and
/// stitching alike.
#[derive(Clone, Copy, Debug)]
pub struct Priors {
    /// Of α, the logarithm of a frame's gain; 0.3 is a third more or less light.
    pub log_gain_sigma: f64,
    /// Of β, a frame's bias, grey levels. On a wall of low contrast bias and gain are hardly told
    /// apart; a wide prior leaves that to noise.
    pub bias_sigma_grey: f64,
    /// Of the coefficients `c_k` of the whole shading: keeps terms that the overlaps do not
    /// determine near 0.
    pub shading_sigma: f64,
}

impl Default for Priors {
    fn default() -> Self {
        Self {
            log_gain_sigma: 0.3,
            bias_sigma_grey: 1.0,
            shading_sigma: 0.5,
        }
    }
}
