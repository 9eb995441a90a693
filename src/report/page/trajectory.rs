//! Where the camera was: planned, refined, true.

use super::View;
use crate::report::FrameRow;
use crate::report::chart::{Chart, Extra, Series, Style, Vertical, legend};
use crate::report::quantity::length_unit;
use maud::{Markup, html};

/// The section.
pub fn section(view: &View) -> Markup {
    let frames = &view.report.frames;
    let known = view.report.survey.truth;
    let mut entries = vec![("planned", Style::Planned), ("refined", Style::Refined)];
    if known {
        entries.push(("true", Style::Truth));
    }
    let extras = band_and_marks(view);
    html! {
        p { "Positions of the camera, metres of the world: the tunnel's axis is y, the chainage; x and z lie across. "
            "Of y, whose size hides everything else, the difference from the plan is shown; so it is of the rotations, "
            "about the camera's own axes (x to the right, y down, z ahead)."
            @if known { " The true poses are turned about the tunnel's axis and shifted along it to lie as close to the \
                refined ones as they go, for no picture of a round tunnel can tell these two." } }
        (legend(&entries, &extras))
        div.charts {
            (position(view, "Position x", 0, |_| 0.0))
            (position(view, "Position y, less the plan", 1, |f| f.planned_m[1]))
            (position(view, "Position z", 2, |_| 0.0))
            @for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                (chart(view, format!("Rotation about {name}, less the plan"), "°", 1.0,
                    [
                        Some(view.points(|_| Some(0.0))),
                        Some(view.points(|k| frames.get(k).map(|f| f.correction_rotation_deg[axis]))),
                        known.then(|| view.points(|k| frames.get(k)?.true_rotation_deg.map(|r| r[axis]))),
                    ],
                    &|f| f.sigma_rotation_deg.map(|sigma| sigma[axis])))
            }
        }
    }
}

/// Whether 1-σ of the poses are known.
pub fn is_sure(view: &View) -> bool {
    let frames = &view.report.frames;
    frames
        .iter()
        .any(|frame| frame.sigma_rotation_deg.is_some())
}

/// Bands of 1-σ and vertical lines, as far as there are any.
pub fn band_and_marks(view: &View) -> Vec<Extra> {
    let band = is_sure(view).then_some(Extra::Band);
    band.into_iter().chain(marks_key(view)).collect()
}

/// The vertical lines, if there are any.
pub fn marks_key(view: &View) -> Vec<Extra> {
    if view.marks().is_empty() {
        Vec::new()
    } else {
        vec![Extra::Mark]
    }
}

type Pick<'p> = &'p dyn Fn(&FrameRow) -> Option<[f64; 3]>;

/// Positions along one axis, less something.
fn position(view: &View, title: &str, axis: usize, less: fn(&FrameRow) -> f64) -> Markup {
    let frames = &view.report.frames;
    let picks: [Pick; 3] = [&|f| Some(f.planned_m), &|f| Some(f.refined_m), &|f| {
        f.true_m
    }];
    let curves = picks.map(|pick| {
        view.points(|k| {
            let frame = frames.get(k)?;
            Some(pick(frame)?[axis] - less(frame))
        })
    });
    let most = curves.iter().flatten().map(|point| point[1].abs());
    let (unit, factor) = length_unit(most.fold(0.0, f64::max));
    let curves = curves.map(|curve| (!curve.is_empty()).then_some(curve));
    let sigma = |f: &FrameRow| f.sigma_translation_m.map(|sigma| factor * sigma[axis]);
    chart(view, title.to_owned(), unit, factor, curves, &sigma)
}

/// Planned, refined and true values times `factor`; `sigma` of the refined ones.
fn chart(
    view: &View,
    title: String,
    unit: &str,
    factor: f64,
    [planned, refined, truth]: [Option<Vec<[f64; 2]>>; 3],
    sigma: &dyn Fn(&FrameRow) -> Option<f64>,
) -> Markup {
    let series = |name: &str, style: Style, points: Option<Vec<[f64; 2]>>| {
        let points = points?.into_iter().map(|[x, y]| [x, factor * y]);
        Some(Series::new(name, style, points.collect()))
    };
    let refined = series("refined", Style::Refined, refined);
    let series = [
        series("planned", Style::Planned, planned),
        refined.map(|refined| refined.with_sigma(view.report.frames.iter().map(sigma))),
        series("true", Style::Truth, truth),
    ];
    Chart {
        title,
        unit: unit.to_owned(),
        along: view.axis(),
        vertical: Vertical::Linear,
        series: series.into_iter().flatten().collect(),
        marks: view.marks(),
    }
    .draw()
}
