//! Where options come from, and the record beside every result.

mod support;

use std::path::Path;
use std::process::{Command, Output};
use support::{fail, first_frames, succeed, text};

/// A survey that holds options for `stitch`.
fn survey(options: &str) -> tempfile::TempDir {
    let survey = first_frames(3);
    let path = survey.path().join("survey.toml");
    let file = std::fs::read_to_string(&path).unwrap();
    std::fs::write(&path, file + options).unwrap();
    survey
}

/// Runs the program with variables.
fn with(variables: &[(&str, &str)], arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tunnelstitch"))
        .envs(variables.iter().copied())
        .args(arguments)
        .output()
        .unwrap()
}

fn toml_of(path: &Path) -> toml::Table {
    std::fs::read_to_string(path).unwrap().parse().unwrap()
}

#[test]
fn flags_come_before_variables_before_the_survey_before_defaults() {
    let survey = survey("\n[options.stitch]\npx_per_metre = 20\nmode = \"average\"\n");
    let out = survey.path().join("p.png");
    let stitch = ["stitch", text(survey.path()), "--out", text(&out), "--json"];
    let px_per_metre = |variables: &[(&str, &str)], more: &[&str]| {
        let arguments: Vec<&str> = stitch.iter().chain(more).copied().collect();
        let output = with(variables, &arguments);
        assert!(output.status.success(), "{output:?}");
        let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        assert_eq!(report["render"]["mode"], "average");
        report["px_per_metre"].as_f64().unwrap().round()
    };
    let variable = [("TUNNELSTITCH_STITCH_PX_PER_METRE", "30")];
    assert_eq!(px_per_metre(&[], &[]), 20.0);
    assert_eq!(px_per_metre(&variable, &[]), 30.0);
    assert_eq!(px_per_metre(&variable, &["--px-per-metre", "40"]), 40.0);
    // `config` says the same.
    let shown = with(
        &variable,
        &["config", text(survey.path()), "stitch", "--json"],
    );
    let shown: serde_json::Value = serde_json::from_slice(&shown.stdout).unwrap();
    let option = |name: &str| &shown["options"]["stitch"][name];
    assert_eq!(option("px_per_metre")["value"], 30);
    assert_eq!(
        option("px_per_metre")["source"],
        "TUNNELSTITCH_STITCH_PX_PER_METRE"
    );
    assert_eq!(option("mode")["source"], "survey.toml");
    assert_eq!(option("interpolation")["source"], "default");
}

/// What is printed is a survey.toml, with the same effect.
#[test]
fn the_configuration_shown_may_be_put_into_the_survey() {
    let survey = survey("\n[options.stitch]\nmode = \"median\"\n");
    let shown = succeed(&["config", text(survey.path())]);
    let path = survey.path().join("survey.toml");
    std::fs::write(&path, &shown).unwrap();
    let again = succeed(&["config", text(survey.path()), "--json"]);
    let again: serde_json::Value = serde_json::from_str(&again).unwrap();
    assert_eq!(again["options"]["stitch"]["mode"]["value"], "median");
    assert_eq!(again["options"]["refine"]["fast"]["value"], false);
}

#[test]
fn a_panorama_can_be_made_again_from_its_record() {
    let survey = survey("");
    let path = |name: &str| survey.path().join(name);
    succeed(&[
        "stitch",
        text(survey.path()),
        "--out",
        text(&path("a.png")),
        "--px-per-metre",
        "25",
        "--mode",
        "median",
        "--quiet",
    ]);
    let record = toml_of(&path("a.png.run.toml"));
    assert_eq!(record["options"]["stitch"]["mode"].as_str(), Some("median"));
    let inputs = record["inputs"].as_array().unwrap();
    let hash = |name: &str| {
        let input = inputs
            .iter()
            .find(|input| input["path"].as_str().unwrap().ends_with(name));
        input.unwrap_or_else(|| panic!("no {name}"))["blake3"]
            .as_str()
            .unwrap()
            .to_owned()
    };
    let own = std::fs::read(path("baseline.tum")).unwrap();
    assert_eq!(
        hash("baseline.tum"),
        blake3::hash(&own).to_hex().to_string()
    );
    let frames = inputs
        .iter()
        .find(|input| input.get("files").is_some())
        .unwrap();
    assert_eq!(frames["files"].as_integer(), Some(3));

    // Its options in survey.toml, without the output's name, make the same picture.
    let mut options = record["options"]["stitch"].as_table().unwrap().clone();
    options.remove("out");
    let sections = toml::Table::from_iter([(
        "options".to_owned(),
        toml::Value::Table(toml::Table::from_iter([(
            "stitch".to_owned(),
            toml::Value::Table(options),
        )])),
    )]);
    let file = std::fs::read_to_string(path("survey.toml")).unwrap();
    std::fs::write(path("survey.toml"), file + "\n" + &sections.to_string()).unwrap();
    succeed(&[
        "stitch",
        text(survey.path()),
        "--out",
        text(&path("b.png")),
        "--quiet",
    ]);
    assert_eq!(
        std::fs::read(path("a.png")).unwrap(),
        std::fs::read(path("b.png")).unwrap()
    );
}

#[test]
fn wrong_options_in_a_survey_are_named_with_the_file() {
    for (options, expected) in [
        (
            "\n[options.stitch]\nmoed = \"average\"\n",
            "unknown option `moed`",
        ),
        (
            "\n[options.stitch]\nmode = \"best\"\n",
            "invalid value 'best'",
        ),
        (
            "\n[options.paint]\nmode = \"best\"\n",
            "[options.paint]: no such section",
        ),
    ] {
        let survey = survey(options);
        let out = survey.path().join("p.png");
        let message = fail(&["stitch", text(survey.path()), "--out", text(&out)], 3);
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists());
    }
}

#[test]
fn shells_and_man_know_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = succeed(&["completions", shell]);
        assert!(
            script.contains("stitch") && script.contains("px-per-metre"),
            "{shell}"
        );
    }
    let dir = tempfile::tempdir().unwrap();
    succeed(&["man", "--out", text(dir.path())]);
    for page in [
        "tunnelstitch.1",
        "tunnelstitch-refine.1",
        "tunnelstitch-stitch.1",
    ] {
        let text = std::fs::read_to_string(dir.path().join(page)).unwrap();
        assert!(text.contains(".SH NAME"), "{page}");
    }
}

/// Every command's help has an example.
#[test]
fn help_teaches_by_example() {
    let help = succeed(&["--help"]);
    let commands: Vec<&str> = help
        .lines()
        .skip_while(|line| *line != "Commands:")
        .skip(1)
        .take_while(|line| !line.is_empty())
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|command| *command != "help")
        .collect();
    assert!(commands.len() > 8, "{help}");
    for command in commands {
        let help = succeed(&[command, "--help"]);
        assert!(
            help.contains("Example") && help.contains(&format!("tunnelstitch {command}")),
            "{help}"
        );
        assert!(!help.contains('\u{1b}'), "colours in a pipe");
    }
}
