//! Values that a layer of the page shows under the pointer, and the scale of its colours.

use crate::evaluate::deformation::DeviationGrid;
use serde::Serialize;
use tunnelstitch_core::colour_map::Palette;

/// Name of the file with the values.
pub(super) const VALUES: &str = "deformation.json";

/// Values that a layer shows, in `tunnel.json`.
#[derive(Clone, Debug, Serialize)]
pub struct LayerValues {
    /// The file of the values, a [`DeviationGrid`].
    file: &'static str,
    /// Values of the first and the last colour, millimetres.
    range_mm: [f64; 2],
    /// The colours, as a CSS gradient.
    gradient: String,
}

impl LayerValues {
    /// The values of a grid.
    pub(super) fn new(grid: &DeviationGrid) -> Self {
        let size_mm = grid.size_mm();
        Self {
            file: VALUES,
            range_mm: [-size_mm, size_mm],
            gradient: Palette::BlueRed.gradient(),
        }
    }
}
