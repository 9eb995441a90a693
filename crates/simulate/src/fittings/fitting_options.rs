//! Options of cables and lamps.

use crate::error::{SimulateError, check_option};
use serde::Serialize;

/// Cables and lamps before the wall of a straight tunnel.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Fittings {
    /// Number of cables along the tunnel.
    pub cables: u32,
    /// Number of rows of lamps along the tunnel.
    pub lamps: u32,
    /// Distance between the lamps of a row, metres.
    pub lamp_spacing_m: f64,
}

impl Default for Fittings {
    fn default() -> Self {
        Self {
            cables: 0,
            lamps: 0,
            lamp_spacing_m: 3.0,
        }
    }
}

impl Fittings {
    /// True without cables and lamps.
    pub fn is_empty(&self) -> bool {
        self.cables == 0 && self.lamps == 0
    }

    /// Validates every value.
    ///
    /// # Errors
    /// [`SimulateError::Option`] with the name of the first impossible option.
    pub(crate) fn validate(&self) -> Result<(), SimulateError> {
        check_option(self.cables <= 100, "there may be 0 to 100 cables")?;
        check_option(self.lamps <= 20, "there may be 0 to 20 rows of lamps")?;
        check_option(
            (1.0..=1000.0).contains(&self.lamp_spacing_m),
            "the spacing of the lamps must lie between 1 and 1000 metres",
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn impossible_fittings_are_refused() {
        let none = Fittings::default();
        none.validate().unwrap();
        let wrong = [
            Fittings {
                cables: 101,
                ..none
            },
            Fittings { lamps: 21, ..none },
            Fittings {
                lamp_spacing_m: 0.5,
                ..none
            },
            Fittings {
                lamp_spacing_m: f64::NAN,
                ..none
            },
        ];
        for fittings in wrong {
            assert!(fittings.validate().is_err(), "{fittings:?}");
        }
    }
}
