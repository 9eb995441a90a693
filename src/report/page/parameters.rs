//! Everything that was set, how long it took, and how to do it again.

use super::View;
use crate::report::quantity::{maybe, short};
use maud::{Markup, html};
use serde_json::{Map, Value};

/// The section of parameters.
pub fn section(view: &View) -> Markup {
    let report = view.report;
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
    html! {
        div.tables {
            (table("Survey (survey.toml)", &survey))
            (table("Camera", &camera))
            @if let Some(refinement) = &report.refinement {
                @let mut options = Vec::new();
                @let () = flatten("", &refinement.options, &mut options);
                (table("Options of refine in effect", &options))
                @let timings: Vec<(String, String)> = refinement.timings.iter()
                    .map(|lap| (lap.stage.clone(), format!("{} s", short(lap.seconds)))).collect();
                (table("Time of refine", &timings))
                @if let Some(factor) = refinement.variance_factor {
                    @let more = [
                        ("variance factor".to_owned(), short(factor)),
                        ("refined by".to_owned(), refinement.program.clone()),
                    ];
                    (table("Estimate", &more))
                }
            }
        }
        @if let Some(calibration) = report.refinement.as_ref().and_then(|r| r.calibration.as_ref()) {
            div.wide {
                table {
                    caption { "Self-calibration" }
                    thead { tr { th scope="col" { "Unknown" } th scope="col" { "Unit" } th.number scope="col" { "Given" }
                        th.number scope="col" { "Estimate" } th.number scope="col" { "1-σ" } th.number scope="col" { "Prior 1-σ" }
                        th scope="col" { "Observed" } } }
                    tbody {
                        @for unknown in &calibration.unknowns {
                            tr {
                                th scope="row" { (unknown.name) }
                                td { (if unknown.unit == "1" { "" } else { unknown.unit.as_str() }) }
                                td.number { (format!("{:.5}", unknown.initial)) }
                                td.number { (format!("{:.5}", unknown.estimate)) }
                                td.number { (maybe(unknown.sigma)) }
                                td.number { (short(unknown.prior_sigma)) }
                                td { @if unknown.observed { "yes" } @else { "no: " (unknown.reason.as_deref().unwrap_or("no reason is given")) } }
                            }
                        }
                    }
                }
            }
        }
    }
}

/// The command lines.
pub fn repeat(view: &View) -> Markup {
    html! {
        p { "The same input gives the same poses, to the last bit, whatever the number of threads." }
        pre tabindex="0" { code {
            @for line in &view.report.commands { (shell(line)) "\n" }
        } }
    }
}

/// A command line as a shell takes it.
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

/// Names with dots between and values as text.
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

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        other => other.to_string(),
    }
}

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
    fn what_a_shell_would_take_apart_is_quoted() {
        let line = ["tunnelstitch", "refine", "my survey", "it's", "--out=r"].map(str::to_owned);
        assert_eq!(
            shell(&line),
            r"tunnelstitch refine 'my survey' 'it'\''s' --out=r"
        );
    }
}
