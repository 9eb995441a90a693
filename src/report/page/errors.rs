//! Section about the errors against the true poses.

use super::page_data::PageData;
use super::trajectory::mark_entry;
use crate::report::chart::{Chart, CurveStyle, Series, Vertical, legend};
use crate::report::model::Report;
use crate::report::quantity::{fixed, short};
use maud::{Markup, html};

/// Draws the section; `None` without true poses.
pub fn section(data: &PageData) -> Option<Markup> {
    let comparison = &data.report.comparison;
    let [before, after] = [&comparison.baseline, &comparison.refined];
    let (initial, refined) = (before.trajectory.as_ref()?, after.trajectory.as_ref()?);
    let (wall_before, wall_after) = (before.wall.as_ref()?, after.wall.as_ref()?);
    let chart = |title: &str, unit: &str, factor: f64, [before, after]: [&[f64]; 2]| {
        let curve = |name: &str, style: CurveStyle, values: &[f64]| {
            let points = data.points(|k| values.get(k).map(|v| factor * v));
            Series::new(name, style, points)
        };
        Chart {
            title: title.to_owned(),
            unit: unit.to_owned(),
            along: data.axis(),
            vertical: Vertical::Logarithmic,
            series: vec![
                curve("initial", CurveStyle::Initial, before),
                curve("refined", CurveStyle::Refined, after),
            ],
            marks: data.marks(),
        }
        .draw()
    };
    let curves = [
        ("initial", CurveStyle::Initial),
        ("refined", CurveStyle::Refined),
    ];
    let rotation_deg = [initial, refined].map(|error| &error.frame_rotation_deg[..]);
    let translation_m = [initial, refined].map(|error| &error.frame_translation_m[..]);
    let wall_px = [wall_before, wall_after].map(|error| &error.frame_rms_px[..]);
    Some(html! {
        p {
            "Errors of each frame against the true poses, after alignment by the gauge of the \
             tunnel (rotation about the axis and shift along it). The scale is logarithmic."
        }
        (legend(&curves, &mark_entry(data)))
        div.charts {
            (chart("Rotation error", "°", 1.0, rotation_deg))
            (chart("Translation error", "mm", 1e3, translation_m))
            (chart("Error on the wall, RMS of the frame", "px", 1.0, wall_px))
        }
        (table(data.report))
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
                    "Comparison of initial and refined poses"
                    @if report.survey.truth { " with the true poses" }
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
