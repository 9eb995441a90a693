//! Section about the wall where frames show something else, so that they were left out.

use super::map_strip::{MapStrip, scale_legend};
use super::page_data::PageData;
use crate::refine::MaskedReport;
use crate::report::error::ReportError;
use crate::report::heat_map::ColourScale;
use crate::report::masked_wall::MaskedMap;
use crate::report::quantity::{fixed, short};
use maud::{Markup, html};
use tunnelstitch_core::colour_map::Palette;

/// Draws the section; None if it is not known what was left out.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn section(data: &PageData) -> Result<Option<Markup>, ReportError> {
    let report = data.report;
    let refinement = report.refinement.as_ref();
    let Some(masked) = refinement.and_then(|refinement| refinement.masked.as_ref()) else {
        return Ok(None);
    };
    let bands = refinement.map_or(&[][..], |refinement| &refinement.hidden_bands);
    let map = match &report.masked {
        Some(map) => draw(map)?,
        None => Markup::default(),
    };
    Ok(Some(html! {
        p {
            "Where frames show something else than the wall (cables, brackets, lamps, water), they \
             are left out, place by place. Half of the frames or more were left out on "
            (short(masked.area_m2)) " m², " (short(100.0 * masked.share)) " % of the "
            (short(masked.seen_m2)) " m² that two frames or more see. No deformation is stated \
             there."
        }
        @for band in bands {
            p { "Left out as a whole: " (band.sentence()) "." }
        }
        (map)
        @if !masked.places.is_empty() { (places(masked)) }
    }))
}

fn draw(map: &MaskedMap) -> Result<Markup, ReportError> {
    let scale = ColourScale {
        palette: Palette::Cividis,
        range: [0.0, 100.0],
        logarithmic: false,
    };
    let percent: Vec<Option<f64>> = (map.share.iter())
        .map(|share| share.map(|share| 100.0 * share))
        .collect();
    let strip = MapStrip {
        title: "Frames left out",
        size: [map.around, map.along],
        chainage_m: map.chainage_m,
        reading: None,
    };
    Ok(html! {
        (strip.draw(&percent, &scale)?)
        (scale_legend("% of the frames left out; blank: no two frames see the wall", &scale))
    })
}

/// Table of the largest places.
fn places(masked: &MaskedReport) -> Markup {
    html! {
        div.wide {
            table {
                caption { "The largest places" }
                thead { tr {
                    th.number scope="col" { "Chainage (m)" }
                    th.number scope="col" { "θ (°)" }
                    th.number scope="col" { "Area (m²)" }
                    th.number scope="col" { "Frames left out (%)" }
                } }
                tbody {
                    @for place in &masked.places {
                        tr {
                            td.number {
                                (fixed(place.chainage_from_m, 2)) " – "
                                (fixed(place.chainage_to_m, 2))
                            }
                            td.number {
                                (fixed(place.angle_from_deg, 1)) " – "
                                (fixed(place.angle_to_deg, 1))
                            }
                            td.number { (fixed(place.area_m2, 4)) }
                            td.number { (fixed(100.0 * place.left_out_share, 0)) }
                        }
                    }
                }
            }
        }
    }
}
