//! Licences and sources of all that the program is built from, by the list in `deny.toml`.
//!
//! Known defects are looked for by `cargo deny check` (`.ci/run`).

use spdx::{Expression, ParseMode};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// Name with version, place if it is not the registry's, and licence of every package that the
/// program with all its features, its build and its tests need on any system.
fn packages() -> BTreeSet<[String; 3]> {
    let tree = Command::new(env!("CARGO"))
        .args([
            "tree",
            "--workspace",
            "--all-features",
            "--target",
            "all",
            "--locked",
        ])
        .args(["--prefix", "none", "--format", "{p}|{l}|"])
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .unwrap();
    let error = String::from_utf8_lossy(&tree.stderr);
    assert!(tree.status.success(), "{error}");
    let lines = String::from_utf8(tree.stdout).unwrap();
    let package = |line: &str| {
        let mut fields = line.split('|');
        // Blank lines stand between the members.
        let (name, licence) = (fields.next()?, fields.next()?);
        let name = name.trim_end_matches(" (proc-macro)");
        let (name, place) = name.split_once(" (").unwrap_or((name, ""));
        Some([name, place, licence].map(str::to_owned))
    };
    lines.lines().filter_map(package).collect()
}

/// The licences that `deny.toml` allows.
fn allowed() -> BTreeSet<String> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("deny.toml");
    let lists: toml::Table = std::fs::read_to_string(path).unwrap().parse().unwrap();
    let names = lists["licenses"]["allow"].as_array().unwrap().iter();
    names
        .map(|name| name.as_str().unwrap().to_owned())
        .collect()
}

#[test]
fn licences_are_allowed_ones() {
    let (allowed, packages) = (allowed(), packages());
    assert!(packages.len() > 100);
    for [name, _, licence] in &packages {
        let expression = Expression::parse_mode(licence, ParseMode::LAX)
            .unwrap_or_else(|error| panic!("{name}: licence \"{licence}\": {error}"));
        let is_allowed = expression.evaluate(|wanted| allowed.contains(&wanted.to_string()));
        assert!(is_allowed, "{name}: {licence} is not allowed by deny.toml");
    }
}

/// No git repository, whose content could change, and no folder beside this one.
#[test]
fn sources_are_the_registry_and_this_repository() {
    for [name, place, _] in packages() {
        let is_here = place.starts_with(env!("CARGO_MANIFEST_DIR"));
        assert!(place.is_empty() || is_here, "{name} comes from {place}");
    }
}
