//! Small convergence tests through the program.

use crate::support::{json, succeed, text};

#[test]
fn a_sweep_is_written_resumed_and_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("sweep");
    let sweep = |seeds: &'static str| {
        let options = "--rotation-deg 2 --jitter random-walk --frames 6 --size 160x120 --quiet";
        let mut arguments = vec!["converge", "--out", text(&out), "--seeds", seeds];
        arguments.extend(options.split(' '));
        succeed(&arguments);
        std::fs::read_to_string(out.join("runs.jsonl")).unwrap()
    };
    let first = sweep("2");
    assert_eq!(first.lines().count(), 2);
    // Finished runs are not repeated; one more seed adds one line.
    assert_eq!(sweep("2"), first);
    let more = sweep("3");
    assert!(more.starts_with(&first) && more.lines().count() == 3);

    let result = json(&out.join("converge.json"));
    assert_eq!(result["cells"][0]["runs"], 3);
    assert_eq!(result["cells"][0]["false_successes"], 0);
    let map = image::open(out.join("converge.png")).unwrap();
    assert!(map.width() > 100 && map.height() > 50);
}

#[test]
fn the_efficiency_is_measured_against_the_bound() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("limit");
    let options = "--efficiency --frames 12 --size 160x120 --seeds 1 --wall concrete --quiet";
    let mut arguments = vec!["converge", "--out", text(&out)];
    arguments.extend(options.split(' '));
    succeed(&arguments);
    let table = json(&out.join("efficiency.json"));
    let number = |name: &str| table[0][name].as_f64().unwrap();
    // A single survey scatters; errors far from the bound would be a mistake in one of the two.
    for kind in ["rotation", "translation", "wall", "pose"] {
        let ratio = table[0]["ratio"][kind].as_f64().unwrap();
        assert!((0.4..3.0).contains(&ratio), "{kind}: {table}");
        // An unknown texture leaves more uncertainty.
        let unknown = table[0]["unknown_texture_ratio"][kind].as_f64().unwrap();
        assert!(
            (0.5 * ratio..0.98 * ratio).contains(&unknown),
            "{kind}: {table}"
        );
    }
    assert!((1.0..20.0).contains(&number("normalised_error")), "{table}");
}

/// On a deformed wall the bounds are those of an unknown one, and the deformation that is found is
/// right within its σ.
#[test]
fn the_efficiency_on_a_deformed_wall_covers_its_deformation() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("walls");
    let options = "--efficiency --frames 24 --size 160x120 --seeds 1 --quiet --ovality-mm 10 \
                   --undulation-mm 4 --undulation-length-m 1";
    let mut arguments = vec!["converge", "--out", text(&out)];
    arguments.extend(options.split(' '));
    succeed(&arguments);
    let row = &json(&out.join("efficiency.json"))[0];
    let deformation = |name: &str| row["deformation"][name].as_f64().unwrap();
    assert!(deformation("nodes") > 100.0, "{row}");
    assert!(deformation("error_mm") < 6.0, "{row}");
    assert!(
        (0.2..3.0).contains(&deformation("normalised_error")),
        "{row}"
    );
    let ratio = row["bayesian_ratio"]["pose"].as_f64().unwrap();
    assert!((0.4..4.0).contains(&ratio), "{row}");
}
