//! Rules that the sources keep: the direction of imports, and the shape of names and comments.
//!
//! Imports are read from `use` items and from paths in bodies, without the compiler, and followed
//! through re-exports to the file that defines the name. The order of the folders is the table
//! between the two marker lines in the documentation of `src/lib.rs`. Every offence is printed with
//! its file and line.

mod cycles;
mod folder_order;
mod lines;
mod scan;
mod sources;
mod tree;

use folder_order::FolderOrder;
use sources::in_all_files;
use std::fmt;
use std::path::{Path, PathBuf};
use tree::Tree;

#[test]
fn files_do_not_import_in_cycles() {
    hold(cycles::cycles(&Tree::of_sources()));
}

#[test]
fn imports_follow_the_order_of_the_folders() {
    let tree = Tree::of_sources();
    let order = FolderOrder::parse(tree.root());
    hold(order.offences(&tree));
}

#[test]
fn files_import_siblings_by_their_own_names() {
    hold(tree::imports_through_own_folder(&Tree::of_sources()));
}

#[test]
fn lines_have_at_most_100_columns() {
    hold(in_all_files(lines::long_lines));
}

#[test]
fn doc_comments_open_with_the_subject() {
    hold(in_all_files(lines::clumsy_openings));
}

#[test]
fn constants_are_named_as_bounds_and_counts() {
    hold(in_all_files(lines::constants_with_vague_names));
}

/// The estimator has so many tuned numbers, and no more than 60.
#[test]
fn tuned_numbers_are_as_many_as_stated() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let read = |path: &str| std::fs::read_to_string(root.join(path)).unwrap();
    let thresholds = read("crates/refine/src/thresholds.rs");
    let count = thresholds.matches("pub const").count();
    assert!(count <= 60, "{count}");
    let stated = format!("`crates/refine/src/thresholds.rs`; there are {count}.");
    assert!(read("CONTRIBUTING.md").contains(&stated), "{count}");
}

#[test]
fn mod_files_hold_no_functions() {
    hold(in_all_files(|path, text| {
        if (path.starts_with("src") || path.starts_with("crates")) && path.ends_with("mod.rs") {
            lines::functions(path, text)
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
