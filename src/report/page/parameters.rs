//! Sections about parameters, run time and command lines.

use super::page_data::PageData;
use crate::report::quantity::{maybe, short};
use crate::report::refined_files::{CalibratedUnknown, Calibration};
use maud::{Markup, html};
use serde_json::{Map, Value};

/// Draws the section of parameters.
pub fn section(data: &PageData) -> Markup {
    let report = data.report;
    let [width, height] = report.survey.frame_size_px;
    let perimeter = short(report.survey.perimeter_m);
    let mut survey = vec![
        ("folder".to_owned(), report.survey.folder.clone()),
        (
            "refined poses".to_owned(),
            report.survey.refined_poses.clone(),
        ),
        (
            "frames".to_owned(),
            format!("{} of {width} × {height} px", report.frames.len()),
        ),
        ("perimeter".to_owned(), format!("{perimeter} m")),
    ];
    flatten("", &report.survey.file, &mut survey);
    let mut camera = Vec::new();
    flatten("", &report.survey.camera, &mut camera);
    let refinement = report.refinement.as_ref();
    let calibration = refinement.and_then(|refinement| refinement.calibration.as_ref());
    html! {
        div.tables {
            (table("Survey (survey.toml)", &survey))
            (table("Camera", &camera))
            @if let Some(refinement) = &report.refinement {
                @let mut options = Vec::new();
                @let () = flatten("", &refinement.options, &mut options);
                (table("Options of refine", &options))
                @let timings: Vec<(String, String)> = refinement.timings.iter()
                    .map(|lap| (lap.stage.clone(), format!("{} s", short(lap.seconds)))).collect();
                (table("Run time of refine", &timings))
                @if let Some(factor) = refinement.variance_factor {
                    @let more = [
                        ("variance factor".to_owned(), short(factor)),
                        ("program".to_owned(), refinement.program.clone()),
                    ];
                    (table("Estimate", &more))
                }
            }
        }
        @if let Some(calibration) = calibration { (calibration_table(calibration)) }
    }
}

/// Table of the parameters of the self-calibration.
fn calibration_table(calibration: &Calibration) -> Markup {
    html! {
        div.wide {
            table {
                caption { "Self-calibration" }
                thead { tr {
                    th scope="col" { "Parameter" }
                    th scope="col" { "Unit" }
                    th.number scope="col" { "Given" }
                    th.number scope="col" { "Estimate" }
                    th.number scope="col" { "1-σ" }
                    th.number scope="col" { "Prior 1-σ" }
                    th scope="col" { "Observable" }
                } }
                tbody {
                    @for parameter in &calibration.unknowns { (calibration_row(parameter)) }
                }
            }
        }
    }
}

fn calibration_row(parameter: &CalibratedUnknown) -> Markup {
    let unit = if parameter.unit == "1" {
        ""
    } else {
        parameter.unit.as_str()
    };
    let reason = parameter.reason.as_deref();
    html! {
        tr {
            th scope="row" { (parameter.name) }
            td { (unit) }
            td.number { (format!("{:.5}", parameter.initial)) }
            td.number { (format!("{:.5}", parameter.estimate)) }
            td.number { (maybe(parameter.sigma)) }
            td.number { (short(parameter.prior_sigma)) }
            td {
                @if parameter.observed {
                    "yes"
                } @else {
                    "no: " (reason.unwrap_or("no reason is given"))
                }
            }
        }
    }
}

/// Draws the section of command lines.
pub fn commands(data: &PageData) -> Markup {
    html! {
        p {
            "The same input gives the same poses to the last bit, independent of the number of \
             threads."
        }
        pre tabindex="0" { code {
            @for line in &data.report.commands { (shell(line)) "\n" }
        } }
    }
}

/// A command line, quoted for a shell.
fn shell(line: &[String]) -> String {
    let plain = |c: char| c.is_alphanumeric() || "-_./=,:+@%".contains(c);
    let quoted = line.iter().map(|argument| {
        if argument.chars().all(plain) && !argument.is_empty() {
            argument.clone()
        } else {
            format!("'{}'", argument.replace('\'', r"'\''"))
        }
    });
    quoted.collect::<Vec<_>>().join(" ")
}

/// Flattens nested objects into rows of dotted names and values as text.
fn flatten(prefix: &str, object: &Map<String, Value>, rows: &mut Vec<(String, String)>) {
    for (key, value) in object {
        let name = match prefix {
            "" => key.clone(),
            prefix => format!("{prefix}.{key}"),
        };
        match value {
            Value::Object(inner) => flatten(&name, inner, rows),
            Value::String(text) => rows.push((name, text.clone())),
            Value::Null => rows.push((name, "–".to_owned())),
            Value::Array(list) => {
                let texts: Vec<String> = list.iter().map(plain).collect();
                rows.push((name, texts.join(", ")));
            }
            other => rows.push((name, plain(other))),
        }
    }
}

/// A value as text.
fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        other => other.to_string(),
    }
}

/// Table of names and values.
fn table(caption: &str, rows: &[(String, String)]) -> Markup {
    html! {
        table.pairs {
            caption { (caption) }
            tbody {
                @for (name, value) in rows {
                    tr { th scope="row" { (name) } td { (value) } }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_tables_have_dots_and_lists_commas() {
        let file = serde_json::json!({
            "tunnel": { "shape": "circle", "radius_m": 3.0 },
            "prior": { "translation_sigma_m": [0.02, 0.03], "search": true, "density": null },
        });
        let mut rows = Vec::new();
        if let Value::Object(object) = &file {
            flatten("", object, &mut rows);
        }
        let value = |name: &str| {
            rows.iter()
                .find(|row| row.0 == name)
                .map(|row| row.1.as_str())
        };
        assert_eq!(value("tunnel.radius_m"), Some("3.0"));
        assert_eq!(value("prior.translation_sigma_m"), Some("0.02, 0.03"));
        assert_eq!(value("prior.search"), Some("yes"));
        assert_eq!(value("prior.density"), Some("–"));
    }

    #[test]
    fn special_characters_of_a_shell_are_quoted() {
        let line = ["tunnelstitch", "refine", "my survey", "it's", "--out=r"].map(str::to_owned);
        assert_eq!(
            shell(&line),
            r"tunnelstitch refine 'my survey' 'it'\''s' --out=r"
        );
    }
}
