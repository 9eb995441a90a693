//! Frames whose pixels could not make them sure, with the reason.

use super::View;
use crate::refine::{FrameFlag, FrameReport};
use crate::report::quantity::{count, fixed, short};
use maud::{Markup, html};

/// Frames without a picture that are listed one by one; the rest is counted.
const MOST_LISTED: usize = 200;

/// The section; `None` without refine's report.
pub fn section(view: &View) -> Option<Markup> {
    let refinement = view.report.refinement.as_ref()?;
    let flagged = view.flagged();
    let frame = |k: &usize| refinement.frames.get(*k);
    let shown = &view.report.thumbnails;
    let is_shown = |k: &usize| shown.iter().any(|thumbnail| thumbnail.frame == *k);
    let others: Vec<usize> = flagged.iter().copied().filter(|k| !is_shown(k)).collect();
    Some(html! {
        @if flagged.is_empty() {
            p { "None: the pixels of every frame made its pose sure." }
        } @else {
            p { "Do not rely on these " (count(flagged.len())) " poses without their prior."
                @if !others.is_empty() { " The first " (shown.len()) " are shown with their pictures." } }
            ol.frames {
                @for thumbnail in shown {
                    @if let Some(frame) = frame(&thumbnail.frame) {
                        li {
                            img src=(view.jpeg(&thumbnail.file)) width=(thumbnail.width) height=(thumbnail.height)
                                alt=(format!("Frame {}", thumbnail.frame));
                            div {
                                h3 { "Frame " (frame.index) " " (badge(frame.flag)) }
                                p.file { (frame.file) }
                                p { (capitalised(frame)) }
                                p.facts { (facts(view, frame)) }
                            }
                        }
                    }
                }
            }
            @if !others.is_empty() {
                div.wide {
                    table {
                        caption { "Flagged frames without a picture" }
                        thead { tr { th.number scope="col" { "Frame" } th scope="col" { "File" } th scope="col" { "Rests on" } th scope="col" { "Reason" } } }
                        tbody {
                            @for frame in others.iter().take(MOST_LISTED).filter_map(frame) {
                                tr { td.number { (frame.index) } td { (frame.file) } td { (badge(frame.flag)) }
                                    td { (frame.reason.as_deref().unwrap_or("–")) } }
                            }
                        }
                    }
                }
                @if others.len() > MOST_LISTED {
                    p { "And " (count(others.len() - MOST_LISTED)) " more, all of them in " code { "report.json" } "." }
                }
            }
        }
    })
}

fn badge(flag: FrameFlag) -> Markup {
    let (class, name) = match flag {
        FrameFlag::Photometric => ("good", "photometric"),
        FrameFlag::Prior => ("fair", "prior"),
        FrameFlag::Ambiguous => ("bad", "ambiguous"),
    };
    html! { span.(format!("flag {class}")) { (name) } }
}

/// The reason as a sentence.
fn capitalised(frame: &FrameReport) -> String {
    let reason = frame.reason.as_deref().unwrap_or("no reason is given");
    let mut letters = reason.chars();
    letters.next().map_or_else(String::new, |first| {
        format!("{}{}.", first.to_uppercase(), letters.as_str())
    })
}

fn facts(view: &View, frame: &FrameReport) -> String {
    let mut facts = Vec::new();
    if let Some(row) = view.report.frames.get(frame.index) {
        facts.push(format!("chainage {} m", fixed(row.refined_m[1], 2)));
    }
    if frame.points > 0 {
        facts.push(format!("residual {} grey", short(frame.residual)));
        facts.push(format!(
            "{} % of its pixels fit",
            short(100.0 * frame.inlier_share)
        ));
    }
    if frame.sigma.wall_px.is_finite() {
        facts.push(format!("1-σ on the wall {} px", short(frame.sigma.wall_px)));
    }
    facts.join(" · ")
}
