//! groundtruth_shape.csv: the true deviation of a lining from its radius.

use crate::lining::lining::Lining;
use std::f64::consts::TAU;
use std::fmt::Write;

/// Cells around the section.
const COLUMNS: usize = 128;

/// Deviation δ at the middles of square cells, [`COLUMNS`] once around, that cover the wall from
/// chainage `h_m[0]` to `h_m[1]` (metres).
///
/// The columns are `s_m` (arc length `r θ`, from 0 to 2πr), `h_m` and `delta_m`, positive outwards,
/// as in shape.json. Steps of segments are included.
pub(crate) fn format_deviation(lining: &Lining, h_m: [f64; 2]) -> String {
    let cell_m = TAU * lining.radius_m / COLUMNS as f64;
    let [first, last] = h_m.map(|h_m| (h_m / cell_m).floor() as i64);
    let mut text = "s_m,h_m,delta_m\n".to_owned();
    for row in first..=last {
        let h_m = (row as f64 + 0.5) * cell_m;
        for column in 0..COLUMNS {
            let s_m = (column as f64 + 0.5) * cell_m;
            let delta_m = lining.deviation_m(s_m / lining.radius_m, h_m);
            // Writing to a String does not fail.
            let _ = writeln!(text, "{s_m:.6},{h_m:.6},{delta_m:.7}");
        }
    }
    text
}
