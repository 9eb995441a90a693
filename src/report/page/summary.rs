//! Headline and key figures of the result.

use super::page_data::PageData;
use crate::report::model::Report;
use crate::report::quantity::{count, length_unit, maybe, short};
use maud::{Markup, html};

/// Draws title and headline.
pub fn header(data: &PageData) -> Markup {
    let report = data.report;
    let (class, words) = headline(report);
    html! {
        header {
            p.kicker { "tunnelstitch report" }
            h1 { (report.survey.name) }
            p.(format!("headline {class}")) { (words) }
        }
    }
}

/// Class in the style sheet and text of the headline.
fn headline(report: &Report) -> (&'static str, String) {
    let frames = count(report.frames.len());
    match (report.summary.photometric, report.summary.flagged) {
        (Some(0), _) => (
            "bad",
            format!("None of {frames} frames refined: all are flagged"),
        ),
        (Some(_), Some(0)) => ("good", format!("All {frames} frames refined")),
        (Some(photometric), Some(flagged)) => (
            "fair",
            format!(
                "{} of {frames} frames refined, {} flagged",
                count(photometric),
                count(flagged)
            ),
        ),
        _ => ("plain", format!("Refined poses of {frames} frames")),
    }
}

/// Draws the key figures and the notes.
pub fn section(data: &PageData) -> Markup {
    let report = data.report;
    let (summary, comparison) = (&report.summary, &report.comparison);
    let [before, after] = [&comparison.baseline, &comparison.refined];
    let wall = before.wall.as_ref().zip(after.wall.as_ref());
    let seam = |scores: &crate::evaluate::Scores| scores.seam.map(|seam| seam.rms_grey);
    html! {
        section.summary aria-label="Summary" {
            dl.tiles {
                @if let Some(flagged) = summary.flagged {
                    (tile("Frames refined", &count(report.frames.len() - flagged), &format!("of {}", count(report.frames.len())),
                        &match flagged { 0 => "none flagged".to_owned(), n => format!("{} flagged", count(n)) }))
                }
                (tile("Typical correction", &format!("{}°", short(summary.correction_rotation_deg)), "",
                    &format!("and {}; median of all frames", length(summary.correction_translation_m))))
                @if let Some(sigma) = summary.sigma_wall_mm {
                    (tile("1-σ on the wall", &length(1e-3 * sigma), "",
                        &format!("{} px; median of refined frames", maybe(summary.sigma_wall_px))))
                }
                @if let Some((before, after)) = wall {
                    @let (mm, px, of) = match (summary.error_wall_mm, summary.error_wall_px, summary.flagged) {
                        (Some(mm), Some(px), Some(flagged)) if flagged > 0 =>
                            (mm, px, format!(" of the refined frames; {} of all", length(1e-3 * after.mm.rms))),
                        _ => (after.mm.rms, after.px.rms, String::new()),
                    };
                    (tile("Error on the wall", &length(1e-3 * mm), "",
                        &format!("{} px RMS{of}; was {}", short(px), length(1e-3 * before.mm.rms))))
                }
                @if let (Some(from), Some(to)) = (seam(before), seam(after)) {
                    (tile("Seam residual", &short(to), "grey",
                        &match comparison.truth.as_ref().and_then(seam) {
                            Some(best) => format!("was {}; true poses {}", short(from), short(best)),
                            None => format!("was {}; difference of overlapping frames", short(from)),
                        }))
                }
            }
            @for note in &report.notes {
                p.note { (note) }
            }
        }
    }
}

/// A length with a suitable unit.
fn length(metres: f64) -> String {
    let (unit, factor) = length_unit(metres.abs());
    format!("{} {unit}", short(factor * metres))
}

/// A key figure: name, value with unit, explanation.
fn tile(name: &str, value: &str, unit: &str, more: &str) -> Markup {
    html! {
        div {
            dt { (name) }
            dd {
                span.value { (value) @if !unit.is_empty() { " " span.unit { (unit) } } }
                span.more { (more) }
            }
        }
    }
}
