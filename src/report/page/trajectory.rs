//! Section about the trajectory: initial, refined and true poses.

use super::page_data::PageData;
use crate::report::chart::{Chart, ChartElement, CurveStyle, Series, Vertical, legend};
use crate::report::model::FrameRow;
use crate::report::quantity::length_unit;
use maud::{Markup, html};

/// Draws the section.
pub fn section(data: &PageData) -> Markup {
    let known = data.report.survey.truth;
    let mut entries = vec![
        ("initial", CurveStyle::Initial),
        ("refined", CurveStyle::Refined),
    ];
    if known {
        entries.push(("true", CurveStyle::Truth));
    }
    let elements = band_and_marks(data);
    html! {
        p {
            "Positions of the camera in the world frame: y is the tunnel's axis (the chainage), x \
             and z are perpendicular to it. For y and for the rotations about the camera's axes (x \
             right, y down, z forward) the chart shows the difference from the initial poses."
            @if known {
                " The true poses are aligned with the refined ones by the gauge of the tunnel: a \
                 rotation about the axis and a shift along it, which the frames cannot determine."
            }
        }
        (legend(&entries, &elements))
        div.charts {
            (position(data, "Position x", 0, |_| 0.0))
            (position(data, "Position y, minus initial", 1, |f| f.initial_m[1]))
            (position(data, "Position z", 2, |_| 0.0))
            @for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                (rotation(data, format!("Rotation about {name}, minus initial"), axis))
            }
        }
    }
}

/// True if the 1-σ of the poses are known.
pub fn has_sigma(data: &PageData) -> bool {
    let frames = &data.report.frames;
    frames
        .iter()
        .any(|frame| frame.sigma_rotation_deg.is_some())
}

/// Legend entries of the bands of 1-σ and of the marks, if there are any.
pub fn band_and_marks(data: &PageData) -> Vec<ChartElement> {
    let band = has_sigma(data).then_some(ChartElement::Band);
    band.into_iter().chain(mark_entry(data)).collect()
}

/// Legend entry of the marks, if there are any.
pub fn mark_entry(data: &PageData) -> Vec<ChartElement> {
    if data.marks().is_empty() {
        Vec::new()
    } else {
        vec![ChartElement::Mark]
    }
}

/// A position of a frame, if it is known, metres.
type PositionOf<'p> = &'p dyn Fn(&FrameRow) -> Option<[f64; 3]>;

/// Chart of the rotations about one axis of the camera, minus the initial ones.
fn rotation(data: &PageData, title: String, axis: usize) -> Markup {
    let frames = &data.report.frames;
    let refined = |k: usize| Some(frames.get(k)?.correction_rotation_deg[axis]);
    let truth = |k: usize| Some(frames.get(k)?.true_rotation_deg?[axis]);
    let curves = [
        Some(data.points(|_| Some(0.0))),
        Some(data.points(refined)),
        data.report.survey.truth.then(|| data.points(truth)),
    ];
    let sigma = |f: &FrameRow| f.sigma_rotation_deg.map(|sigma| sigma[axis]);
    chart(data, title, "°", 1.0, curves, &sigma)
}

/// Chart of the positions along one axis, minus `offset_m`.
fn position(data: &PageData, title: &str, axis: usize, offset_m: fn(&FrameRow) -> f64) -> Markup {
    let frames = &data.report.frames;
    let picks: [PositionOf; 3] = [&|f| Some(f.initial_m), &|f| Some(f.refined_m), &|f| {
        f.true_m
    }];
    let curves = picks.map(|pick| {
        data.points(|k| {
            let frame = frames.get(k)?;
            Some(pick(frame)?[axis] - offset_m(frame))
        })
    });
    let magnitudes = curves.iter().flatten().map(|point| point[1].abs());
    let (unit, factor) = length_unit(magnitudes.fold(0.0, f64::max));
    let curves = curves.map(|curve| (!curve.is_empty()).then_some(curve));
    let sigma = |f: &FrameRow| f.sigma_translation_m.map(|sigma| factor * sigma[axis]);
    chart(data, title.to_owned(), unit, factor, curves, &sigma)
}

/// Chart of initial, refined and true values times `factor`, with the `sigma` of the refined ones.
fn chart(
    data: &PageData,
    title: String,
    unit: &str,
    factor: f64,
    [initial, refined, truth]: [Option<Vec<[f64; 2]>>; 3],
    sigma: &dyn Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    let series = |name: &str, style: CurveStyle, points: Option<Vec<[f64; 2]>>| {
        let points = points?.into_iter().map(|[x, y]| [x, factor * y]);
        Some(Series::new(name, style, points.collect()))
    };
    let refined = series("refined", CurveStyle::Refined, refined);
    let series = [
        series("initial", CurveStyle::Initial, initial),
        refined.map(|refined| refined.with_sigma(data.report.frames.iter().map(sigma))),
        series("true", CurveStyle::Truth, truth),
    ];
    Chart {
        title,
        unit: unit.to_owned(),
        along: data.axis(),
        vertical: Vertical::Linear,
        series: series.into_iter().flatten().collect(),
        marks: data.marks(),
    }
    .draw()
}
