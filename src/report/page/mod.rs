//! `report.html`: the report as one page that needs nothing else.
//!
//! One file per section; each draws a part of [`Report`] and knows nothing of where the numbers
//! come from. Without scripts everything is there; with them the panoramas lie over each other and
//! charts tell the values under the pointer.

mod convergence;
mod corrections;
mod errors;
mod flagged;
mod panorama;
mod parameters;
mod trajectory;
mod verdict;
mod wall;

use super::chart::Axis;
use super::{Abscissa, Pictures, Report, ReportError};
use crate::refine::FrameFlag;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use maud::{DOCTYPE, Markup, PreEscaped, html};

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("script.js");

/// The page of a report; `pictures` under the names that the report gives.
///
/// # Errors
/// [`ReportError::Encode`].
pub fn page(report: &Report, pictures: &Pictures) -> Result<String, ReportError> {
    let view = View { report, pictures };
    let sections: Vec<(&str, &str, Markup)> = [
        ("panorama", "The wall", Some(panorama::section(&view))),
        (
            "overlap",
            "Residual and overlap",
            Some(wall::section(&view)?),
        ),
        ("trajectory", "Trajectory", Some(trajectory::section(&view))),
        (
            "corrections",
            "Corrections",
            Some(corrections::section(&view)),
        ),
        ("errors", "Errors", errors::section(&view)),
        ("convergence", "Convergence", convergence::section(&view)),
        ("flagged", "Flagged frames", flagged::section(&view)),
        ("parameters", "Parameters", Some(parameters::section(&view))),
        (
            "repeat",
            "How to repeat it",
            Some(parameters::repeat(&view)),
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
                (verdict::header(&view))
                nav aria-label="Sections" {
                    @for (id, title, _) in &sections {
                        a href=(format!("#{id}")) { (title) }
                    }
                }
                main {
                    (verdict::section(&view))
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

/// What sections draw from.
struct View<'a> {
    report: &'a Report,
    pictures: &'a Pictures,
}

impl View<'_> {
    /// A picture as a data URI; without a picture of that name, an empty one.
    fn jpeg(&self, file: &str) -> String {
        let bytes = self.pictures.get(file);
        bytes.map_or_else(
            || "data:,".to_owned(),
            |bytes| data_uri("image/jpeg", bytes),
        )
    }

    /// Where frames lie along charts.
    fn places(&self) -> Vec<f64> {
        let frames = self.report.frames.iter();
        match self.report.abscissa {
            Abscissa::Chainage => frames.map(|frame| frame.refined_m[1]).collect(),
            Abscissa::Frame => frames.map(|frame| frame.index as f64).collect(),
        }
    }

    /// The horizontal axis of charts of frames.
    fn axis(&self) -> Axis {
        let places = self.places();
        let low = places.iter().copied().fold(f64::INFINITY, f64::min);
        let high = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        Axis {
            name: match self.report.abscissa {
                Abscissa::Chainage => "chainage (m)".to_owned(),
                Abscissa::Frame => "frame".to_owned(),
            },
            range: if low <= high { [low, high] } else { [0.0, 1.0] },
            whole: self.report.abscissa == Abscissa::Frame,
        }
    }

    /// The numbers of flagged frames.
    fn flagged(&self) -> Vec<usize> {
        let frames = self.report.refinement.iter().flat_map(|r| &r.frames);
        let flagged = frames.filter(|frame| frame.flag != FrameFlag::Photometric);
        flagged.map(|frame| frame.index).collect()
    }

    /// Where flagged frames lie along charts.
    fn marks(&self) -> Vec<f64> {
        let places = self.places();
        let of = |frame: usize| places.get(frame).copied();
        self.flagged().into_iter().filter_map(of).collect()
    }

    /// Each frame's place with its value, where it has one.
    fn points(&self, value: impl Fn(usize) -> Option<f64>) -> Vec<[f64; 2]> {
        let places = self.places();
        let pairs = places.iter().enumerate();
        pairs.filter_map(|(k, x)| Some([*x, value(k)?])).collect()
    }
}

fn data_uri(kind: &str, bytes: &[u8]) -> String {
    format!("data:{kind};base64,{}", STANDARD.encode(bytes))
}
