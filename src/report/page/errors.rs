//! How far the poses are from the true ones, where these are known.

use super::View;
use super::trajectory::marks_key;
use crate::report::Report;
use crate::report::chart::{Chart, Series, Style, Vertical, legend};
use crate::report::quantity::{fixed, short};
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
        (table(view.report))
    })
}

fn table(report: &Report) -> Markup {
    let comparison = &report.comparison;
    let rows = comparison.rows();
    let truth = comparison.truth.as_ref().and_then(|truth| truth.seam);
    let [from_m, to_m] = comparison.canvas.chainage_m();
    html! {
        div.wide {
            table {
                caption {
                    "Initial and refined poses compared"
                    @if report.survey.truth { " with the true ones" }
                    ", over chainage " (fixed(from_m, 2)) " to "
                    (fixed(to_m, 2)) " m at "
                    (short(comparison.canvas.px_per_metre)) " pixels per metre"
                }
                thead { tr { th scope="col" { "Measure" } th scope="col" { "Unit" }
                    th.number scope="col" { "Baseline" } th.number scope="col" { "Refined" } } }
                tbody {
                    @for row in &rows {
                        tr {
                            th scope="row" { (row.measure) }
                            td { (row.unit) }
                            td.number { (row.baseline.as_deref().unwrap_or("–")) }
                            td.number { (row.refined.as_deref().unwrap_or("–")) }
                        }
                    }
                    @if let Some(seam) = truth {
                        tr { th scope="row" { "seam residual, true poses" } td { "grey" }
                            td.number colspan="2" { (format!("{:.2}", seam.rms_grey)) } }
                    }
                }
            }
        }
    }
}
