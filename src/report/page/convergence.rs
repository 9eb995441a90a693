//! Section about the convergence of the global solves.

use super::page_data::PageData;
use crate::refine::{LevelReport, StopReason};
use crate::report::chart::{Axis, Chart, CurveStyle, Series, Vertical, legend};
use crate::report::quantity::{count, short};
use maud::{Markup, html};

/// Draws the section; `None` without refine's report.
pub fn section(data: &PageData) -> Option<Markup> {
    let refinement = data.report.refinement.as_ref()?;
    let levels = &refinement.levels;
    let names: Vec<String> = levels.iter().map(name).collect();
    let entries = names.iter().enumerate();
    let entries: Vec<(&str, CurveStyle)> = entries
        .map(|(k, name)| (name.as_str(), CurveStyle::Ordered(k)))
        .collect();
    Some(html! {
        p {
            "The global solves, from coarse to fine, each with a few damped Gauss–Newton steps \
             over all frames. The cost is robust. It can be compared within a solve only, since \
             each solve has its own samples of the wall. The cost after a last step is not \
             computed, so a solve of one step has no curve. The last solve stopped: "
            (refinement.stopped_because) "."
        }
        (legend(&entries, &[]))
        div.charts {
            @for (k, (level, name)) in levels.iter().zip(&names).enumerate() {
                @if level.solve.steps.len() > 1 { (cost_chart(level, name, k)) }
            }
            (step_chart(levels, &names))
        }
        (table(levels, &names))
    })
}

/// Name of a solve: density of samples, size of pixels, and whether the wall is solved for.
fn name(level: &LevelReport) -> String {
    let mut name = format!("{} samples per px", level.samples_per_pixel);
    if level.level > 0 {
        name += &format!(" of size {}", level.pixel_px());
    }
    if level.joint {
        name += ", jointly with the wall";
    }
    name
}

/// Chart of the cost per observation before the first and after each step of one solve.
fn cost_chart(level: &LevelReport, name: &str, k: usize) -> Markup {
    let observations = level.solve.observations.max(1) as f64;
    let after = level.solve.steps.iter().map(|step| step.cost);
    let costs = std::iter::once(Some(level.solve.cost_start)).chain(after);
    let points = costs.enumerate();
    let points = points.filter_map(|(step, cost)| Some([step as f64, cost? / observations]));
    Chart {
        title: format!("Cost per observation, {name}"),
        unit: String::new(),
        along: Axis {
            name: "steps".to_owned(),
            range: [0.0, level.solve.steps.len() as f64],
            whole: true,
        },
        vertical: Vertical::Linear,
        series: vec![Series::new(
            "cost",
            CurveStyle::Ordered(k),
            points.collect(),
        )],
        marks: Vec::new(),
    }
    .draw()
}

/// Chart of the largest displacement on the wall in every step of all solves.
fn step_chart(levels: &[LevelReport], names: &[String]) -> Markup {
    let mut done = 0;
    let mut series = Vec::new();
    for (k, (level, name)) in levels.iter().zip(names).enumerate() {
        let points = (done + 1..).zip(&level.solve.steps);
        let points = points.map(|(at, step): (usize, _)| [at as f64, step.step_px]);
        series.push(Series::new(name, CurveStyle::Ordered(k), points.collect()));
        done += level.solve.steps.len();
    }
    Chart {
        title: "Largest step on the wall".to_owned(),
        unit: "px".to_owned(),
        along: Axis {
            name: "steps of all solves".to_owned(),
            range: [0.0, done.max(1) as f64],
            whole: true,
        },
        vertical: Vertical::Logarithmic,
        series,
        marks: Vec::new(),
    }
    .draw()
}

fn table(levels: &[LevelReport], names: &[String]) -> Markup {
    html! {
        div.wide {
            table.solves {
                caption { "The global solves" }
                thead { tr {
                    th scope="col" { "Solve" }
                    th.number scope="col" { "Steps" }
                    th.number scope="col" { "Observations" }
                    th.number scope="col" { "Cost: start" } th.number scope="col" { "end" }
                    th.number scope="col" { "Last step (px)" }
                    th.number scope="col" { "Noise (grey)" }
                    th scope="col" { "Stopped by" }
                } }
                tbody {
                    @for (level, name) in levels.iter().zip(names) {
                        @let solve = &level.solve;
                        tr {
                            th scope="row" { (name) }
                            td.number { (solve.iterations) }
                            td.number { (count(solve.observations)) }
                            td.number { (count(solve.cost_start.round() as usize)) }
                            td.number { (count(solve.cost_end.round() as usize)) }
                            td.number { (short(solve.last_step_px)) }
                            td.number { (short(solve.sigma)) }
                            td { (stop_text(solve.stop)) }
                        }
                    }
                }
            }
        }
    }
}

fn stop_text(stop: StopReason) -> &'static str {
    match stop {
        StopReason::StepBelowTolerance => "step below the tolerance",
        StopReason::StepBelowUncertainty => "step below the uncertainty",
        StopReason::NoFurtherDescent => "no further descent",
        StopReason::MaxIterations => "number of steps",
    }
}
