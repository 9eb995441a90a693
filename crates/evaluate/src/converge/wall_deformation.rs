//! Deformation of the walls of a sweep.

use serde::{Deserialize, Serialize};
use std::fmt;
use tunnelstitch_refine::WallPrior;
use tunnelstitch_simulate::AsBuilt;

/// Random deformation of a wall, which the survey does not know.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct WallDeformation {
    /// Amplitude of the ovality, millimetres.
    pub ovality_mm: f64,
    /// Undulation, root mean square, millimetres.
    pub undulation_mm: f64,
    /// Length ℓ of the undulation's correlation `exp(−x²/2ℓ²)`, metres.
    pub undulation_length_m: f64,
}

impl Default for WallDeformation {
    /// None.
    fn default() -> Self {
        let AsBuilt {
            ovality_mm,
            undulation_mm,
            undulation_length_m,
            ..
        } = AsBuilt::default();
        Self {
            ovality_mm,
            undulation_mm,
            undulation_length_m,
        }
    }
}

impl WallDeformation {
    /// The lining to be simulated.
    pub fn as_built(&self) -> AsBuilt {
        AsBuilt {
            ovality_mm: self.ovality_mm,
            undulation_mm: self.undulation_mm,
            undulation_length_m: self.undulation_length_m,
            ..AsBuilt::default()
        }
    }

    /// True if walls are deformed.
    pub(super) fn is_any(&self) -> bool {
        self.ovality_mm > 0.0 || self.undulation_mm > 0.0
    }

    /// Prior knowledge of such a wall, before any frame is seen.
    pub(super) fn prior(&self) -> WallPrior {
        WallPrior {
            ovality_m: 1e-3 * self.ovality_mm,
            undulation_m: 1e-3 * self.undulation_mm,
            undulation_length_m: self.undulation_length_m,
        }
    }
}

impl fmt::Display for WallDeformation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "ovality {} mm, undulation {} mm over {} m",
            self.ovality_mm, self.undulation_mm, self.undulation_length_m
        )
    }
}
