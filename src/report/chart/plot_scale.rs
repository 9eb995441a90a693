//! Mapping from the values of a chart to its drawing.

use super::model::{Chart, Vertical};

/// Width and height of the drawing in its own units, about CSS pixels on a phone.
pub(super) const SIZE: [f64; 2] = [380.0, 214.0];
/// Left, right, upper and lower edge of the plot in the drawing.
pub(super) const PLOT: [f64; 4] = [48.0, 372.0, 8.0, 172.0];
/// Margin above and below the values, share of their range.
const MARGIN: f64 = 0.07;

/// Mapping from values to the drawing.
pub(super) struct PlotScale {
    /// Range of the horizontal axis.
    pub(super) x: [f64; 2],
    /// Range of the vertical axis.
    pub(super) y: [f64; 2],
    /// True for a logarithmic vertical axis.
    pub(super) logarithmic: bool,
}

impl PlotScale {
    /// Horizontal coordinate of a value.
    pub(super) fn x(&self, value: f64) -> f64 {
        let [left, right, ..] = PLOT;
        left + (value - self.x[0]) / (self.x[1] - self.x[0]) * (right - left)
    }

    /// Vertical coordinate of a value.
    pub(super) fn y(&self, value: f64) -> f64 {
        let [_, _, top, bottom] = PLOT;
        let axis = |v: f64| if self.logarithmic { v.ln() } else { v };
        let share = (axis(value) - axis(self.y[0])) / (axis(self.y[1]) - axis(self.y[0]));
        bottom - share * (bottom - top)
    }

    /// Points of an SVG polyline, clamped far outside of the plot.
    pub(super) fn polyline(&self, points: &[[f64; 2]]) -> String {
        let pair = |[x, y]: &[f64; 2]| {
            let y = self.y(*y).clamp(-1e4, 1e4);
            format!("{:.1},{:.1}", self.x(*x), y)
        };
        points.iter().map(pair).collect::<Vec<_>>().join(" ")
    }
}

impl Chart {
    /// Scale that shows all values and the part of the bands near them.
    pub(super) fn scale(&self) -> PlotScale {
        let logarithmic = self.vertical == Vertical::Logarithmic;
        let shown = |v: &f64| v.is_finite() && (!logarithmic || *v > 0.0);
        let values: Vec<f64> = self
            .series
            .iter()
            .flat_map(|series| series.points.iter().map(|point| point[1]))
            .filter(shown)
            .collect();
        let low = values.iter().copied().fold(f64::INFINITY, f64::min);
        let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // A band extends the range only as long as the curve keeps its visible height.
        let edges = self
            .series
            .iter()
            .flat_map(|series| series.band_edges().concat());
        let near = |v: &f64| *v > low - (high - low) && *v < high + (high - low);
        let edges: Vec<f64> = edges.map(|p| p[1]).filter(shown).filter(near).collect();
        let low = edges.iter().copied().fold(low, f64::min);
        let high = edges.iter().copied().fold(high, f64::max);
        let y = match self.vertical {
            Vertical::Logarithmic if values.is_empty() => [0.1, 10.0],
            _ if values.is_empty() => [0.0, 1.0],
            Vertical::Logarithmic => {
                let margin = (high / low).powf(MARGIN).max(1.2);
                [low / margin, high * margin]
            }
            Vertical::FromZero if high > 0.0 => [0.0, high * (1.0 + MARGIN)],
            _ if high > low => [low - MARGIN * (high - low), high + MARGIN * (high - low)],
            _ => [
                low - 0.5 * low.abs().max(1e-3),
                high + 0.5 * high.abs().max(1e-3),
            ],
        };
        let x = match self.along.range {
            [from, to] if to != from => [from, to],
            [from, _] => [from - 0.5, from + 0.5],
        };
        PlotScale { x, y, logarithmic }
    }
}
