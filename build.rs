//! Bundles the viewer's page (`src/inspect/web`) where npm is there.
//!
//! Everything happens in `OUT_DIR`: the sources are copied there, npm installs what the lock file
//! names (its cache included), and esbuild writes `viewer.js`. Without npm or a network the file is
//! empty; the program is whole but for `view` and `export --web`, which then say what to install.

use std::path::Path;
use std::process::Command;
use std::{env, fs, io};

/// All that the page is made of.
const SOURCES: [&str; 4] = ["package.json", "package-lock.json", ".npmrc", "src"];

fn main() {
    let Some(out) = env::var_os("OUT_DIR") else {
        return;
    };
    let (web, out) = (Path::new("src/inspect/web"), Path::new(&out));
    for source in SOURCES {
        println!("cargo::rerun-if-changed={}", web.join(source).display());
    }
    println!("cargo::rerun-if-changed=build.rs");
    let script = out.join("viewer.js");
    if let Err(error) = bundle(web, &out.join("web"), &script) {
        println!(
            "cargo::warning=the viewer is left out ({error}): install Node.js 20 or newer with \
             npm, then `touch build.rs` and build again"
        );
        if let Err(error) = fs::write(&script, "") {
            println!("cargo::error=cannot write {}: {error}", script.display());
        }
    }
}

fn bundle(web: &Path, work: &Path, script: &Path) -> io::Result<()> {
    let lock = fs::read(web.join("package-lock.json"))?;
    let installed = work.join("installed.lock");
    if fs::read(&installed).ok().as_ref() != Some(&lock) {
        fs::create_dir_all(work)?;
        for name in &SOURCES[..3] {
            fs::copy(web.join(name), work.join(name))?;
        }
        let npm = if cfg!(windows) { "npm.cmd" } else { "npm" };
        let mut install = Command::new(npm);
        install.args([
            "ci",
            "--omit=dev",
            "--ignore-scripts",
            "--no-audit",
            "--no-fund",
            "--no-update-notifier",
        ]);
        install.arg("--cache").arg(work.join("cache"));
        run(install.current_dir(work))?;
        fs::write(&installed, &lock)?;
    }
    let sources = work.join("src");
    if sources.exists() {
        fs::remove_dir_all(&sources)?;
    }
    copy(&web.join("src"), &sources)?;
    let mut esbuild = Command::new("node");
    esbuild.args([
        "node_modules/esbuild/bin/esbuild",
        "src/main.ts",
        "--bundle",
        "--minify",
    ]);
    esbuild.args(["--format=esm", "--target=es2022", "--log-level=warning"]);
    esbuild.arg(format!("--outfile={}", script.display()));
    run(esbuild.current_dir(work))
}

fn copy(from: &Path, to: &Path) -> io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        fs::copy(entry.path(), to.join(entry.file_name()))?;
    }
    Ok(())
}

/// Runs a program to its end; what it said if that is none.
fn run(command: &mut Command) -> io::Result<()> {
    let program = command.get_program().to_string_lossy().into_owned();
    let fail = |what: String| io::Error::other(format!("{program}: {what}"));
    let output = command.output().map_err(|error| fail(error.to_string()))?;
    if output.status.success() {
        return Ok(());
    }
    let said = String::from_utf8_lossy(&output.stderr);
    let last: Vec<&str> = said.lines().rev().take(3).collect();
    Err(fail(last.into_iter().rev().collect::<Vec<_>>().join("; ")))
}
