//! Section about rejected frames, with the rejection reason.

use super::page_data::PageData;
use crate::files::printed;
use crate::refine::{FrameFlag, FrameReport};
use crate::report::quantity::{count, fixed, short};
use maud::{Markup, html};
use std::path::Path;

/// Largest number of frames without a picture that are listed.
const MAX_LISTED_FRAMES: usize = 200;

/// Draws the section; `None` without refine's report.
pub fn section(data: &PageData) -> Option<Markup> {
    let refinement = data.report.refinement.as_ref()?;
    let flagged = data.flagged();
    let frame = |k: &usize| refinement.frames.get(*k);
    let shown = &data.report.thumbnails;
    let is_shown = |k: &usize| shown.iter().any(|thumbnail| thumbnail.frame == *k);
    let others: Vec<usize> = flagged.iter().copied().filter(|k| !is_shown(k)).collect();
    Some(html! {
        @if flagged.is_empty() {
            p { "None: all frames are photometric, so their poses rest on their pixels." }
        } @else {
            p {
                "The poses of these " (count(flagged.len()))
                " frames rest on the prior."
                @if !others.is_empty() {
                    " The first " (shown.len()) " are shown with their pictures."
                }
            }
            ol.frames {
                @for thumbnail in shown {
                    @if let Some(frame) = frame(&thumbnail.frame) {
                        li {
                            img src=(data.jpeg(&thumbnail.file))
                                width=(thumbnail.width) height=(thumbnail.height)
                                alt=(format!("Frame {}", thumbnail.frame));
                            div {
                                h3 { "Frame " (frame.index) " " (badge(frame.flag)) }
                                p.file { (file_name(frame)) }
                                p { (reason_sentence(frame)) }
                                p.facts { (facts(data, frame)) }
                            }
                        }
                    }
                }
            }
            @if !others.is_empty() {
                div.wide {
                    table {
                        caption { "Flagged frames without a picture" }
                        thead { tr {
                            th.number scope="col" { "Frame" }
                            th scope="col" { "File" }
                            th scope="col" { "Flag" }
                            th scope="col" { "Rejection reason" }
                        } }
                        tbody {
                            @for frame in others.iter().take(MAX_LISTED_FRAMES).filter_map(frame) {
                                tr {
                                    td.number { (frame.index) }
                                    td { (file_name(frame)) }
                                    td { (badge(frame.flag)) }
                                    td { (frame.reason.as_deref().unwrap_or("–")) }
                                }
                            }
                        }
                    }
                }
                @if others.len() > MAX_LISTED_FRAMES {
                    p {
                        "And " (count(others.len() - MAX_LISTED_FRAMES)) " more, all of them in "
                        code { "report.json" } "."
                    }
                }
            }
        }
    })
}

/// The file of a frame, without control characters.
fn file_name(frame: &FrameReport) -> String {
    printed(Path::new(&frame.file)).to_string()
}

/// The flag of a frame.
fn badge(flag: FrameFlag) -> Markup {
    let (class, name) = match flag {
        FrameFlag::Photometric => ("good", "photometric"),
        FrameFlag::Prior => ("fair", "prior"),
        FrameFlag::Ambiguous => ("bad", "ambiguous"),
        FrameFlag::Uncertain => ("fair", "uncertain"),
    };
    html! { span.(format!("flag {class}")) { (name) } }
}

/// The rejection reason as a sentence.
fn reason_sentence(frame: &FrameReport) -> String {
    let reason = frame.reason.as_deref().unwrap_or("no reason is given");
    let mut letters = reason.chars();
    letters.next().map_or_else(String::new, |first| {
        format!("{}{}.", first.to_uppercase(), letters.as_str())
    })
}

/// Position, residual, inliers and uncertainty of a frame.
fn facts(data: &PageData, frame: &FrameReport) -> String {
    let mut facts = Vec::new();
    if let Some(row) = data.report.frames.get(frame.index) {
        facts.push(format!("chainage {} m", fixed(row.refined_m[1], 2)));
    }
    if frame.points > 0 {
        facts.push(format!("residual {} grey", short(frame.residual)));
        facts.push(format!("{} % inliers", short(100.0 * frame.inlier_share)));
    }
    if frame.sigma.wall_px.is_finite() {
        facts.push(format!("1-σ on the wall {} px", short(frame.sigma.wall_px)));
    }
    facts.join(" · ")
}
