//! Priors of the photometric calibration.

use tunnelstitch_core::frames::SHADING_TERMS;

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
    /// Of the lamp's position in units of its reach.
    pub lamp_sigma: f64,
}

impl Priors {
    /// Standard deviation of an unknown of the light: a coefficient of the shading, or one of the
    /// lamp's unknowns after these.
    pub fn light_sigma(&self, term: usize) -> f64 {
        if term < SHADING_TERMS {
            self.shading_sigma
        } else {
            self.lamp_sigma
        }
    }
}

impl Default for Priors {
    fn default() -> Self {
        Self {
            log_gain_sigma: 0.3,
            bias_sigma_grey: 1.0,
            shading_sigma: 0.5,
            lamp_sigma: 0.5,
        }
    }
}
