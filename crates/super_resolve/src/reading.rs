//! Reading of a pixel.

/// Reading of a pixel: grey level of the wall and its noise.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    /// Grey level of the wall, corrected for exposure and shading; 0 for an invalid pixel.
    pub value: f32,
    /// `1/σ` of its noise; 0 for an invalid pixel.
    pub inverse_sigma: f32,
}
