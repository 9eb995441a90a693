//! The page as a whole: head, summary, navigation and sections.

use super::page_data::PageData;
use super::{
    convergence, corrections, deformation, errors, flagged, masked_wall, panorama, parameters,
    summary, trajectory, wall_maps,
};
use crate::report::error::ReportError;
use crate::report::model::Report;
use crate::report::pictures::Pictures;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// Writes the page of a report; `pictures` has the files that the report names.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn page(report: &Report, pictures: &Pictures) -> Result<String, ReportError> {
    let data = PageData { report, pictures };
    let sections: Vec<(&str, &str, Markup)> = [
        ("panorama", "The wall", Some(panorama::section(&data))),
        (
            "overlap",
            "Residual and overlap",
            Some(wall_maps::section(&data)?),
        ),
        ("deformation", "Deformation", deformation::section(&data)?),
        ("left-out", "Wall left out", masked_wall::section(&data)?),
        ("trajectory", "Trajectory", Some(trajectory::section(&data))),
        (
            "corrections",
            "Corrections",
            Some(corrections::section(&data)),
        ),
        ("errors", "Errors", errors::section(&data)),
        ("convergence", "Convergence", convergence::section(&data)),
        ("flagged", "Flagged frames", flagged::section(&data)),
        ("parameters", "Parameters", Some(parameters::section(&data))),
        (
            "repeat",
            "How to reproduce it",
            Some(parameters::commands(&data)),
        ),
    ]
    .into_iter()
    .filter_map(|(id, title, section)| Some((id, title, section?)))
    .collect();
    let title = format!("{} – tunnelstitch report", report.survey.name);
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content=(report.program);
                title { (title) }
                link rel="icon" href="data:,";
                style { (PreEscaped(STYLE)) }
            }
            body {
                (summary::header(&data))
                nav aria-label="Sections" {
                    @for (id, title, _) in &sections {
                        a href=(format!("#{id}")) { (title) }
                    }
                }
                main {
                    (summary::section(&data))
                    @for (id, title, section) in &sections {
                        section id=(id) aria-labelledby=(format!("{id}-title")) {
                            h2 id=(format!("{id}-title")) { (title) }
                            (section)
                        }
                    }
                }
                footer {
                    p { (report.program) ". The numbers of this page are in " code { "report.json" }
                        " beside it, schema version " (report.schema_version) "." }
                }
                script { (PreEscaped(SCRIPT)) }
            }
        }
    };
    Ok(page.into_string())
}
