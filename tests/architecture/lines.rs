//! Rules for single lines: their length, comments and names.

use crate::Offence;
use crate::scan::Scan;
use std::path::Path;

const MAX_COLUMNS: usize = 100;

/// Words that make the first sentence of a comment depend on its neighbour.
const CLUMSY_OPENINGS: [&str; 8] = [
    "The same", "What", "How", "Whether", "Where", "Why", "Like", "Same",
];

/// Words of constants that `MIN_…`, `MAX_…` and `MAX_…_ITERATIONS` say better.
const VAGUE_WORDS: [&str; 5] = ["LEAST", "MOST", "SURE", "APART", "TRIES"];

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

/// Finds lines with more than [`MAX_COLUMNS`]; rows of tables in comments may be longer.
pub fn long_lines(path: &Path, text: &str) -> Vec<Offence> {
    offences_by_line(path, text, |line| {
        let columns = line.chars().count();
        let table_row = doc_text(line).is_some_and(|text| text.starts_with('|'));
        (columns > MAX_COLUMNS && !table_row).then(|| format!("{columns} columns"))
    })
}

/// The text of a line of a doc comment.
pub fn doc_text(line: &str) -> Option<&str> {
    let line = line.trim_start();
    let text = line
        .strip_prefix("///")
        .or_else(|| line.strip_prefix("//!"))?;
    Some(text.trim())
}

/// Finds doc comments that open with one of [`CLUMSY_OPENINGS`].
pub fn clumsy_openings(path: &Path, text: &str) -> Vec<Offence> {
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

/// Finds constants with one of [`VAGUE_WORDS`] in their names.
pub fn constants_with_vague_names(path: &Path, text: &str) -> Vec<Offence> {
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

/// Finds functions outside of tests.
pub fn functions(path: &Path, text: &str) -> Vec<Offence> {
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

#[cfg(test)]
mod tests {
    use super::*;

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
