//! The result in words and a few figures.

use super::View;
use crate::report::Report;
use crate::report::quantity::{count, length_unit, maybe, short};
use maud::{Markup, html};

/// Title and verdict.
pub fn header(view: &View) -> Markup {
    let report = view.report;
    let (class, words) = headline(report);
    html! {
        header {
            p.kicker { "tunnelstitch report" }
            h1 { (report.survey.name) }
            p.(format!("verdict {class}")) { (words) }
        }
    }
}

fn headline(report: &Report) -> (&'static str, String) {
    let frames = count(report.frames.len());
    match (report.verdict.repaired, report.verdict.flagged) {
        (Some(0), _) => ("bad", format!("None of {frames} frames could be made sure")),
        (Some(_), Some(0)) => ("good", format!("All {frames} frames repaired")),
        (Some(repaired), Some(flagged)) => (
            "fair",
            format!(
                "{} of {frames} frames repaired, {} flagged",
                count(repaired),
                count(flagged)
            ),
        ),
        _ => ("plain", format!("Refined poses of {frames} frames")),
    }
}

/// Key figures and what must be known of them.
pub fn section(view: &View) -> Markup {
    let report = view.report;
    let (verdict, comparison) = (&report.verdict, &report.comparison);
    let [before, after] = [&comparison.baseline, &comparison.refined];
    let wall = before.wall.as_ref().zip(after.wall.as_ref());
    let seam = |scores: &crate::evaluate::Scores| scores.seam.map(|seam| seam.rms_grey);
    html! {
        section.summary aria-label="Summary" {
            dl.tiles {
                @if let Some(flagged) = verdict.flagged {
                    (tile("Frames repaired", &count(report.frames.len() - flagged), &format!("of {}", count(report.frames.len())),
                        &match flagged { 0 => "none flagged".to_owned(), n => format!("{} flagged", count(n)) }))
                }
                (tile("Typical correction", &format!("{}°", short(verdict.correction_rotation_deg)), "",
                    &format!("and {}; median of all frames", length(verdict.correction_translation_m))))
                @if let Some(sigma) = verdict.sigma_wall_mm {
                    (tile("Sure on the wall to", &length(1e-3 * sigma), "",
                        &format!("{} px; 1-σ, median of repaired frames", maybe(verdict.sigma_wall_px))))
                }
                @if let Some((before, after)) = wall {
                    @let (mm, px, of) = match (verdict.error_wall_mm, verdict.error_wall_px, verdict.flagged) {
                        (Some(mm), Some(px), Some(flagged)) if flagged > 0 =>
                            (mm, px, format!(" of the repaired frames; {} of all", length(1e-3 * after.mm.rms))),
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

/// A length in the unit that suits it.
fn length(metres: f64) -> String {
    let (unit, factor) = length_unit(metres.abs());
    format!("{} {unit}", short(factor * metres))
}

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
