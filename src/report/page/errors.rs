//! How far the poses are from the true ones, where these are known.

use super::View;
use super::trajectory::marks_key;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
use maud::{Markup, html};

/// The section; `None` without truth.
pub fn section(view: &View) -> Option<Markup> {
    let comparison = &view.report.comparison;
    let [before, after] = [&comparison.baseline, &comparison.refined];
    let (turned, now) = (before.trajectory.as_ref()?, after.trajectory.as_ref()?);
    let (wall_before, wall_after) = (before.wall.as_ref()?, after.wall.as_ref()?);
    let chart = |title: &str, unit: &str, before: &[f64], after: &[f64], factor: f64| {
        let curve = |name: &str, style: Style, values: &[f64]| {
            let points = view.points(|k| values.get(k).map(|v| factor * v));
            Series::new(name, style, points)
        };
        Chart {
            title: title.to_owned(),
            unit: unit.to_owned(),
            along: view.axis(),
            vertical: Vertical::Logarithmic,
            series: vec![
                curve("planned", Style::Planned, before),
                curve("refined", Style::Refined, after),
            ],
            marks: view.marks(),
        }
        .draw()
    };
    Some(html! {
        p { "Frame by frame against the true poses, after the turn about the axis and the shift along it that no picture can \
            tell. Mind the logarithmic scale." }
        (legend(&[("planned", Style::Planned), ("refined", Style::Refined)], &marks_key(view)))
        div.charts {
            (chart("Rotation error", "°", &turned.frame_rotation_deg, &now.frame_rotation_deg, 1.0))
            (chart("Translation error", "mm", &turned.frame_translation_m, &now.frame_translation_m, 1e3))
            (chart("Error on the wall, RMS of the frame", "px", &wall_before.frame_rms_px, &wall_after.frame_rms_px, 1.0))
        }
    })
}
