//! Section about the panoramas: initial and refined poses over each other, true poses below.

use super::page_data::PageData;
use crate::render::Layout;
use crate::report::model::Strip;
use crate::report::quantity::short;
use crate::report::ticks;
use maud::{Markup, html};

/// Smallest height of a panorama on the screen, CSS pixels; longer panoramas scroll.
const MIN_HEIGHT_PX: f64 = 260.0;
/// Approximate distance of ticks along the wall, CSS pixels.
const TICK_SPACING_PX: f64 = 130.0;

/// Draws the section.
pub fn section(data: &PageData) -> Markup {
    let strips = &data.report.panoramas;
    let (direction, orientation) = match strips.layout {
        Layout::ThetaRight => (
            "down",
            "Chainage runs down, the clock position to the right.",
        ),
        Layout::ChainageRight => (
            "right",
            "Chainage runs to the right (scroll for more), the clock position upwards.",
        ),
    };
    html! {
        p {
            "The unrolled wall, seen from inside, drawn from the same frames with the initial \
             (baseline) and the refined poses. "
            (orientation)
            " Twelve o'clock is at θ\u{a0}=\u{a0}0. Resolution: " (short(strips.px_per_metre))
            " pixels per metre."
        }
        figure.(format!("pano wipe {direction}")) style=(aspect(&strips.refined)) {
            div.wiper {
                span aria-hidden="true" { "baseline" }
                input type="range" min="0" max="100" value="50" step="0.5"
                    aria-label="Share of the picture that shows the baseline";
                span aria-hidden="true" { "refined" }
            }
            (picture(data, &[
                ("Baseline", "before", &strips.baseline),
                ("Refined", "after", &strips.refined),
            ]))
            figcaption { "Baseline above, refined poses below." }
        }
        @if let Some(truth) = &strips.truth {
            h3 { "With the true poses" }
            figure.(format!("pano {direction}")) style=(aspect(truth)) {
                (picture(data, &[("True poses", "alone", truth)]))
                figcaption { "The best possible result: the same frames with their true poses." }
            }
        }
    }
}

/// Aspect ratio for the style sheet.
fn aspect(strips: &[Strip]) -> String {
    let [width, height] = size(strips);
    format!("--aspect:{:.4}", width / height)
}

/// Width and height of strips side by side, pixels.
fn size(strips: &[Strip]) -> [f64; 2] {
    let width: u32 = strips.iter().map(|strip| strip.width).sum();
    let height = strips.first().map_or(1, |strip| strip.height);
    [f64::from(width.max(1)), f64::from(height.max(1))]
}

/// Layers of strips with their two axes.
fn picture(data: &PageData, layers: &[(&str, &str, &Vec<Strip>)]) -> Markup {
    let report = data.report;
    let layout = report.panoramas.layout;
    let [from_m, to_m] = report.panoramas.chainage_m;
    let [width, height] = layers.first().map_or([1.0; 2], |(.., strips)| size(strips));
    let shown = match layout {
        Layout::ThetaRight => MIN_HEIGHT_PX * 2.0,
        Layout::ChainageRight => (MIN_HEIGHT_PX * width / height).max(900.0),
    };
    let chainages: Vec<(f64, String)> =
        ticks::linear(from_m, to_m, (shown / TICK_SPACING_PX) as usize)
            .into_iter()
            .map(|(h_m, text)| {
                (
                    100.0 * (h_m - from_m) / (to_m - from_m),
                    format!("{text} m"),
                )
            })
            .collect();
    let hours: Vec<(f64, String)> = [12, 3, 6, 9, 12]
        .iter()
        .enumerate()
        .map(|(quarter, hour)| {
            let share = 25.0 * quarter as f64;
            let share = match layout {
                Layout::ThetaRight => share,
                Layout::ChainageRight => 100.0 - share,
            };
            (share, format!("{hour}:00"))
        })
        .collect();
    let (side, below) = match layout {
        Layout::ThetaRight => (chainages, hours),
        Layout::ChainageRight => (hours, chainages),
    };
    html! {
        div.frame {
            div.side aria-hidden="true" {
                // Without scripts the layers lie below each other, each with its own ruler.
                @for k in 0..layers.len() {
                    div.ruler.again[k > 0] {
                        @for (share, text) in &side {
                            span style=(format!("top:{share:.2}%")) { (text) }
                        }
                    }
                }
            }
            div.scroller tabindex="0" role="region" aria-label="Panorama, to be scrolled along" {
                div.sheet {
                    @for (name, class, strips) in layers {
                        div.(format!("layer {class}")) {
                            @for (k, strip) in strips.iter().enumerate() {
                                @let percent = 100.0 * f64::from(strip.width) / width;
                                img src=(data.jpeg(&strip.file))
                                    width=(strip.width) height=(strip.height)
                                    style=(format!("width:{percent:.4}%"))
                                    alt=(alt(name, k, strips.len(), [from_m, to_m]));
                            }
                            span.badge { (name) }
                        }
                    }
                    div.divider aria-hidden="true" {}
                }
                div.below aria-hidden="true" {
                    @for (share, text) in &below {
                        span.(edge(*share)) style=(format!("left:{share:.2}%")) { (text) }
                    }
                }
            }
        }
    }
}

/// Class that keeps labels at the ends of an axis inside of it.
fn edge(share: f64) -> &'static str {
    match share {
        share if share < 2.0 => "start",
        share if share > 98.0 => "end",
        _ => "inside",
    }
}

/// Text alternative of a strip.
fn alt(name: &str, piece: usize, pieces: usize, [from_m, to_m]: [f64; 2]) -> String {
    let edge = |k: usize| from_m + (to_m - from_m) * k as f64 / pieces as f64;
    match pieces {
        1 => format!("{name}: unrolled wall, chainage {from_m:.1} to {to_m:.1} m"),
        _ => format!(
            "{name}: unrolled wall, chainage {:.1} to {:.1} m, piece {} of {pieces}",
            edge(piece),
            edge(piece + 1),
            piece + 1
        ),
    }
}
