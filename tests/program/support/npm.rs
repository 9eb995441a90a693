//! Programs from npm that judge what is written: `.ci/run` installs what
//! `src/inspect/web/package-lock.json` names.

use std::path::{Path, PathBuf};
use std::process::Command;

/// The folder `node_modules` with these programs. Without it, `None` after saying so; where the
/// environment says CI, a failure.
pub fn find() -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_TARGET_TMPDIR")).parent()?;
    let modules = target.join("npm/node_modules");
    if modules.join("gltf-validator").is_dir() && modules.join("playwright-core").is_dir() {
        return Some(modules);
    }
    let what = format!(
        "no gltf-validator and playwright-core: copy src/inspect/web/package*.json to {0} and run \
         `npm ci --prefix {0}`",
        target.join("npm").display()
    );
    assert!(std::env::var_os("CI").is_none(), "{what}");
    eprintln!("{what}; nothing was checked by them");
    None
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
