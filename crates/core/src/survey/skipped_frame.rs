//! A frame that is left out because its file cannot be read.

use serde::{Deserialize, Serialize};

/// Most names of frames in a message.
const MAX_NAMED_FRAMES: usize = 5;

/// A frame that is left out because its file is missing, damaged or of another size.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct SkippedFrame {
    /// Its index among all frames that `frames.images` matches.
    pub index: usize,
    /// Its file.
    pub file: String,
    /// The reason why it cannot be read.
    pub reason: String,
}

/// A sentence that names frames that are left out, if there are any. `others`: the number of those
/// that are used.
pub(super) fn sentence(skipped: &[SkippedFrame], others: usize) -> Option<String> {
    if skipped.is_empty() {
        return None;
    }
    let named = skipped.iter().take(MAX_NAMED_FRAMES);
    let named: Vec<String> = named
        .map(|s| format!("{} ({})", s.file, s.reason))
        .collect();
    let more = match skipped.len() - named.len() {
        0 => String::new(),
        more => format!(" and {more} more"),
    };
    Some(format!(
        "{} of {} frames cannot be read and are left out: {}{more}",
        skipped.len(),
        skipped.len() + others,
        named.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sentence_names_the_first_and_counts_the_others() {
        let frame = |index: usize| SkippedFrame {
            index,
            file: format!("{index}.png"),
            reason: "truncated".to_owned(),
        };
        let skipped: Vec<SkippedFrame> = (0..7).map(frame).collect();
        let said = sentence(&skipped, 20).unwrap();
        assert!(said.starts_with("7 of 27 frames cannot be read"), "{said}");
        assert!(
            said.contains("4.png (truncated)") && !said.contains("5.png"),
            "{said}"
        );
        assert!(said.ends_with("and 2 more"), "{said}");
        assert_eq!(sentence(&[], 20), None);
    }
}
