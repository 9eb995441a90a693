//! Legend of charts.

use super::model::CurveStyle;
use maud::{Markup, html};

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
