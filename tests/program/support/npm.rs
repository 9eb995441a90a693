//! Programs from npm that judge what is written: `.ci/run` installs what
//! `src/inspect/web/package-lock.json` names.

use super::missing::{find_installed, find_program, skip};
use std::path::{Path, PathBuf};
use std::process::Command;
use tunnelstitch::inspect::Viewer;

/// Finds the folder `node_modules` with gltf-validator and playwright-core, and Node.js to run
/// them; without one of them the test is skipped.
pub fn find() -> Option<PathBuf> {
    find_program(&["node"])?;
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent()?;
    let modules = target.join("npm/node_modules");
    for package in ["gltf-validator", "playwright-core"] {
        find_installed(&modules.join(package), &format!("{package} (npm)"))?;
    }
    Some(modules)
}

/// Returns true after a notice if the program was built without its viewer.
pub fn is_viewer_missing() -> bool {
    let missing = Viewer::bundled().is_err();
    if missing {
        skip("the viewer's page (npm when the program was built)");
    }
    missing
}

/// Runs a script of `tests/program/support` with Node.js and returns what it printed.
pub fn node(script: &str, arguments: &[&str]) -> String {
    let script = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("tests/program/support")
        .join(script);
    let output = Command::new("node")
        .arg(script)
        .args(arguments)
        .output()
        .expect("node starts");
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(
        output.status.success(),
        "{said}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    said
}
