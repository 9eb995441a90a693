//! Interface of a wall's texture.

/// Grey levels of the wall under even light.
pub(crate) trait WallTexture: Send + Sync {
    /// Fills one row of texels once around the section.
    ///
    /// Texel k is the mean over the square of side `texel_m` around
    /// `(s, h) = ((k + ½) texel_m, h_m)`, metres.
    fn fill_row(&self, h_m: f64, texel_m: f64, row: &mut [f32]);
}
