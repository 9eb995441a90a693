//! Initial poses from a plan, through the program.

use crate::support::{edit, fail, first_frames, succeed, text};
use std::path::Path;
use tunnelstitch::survey::Survey;
use tunnelstitch::trajectory::{StampedPose, tum};

fn read(path: &Path) -> Vec<StampedPose> {
    tum::read(path).unwrap()
}

fn assert_same(a: &[StampedPose], b: &[StampedPose]) {
    assert_eq!(a.len(), b.len());
    for (a, b) in a.iter().zip(b) {
        assert!(a.pose.local(&b.pose).norm() < 1e-9, "{a:?} {b:?}");
    }
}

/// The fixture's baseline, specified in three ways; the printed lines for survey.toml complete a
/// survey.
#[test]
fn the_fixtures_plan_is_written_in_every_way() {
    let survey = first_frames(8);
    let baseline = read(&survey.path().join("baseline.tum"));
    let out = survey.path().join("plan.tum");
    let plan = |arguments: &[&str]| {
        let all = [&["plan", "--out", text(&out)], arguments].concat();
        succeed(&all)
    };
    let folder = text(survey.path());
    let said = plan(&[folder, "--advance-m", "0.1", "--turn-deg", "30"]);
    assert!(said.contains("initial = \"plan.tum\""), "{said}");
    assert!(said.contains("rotation_sigma_deg = 2.0"), "{said}");
    assert_same(&read(&out), &baseline);

    plan(&[
        "--frames",
        "8",
        "--fps",
        "4",
        "--advance-m-per-s",
        "0.4",
        "--turn-deg-per-s",
        "120",
    ]);
    let poses = read(&out);
    assert_same(&poses, &baseline);
    assert_eq!(poses[6].time_s, 1.5);

    let table = survey.path().join("plan.csv");
    std::fs::write(&table, "frame,chainage_m,angle_deg\n0,0,0\n7,0.7,210\n").unwrap();
    let lines = survey.path().join("lines.toml");
    plan(&[
        folder,
        "--table",
        text(&table),
        "--toml-out",
        text(&lines),
        "--rotation-sigma-deg",
        "1.5",
    ]);
    assert_same(&read(&out), &baseline);

    // The lines are valid sections of survey.toml.
    let toml = survey.path().join("survey.toml");
    let all = std::fs::read_to_string(&toml).unwrap();
    let before = all.split("[poses]").next().unwrap().to_owned();
    let lines = std::fs::read_to_string(&lines).unwrap();
    std::fs::write(&toml, before + &lines).unwrap();
    let opened = Survey::open(survey.path()).unwrap();
    assert_same(&opened.initial, &baseline);
    assert!((opened.prior.rotation_sigma_rad.to_degrees() - 1.5).abs() < 1e-12);
}

#[test]
fn what_is_missing_is_asked_for() {
    let survey = first_frames(3);
    let out = survey.path().join("plan.tum");
    let table = survey.path().join("plan.csv");
    std::fs::write(&table, "frame,chainage_m,angle_deg\n0,0,0\n1,0.7,x\n").unwrap();
    let short = survey.path().join("short.csv");
    std::fs::write(&short, "frame,chainage_m,angle_deg\n0,0,0\n1,0.7,20\n").unwrap();
    let timed = survey.path().join("timed.csv");
    std::fs::write(&timed, "time_s,chainage_m,angle_deg\n0,0,0\n9,0.7,20\n").unwrap();
    let folder = text(survey.path());
    for (arguments, code, expected) in [
        (vec!["--advance-m", "0.1"], 2, "number of frames is unknown"),
        (vec![folder], 2, "no motion is given"),
        (
            vec![folder, "--frames", "4", "--advance-m", "1"],
            2,
            "there are 3",
        ),
        (
            vec![folder, "--turn-deg-per-s", "1"],
            2,
            "needs the frames' times",
        ),
        (vec![folder, "--table", text(&table)], 3, "plan.csv:3: `x`"),
        (
            vec![folder, "--table", text(&short)],
            3,
            "frame 2 lies beyond",
        ),
        (vec![folder, "--table", text(&timed)], 2, "--fps"),
    ] {
        let all = [&["plan", "--out", text(&out)], &arguments[..]].concat();
        let message = fail(&all, code);
        assert!(message.contains(expected), "{message}");
        assert!(!out.exists());
    }
    // Times in the wrong order.
    let times = survey.path().join("times.txt");
    std::fs::write(&times, "1\n3\n2\n").unwrap();
    edit(
        &survey.path().join("survey.toml"),
        "[frames]",
        "[frames]\ntimes = \"times.txt\"",
    );
    let message = fail(&["plan", folder, "--out", text(&out), "--turn-deg", "1"], 3);
    assert!(message.contains("frame 2 has time 2"), "{message}");
}
