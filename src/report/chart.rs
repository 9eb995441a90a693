//! Line charts as inline SVG, coloured by the style sheet of the page.

use super::decimate::decimate;
use super::quantity::{fixed, significant};
use super::ticks;
use maud::{Markup, html};

/// Width and height of the drawing in its own units, about CSS pixels on a phone.
const SIZE: [f64; 2] = [380.0, 214.0];
/// Left, right, upper and lower edge of the plot in the drawing.
const PLOT: [f64; 4] = [48.0, 372.0, 8.0, 172.0];
/// Margin above and below the values, share of their range.
const MARGIN: f64 = 0.07;
/// Largest number of flagged frames whose marks are as high as the plot; more have short marks,
/// which hide nothing.
const MAX_TALL_MARKS: usize = 24;
/// Height of a short mark, units of the drawing.
const SHORT_MARK: f64 = 7.0;
/// Largest number of points that a curve shows as dots.
const MAX_DOTS: usize = 30;

/// Meaning of a curve, which decides its appearance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CurveStyle {
    /// Initial poses.
    Initial,
    /// Refined poses.
    Refined,
    /// True poses.
    Truth,
    /// The n-th curve of an ordered set, as pyramid levels.
    Ordered(usize),
}

impl CurveStyle {
    /// Class in the style sheet.
    pub fn class(self) -> String {
        match self {
            Self::Initial => "initial".to_owned(),
            Self::Refined => "refined".to_owned(),
            Self::Truth => "truth".to_owned(),
            Self::Ordered(k) => format!("ordered-{}", k % 6),
        }
    }
}

/// A curve of a chart.
#[derive(Clone, Debug)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Its appearance.
    pub style: CurveStyle,
    /// Its points, along the curve.
    pub points: Vec<[f64; 2]>,
    /// 1-σ of each point; empty if there is none.
    pub sigma: Vec<f64>,
}

impl Series {
    /// A curve without uncertainty.
    pub fn new(name: &str, style: CurveStyle, points: Vec<[f64; 2]>) -> Self {
        Self {
            name: name.to_owned(),
            style,
            points,
            sigma: Vec::new(),
        }
    }

    /// Adds the 1-σ of the points that have one.
    pub fn with_sigma(mut self, sigma: impl Iterator<Item = Option<f64>>) -> Self {
        let sigma: Vec<f64> = sigma.map(|sigma| sigma.unwrap_or(f64::NAN)).collect();
        if sigma.iter().any(|sigma| sigma.is_finite()) {
            self.sigma = sigma;
        }
        self
    }

    /// Upper and lower edge of the band of ±1-σ.
    fn band_edges(&self) -> [Vec<[f64; 2]>; 2] {
        let edge = |sign: f64| {
            let points = self.points.iter().zip(&self.sigma);
            points.map(|([x, y], s)| [*x, y + sign * s]).collect()
        };
        [edge(1.0), edge(-1.0)]
    }
}

/// Horizontal axis of a chart.
#[derive(Clone, Debug)]
pub struct Axis {
    /// Its name with the unit.
    pub name: String,
    /// Its range.
    pub range: [f64; 2],
    /// True if all values are integers.
    pub whole: bool,
}

/// Scale of a chart's vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Vertical {
    /// Linear over the values.
    Linear,
    /// Linear from zero to the highest value.
    FromZero,
    /// Logarithmic over the values, which are positive.
    Logarithmic,
}

/// A line chart.
#[derive(Clone, Debug)]
pub struct Chart {
    /// Title.
    pub title: String,
    /// Unit of the values; empty for pure numbers.
    pub unit: String,
    /// The horizontal axis.
    pub along: Axis,
    /// The vertical axis.
    pub vertical: Vertical,
    /// The curves.
    pub series: Vec<Series>,
    /// Abscissae of flagged frames.
    pub marks: Vec<f64>,
}

/// Mapping from values to the drawing.
struct PlotScale {
    x: [f64; 2],
    y: [f64; 2],
    logarithmic: bool,
}

impl PlotScale {
    fn x(&self, value: f64) -> f64 {
        let [left, right, ..] = PLOT;
        left + (value - self.x[0]) / (self.x[1] - self.x[0]) * (right - left)
    }

    fn y(&self, value: f64) -> f64 {
        let [_, _, top, bottom] = PLOT;
        let axis = |v: f64| if self.logarithmic { v.ln() } else { v };
        let share = (axis(value) - axis(self.y[0])) / (axis(self.y[1]) - axis(self.y[0]));
        bottom - share * (bottom - top)
    }

    /// Points of an SVG polyline, clamped far outside of the plot.
    fn polyline(&self, points: &[[f64; 2]]) -> String {
        let pair = |[x, y]: &[f64; 2]| {
            let y = self.y(*y).clamp(-1e4, 1e4);
            format!("{:.1},{:.1}", self.x(*x), y)
        };
        points.iter().map(pair).collect::<Vec<_>>().join(" ")
    }
}

impl Chart {
    /// Scale that shows all values and the part of the bands near them.
    fn scale(&self) -> PlotScale {
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

    /// Description for screen readers.
    fn description(&self) -> String {
        let curves: Vec<String> = self
            .series
            .iter()
            .filter_map(|series| {
                let values = series.points.iter().map(|p| p[1]).filter(|v| v.is_finite());
                let low = values.clone().reduce(f64::min)?;
                let high = values.reduce(f64::max)?;
                Some(format!(
                    "{} from {} to {} {}",
                    series.name,
                    significant(low, 3),
                    significant(high, 3),
                    self.unit
                ))
            })
            .collect();
        format!(
            "{} along {}: {}.",
            self.title,
            self.along.name,
            curves.join("; ")
        )
    }

    /// Draws the chart with its title.
    pub fn draw(&self) -> Markup {
        let scale = self.scale();
        let [left, right, top, bottom] = PLOT;
        let (width, height) = (right - left, bottom - top);
        html! {
            figure.chart {
                (self.caption())
                svg role="img" aria-label=(self.description())
                    viewBox=(format!("0 0 {} {}", SIZE[0], SIZE[1]))
                    data-plot=(format!("{left} {right} {top} {bottom}"))
                    data-x=(format!("{} {}", scale.x[0], scale.x[1]))
                    data-y=(format!("{} {}", scale.y[0], scale.y[1]))
                    data-log=[scale.logarithmic.then_some("1")]
                {
                    (vertical_axis(&scale))
                    (self.horizontal_axis(&scale))
                    svg x=(left) y=(top) width=(width) height=(height)
                        viewBox=(format!("{left} {top} {width} {height}"))
                    {
                        (self.marks(&scale))
                        @for series in &self.series {
                            @if !series.sigma.is_empty() { (band(series, &scale)) }
                        }
                        @for series in &self.series { (curve(series, &scale)) }
                    }
                    line.base x1=(left) x2=(right) y1=(bottom) y2=(bottom) {}
                }
            }
        }
    }

    /// Title, unit, and the place of the values at the pointer.
    fn caption(&self) -> Markup {
        html! {
            figcaption {
                span {
                    (self.title)
                    @if !self.unit.is_empty() { " " span.unit { "(" (self.unit) ")" } }
                }
                output.reading aria-hidden="true" {}
            }
        }
    }

    fn horizontal_axis(&self, scale: &PlotScale) -> Markup {
        let [left, right, _, bottom] = PLOT;
        let (from, to) = (scale.x[0].min(scale.x[1]), scale.x[0].max(scale.x[1]));
        let mut ticks = ticks::linear(from, to, 6);
        if self.along.whole {
            ticks.retain(|(value, _)| value.fract() == 0.0);
            for (value, text) in &mut ticks {
                *text = fixed(*value, 0);
            }
        }
        let (middle, foot) = (0.5 * (left + right), SIZE[1] - 6.0);
        html! {
            @for (value, text) in &ticks {
                @let x = format!("{:.1}", scale.x(*value));
                line.stub x1=(x) x2=(x) y1=(bottom) y2=(bottom + 4.0) {}
                text.tick x=(x) y=(bottom + 16.0) text-anchor="middle" { (text) }
            }
            text.axis x=(middle) y=(foot) text-anchor="middle" { (self.along.name) }
        }
    }

    /// Marks of flagged frames.
    fn marks(&self, scale: &PlotScale) -> Markup {
        let [_, _, top, bottom] = PLOT;
        let rounded = |x: &f64| scale.x(*x).round() as i64;
        let mut marks: Vec<i64> = self.marks.iter().map(rounded).collect();
        marks.sort_unstable();
        marks.dedup();
        let foot = if marks.len() > MAX_TALL_MARKS {
            top + SHORT_MARK
        } else {
            bottom
        };
        html! {
            @for x in &marks {
                line.mark x1=(x) x2=(x) y1=(top) y2=(foot) {}
            }
        }
    }
}

fn vertical_axis(scale: &PlotScale) -> Markup {
    let [left, right, ..] = PLOT;
    let ticks = if scale.logarithmic {
        ticks::logarithmic(scale.y[0], scale.y[1], 6)
    } else {
        ticks::linear(scale.y[0], scale.y[1], 5)
    };
    html! {
        @for (value, text) in &ticks {
            @let y = format!("{:.1}", scale.y(*value));
            line.grid x1=(left) x2=(right) y1=(y) y2=(y) {}
            text.tick x=(left - 6.0) y=(y) dy="0.32em" text-anchor="end" { (text) }
        }
    }
}

/// Width of the plot, pixel columns.
fn plot_columns() -> usize {
    let [left, right, ..] = PLOT;
    (right - left) as usize
}

/// Band of ±1-σ of a curve.
fn band(series: &Series, scale: &PlotScale) -> Markup {
    let edges = series.band_edges();
    let [upper, lower] = edges.map(|edge| decimate(&edge, scale.x, plot_columns()));
    let outline: Vec<[f64; 2]> = upper.into_iter().chain(lower.into_iter().rev()).collect();
    let points = scale.polyline(&outline);
    html! {
        polygon.(format!("band {}", series.style.class())) points=(points) {}
    }
}

/// A curve, with dots if it has few points.
fn curve(series: &Series, scale: &PlotScale) -> Markup {
    let is_shown = |point: &[f64; 2]| !scale.logarithmic || point[1] > 0.0;
    let points = series.points.iter().copied();
    let points: Vec<[f64; 2]> = points.filter(is_shown).collect();
    let points = decimate(&points, scale.x, plot_columns());
    let is_reference = matches!(series.style, CurveStyle::Initial | CurveStyle::Truth);
    let class = series.style.class();
    html! {
        polyline.(format!("curve {class}"))
            data-name=(series.name) points=(scale.polyline(&points)) {}
        @if points.len() <= MAX_DOTS && !is_reference {
            @for [x, y] in &points {
                circle.(format!("dot {class}")) r="2.2"
                    cx=(format!("{:.1}", scale.x(*x)))
                    cy=(format!("{:.1}", scale.y(*y))) {}
            }
        }
    }
}

/// Element of a chart besides its curves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChartElement {
    /// The band of ±1-σ.
    Band,
    /// Mark of a flagged frame.
    Mark,
}

/// Legend of curves and other elements, for several charts.
pub fn legend(entries: &[(&str, CurveStyle)], elements: &[ChartElement]) -> Markup {
    html! {
        p.legend {
            @for (name, style) in entries {
                span.key {
                    svg viewBox="0 0 28 10" aria-hidden="true" {
                        line.(format!("curve {}", style.class())) x1="1" x2="27" y1="5" y2="5" {}
                    }
                    (name)
                }
            }
            @for element in elements {
                span.key {
                    svg viewBox="0 0 28 10" aria-hidden="true" {
                        @match element {
                            ChartElement::Band => {
                                rect.band.refined x="1" y="0" width="26" height="10" {}
                            }
                            ChartElement::Mark => { line.mark x1="14" x2="14" y1="-1" y2="11" {} }
                        }
                    }
                    @match element {
                        ChartElement::Band => { "±1-σ" }
                        ChartElement::Mark => { "flagged frame" }
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<[f64; 2]>, vertical: Vertical) -> Chart {
        Chart {
            title: "Error <x>".to_owned(),
            unit: "mm".to_owned(),
            along: Axis {
                name: "chainage (m)".to_owned(),
                range: [0.0, 10.0],
                whole: false,
            },
            vertical,
            series: vec![Series::new("refined & more", CurveStyle::Refined, points)],
            marks: vec![5.0],
        }
    }

    #[test]
    fn values_lie_where_the_axes_say_and_text_is_escaped() {
        let chart = chart(vec![[0.0, 0.0], [10.0, 100.0]], Vertical::FromZero);
        let text = chart.draw().into_string();
        // From the lower left corner to the right edge, 7 % below the top.
        assert!(text.contains("points=\"48.0,172.0 372.0,18.7\""), "{text}");
        assert!(text.contains("Error &lt;x&gt;") && text.contains("refined &amp; more"));
        assert!(!text.contains("<x>"));
        assert!(text.contains("x1=\"210\" x2=\"210\""), "{text}");
    }

    #[test]
    fn nothing_to_show_and_nothing_positive_are_drawn_without_numbers_that_are_none() {
        for vertical in [Vertical::Linear, Vertical::FromZero, Vertical::Logarithmic] {
            for points in [
                vec![],
                vec![[3.0, f64::NAN]],
                vec![[3.0, 0.0], [4.0, 0.0]],
                vec![[3.0, -2.0]],
            ] {
                let text = chart(points, vertical).draw().into_string();
                assert!(!text.contains("NaN") && !text.contains("inf"), "{text}");
            }
        }
    }

    #[test]
    fn a_long_curve_is_short_in_the_page() {
        let points = (0..100_000).map(|k| [f64::from(k) * 1e-4, f64::from(k % 97)]);
        let text = chart(points.collect(), Vertical::Linear)
            .draw()
            .into_string();
        assert!(text.len() < 30_000, "{}", text.len());
    }
}
