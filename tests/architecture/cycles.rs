//! Cycles of imports.

use crate::Offence;
use crate::tree::{Import, Tree};
use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

/// The shortest cycle through each file that is on one, each cycle once.
pub fn cycles(tree: &Tree) -> Vec<Offence> {
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
            if let Entry::Vacant(place) = came.entry(import.to) {
                place.insert(import);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tests::{arrows, tree};

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
            "src/a.rs:1: imports itself by way of src/b/deep.rs (Deep, line 1) \
             -> src/a.rs (A, line 2)"
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
}
