//! Names and texts without control characters, for terminals and pages.
//!
//! A file name may hold any character. On a terminal, control characters move the cursor, change
//! colours or the title, and directional marks reorder what is read.

use super::standard_input::name_of;
use std::fmt::{self, Display, Write};
use std::path::Path;

/// A path as it is printed: control characters are escaped as in `\u{1b}` or `\n`, and bytes that
/// are not UTF-8 as in `\xff`. Standard input is named so.
pub fn printed(path: &Path) -> impl Display + '_ {
    PrintedPath(path)
}

struct PrintedPath<'a>(&'a Path);

impl Display for PrintedPath<'_> {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(name) = name_of(self.0) {
            return f.write_str(name);
        }
        for chunk in self.0.as_os_str().as_encoded_bytes().utf8_chunks() {
            chunk
                .valid()
                .chars()
                .try_for_each(|c| write_escaped(f, c))?;
            for byte in chunk.invalid() {
                write!(f, "\\x{byte:02x}")?;
            }
        }
        Ok(())
    }
}

/// Escapes the control characters of a text except line breaks and tabs.
pub fn escape_controls(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        let _ = match c {
            '\n' | '\t' => escaped.write_char(c),
            c => write_escaped(&mut escaped, c),
        };
    }
    escaped
}

fn write_escaped(to: &mut impl Write, c: char) -> fmt::Result {
    if c.is_control() || is_directional(c) {
        write!(to, "{}", c.escape_default())
    } else {
        to.write_char(c)
    }
}

/// True for marks that change the direction of text, and for line separators.
fn is_directional(c: char) -> bool {
    let ranges = [
        '\u{200e}'..='\u{200f}',
        '\u{2028}'..='\u{202e}',
        '\u{2066}'..='\u{2069}',
    ];
    ranges.iter().any(|range| range.contains(&c))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_and_letters_stay() {
        let name = "frames/ü\u{1b}[31m\u{7}\r\n\u{202e}.png";
        assert_eq!(
            printed(Path::new(name)).to_string(),
            "frames/ü\\u{1b}[31m\\u{7}\\r\\n\\u{202e}.png"
        );
        assert_eq!(escape_controls("two\nlines\u{1b}"), "two\nlines\\u{1b}");
    }

    #[cfg(unix)]
    #[test]
    fn bytes_that_are_no_text_are_shown() {
        use std::os::unix::ffi::OsStrExt;
        let name = std::ffi::OsStr::from_bytes(b"a\xff.png");
        assert_eq!(printed(Path::new(name)).to_string(), "a\\xff.png");
    }
}
