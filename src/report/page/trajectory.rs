//! Where the camera was: planned, refined, true.

use super::View;
use crate::report::FrameRow;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
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
    html! {
        p { "Positions of the camera, metres of the world: the tunnel's axis is y, the chainage; x and z lie across. "
            "Of y, whose size hides everything else, the difference from the plan is shown; so it is of the rotations, "
            "about the camera's own axes (x to the right, y down, z ahead)."
            @if known { " The true poses are turned about the tunnel's axis and shifted along it to lie as close to the \
                refined ones as they go, for no picture of a round tunnel can tell these two." } }
        (legend(&entries, &marks_key(view)))
        div.charts {
            (position(view, "Position x", |f, p| p(f).map(|t| t[0])))
            (position(view, "Advance y over plan", |f, p| p(f).map(|t| t[1] - f.planned_m[1])))
            (position(view, "Position z", |f, p| p(f).map(|t| t[2])))
            @for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
                (chart(view, format!("Rotation about {name} over plan"), "°", 1.0, [
                    Some(view.points(|_| Some(0.0))),
                    Some(view.points(|k| frames.get(k).map(|f| f.correction_rotation_deg[axis]))),
                    known.then(|| view.points(|k| frames.get(k)?.true_rotation_deg.map(|r| r[axis]))),
                ]))
            }
        }
    }
}

/// What the vertical lines mean, if there are any.
pub fn marks_key(view: &View) -> Vec<(&'static str, &'static str)> {
    match view.marks().is_empty() {
        true => Vec::new(),
        false => vec![("flagged frame", "mark")],
    }
}

type Pick<'p> = &'p dyn Fn(&FrameRow) -> Option<[f64; 3]>;

fn position(view: &View, title: &str, value: fn(&FrameRow, Pick) -> Option<f64>) -> Markup {
    let frames = &view.report.frames;
    let picks: [Pick; 3] = [
        &|f| Some(f.planned_m),
        &|f| Some(f.refined_m),
        &|f| f.true_m,
    ];
    let curves = picks.map(|pick| view.points(|k| value(frames.get(k)?, pick)));
    let most = curves.iter().flatten().map(|point| point[1].abs());
    let (unit, factor) = length_unit(most.fold(0.0, f64::max));
    let curves = curves.map(|curve| (!curve.is_empty()).then_some(curve));
    chart(view, title.to_owned(), unit, factor, curves)
}

fn chart(
    view: &View,
    title: String,
    unit: &str,
    factor: f64,
    curves: [Option<Vec<[f64; 2]>>; 3],
) -> Markup {
    let names = [
        ("planned", Style::Planned),
        ("refined", Style::Refined),
        ("true", Style::Truth),
    ];
    let scaled = |points: Vec<[f64; 2]>| points.into_iter().map(|[x, y]| [x, factor * y]).collect();
    let series = names.into_iter().zip(curves).filter_map(|((name, style), points)| {
        Some(Series::new(name, style, scaled(points?)))
    });
    Chart {
        title,
        unit: unit.to_owned(),
        along: view.axis(),
        vertical: Vertical::Linear,
        series: series.collect(),
        marks: view.marks(),
    }
    .draw()
}
