//! Sources of options, and the record beside every result.

use crate::support::{fail, first_frames, succeed, text};
use std::path::Path;
use std::process::{Command, Output};

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
    // `config` shows the same options.
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

/// The output of `config` is a survey.toml with the same effect.
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

/// The survey may hold required options and global ones.
#[test]
fn every_command_takes_options_from_its_survey() {
    let survey =
        survey("\n[options.convert]\nto = \"kitti\"\nquiet = true\n[options.check]\njson = true\n");
    let out = survey.path().join("poses.txt");
    let convert = ["convert", text(survey.path()), "--out", text(&out)];
    assert_eq!(succeed(&convert), "");
    let poses = std::fs::read_to_string(&out).unwrap();
    assert_eq!(poses.lines().next().unwrap().split(' ').count(), 12);
    assert!(succeed(&["check", text(survey.path())]).starts_with('{'));
    let shown = succeed(&["config", text(survey.path()), "convert"]);
    assert!(shown.contains("to = \"kitti\"    # survey.toml"), "{shown}");
    assert!(shown.contains("quiet = true    # survey.toml"), "{shown}");
    // All of it may be put into the survey: defaults conflict with no other option.
    let all = succeed(&["config", text(survey.path())]);
    std::fs::write(survey.path().join("survey.toml"), all).unwrap();
    let table = survey.path().join("plan.csv");
    std::fs::write(&table, "frame,chainage_m,angle_deg\n0,0,0\n2,1,60\n").unwrap();
    let plan = [
        "plan",
        text(survey.path()),
        "--table",
        text(&table),
        "--out",
        text(&out),
    ];
    succeed(&plan);
    // Missing options are still required.
    let message = fail(&["stitch", text(survey.path())], 2);
    assert!(message.contains("--out"), "{message}");
}

#[test]
fn every_result_has_a_record() {
    let dir = tempfile::tempdir().unwrap();
    let path = |name: &str| dir.path().join(name);
    let simulate = "simulate free --frames 3 --size 64x48 --supersample 1 --seed 7 --out D/survey";
    for (arguments, record, input) in [
        (simulate, "survey/run.toml", None),
        // Again, replacing the output.
        (&format!("{simulate} --force"), "survey/run.toml", None),
        (
            "converge --rotation-deg 1 --jitter independent --seeds 1 --frames 2 --size 32x24 \
             --out D/sweep",
            "sweep/run.toml",
            None,
        ),
        (
            "plan D/survey --advance-m 0.1 --turn-deg 30 --out D/plan.tum",
            "plan.tum.run.toml",
            Some("survey.toml"),
        ),
        (
            "convert D/survey --to tum --out D/out.tum",
            "out.tum.run.toml",
            Some("baseline.tum"),
        ),
        (
            "convert D/survey --to colmap --out D/model",
            "model/run.toml",
            Some("baseline.tum"),
        ),
        // Again, replacing the output.
        (
            "convert D/survey --to colmap --out D/model",
            "model/run.toml",
            Some("baseline.tum"),
        ),
        (
            "project D/survey/frames/000000.png --out D/photo.png",
            "photo.png.run.toml",
            Some("000000.png"),
        ),
        (
            "export D/survey --glb D/wall.glb",
            "wall.glb.run.toml",
            Some("camera.json"),
        ),
        (
            "export D/survey --3dtiles D/tiles",
            "tiles/run.toml",
            Some("camera.json"),
        ),
        (
            "compare D/survey --refined D/out.tum --out D/compared",
            "compared/run.toml",
            Some("out.tum"),
        ),
        (
            "report D/survey --refined D/out.tum --out D/report",
            "report/run.toml",
            Some("out.tum"),
        ),
    ] {
        let words: Vec<String> = arguments
            .split(' ')
            .map(|word| word.replacen("D/", &format!("{}/", text(dir.path())), 1))
            .collect();
        succeed(&words.iter().map(String::as_str).collect::<Vec<_>>());
        let record = toml_of(&path(record));
        assert!(
            record["program"]
                .as_str()
                .unwrap()
                .starts_with("tunnelstitch ")
        );
        assert_eq!(record["arguments"][1].as_str(), Some(words[0].as_str()));
        assert!(record["options"][&words[0]].get("out").is_some() || words[0] == "export");
        let inputs = record["inputs"].as_array().unwrap();
        let names = |name: &str| {
            inputs
                .iter()
                .any(|i| i["path"].as_str().unwrap().ends_with(name))
        };
        assert!(input.is_none_or(names), "{arguments}: {record}");
    }
    let simulated = toml_of(&path("survey/run.toml"));
    assert_eq!(
        simulated["options"]["simulate"]["seed"].as_integer(),
        Some(7)
    );
}

#[test]
fn the_report_reads_poses_according_to_its_flags() {
    let survey = survey("");
    let (poses, out) = (
        survey.path().join("groundtruth.tum"),
        survey.path().join("report"),
    );
    let report = [
        "report",
        text(survey.path()),
        "--refined",
        text(&poses),
        "--out",
        text(&out),
    ];
    let message = fail(&[&report[..], &["--pose-format", "kitti"]].concat(), 3);
    assert!(message.contains("baseline.tum"), "{message}");
    assert!(!out.exists());
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
        .take_while(|line| *line != "Options:")
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
