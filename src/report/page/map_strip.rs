//! A map of the unrolled wall with its axes, and the legend of its colours.

use super::page_data::data_uri;
use crate::report::error::ReportError;
use crate::report::heat_map::{self, ColourScale};
use crate::report::quantity::short;
use crate::report::ticks;
use maud::{Markup, html};

/// A map of the unrolled wall: chainage to the right, clock position upwards.
pub(super) struct MapStrip<'a> {
    /// Its title.
    pub(super) title: &'a str,
    /// Number of cells around the section and along the axis.
    pub(super) size: [usize; 2],
    /// Chainage of the first cell's beginning and of the last one's end, metres.
    pub(super) chainage_m: [f64; 2],
    /// A figure of the whole map.
    pub(super) reading: Option<String>,
}

impl MapStrip<'_> {
    /// Draws the values, row by row.
    ///
    /// # Errors
    /// [`ReportError::Encode`].
    pub(super) fn draw(
        &self,
        values: &[Option<f64>],
        scale: &ColourScale,
    ) -> Result<Markup, ReportError> {
        let Self {
            title,
            size: [around, along],
            chainage_m: [from_m, to_m],
            ref reading,
        } = *self;
        let png = heat_map::png(title, [around, along], values, scale)?;
        let words = match reading {
            Some(reading) => format!("{title}: {reading} over the wall"),
            None => format!("{title}: no values"),
        };
        Ok(html! {
            figure.strip {
                figcaption {
                    span { (title) }
                    @if let Some(reading) = reading { span.reading { (reading) } }
                }
                div.side aria-hidden="true" {
                    @for (top, text) in [(0, "12"), (25, "9"), (50, "6"), (75, "3"), (100, "12")] {
                        span style=(format!("top:{top}%")) { (text) }
                    }
                }
                img src=(data_uri("image/png", &png)) alt=(words) width=(along) height=(around);
                div.below aria-hidden="true" {
                    @for (h_m, text) in ticks::linear(from_m, to_m, 6) {
                        @let left = 100.0 * (h_m - from_m) / (to_m - from_m);
                        span style=(format!("left:{left:.2}%")) { (text) " m" }
                    }
                }
            }
        })
    }
}

/// Legend of a colour scale.
pub(super) fn scale_legend(words: &str, scale: &ColourScale) -> Markup {
    let [low, high] = scale.range;
    html! {
        p.scale {
            span { (short(low)) }
            span.bar style=(format!("background:{}", scale.palette.gradient())) {}
            span { (short(high)) }
            span.words { (words) }
        }
    }
}
