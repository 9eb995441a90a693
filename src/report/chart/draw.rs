//! Draws a chart.

use super::model::{Chart, CurveStyle, Series};
use super::plot_scale::{PLOT, PlotScale, SIZE};
use crate::report::decimate::decimate;
use crate::report::quantity::{fixed, significant};
use crate::report::ticks;
use maud::{Markup, html};

/// Largest number of flagged frames whose marks are as high as the plot; more have short marks,
/// which hide nothing.
const MAX_TALL_MARKS: usize = 24;
/// Height of a short mark, units of the drawing.
const SHORT_MARK: f64 = 7.0;
/// Largest number of points that a curve shows as dots.
const MAX_DOTS: usize = 30;

impl Chart {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::chart::model::{Axis, Vertical};

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
