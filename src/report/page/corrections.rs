//! What the refinement changed of each frame, and how sure it is of it.

use super::View;
use super::trajectory::{band_and_marks, is_sure};
use crate::report::FrameRow;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
use maud::{Markup, html};

/// The section.
pub fn section(view: &View) -> Markup {
    let frames = &view.report.frames;
    let sure = is_sure(view);
    let extras = band_and_marks(view);
    html! {
        p { "From the initial to the refined pose of each frame"
            @if sure { ", with its 1-σ relative to the first frame, from the covariance of all poses. Where the band is too \
                narrow to be seen, the charts below tell how narrow" } "." }
        (legend(&[("correction", Style::Refined)], &extras))
        div.charts {
            (corrected(view, "Rotation", "°", |f| f.correction_angle_deg, |f| f.sigma_rotation_deg.map(length)))
            (corrected(view, "Translation", "mm", |f| 1e3 * f.correction_distance_m,
                |f| f.sigma_translation_m.map(|sigma| 1e3 * length(sigma))))
            (step(view))
        }
        @if sure {
            h3 { "1-σ of the refined poses" }
            p { "Relative to the first frame. Lower is surer; the scale is logarithmic." }
            div.charts {
                (sigma(view, "1-σ of the rotation about an axis", "°", |k| frames.get(k)?.sigma_rotation_deg.map(mean)))
                (sigma(view, "1-σ of the translation along an axis", "mm",
                    |k| frames.get(k)?.sigma_translation_m.map(|s| 1e3 * mean(s))))
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

/// The size of the corrections with their 1-σ.
fn corrected(
    view: &View,
    title: &str,
    unit: &str,
    value: impl Fn(&FrameRow) -> f64,
    sigma: impl Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    let frames = &view.report.frames;
    let points = view.points(|k| frames.get(k).map(&value));
    let series = Series::new("correction", Style::Refined, points);
    Chart {
        title: title.to_owned(),
        unit: unit.to_owned(),
        along: view.axis(),
        vertical: Vertical::FromZero,
        series: vec![series.with_sigma(frames.iter().map(sigma))],
        marks: view.marks(),
    }
    .draw()
}

/// How much each frame's correction differs from that of the frame before: what a noise of steps
/// shows.
fn step(view: &View) -> Markup {
    let frames = &view.report.frames;
    let between = |k: usize| {
        let (before, here) = (frames.get(k.checked_sub(1)?)?, frames.get(k)?);
        let off = |frame: &FrameRow, axis: usize| frame.refined_m[axis] - frame.planned_m[axis];
        Some(1e3 * length([0, 1, 2].map(|axis| off(here, axis) - off(before, axis))))
    };
    Chart {
        title: "Translation, step from the frame before".to_owned(),
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
