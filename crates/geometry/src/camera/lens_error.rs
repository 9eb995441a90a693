//! Parameters that no lens can have.

/// A parameter of a lens outside its range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{name} is {value}; it must {rule}")]
pub struct LensParameterError {
    /// Name of the parameter.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its range, as "be positive".
    pub rule: &'static str,
}

impl LensParameterError {
    /// Returns the error unless the parameter `is_valid`.
    pub(super) fn unless(
        is_valid: bool,
        name: &'static str,
        value: f64,
        rule: &'static str,
    ) -> Result<(), Self> {
        if is_valid {
            Ok(())
        } else {
            Err(Self { name, value, rule })
        }
    }

    /// Returns the error of the first parameter that is not a finite number.
    pub(super) fn unless_finite(
        parameters: impl IntoIterator<Item = (&'static str, f64)>,
    ) -> Result<(), Self> {
        parameters
            .into_iter()
            .try_for_each(|(name, value)| Self::unless(value.is_finite(), name, value, FINITE))
    }
}

const FINITE: &str = "be a number";
