//! Deviation of the wall as a grid, for pages.

use super::deviation::DeviationMap;
use serde::{Deserialize, Serialize};
use tunnelstitch_geometry::numerics::parallel::ParallelMap;
use tunnelstitch_geometry::surface::WallPoint;

/// Cells of a map of the unrolled wall on a page: 180 around the section, and square unless the
/// tunnel is very long.
#[derive(Clone, Copy, Debug)]
pub struct PageCells {
    /// Number of cells along the axis.
    pub along: usize,
    /// Side of a cell, metres.
    pub side_m: f64,
}

impl PageCells {
    /// Number of cells around the section.
    pub const AROUND: usize = 180;
    /// Largest number of cells along the axis.
    const MAX_ALONG: usize = 2000;

    /// The cells of a wall between two chainages, metres.
    pub fn new([from_m, to_m]: [f64; 2], perimeter_m: f64) -> Self {
        let side_m = perimeter_m / Self::AROUND as f64;
        let along = ((to_m - from_m) / side_m).ceil() as usize;
        Self {
            along: along.clamp(1, Self::MAX_ALONG),
            side_m,
        }
    }
}

/// Deviation over the wall. Lists are row-major: a row for each cell along the axis, which begins
/// at θ = 0.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[non_exhaustive]
pub struct DeviationGrid {
    /// Number of cells around the section.
    pub around: usize,
    /// Number of cells along the axis.
    pub along: usize,
    /// Chainage of the first cell's beginning and of the last one's end, metres.
    pub chainage_m: [f64; 2],
    /// Deviation at the cells' centres, millimetres, positive outwards; null where it is not
    /// determined.
    pub deviation_mm: Vec<Option<f64>>,
    /// 1-σ of the deviation, millimetres; null where it is not known.
    pub sigma_mm: Vec<Option<f64>>,
}

impl DeviationGrid {
    /// The grid of a map; None if nothing is determined.
    pub fn new(map: &DeviationMap) -> Option<Self> {
        let [from_m, to_m] = map.chainage_m()?;
        let PageCells { along, side_m } = PageCells::new([from_m, to_m], map.perimeter_m());
        let rows = (0..along).par_map(|row| {
            let share = (row as f64 + 0.5) / along as f64;
            let h_m = from_m + share * (to_m - from_m);
            let at = |column: usize| {
                let s_m = (column as f64 + 0.5) * side_m;
                map.at_mm(WallPoint { s_m, h_m })
            };
            (0..PageCells::AROUND).map(at).collect::<Vec<[f32; 2]>>()
        });
        let part = |which: usize| {
            let rounded = |value: f32| {
                let known = value.is_finite();
                known.then(|| (1e3 * f64::from(value)).round() / 1e3)
            };
            let cells = rows.iter().flatten();
            cells.map(|cell| rounded(cell[which])).collect()
        };
        Some(Self {
            around: PageCells::AROUND,
            along,
            chainage_m: [from_m, to_m],
            deviation_mm: part(0),
            sigma_mm: part(1),
        })
    }

    /// Size of nearly all deviations, for a scale of colours: the 99.5th percentile of their
    /// absolute values, millimetres.
    pub fn size_mm(&self) -> f64 {
        percentile_of_sizes(&self.deviation_mm)
    }

    /// Size of nearly all 1-σ, for a scale of colours, millimetres.
    pub fn sigma_size_mm(&self) -> f64 {
        percentile_of_sizes(&self.sigma_mm)
    }
}

/// The 99.5th percentile of absolute values, at least a thousandth.
fn percentile_of_sizes(values: &[Option<f64>]) -> f64 {
    let mut sizes: Vec<f64> = values.iter().flatten().map(|value| value.abs()).collect();
    sizes.sort_unstable_by(f64::total_cmp);
    let last = sizes.len().saturating_sub(1) as f64;
    sizes
        .get((0.995 * last) as usize)
        .map_or(1e-3, |size| size.max(1e-3))
}
