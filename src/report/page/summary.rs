//! Headline and key figures of the result.

use super::page_data::{PageData, data_uri};
use crate::evaluate::Scores;
use crate::report::model::{Report, ResultSummary};
use crate::report::quantity::{count, length_unit, maybe, short};
use crate::report::refined_files::OVERLAY_FILE;
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
    let summary = &report.summary;
    html! {
        section.summary aria-label="Summary" {
            dl.tiles {
                @if let Some(flagged) = summary.flagged {
                    (frames_tile(report.frames.len(), flagged))
                }
                (correction_tile(summary))
                @if let Some(sigma_mm) = summary.sigma_wall_mm {
                    (sigma_tile(sigma_mm, summary.sigma_wall_px))
                }
                @if let Some(tile) = error_tile(report) { (tile) }
                @if let Some(tile) = seam_tile(report) { (tile) }
            }
            @if let Some(refinement) = &report.refinement {
                @if let Some(verdict) = &refinement.verdict {
                    p.note { (sentence(&verdict.sentence)) }
                }
                @if let Some(scale) = &refinement.scale {
                    p.note { (sentence(&scale.sentence())) }
                }
                @if let Some(points) = &refinement.points {
                    p.note { (sentence(&points.sentence())) }
                }
                @if let Some(words) = refinement.overlay.as_ref().and_then(|o| o.sentence()) {
                    p.note { (sentence(&words)) }
                    @if let Some(bytes) = data.pictures.get(OVERLAY_FILE) {
                        img width="160" alt="Pixels that do not move with the wall, in black"
                            src=(data_uri("image/png", bytes));
                    }
                }
                @for finding in &refinement.prior_test.findings {
                    p.note { (sentence(finding)) }
                }
            }
            @for note in &report.notes {
                p.note { (note) }
            }
        }
    }
}

/// Words as a sentence: with a capital and a full stop.
fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    let first = letters.next().map(|first| first.to_uppercase().to_string());
    format!("{}{}.", first.unwrap_or_default(), letters.as_str())
}

fn frames_tile(frames: usize, flagged: usize) -> Markup {
    let more = match flagged {
        0 => "none flagged".to_owned(),
        n => format!("{} flagged", count(n)),
    };
    let of = format!("of {}", count(frames));
    tile("Frames refined", &count(frames - flagged), &of, &more)
}

fn correction_tile(summary: &ResultSummary) -> Markup {
    let rotation = format!("{}°", short(summary.correction_rotation_deg));
    let translation = length(summary.correction_translation_m);
    let more = format!("and {translation}; median of all frames");
    tile("Typical correction", &rotation, "", &more)
}

fn sigma_tile(sigma_mm: f64, sigma_px: Option<f64>) -> Markup {
    let more = format!("{} px; median of refined frames", maybe(sigma_px));
    tile("1-σ on the wall", &length(1e-3 * sigma_mm), "", &more)
}

/// Error of the refined poses on the wall; `None` without true poses.
fn error_tile(report: &Report) -> Option<Markup> {
    let (summary, comparison) = (&report.summary, &report.comparison);
    let before = comparison.baseline.wall.as_ref()?;
    let after = comparison.refined.wall.as_ref()?;
    let of_refined_frames = summary.error_wall_mm.zip(summary.error_wall_px);
    let (mm, px, of) = match (of_refined_frames, summary.flagged) {
        (Some((mm, px)), Some(flagged)) if flagged > 0 => {
            let all = length(1e-3 * after.mm.rms);
            (mm, px, format!(" of the refined frames; {all} of all"))
        }
        _ => (after.mm.rms, after.px.rms, String::new()),
    };
    let initial = length(1e-3 * before.mm.rms);
    let more = format!("{} px RMS{of}; initially {initial}", short(px));
    Some(tile("Error on the wall", &length(1e-3 * mm), "", &more))
}

/// Seam residual before and after; `None` if no two frames overlap.
fn seam_tile(report: &Report) -> Option<Markup> {
    let comparison = &report.comparison;
    let residual = |scores: &Scores| scores.seam.map(|seam| seam.rms_grey);
    let before = short(residual(&comparison.baseline)?);
    let after = short(residual(&comparison.refined)?);
    let more = match comparison.truth.as_ref().and_then(residual) {
        Some(truth) => format!("initially {before}; true poses {}", short(truth)),
        None => format!("initially {before}; difference of overlapping frames"),
    };
    Some(tile("Seam residual", &after, "grey", &more))
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
