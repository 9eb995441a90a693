//! Section about the corrections of the poses and their uncertainty.

use super::page_data::PageData;
use super::trajectory::{band_and_marks, has_sigma};
use crate::report::chart::{Chart, CurveStyle, Series, Vertical, legend};
use crate::report::model::FrameRow;
use maud::{Markup, html};

/// Draws the section.
pub fn section(data: &PageData) -> Markup {
    let frames = &data.report.frames;
    let has_sigma = has_sigma(data);
    let elements = band_and_marks(data);
    html! {
        p {
            "Difference between the initial and the refined pose of each frame"
            @if has_sigma {
                ", with its 1-σ relative to the first frame from the covariance of all poses. The \
                 charts below show the 1-σ on a logarithmic scale"
            }
            "."
        }
        (legend(&[("correction", CurveStyle::Refined)], &elements))
        div.charts {
            (corrected(data, "Rotation", "°", |f| f.correction_angle_deg,
                |f| f.sigma_rotation_deg.map(norm)))
            (corrected(data, "Translation", "mm", |f| 1e3 * f.correction_distance_m,
                |f| f.sigma_translation_m.map(|sigma| 1e3 * norm(sigma))))
            (step(data))
        }
        @if has_sigma {
            h3 { "1-σ of the refined poses" }
            p { "Relative to the first frame." }
            div.charts {
                (sigma(data, "1-σ of the rotation about an axis", "°",
                    |k| frames.get(k)?.sigma_rotation_deg.map(rms)))
                (sigma(data, "1-σ of the translation along an axis", "mm",
                    |k| frames.get(k)?.sigma_translation_m.map(|s| 1e3 * rms(s))))
                @if let Some(refinement) = &data.report.refinement {
                    (sigma(data, "1-σ on the wall", "px",
                        |k| refinement.frames.get(k).map(|f| f.sigma.wall_px)))
                }
            }
        }
    }
}

/// Euclidean norm.
fn norm(of: [f64; 3]) -> f64 {
    of.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// Root mean square over the axes.
fn rms(of: [f64; 3]) -> f64 {
    norm(of) / 3f64.sqrt()
}

/// Chart of the magnitude of the corrections with their 1-σ.
fn corrected(
    data: &PageData,
    title: &str,
    unit: &str,
    value: impl Fn(&FrameRow) -> f64,
    sigma: impl Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    let frames = &data.report.frames;
    let points = data.points(|k| frames.get(k).map(&value));
    let series = Series::new("correction", CurveStyle::Refined, points);
    Chart {
        title: title.to_owned(),
        unit: unit.to_owned(),
        along: data.axis(),
        vertical: Vertical::FromZero,
        series: vec![series.with_sigma(frames.iter().map(sigma))],
        marks: data.marks(),
    }
    .draw()
}

/// Chart of the change of the translation's correction between consecutive frames, which shows
/// errors that accumulate.
fn step(data: &PageData) -> Markup {
    let frames = &data.report.frames;
    let between = |k: usize| {
        let (before, here) = (frames.get(k.checked_sub(1)?)?, frames.get(k)?);
        let correction =
            |frame: &FrameRow, axis: usize| frame.refined_m[axis] - frame.initial_m[axis];
        Some(1e3 * norm([0, 1, 2].map(|axis| correction(here, axis) - correction(before, axis))))
    };
    Chart {
        title: "Translation, change from the previous frame".to_owned(),
        unit: "mm".to_owned(),
        along: data.axis(),
        vertical: Vertical::FromZero,
        series: vec![Series::new(
            "change",
            CurveStyle::Refined,
            data.points(between),
        )],
        marks: data.marks(),
    }
    .draw()
}

/// Chart of a 1-σ.
fn sigma(data: &PageData, title: &str, unit: &str, value: impl Fn(usize) -> Option<f64>) -> Markup {
    Chart {
        title: title.to_owned(),
        unit: unit.to_owned(),
        along: data.axis(),
        vertical: Vertical::Logarithmic,
        series: vec![Series::new("1-σ", CurveStyle::Refined, data.points(value))],
        marks: data.marks(),
    }
    .draw()
}
