//! The panoramas, baseline and refined over each other, the true one below.

use super::View;
use crate::render::Layout;
use crate::report::quantity::short;
use crate::report::{Strip, ticks};
use maud::{Markup, html};

/// Least height of a panorama on the screen, CSS pixels; what is longer is scrolled.
const LEAST_HEIGHT: f64 = 260.0;
/// Distance of ticks along the wall, CSS pixels, about.
const APART: f64 = 130.0;

/// The section.
pub fn section(view: &View) -> Markup {
    let strips = &view.report.panoramas;
    let (way, how) = match strips.layout {
        Layout::ThetaRight => ("down", "Chainage runs down, the clock to the right."),
        Layout::ChainageRight => (
            "right",
            "Chainage runs to the right, where there is more to scroll to; the clock runs upwards.",
        ),
    };
    html! {
        p { "The unrolled wall, seen from inside, from the same frames with the initial and with the refined poses. " (how)
            " Twelve o'clock is the angle θ\u{a0}=\u{a0}0. Shown at " (short(strips.px_per_metre)) " pixels per metre." }
        figure.(format!("pano wipe {way}")) style=(aspect(&strips.refined)) {
            div.wiper {
                span aria-hidden="true" { "baseline" }
                input type="range" min="0" max="100" value="50" step="0.5" aria-label="Share of the picture that shows the baseline";
                span aria-hidden="true" { "refined" }
            }
            (picture(view, &[("Baseline", "before", &strips.baseline), ("Refined", "after", &strips.refined)]))
            figcaption { "Above the baseline, below the refined poses." }
        }
        @if let Some(truth) = &strips.truth {
            h3 { "With the true poses" }
            figure.(format!("pano {way}")) style=(aspect(truth)) {
                (picture(view, &[("True poses", "alone", truth)]))
                figcaption { "What could be reached: the same frames with the poses they were taken from." }
            }
        }
    }
}

fn aspect(strips: &[Strip]) -> String {
    let [width, height] = size(strips);
    format!("--aspect:{:.4}", width / height)
}

fn size(strips: &[Strip]) -> [f64; 2] {
    let width: u32 = strips.iter().map(|strip| strip.width).sum();
    let height = strips.first().map_or(1, |strip| strip.height);
    [f64::from(width.max(1)), f64::from(height.max(1))]
}

/// Layers of strips in one frame with its two axes.
fn picture(view: &View, layers: &[(&str, &str, &Vec<Strip>)]) -> Markup {
    let report = view.report;
    let layout = report.panoramas.layout;
    let [from_m, to_m] = report.panoramas.chainage_m;
    let [width, height] = layers.first().map_or([1.0; 2], |(.., strips)| size(strips));
    let shown = match layout {
        Layout::ThetaRight => LEAST_HEIGHT * 2.0,
        Layout::ChainageRight => (LEAST_HEIGHT * width / height).max(900.0),
    };
    let chainages: Vec<(f64, String)> = ticks::linear(from_m, to_m, (shown / APART) as usize)
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
                // Without scripts the layers lie one below the other, each beside its own.
                @for k in 0..layers.len() {
                    div.ruler.again[k > 0] {
                        @for (share, text) in &side { span style=(format!("top:{share:.2}%")) { (text) } }
                    }
                }
            }
            div.scroller tabindex="0" role="region" aria-label="Panorama, to be scrolled along" {
                div.sheet {
                    @for (name, class, strips) in layers {
                        div.(format!("layer {class}")) {
                            @for (k, strip) in strips.iter().enumerate() {
                                img src=(view.jpeg(&strip.file)) width=(strip.width) height=(strip.height)
                                    style=(format!("width:{:.4}%", 100.0 * f64::from(strip.width) / width))
                                    alt=(alt(name, k, strips.len(), [from_m, to_m]));
                            }
                            span.badge { (name) }
                        }
                    }
                    div.divider aria-hidden="true" {}
                }
                div.below aria-hidden="true" {
                    @for (share, text) in &below { span.(edge(*share)) style=(format!("left:{share:.2}%")) { (text) } }
                }
            }
        }
    }
}

/// Labels at the ends of an axis stay inside of it.
fn edge(share: f64) -> &'static str {
    match share {
        share if share < 2.0 => "start",
        share if share > 98.0 => "end",
        _ => "inside",
    }
}

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
