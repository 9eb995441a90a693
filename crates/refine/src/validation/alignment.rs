//! The measured displacement of a pair of frames.

/// The displacement of two frames against each other.
#[derive(Clone, Copy, Debug)]
pub struct Alignment {
    /// The earlier frame.
    pub a: usize,
    /// The later one.
    pub b: usize,
    /// Number of samples that they share.
    pub samples: f64,
    /// Root mean square displacement e, pixels of full size.
    pub error_px: f64,
    /// Uncertainty σ of the displacement, pixels of full size; infinite where the texture is too
    /// faint.
    pub sigma_px: f64,
    /// Degrees of freedom of σ: patches of the overlap less unknowns.
    pub freedoms: f64,
    /// Correlation of their grey values at the present poses, without robust weights that could
    /// hide that the frames show different things: of all samples or of most, whichever is greater.
    pub correlation: f64,
}
