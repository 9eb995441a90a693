//! Rules that the sources keep: the direction of imports, and the shape of names and comments.
//!
//! Imports are read from `use` items and from paths in bodies, without the compiler, and followed
//! through re-exports to the file that defines the name. The order of the folders is the table
//! between the two marker lines in the documentation of `src/lib.rs`. Every offence is printed with
//! its file and line.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::path::{Path, PathBuf};

// ---------------------------------------------------------------------------------------------
// Rules

#[test]
fn files_do_not_import_in_cycles() {
    hold(cycles(&Tree::of_sources()));
}

#[test]
fn imports_follow_the_order_of_the_folders() {
    let tree = Tree::of_sources();
    let order = FolderOrder::parse(&tree.files[0].text);
    hold(order.offences(&tree));
}

#[test]
fn files_import_siblings_by_their_own_names() {
    hold(imports_through_own_folder(&Tree::of_sources()));
}

#[test]
fn lines_have_at_most_100_columns() {
    hold(in_all_files(long_lines));
}

#[test]
fn doc_comments_open_with_the_subject() {
    hold(in_all_files(clumsy_openings));
}

#[test]
fn constants_are_named_as_bounds_and_counts() {
    hold(in_all_files(constants_with_vague_names));
}

#[test]
fn mod_files_hold_no_functions() {
    hold(in_all_files(|path, text| {
        if path.starts_with("src") && path.ends_with("mod.rs") {
            functions(path, text)
        } else {
            Vec::new()
        }
    }));
}

/// A line of a file that breaks a rule.
#[derive(Debug, PartialEq)]
struct Offence {
    path: PathBuf,
    line: usize,
    text: String,
}

impl fmt::Display for Offence {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}: {}", self.path.display(), self.line, self.text)
    }
}

/// Fails with a list of all offences if there are any.
fn hold(offences: Vec<Offence>) {
    let lines: Vec<String> = offences.iter().map(Offence::to_string).collect();
    assert!(
        lines.is_empty(),
        "{} offences:\n{}",
        lines.len(),
        lines.join("\n")
    );
}

// ---------------------------------------------------------------------------------------------
// Lines

const MAX_COLUMNS: usize = 100;

/// Words that make the first sentence of a comment depend on its neighbour.
const CLUMSY_OPENINGS: [&str; 8] = [
    "The same", "What", "How", "Whether", "Where", "Why", "Like", "Same",
];

/// Words of constants that `MIN_…`, `MAX_…` and `MAX_…_ITERATIONS` say better.
const VAGUE_WORDS: [&str; 5] = ["LEAST", "MOST", "SURE", "APART", "TRIES"];

fn in_all_files(rule: impl Fn(&Path, &str) -> Vec<Offence>) -> Vec<Offence> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths = vec![PathBuf::from("build.rs")];
    for folder in ["src", "tests", "benches", "examples"] {
        collect_rust_files(root, Path::new(folder), &mut paths);
    }
    paths.sort();
    let read = |path: &Path| std::fs::read_to_string(root.join(path)).expect("a source file");
    paths
        .iter()
        .flat_map(|path| rule(path, &read(path)))
        .collect()
}

fn collect_rust_files(root: &Path, folder: &Path, paths: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(root.join(folder)) else {
        return;
    };
    for entry in entries {
        let entry = entry.expect("an entry of a folder");
        let path = folder.join(entry.file_name());
        if entry.path().is_dir() {
            collect_rust_files(root, &path, paths);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            paths.push(path);
        }
    }
}

fn offences_by_line(
    path: &Path,
    text: &str,
    judge: impl Fn(&str) -> Option<String>,
) -> Vec<Offence> {
    let numbered = text.lines().zip(1..);
    let offence = |(text, line)| {
        judge(text).map(|text| Offence {
            path: path.into(),
            line,
            text,
        })
    };
    numbered.filter_map(offence).collect()
}

fn long_lines(path: &Path, text: &str) -> Vec<Offence> {
    offences_by_line(path, text, |line| {
        let columns = line.chars().count();
        let table_row = doc_text(line).is_some_and(|text| text.starts_with('|'));
        (columns > MAX_COLUMNS && !table_row).then(|| format!("{columns} columns"))
    })
}

/// The text of a line of a doc comment.
fn doc_text(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let text = line
        .strip_prefix("///")
        .or_else(|| line.strip_prefix("//!"))?;
    Some(text.trim())
}

fn clumsy_openings(path: &Path, text: &str) -> Vec<Offence> {
    let mut offences = Vec::new();
    let mut within = false;
    for (line, number) in text.lines().zip(1..) {
        let doc = doc_text(line);
        if let (Some(doc), false) = (doc, within)
            && let Some(opening) = CLUMSY_OPENINGS.iter().find(|words| opens_with(doc, words))
        {
            let text = format!("the comment opens with \"{opening}\"");
            offences.push(Offence {
                path: path.into(),
                line: number,
                text,
            });
        }
        within = doc.is_some();
    }
    offences
}

fn opens_with(text: &str, words: &str) -> bool {
    let rest = text.strip_prefix(words);
    rest.is_some_and(|rest| !rest.starts_with(|next: char| next.is_alphanumeric()))
}

fn constants_with_vague_names(path: &Path, text: &str) -> Vec<Offence> {
    offences_by_line(path, text, |line| {
        let mut words = line
            .split_whitespace()
            .skip_while(|&word| word.starts_with("pub"));
        if !matches!(words.next()?, "const" | "static") {
            return None;
        }
        let name = words.next()?.trim_end_matches(':');
        let vague = name.split('_').find(|word| VAGUE_WORDS.contains(word))?;
        Some(format!("the name {name} says \"{vague}\""))
    })
}

fn functions(path: &Path, text: &str) -> Vec<Offence> {
    let scan = Scan::of(text);
    let code = scan.tokens.iter().filter(|token| !token.test);
    let mut offences = Vec::new();
    let mut after_fn = false;
    for token in code {
        if after_fn && token.is_name() {
            let text = format!("function {}", token.text);
            offences.push(Offence {
                path: path.into(),
                line: token.line,
                text,
            });
        }
        after_fn = token.text == "fn";
    }
    offences
}

// ---------------------------------------------------------------------------------------------
// Order of the folders

const ORDER_START: &str = "<!-- order of the folders -->";
const ORDER_END: &str = "<!-- end of the order -->";

/// The order of the modules in each folder that the table names, lowest first; modules of one step
/// do not import each other.
struct FolderOrder(BTreeMap<String, Vec<Vec<String>>>);

impl FolderOrder {
    /// Reads the table in the documentation of the crate: a row names a folder (the crate itself is
    /// `src`) and its modules in backticks, steps separated by `<`.
    fn parse(lib: &str) -> FolderOrder {
        let table = lib
            .split_once(ORDER_START)
            .and_then(|(_, rest)| rest.split_once(ORDER_END));
        let (table, _) = table.expect("src/lib.rs has a table of the order of the folders");
        let mut folders: BTreeMap<String, Vec<Vec<String>>> = BTreeMap::new();
        for row in table.lines().filter_map(doc_text) {
            let mut cells = row.split('|').skip(1).map(str::trim);
            let (Some(folder), Some(steps)) = (cells.next(), cells.next()) else {
                continue;
            };
            if let [folder] = &in_backticks(folder)[..] {
                let steps = steps
                    .split('<')
                    .map(in_backticks)
                    .filter(|step| !step.is_empty());
                folders.entry(folder.clone()).or_default().extend(steps);
            }
        }
        FolderOrder(folders)
    }

    fn offences(&self, tree: &Tree) -> Vec<Offence> {
        let mut offences = self.modules_without_place(tree);
        for import in tree.imports() {
            let from = &tree.files[import.from].module;
            let to = &tree.files[import.to].module;
            let shared = from.iter().zip(to).take_while(|(a, b)| a == b).count();
            let (Some(upper), Some(lower)) = (from.get(shared), to.get(shared)) else {
                continue;
            };
            let folder = &from[..shared];
            let (Some(upper_step), Some(lower_step)) =
                (self.step(folder, upper), self.step(folder, lower))
            else {
                continue;
            };
            if upper_step <= lower_step {
                let text = format!(
                    "{upper} imports {} of {lower}, which does not stand below it",
                    import.name
                );
                let path = tree.files[import.from].path.clone();
                offences.push(Offence {
                    path,
                    line: import.line,
                    text,
                });
            }
        }
        offences
    }

    fn step(&self, folder: &[String], module: &str) -> Option<usize> {
        let steps = self.0.get(&folder_name(folder))?;
        steps
            .iter()
            .position(|step| step.iter().any(|name| name == module))
    }

    /// Modules of the listed folders that the table forgets, and names in it without a module.
    fn modules_without_place(&self, tree: &Tree) -> Vec<Offence> {
        let mut offences = Vec::new();
        let mut offend = |folder: &str, text: String| {
            offences.push(Offence {
                path: Path::new("src/lib.rs").into(),
                line: 1,
                text,
            });
            let _ = folder;
        };
        for (folder, steps) in &self.0 {
            let listed: BTreeSet<&str> = steps.iter().flatten().map(String::as_str).collect();
            let modules: BTreeSet<&str> = tree
                .files
                .iter()
                .filter(|file| !file.test)
                .filter_map(|file| {
                    let (last, parent) = file.module.split_last()?;
                    (folder_name(parent) == *folder).then_some(last.as_str())
                })
                .collect();
            for module in modules.difference(&listed) {
                offend(
                    folder,
                    format!("the table of the order lacks {module} of {folder}"),
                );
            }
            for module in listed.difference(&modules) {
                if !tree
                    .files
                    .iter()
                    .any(|file| file.module.last().is_some_and(|m| m == module))
                {
                    offend(
                        folder,
                        format!("the table names {module}, which {folder} lacks"),
                    );
                }
            }
        }
        offences
    }
}

/// `src`, `src/refine`, …
fn folder_name(folder: &[String]) -> String {
    let names = std::iter::once("src").chain(folder.iter().map(String::as_str));
    names.collect::<Vec<_>>().join("/")
}

fn in_backticks(text: &str) -> Vec<String> {
    text.split('`')
        .skip(1)
        .step_by(2)
        .map(String::from)
        .collect()
}

// ---------------------------------------------------------------------------------------------
// Imports

/// The files of a crate and the names in each.
struct Tree {
    /// The first is the root.
    files: Vec<File>,
    /// Modules, those written inline included.
    modules: BTreeMap<Vec<String>, Module>,
}

struct File {
    path: PathBuf,
    text: String,
    module: Vec<String>,
    /// Declared for tests only.
    test: bool,
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
struct Import {
    from: usize,
    to: usize,
    line: usize,
    name: String,
    test: bool,
    /// Files with a re-export that the name came through.
    through: Vec<usize>,
}

impl Tree {
    fn of_sources() -> Tree {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let mut paths = Vec::new();
        collect_rust_files(root, Path::new("src"), &mut paths);
        let read = |path: PathBuf| {
            let text = std::fs::read_to_string(root.join(&path)).expect("a source file");
            (path, text)
        };
        Tree::new(paths.into_iter().map(read))
    }

    /// Files named from the folder above `src`; `main.rs` is another crate and left out.
    fn new(sources: impl IntoIterator<Item = (PathBuf, String)>) -> Tree {
        let mut files: Vec<File> = Vec::new();
        for (path, text) in sources {
            let mut module: Vec<String> = path
                .with_extension("")
                .iter()
                .skip(1)
                .map(|name| name.to_string_lossy().into_owned())
                .collect();
            match module.last().map(String::as_str) {
                Some("main") if module.len() == 1 => continue,
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

    fn imports(&self) -> Vec<Import> {
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
                at.clear();
                names.next();
            }
            "self" => drop(names.next()),
            _ => {}
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
                .map(|glob| [&glob[..], &[name.clone()]].concat());
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

/// The shortest cycle through each file that is on one, each cycle once.
fn cycles(tree: &Tree) -> Vec<Offence> {
    let imports: Vec<Import> = tree
        .imports()
        .into_iter()
        .filter(|import| !import.test)
        .collect();
    let mut next: BTreeMap<usize, BTreeMap<usize, &Import>> = BTreeMap::new();
    for import in &imports {
        next.entry(import.from)
            .or_default()
            .entry(import.to)
            .or_insert(import);
    }
    let mut seen = BTreeSet::new();
    let mut offences = Vec::new();
    for &start in next.keys() {
        let Some(cycle) = shortest_way_round(&next, start) else {
            continue;
        };
        let members: BTreeSet<usize> = cycle.iter().map(|import| import.from).collect();
        if !seen.insert(members) {
            continue;
        }
        let steps = cycle.iter().map(|import| {
            let to = tree.files[import.to].path.display();
            format!("{to} ({}, line {})", import.name, import.line)
        });
        let text = format!(
            "imports itself by way of {}",
            steps.collect::<Vec<_>>().join(" -> ")
        );
        let path = tree.files[start].path.clone();
        offences.push(Offence {
            path,
            line: cycle[0].line,
            text,
        });
    }
    offences
}

fn shortest_way_round<'a>(
    next: &BTreeMap<usize, BTreeMap<usize, &'a Import>>,
    start: usize,
) -> Option<Vec<&'a Import>> {
    let mut came: BTreeMap<usize, &Import> = BTreeMap::new();
    let mut front = vec![start];
    while !front.is_empty() && !came.contains_key(&start) {
        let mut reached = Vec::new();
        for import in front
            .iter()
            .filter_map(|from| next.get(from))
            .flat_map(BTreeMap::values)
        {
            if !came.contains_key(&import.to) {
                came.insert(import.to, import);
                reached.push(import.to);
            }
        }
        front = reached;
    }
    let mut cycle = vec![*came.get(&start)?];
    while cycle[cycle.len() - 1].from != start {
        cycle.push(came[&cycle[cycle.len() - 1].from]);
    }
    cycle.reverse();
    Some(cycle)
}

/// Imports from the `mod.rs` of a folder that the file lives in: a name defined there, or one
/// that it hands on.
fn imports_through_own_folder(tree: &Tree) -> Vec<Offence> {
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

// ---------------------------------------------------------------------------------------------
// Reading Rust

/// The tokens of a source file without comments and literals.
struct Scan {
    tokens: Vec<Token>,
}

struct Token {
    text: String,
    line: usize,
    /// Inside of an item behind `#[cfg(test)]`.
    test: bool,
    /// Modules written inline around it.
    inline: Vec<String>,
    /// Braces around it within the innermost module.
    depth: usize,
}

impl Token {
    fn is_name(&self) -> bool {
        self.text
            .starts_with(|first: char| first.is_alphabetic() || first == '_')
    }
}

/// A path as written, and where.
struct Used {
    path: Vec<String>,
    /// The name that a `use` brings into scope; `None` for `*`.
    alias: Option<String>,
    line: usize,
    test: bool,
    inline: Vec<String>,
}

/// Keywords before the name of an item.
const ITEMS: [&str; 9] = [
    "fn",
    "struct",
    "enum",
    "trait",
    "type",
    "const",
    "static",
    "union",
    "macro_rules",
];

impl Scan {
    fn of(text: &str) -> Scan {
        let mut tokens: Vec<Token> = split_tokens(&blank_comments_and_literals(text))
            .into_iter()
            .map(|(text, line)| Token {
                text,
                line,
                test: false,
                inline: Vec::new(),
                depth: 0,
            })
            .collect();
        mark_tests(&mut tokens);
        mark_modules(&mut tokens);
        Scan { tokens }
    }

    /// The module of the file itself (an empty path) and those written inline.
    fn modules(&self) -> BTreeSet<Vec<String>> {
        let inline = self.tokens.iter().map(|token| token.inline.clone());
        inline.chain([Vec::new()]).collect()
    }

    /// `mod name;`: the inline module around it, its name, and whether it is for tests.
    fn declarations(&self) -> impl Iterator<Item = (&[String], &String, bool)> {
        self.tokens
            .windows(3)
            .filter(|three| three[0].text == "mod" && three[2].text == ";")
            .map(|three| {
                let name = &three[1];
                (&name.inline[..], &name.text, name.test)
            })
    }

    fn definitions(&self) -> impl Iterator<Item = (&[String], &str)> {
        self.tokens.windows(3).filter_map(|three| {
            let [item, name, after] = three else {
                return None;
            };
            let named = if item.text == "macro_rules" {
                after
            } else {
                name
            };
            let defines = item.depth == 0 && ITEMS.contains(&item.text.as_str());
            (defines && named.is_name()).then_some((&item.inline[..], named.text.as_str()))
        })
    }

    fn uses(&self) -> Vec<Used> {
        let mut uses = Vec::new();
        let mut at = 0;
        while at < self.tokens.len() {
            let token = &self.tokens[at];
            // `use<'a>` in return types captures lifetimes.
            if token.text == "use" && self.tokens.get(at + 1).is_some_and(|t| t.text != "<") {
                at = self.use_tree(at + 1, &[], &mut uses);
            }
            at += 1;
        }
        uses
    }

    /// Reads one tree of a `use` item from token `at`; the token after it.
    fn use_tree(&self, mut at: usize, prefix: &[String], uses: &mut Vec<Used>) -> usize {
        let mut path = prefix.to_vec();
        let start = at.min(self.tokens.len() - 1);
        let push = |path: &[String], alias: Option<String>, uses: &mut Vec<Used>| {
            let Token {
                line, test, inline, ..
            } = &self.tokens[start];
            let (line, test, inline) = (*line, *test, inline.clone());
            uses.push(Used {
                path: path.to_vec(),
                alias,
                line,
                test,
                inline,
            });
        };
        loop {
            let text = self.tokens.get(at).map_or(";", |token| token.text.as_str());
            match text {
                "::" => at += 1,
                "{" => {
                    at += 1;
                    while self.tokens.get(at).is_some_and(|token| token.text != "}") {
                        at = self.use_tree(at, &path, uses);
                        if self.tokens.get(at).is_some_and(|token| token.text == ",") {
                            at += 1;
                        }
                    }
                    return at + 1;
                }
                "*" => {
                    push(&path, None, uses);
                    return at + 1;
                }
                "as" => {
                    let alias = self.tokens.get(at + 1).map(|token| token.text.clone());
                    push(&path, alias, uses);
                    return at + 2;
                }
                "," | "}" | ";" => {
                    if path.len() > prefix.len() || !prefix.is_empty() {
                        push(&path, path.last().cloned(), uses);
                    }
                    return at;
                }
                "self" if !path.is_empty() => at += 1,
                name => {
                    path.push(name.into());
                    at += 1;
                }
            }
        }
    }

    /// Paths outside of `use` items that start with `crate`, `self`, `super` or a lower-case name.
    fn body_paths(&self) -> Vec<Used> {
        let mut paths = Vec::new();
        let mut at = 0;
        while at < self.tokens.len() {
            let token = &self.tokens[at];
            if token.text == "use" {
                while self.tokens.get(at).is_some_and(|token| token.text != ";") {
                    at += 1;
                }
            }
            let mut path = Vec::new();
            while at < self.tokens.len() && self.tokens[at].is_name() {
                path.push(self.tokens[at].text.clone());
                at += 1;
                if self.tokens.get(at).is_none_or(|token| token.text != "::") {
                    break;
                }
                at += 1;
            }
            let Some(first) = path.first() else {
                at += 1;
                continue;
            };
            let module = first.starts_with(|c: char| c.is_lowercase());
            if path.len() > 1 && module && !(path.len() == 2 && first == "self") {
                let Token {
                    line, test, inline, ..
                } = token;
                let (line, test, inline) = (*line, *test, inline.clone());
                paths.push(Used {
                    path,
                    alias: None,
                    line,
                    test,
                    inline,
                });
            }
        }
        paths
    }
}

/// Replaces comments, strings and characters by spaces; lines stay.
fn blank_comments_and_literals(text: &str) -> String {
    let source: Vec<char> = text.chars().collect();
    let mut out = String::with_capacity(text.len());
    let mut at = 0;
    let starts = |at: usize, pattern: &str| {
        pattern
            .chars()
            .enumerate()
            .all(|(k, c)| source.get(at + k) == Some(&c))
    };
    while at < source.len() {
        let end = if starts(at, "//") {
            (at..source.len())
                .find(|&k| source[k] == '\n')
                .unwrap_or(source.len())
        } else if starts(at, "/*") {
            end_of_block_comment(&source, at)
        } else if source[at] == '"' {
            end_of_string(&source, at)
        } else if let Some(end) = end_of_raw_string(&source, at) {
            end
        } else if source[at] == '\'' {
            end_of_character(&source, at)
        } else {
            out.push(source[at]);
            at += 1;
            continue;
        };
        out.extend(
            source[at..end]
                .iter()
                .map(|&c| if c == '\n' { '\n' } else { ' ' }),
        );
        at = end;
    }
    out
}

fn end_of_block_comment(source: &[char], start: usize) -> usize {
    let (mut at, mut depth) = (start, 0);
    while at + 1 < source.len() {
        match (source[at], source[at + 1]) {
            ('/', '*') => depth += 1,
            ('*', '/') => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    source.len()
}

fn end_of_string(source: &[char], start: usize) -> usize {
    let mut at = start + 1;
    while at < source.len() && source[at] != '"' {
        at += if source[at] == '\\' { 2 } else { 1 };
    }
    (at + 1).min(source.len())
}

/// The end of `r"…"`, `r#"…"#`, `br"…"`, if one starts here.
fn end_of_raw_string(source: &[char], start: usize) -> Option<usize> {
    let within_name =
        start > 0 && (source[start - 1].is_alphanumeric() || source[start - 1] == '_');
    if within_name || source[start] != 'r' {
        // The `b` of `br"…"` stays as a name of its own.
        let after_b = start > 0 && source[start] == 'r' && source[start - 1] == 'b';
        if !after_b {
            return None;
        }
    }
    let hashes = source[start + 1..]
        .iter()
        .take_while(|&&c| c == '#')
        .count();
    if source.get(start + 1 + hashes) != Some(&'"') {
        return None;
    }
    let mut at = start + 2 + hashes;
    while at < source.len() {
        let closing = source[at + 1..]
            .iter()
            .take(hashes)
            .filter(|&&c| c == '#')
            .count();
        if source[at] == '"' && closing == hashes {
            return Some(at + 1 + hashes);
        }
        at += 1;
    }
    Some(source.len())
}

/// The end of `'x'` or `'\n'`; of the apostrophe alone where it opens a lifetime.
fn end_of_character(source: &[char], start: usize) -> usize {
    if source.get(start + 1) == Some(&'\\') {
        let close = (start + 3..source.len()).find(|&k| source[k] == '\'');
        return close.map_or(source.len(), |k| k + 1);
    }
    if source.get(start + 2) == Some(&'\'') {
        start + 3
    } else {
        start + 1
    }
}

/// Names, `::` and single characters, with their lines.
fn split_tokens(text: &str) -> Vec<(String, usize)> {
    let mut tokens: Vec<(String, usize)> = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        let mut rest = line.trim_start();
        while let Some(first) = rest.chars().next() {
            let name = rest
                .find(|c: char| !c.is_alphanumeric() && c != '_')
                .unwrap_or(rest.len());
            let length = match first {
                _ if name > 0 => name,
                ':' if rest.starts_with("::") => 2,
                _ => first.len_utf8(),
            };
            tokens.push((rest[..length].into(), number));
            rest = rest[length..].trim_start();
        }
    }
    tokens
}

/// Marks items behind `#[cfg(test)]`: up to their closing brace or semicolon.
fn mark_tests(tokens: &mut [Token]) {
    const ATTRIBUTE: [&str; 7] = ["#", "[", "cfg", "(", "test", ")", "]"];
    let mut at = 0;
    while at + ATTRIBUTE.len() <= tokens.len() {
        let found = ATTRIBUTE
            .iter()
            .zip(&tokens[at..])
            .all(|(text, token)| *text == token.text);
        if !found {
            at += 1;
            continue;
        }
        let (mut depth, mut end) = (0, at + ATTRIBUTE.len());
        while end < tokens.len() {
            match tokens[end].text.as_str() {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => depth -= 1,
                _ => {}
            }
            let closed = matches!(tokens[end].text.as_str(), "}" | ";");
            end += 1;
            if closed && depth == 0 {
                break;
            }
        }
        for token in &mut tokens[at..end] {
            token.test = true;
        }
        at = end;
    }
}

/// Notes the inline modules and braces around each token.
fn mark_modules(tokens: &mut [Token]) {
    // Per open brace: whether it opened a module.
    let mut open: Vec<bool> = Vec::new();
    let mut inline: Vec<String> = Vec::new();
    for at in 0..tokens.len() {
        let opens_module = at >= 2 && tokens[at].text == "{" && tokens[at - 2].text == "mod";
        match tokens[at].text.as_str() {
            "{" => {
                if opens_module {
                    inline.push(tokens[at - 1].text.clone());
                }
                open.push(opens_module);
            }
            "}" => {
                if open.pop() == Some(true) {
                    inline.pop();
                }
            }
            _ => {}
        }
        tokens[at].inline.clone_from(&inline);
        tokens[at].depth = open.iter().rev().take_while(|&&module| !module).count();
    }
}

// ---------------------------------------------------------------------------------------------
// Tests of the reading itself, on trees of a few lines

#[cfg(test)]
mod tests {
    use super::*;

    fn tree(files: &[(&str, &str)]) -> Tree {
        Tree::new(
            files
                .iter()
                .map(|(path, text)| (PathBuf::from(path), (*text).to_string())),
        )
    }

    fn arrows(tree: &Tree) -> Vec<String> {
        let name = |k: usize| tree.files[k].path.display().to_string();
        let imports = tree.imports();
        imports
            .iter()
            .map(|import| format!("{} -> {}", name(import.from), name(import.to)))
            .collect()
    }

    #[test]
    fn a_cycle_through_a_re_export_is_found() {
        let tree = tree(&[
            ("src/lib.rs", "mod a;\nmod b;"),
            ("src/a.rs", "use crate::b::Deep;\npub struct A;"),
            ("src/b/mod.rs", "mod deep;\npub use deep::Deep;"),
            ("src/b/deep.rs", "\npub struct Deep(crate::a::A);"),
        ]);
        let found = cycles(&tree);
        assert_eq!(found.len(), 1, "{found:?}");
        let text = found[0].to_string();
        assert_eq!(
            text,
            "src/a.rs:1: imports itself by way of src/b/deep.rs (Deep, line 1) -> src/a.rs (A, line 2)"
        );
    }

    #[test]
    fn tests_may_close_a_cycle() {
        let tree = tree(&[
            ("src/lib.rs", "mod a;\nmod b;\n#[cfg(test)]\nmod scene;"),
            (
                "src/a.rs",
                "pub struct A;\n#[cfg(test)]\nmod tests {\n use super::*;\n use crate::b::B;\n}",
            ),
            ("src/b.rs", "use crate::a::A;\npub struct B(A);"),
            ("src/scene.rs", "use crate::a::A;"),
        ]);
        assert!(cycles(&tree).is_empty());
        assert_eq!(
            arrows(&tree),
            [
                "src/a.rs -> src/b.rs",
                "src/b.rs -> src/a.rs",
                "src/scene.rs -> src/a.rs"
            ]
        );
    }

    const ORDER: &str = "\
        //! <!-- order of the folders -->\n\
        //!\n\
        //! | folder | modules |\n\
        //! | --- | --- |\n\
        //! | `src` | `a`, `peer` < `b` |\n\
        //! | `src/b` | `low` < `high` |\n\
        //!\n\
        //! <!-- end of the order -->\n\
        mod a; mod b; mod peer;";

    #[test]
    fn imports_against_the_order_are_found_in_tests_too() {
        let tree = tree(&[
            ("src/lib.rs", ORDER),
            (
                "src/a.rs",
                "#[cfg(test)]\nmod tests { use crate::b::high::H; }",
            ),
            ("src/peer.rs", "use crate::a;"),
            ("src/b/mod.rs", "mod high;\nmod low;"),
            ("src/b/low.rs", "fn f() { super::high::g(); }"),
            (
                "src/b/high.rs",
                "use super::low;\nuse crate::a;\npub fn g() {}\npub struct H;",
            ),
        ]);
        let found = FolderOrder::parse(&tree.files[0].text).offences(&tree);
        let found: Vec<String> = found.iter().map(Offence::to_string).collect();
        assert_eq!(
            found,
            [
                "src/a.rs:2: a imports H of b, which does not stand below it",
                "src/b/low.rs:1: low imports g of high, which does not stand below it",
                "src/peer.rs:1: peer imports a of a, which does not stand below it",
            ]
        );
    }

    #[test]
    fn the_table_lists_every_module() {
        let tree = tree(&[("src/lib.rs", ORDER), ("src/new.rs", ""), ("src/a.rs", "")]);
        let found = FolderOrder::parse(&tree.files[0].text).offences(&tree);
        let texts: Vec<&str> = found.iter().map(|offence| offence.text.as_str()).collect();
        assert!(
            texts.contains(&"the table of the order lacks new of src"),
            "{texts:?}"
        );
        assert!(
            texts.contains(&"the table names low, which src/b lacks"),
            "{texts:?}"
        );
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

    #[test]
    fn comments_and_literals_hold_no_imports() {
        let text = "// use crate::a;\n/* /* */ crate::a */ let x = \"crate::a \\\" \";\n\
            let y = r#\"crate::a\"#; let c = '\"'; fn f<'a>() { crate::b::g('\\''); }";
        let paths = Scan::of(text).body_paths();
        let paths: Vec<String> = paths.iter().map(|used| used.path.join("::")).collect();
        assert_eq!(paths, ["crate::b::g"]);
    }

    #[test]
    fn lines_are_judged() {
        let path = Path::new("x.rs");
        let wide = "x".repeat(101);
        assert_eq!(
            long_lines(path, &format!("fn f() {{}}\n{wide}\n/// | {wide} |")).len(),
            1
        );
        let comments = "/// What it is.\n/// What follows.\nfn f();\n/// Whatever.\n//! How so.";
        assert_eq!(clumsy_openings(path, comments)[0].line, 1);
        let constants = "pub(crate) const LEAST_RAYS: usize = 1;\nconst MOSTLY: u8 = 1;";
        assert_eq!(constants_with_vague_names(path, constants).len(), 1);
        assert_eq!(
            functions(path, "pub use a::f;\nfn g() {}\n#[cfg(test)]\nfn h() {}").len(),
            1
        );
    }
}
