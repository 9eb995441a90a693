//! What the refinement changed of each frame, and how sure it is of it.

use super::View;
use super::trajectory::marks_key;
use crate::report::FrameRow;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
use maud::{Markup, html};

const AXES: [&str; 3] = ["x", "y", "z"];

/// The section.
pub fn section(view: &View) -> Markup {
    let frames = &view.report.frames;
    let sure = frames.iter().any(|frame| frame.sigma_rotation_deg.is_some());
    let mut keys = marks_key(view);
    if sure {
        keys.insert(0, ("±1-σ", "band refined"));
    }
    html! {
        p { "From the initial to the refined pose of each frame"
            @if sure { ", with its 1-σ relative to the first frame, from the covariance of all poses. Where the band is too \
                narrow to be seen, the charts of the 1-σ below tell how narrow" } "." }
        (legend(&[("correction", Style::Refined)], &keys))
        div.charts {
            (corrected(view, "Rotation corrected", "°", |f| f.correction_angle_deg, |f| f.sigma_rotation_deg.map(length)))
            (corrected(view, "Translation corrected", "mm", |f| 1e3 * f.correction_distance_m,
                |f| f.sigma_translation_m.map(|sigma| 1e3 * length(sigma))))
            (step(view))
            @for (k, name) in AXES.into_iter().enumerate() {
                (component(view, format!("Rotation about {name}"), "°", |f| f.correction_rotation_deg[k],
                    |f| f.sigma_rotation_deg.map(|sigma| sigma[k])))
            }
            @for (k, name) in AXES.into_iter().enumerate() {
                (component(view, format!("Translation along {name}"), "mm", |f| 1e3 * (f.refined_m[k] - f.planned_m[k]),
                    |f| f.sigma_translation_m.map(|sigma| 1e3 * sigma[k])))
            }
        }
        @if sure {
            h3 { "1-σ" }
            p { "How far off each refined pose may be, relative to the first frame. Lower is surer; the scale is logarithmic." }
            div.charts {
                (sigma(view, "1-σ of the rotation", "°", |k| frames.get(k)?.sigma_rotation_deg.map(mean)))
                (sigma(view, "1-σ of the translation", "mm", |k| frames.get(k)?.sigma_translation_m.map(|s| 1e3 * mean(s))))
                @if let Some(refinement) = &view.report.refinement {
                    (sigma(view, "1-σ on the wall", "px", |k| refinement.frames.get(k).map(|f| f.sigma.wall_px)))
                }
            }
        }
    }
}

/// Length of a vector.
fn length(of: [f64; 3]) -> f64 {
    of.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Root mean square over the axes.
fn mean(of: [f64; 3]) -> f64 {
    length(of) / 3f64.sqrt()
}

fn corrected(
    view: &View,
    title: &str,
    unit: &str,
    value: impl Fn(&FrameRow) -> f64,
    sigma: impl Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    banded(view, title.to_owned(), unit, Vertical::FromZero, value, sigma)
}

fn component(
    view: &View,
    title: String,
    unit: &str,
    value: impl Fn(&FrameRow) -> f64,
    sigma: impl Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    banded(view, title, unit, Vertical::Linear, value, sigma)
}

fn banded(
    view: &View,
    title: String,
    unit: &str,
    vertical: Vertical,
    value: impl Fn(&FrameRow) -> f64,
    sigma: impl Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    let frames = &view.report.frames;
    // Where there is no 1-σ there is no band.
    let sigmas = frames.iter().map(|frame| sigma(frame).unwrap_or(f64::NAN));
    let sigmas: Vec<f64> = sigmas.collect();
    Chart {
        title,
        unit: unit.to_owned(),
        along: view.axis(),
        vertical,
        series: vec![Series {
            sigma: match sigmas.iter().any(|s| s.is_finite()) {
                true => sigmas,
                false => Vec::new(),
            },
            ..Series::new(
                "correction",
                Style::Refined,
                view.points(|k| frames.get(k).map(&value)),
            )
        }],
        marks: view.marks(),
    }
    .draw()
}

/// How much each frame's correction differs from that of the frame before: what a noise of steps shows.
fn step(view: &View) -> Markup {
    let frames = &view.report.frames;
    let between = |k: usize| {
        let (before, here) = (frames.get(k.checked_sub(1)?)?, frames.get(k)?);
        let off = |frame: &FrameRow, axis: usize| frame.refined_m[axis] - frame.planned_m[axis];
        Some(1e3 * length([0, 1, 2].map(|axis| off(here, axis) - off(before, axis))))
    };
    Chart {
        title: "Translation corrected, step from frame to frame".to_owned(),
        unit: "mm".to_owned(),
        along: view.axis(),
        vertical: Vertical::FromZero,
        series: vec![Series::new("step", Style::Refined, view.points(between))],
        marks: view.marks(),
    }
    .draw()
}

fn sigma(view: &View, title: &str, unit: &str, value: impl Fn(usize) -> Option<f64>) -> Markup {
    Chart {
        title: title.to_owned(),
        unit: unit.to_owned(),
        along: view.axis(),
        vertical: Vertical::Logarithmic,
        series: vec![Series::new("1-σ", Style::Refined, view.points(value))],
        marks: view.marks(),
    }
    .draw()
}
