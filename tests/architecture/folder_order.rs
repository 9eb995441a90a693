//! The order of the folders, and imports against it.

use crate::Offence;
use crate::lines::doc_text;
use crate::tree::Tree;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

const ORDER_START: &str = "<!-- order of the folders -->";
const ORDER_END: &str = "<!-- end of the order -->";

/// The order of the modules in each folder that the table names, lowest first; modules of one step
/// do not import each other.
pub struct FolderOrder(BTreeMap<String, Vec<Vec<String>>>);

impl FolderOrder {
    /// Reads the table in the documentation of the library: a row names a folder and its modules in
    /// backticks, steps separated by `<`. The row of `crates` has the crates, of which `src` is
    /// one.
    pub fn parse(lib: &str) -> FolderOrder {
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

    /// Finds imports of what does not stand below, and modules without a place in the table.
    pub fn offences(&self, tree: &Tree) -> Vec<Offence> {
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
        let start = tree
            .root()
            .lines()
            .position(|line| line.contains(ORDER_START));
        let line = start.map_or(1, |above| above + 1);
        let mut offences = Vec::new();
        for (folder, steps) in &self.0 {
            let listed: BTreeSet<&str> = steps.iter().flatten().map(String::as_str).collect();
            let modules = |with_tests: bool| -> BTreeSet<&str> {
                let files = tree.files.iter().filter(|file| with_tests || !file.test);
                let split = files.filter_map(|file| file.module.split_last());
                let inside = split.filter(|(_, parent)| folder_name(parent) == *folder);
                inside.map(|(module, _)| module.as_str()).collect()
            };
            let forgotten = &modules(false) - &listed;
            let forgotten = forgotten
                .iter()
                .map(|name| format!("the table lacks {name}"));
            let gone = &listed - &modules(true);
            let gone = gone
                .iter()
                .map(|name| format!("the table names {name}, which is not"));
            offences.extend(forgotten.chain(gone).map(|text| Offence {
                path: Path::new("src/lib.rs").into(),
                line,
                text: format!("{text} in {folder}"),
            }));
        }
        offences
    }
}

/// `crates`, `crates/refine`, `crates/refine/tracking`, `src`, `src/cli`, …
fn folder_name(folder: &[String]) -> String {
    match folder.first().map(String::as_str) {
        Some("src") => folder.join("/"),
        Some(_) => format!("crates/{}", folder.join("/")),
        None => "crates".to_owned(),
    }
}

fn in_backticks(text: &str) -> Vec<String> {
    text.split('`')
        .skip(1)
        .step_by(2)
        .map(String::from)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tests::tree;

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
        let found = FolderOrder::parse(tree.root()).offences(&tree);
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
        let found = FolderOrder::parse(tree.root()).offences(&tree);
        let texts: Vec<&str> = found.iter().map(|offence| offence.text.as_str()).collect();
        assert!(texts.contains(&"the table lacks new in src"), "{texts:?}");
        assert!(
            texts.contains(&"the table names low, which is not in src/b"),
            "{texts:?}"
        );
    }
}
