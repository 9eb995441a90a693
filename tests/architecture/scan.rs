//! Just enough of Rust's grammar to find items, `use` trees and paths.

use std::collections::BTreeSet;

/// The tokens of a source file without comments and literals.
pub struct Scan {
    pub tokens: Vec<Token>,
}

pub struct Token {
    pub text: String,
    pub line: usize,
    /// Inside of an item behind `#[cfg(test)]`.
    pub test: bool,
    /// Modules written inline around it.
    pub inline: Vec<String>,
    /// Braces around it within the innermost module.
    pub depth: usize,
}

impl Token {
    pub fn is_name(&self) -> bool {
        self.text
            .starts_with(|first: char| first.is_alphabetic() || first == '_')
    }
}

/// A path as written, and where.
pub struct Used {
    pub path: Vec<String>,
    /// The name that a `use` brings into scope; `None` for `*`.
    pub alias: Option<String>,
    pub line: usize,
    pub test: bool,
    pub inline: Vec<String>,
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
    pub fn of(text: &str) -> Scan {
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
    pub fn modules(&self) -> BTreeSet<Vec<String>> {
        let inline = self.tokens.iter().map(|token| token.inline.clone());
        inline.chain([Vec::new()]).collect()
    }

    /// `mod name;`: the inline module around it, its name, and whether it is for tests.
    pub fn declarations(&self) -> impl Iterator<Item = (&[String], &String, bool)> {
        self.tokens
            .windows(3)
            .filter(|three| three[0].text == "mod" && three[2].text == ";")
            .map(|three| {
                let name = &three[1];
                (&name.inline[..], &name.text, name.test)
            })
    }

    pub fn definitions(&self) -> impl Iterator<Item = (&[String], &str)> {
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

    pub fn uses(&self) -> Vec<Used> {
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
    pub fn body_paths(&self) -> Vec<Used> {
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
                let closes_module = open.pop() == Some(true);
                inline.truncate(inline.len() - usize::from(closes_module));
            }
            _ => {}
        }
        tokens[at].inline.clone_from(&inline);
        tokens[at].depth = open.iter().rev().take_while(|&&module| !module).count();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_literals_hold_no_imports() {
        let text = "// use crate::a;\n/* /* */ crate::a */ let x = \"crate::a \\\" \";\n\
            let y = r#\"crate::a\"#; let c = '\"'; fn f<'a>() { crate::b::g('\\''); }";
        let paths = Scan::of(text).body_paths();
        let paths: Vec<String> = paths.iter().map(|used| used.path.join("::")).collect();
        assert_eq!(paths, ["crate::b::g"]);
    }
}
