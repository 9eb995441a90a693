//! The files of all crates of the workspace, and which of them import which.

use crate::Offence;
use crate::scan::Scan;
use crate::sources::collect_rust_files;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// The files and the names in each.
pub struct Tree {
    pub files: Vec<File>,
    /// Modules, those written inline included.
    modules: BTreeMap<Vec<String>, Module>,
}

pub struct File {
    pub path: PathBuf,
    text: String,
    /// The crate (`src`, or its folder in `crates`) and the modules around and of the file.
    pub module: Vec<String>,
    /// Declared for tests only.
    pub test: bool,
    scan: Scan,
}

#[derive(Default)]
struct Module {
    file: usize,
    defined: BTreeSet<String>,
    /// Name and the path that it stands for.
    used: Vec<(String, Vec<String>)>,
    globs: Vec<Vec<String>>,
}

/// A name that one file takes from another.
#[derive(Debug)]
pub struct Import {
    pub from: usize,
    pub to: usize,
    pub line: usize,
    pub name: String,
    pub test: bool,
    /// Files with a re-export that the name came through.
    pub through: Vec<usize>,
}

impl Tree {
    pub fn of_sources() -> Tree {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut paths = Vec::new();
        for folder in ["src", "crates"] {
            collect_rust_files(root, Path::new(folder), &mut paths);
        }
        let read = |path: PathBuf| {
            let text = std::fs::read_to_string(root.join(&path)).expect("a source file");
            (path, text)
        };
        Tree::new(paths.into_iter().map(read))
    }

    /// Files named from the project's folder; `main.rs` is another crate and left out.
    pub fn new(sources: impl IntoIterator<Item = (PathBuf, String)>) -> Tree {
        let mut files: Vec<File> = Vec::new();
        for (path, text) in sources {
            let mut module: Vec<String> = path
                .with_extension("")
                .iter()
                .map(|name| name.to_string_lossy().into_owned())
                .collect();
            // `crates/name/src/…`: the crate goes by its folder's name.
            if module[0] == "crates" {
                module.remove(2);
                module.remove(0);
            }
            match module.last().map(String::as_str) {
                Some("main") if module.len() == 2 => continue,
                Some("lib" | "mod") => drop(module.pop()),
                _ => {}
            }
            let scan = Scan::of(&text);
            files.push(File {
                path,
                text,
                module,
                test: false,
                scan,
            });
        }
        files.sort_by(|a, b| a.module.cmp(&b.module));
        mark_test_files(&mut files);
        let mut modules = BTreeMap::new();
        for (k, file) in files.iter().enumerate() {
            for module in file.scan.modules() {
                let path = [&file.module[..], &module].concat();
                modules.entry(path).or_insert(Module {
                    file: k,
                    ..Module::default()
                });
            }
        }
        for file in &files {
            for (inline, name) in file.scan.definitions() {
                let path = [&file.module[..], inline].concat();
                modules.entry(path).or_default().defined.insert(name.into());
            }
            for used in file.scan.uses() {
                let path = [&file.module[..], &used.inline].concat();
                let module = modules.entry(path).or_default();
                match &used.alias {
                    Some(alias) => module.used.push((alias.clone(), used.path)),
                    None => module.globs.push(used.path),
                }
            }
        }
        Tree { files, modules }
    }

    /// The text of `src/lib.rs`.
    pub fn root(&self) -> &str {
        let root = self.files.iter().find(|file| file.module == ["src"]);
        root.map_or("", |file| &file.text)
    }

    /// Every import of one file from another.
    pub fn imports(&self) -> Vec<Import> {
        let mut imports = Vec::new();
        for (from, file) in self.files.iter().enumerate() {
            let mut paths = file.scan.uses();
            paths.extend(file.scan.body_paths());
            for used in paths {
                let module = [&file.module[..], &used.inline].concat();
                let mut through = Vec::new();
                let Some(to) = self.resolve(&module, &used.path, &mut through, 0) else {
                    continue;
                };
                through.retain(|&k| k != from && k != to);
                if to != from {
                    let name = used.path.last().cloned().unwrap_or_default();
                    let test = used.test || file.test;
                    imports.push(Import {
                        from,
                        to,
                        line: used.line,
                        name,
                        test,
                        through,
                    });
                }
            }
        }
        imports
    }

    /// The file that defines the last name of `path`, as written in `module`; `None` if it is of
    /// another crate.
    fn resolve(
        &self,
        module: &[String],
        path: &[String],
        through: &mut Vec<usize>,
        depth: usize,
    ) -> Option<usize> {
        /// More re-exports of re-exports than any crate has.
        const MAX_DEPTH: usize = 16;
        if depth > MAX_DEPTH {
            return None;
        }
        let mut at = module.to_vec();
        let mut names = path.iter().peekable();
        match names.peek()?.as_str() {
            "crate" => {
                at.truncate(1);
                names.next();
            }
            "self" => drop(names.next()),
            name => {
                if let Some(member) = member(name)
                    && self.modules.contains_key(&[member.to_owned()][..])
                {
                    at = vec![member.to_owned()];
                    names.next();
                }
            }
        }
        while names.peek().is_some_and(|name| *name == "super") {
            at.pop()?;
            names.next();
        }
        while let Some(name) = names.next() {
            let child = [&at[..], std::slice::from_ref(name)].concat();
            if self.modules.contains_key(&child) {
                at = child;
                continue;
            }
            let here = self.modules.get(&at)?;
            if here.defined.contains(name) {
                return Some(here.file);
            }
            let rest: Vec<String> = names.cloned().collect();
            let known = here.used.iter().filter(|(alias, _)| alias == name);
            let globbed = here
                .globs
                .iter()
                .map(|glob| [&glob[..], std::slice::from_ref(name)].concat());
            let named = known.map(|(_, path)| path.clone());
            for target in named.chain(globbed) {
                // `use name::…` of another crate stands for itself.
                if target.first() == Some(name) {
                    continue;
                }
                let mut passed = vec![here.file];
                let full = [&target[..], &rest].concat();
                if let Some(file) = self.resolve(&at, &full, &mut passed, depth + 1) {
                    through.extend(passed);
                    return Some(file);
                }
            }
            // Of another crate if it is the first name; else something that macros make.
            let foreign = at == module && !matches!(path[0].as_str(), "crate" | "self" | "super");
            return (!foreign).then_some(here.file);
        }
        self.modules.get(&at).map(|module| module.file)
    }
}

/// The crate of the workspace that code calls `name`.
fn member(name: &str) -> Option<&str> {
    match name {
        "tunnelstitch" => Some("src"),
        _ => name.strip_prefix("tunnelstitch_"),
    }
}

/// Marks files whose `mod` item stands behind `#[cfg(test)]`, and all files below them.
fn mark_test_files(files: &mut [File]) {
    let declared: Vec<Vec<String>> = files
        .iter()
        .flat_map(|file| {
            let of_tests = file.scan.declarations().filter(|(_, _, test)| *test);
            of_tests.map(|(inline, name, _)| {
                [&file.module[..], inline, std::slice::from_ref(name)].concat()
            })
        })
        .collect();
    for file in files {
        file.test = declared
            .iter()
            .any(|module| file.module.starts_with(module));
    }
}

/// Imports from the `mod.rs` of a folder that the file lives in: a name defined there, or one
/// that it hands on.
pub fn imports_through_own_folder(tree: &Tree) -> Vec<Offence> {
    let mut offences = Vec::new();
    for import in tree.imports() {
        let from = &tree.files[import.from];
        let above = |&k: &usize| {
            let file = &tree.files[k];
            file.path.ends_with("mod.rs") && from.module.starts_with(&file.module)
        };
        let touched = import.through.iter().chain([&import.to]);
        if let (Some(&k), false) = (touched.into_iter().find(|k| above(k)), import.test) {
            let text = format!(
                "{} comes through {}: name the file that defines it",
                import.name,
                tree.files[k].path.display()
            );
            let path = from.path.clone();
            offences.push(Offence {
                path,
                line: import.line,
                text,
            });
        }
    }
    offences
}

#[cfg(test)]
pub mod tests {
    use super::*;

    pub fn tree(files: &[(&str, &str)]) -> Tree {
        Tree::new(
            files
                .iter()
                .map(|(path, text)| (PathBuf::from(path), (*text).to_string())),
        )
    }

    pub fn arrows(tree: &Tree) -> Vec<String> {
        let name = |k: usize| tree.files[k].path.display().to_string();
        let imports = tree.imports();
        imports
            .iter()
            .map(|import| format!("{} -> {}", name(import.from), name(import.to)))
            .collect()
    }

    #[test]
    fn siblings_are_not_imported_through_their_folder() {
        let tree = tree(&[
            ("src/lib.rs", "mod a;"),
            (
                "src/a/mod.rs",
                "mod x;\nmod y;\npub use x::X;\npub const C: u8 = 1;",
            ),
            ("src/a/x.rs", "pub struct X;"),
            (
                "src/a/y.rs",
                "use super::x::X as Good;\nuse super::X;\nfn f() { crate::a::C; }",
            ),
        ]);
        let found = imports_through_own_folder(&tree);
        let lines: Vec<usize> = found.iter().map(|offence| offence.line).collect();
        assert_eq!(lines, [2, 3]);
    }

    #[test]
    fn names_are_followed_through_braces_globs_and_other_crates() {
        let tree = tree(&[
            ("src/lib.rs", "mod a;\nmod b;\nmod c;\nmod std;"),
            ("src/a.rs", "pub struct A;\npub fn f() {}"),
            (
                "src/b.rs",
                "pub use crate::a::*;\nmod inner { use super::super::c::C; }",
            ),
            (
                "src/c.rs",
                "use crate::{b::{self, A as Other}, a};\nuse rand::Rng;\npub struct C;",
            ),
            ("src/main.rs", "use crate::a::A;"),
        ]);
        assert_eq!(
            arrows(&tree),
            [
                "src/b.rs -> src/a.rs",
                "src/b.rs -> src/c.rs",
                "src/c.rs -> src/b.rs",
                "src/c.rs -> src/a.rs",
                "src/c.rs -> src/a.rs"
            ]
        );
    }
}
