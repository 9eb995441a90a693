//! Failures of the factorisation.

/// Failures of the factorisation of the normal matrix.
#[derive(Clone, Debug, thiserror::Error)]
pub enum FactorError {
    /// The matrix is not positive definite: neither pixels nor prior constrain some parameter.
    #[error("the normal matrix is not positive definite")]
    NotPositiveDefinite,
    /// The symbolic analysis failed (the matrix is too large for memory).
    #[error("the normal matrix could not be analysed: {0}")]
    Structure(String),
}
