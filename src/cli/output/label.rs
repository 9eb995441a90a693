//! Labels of errors and warnings, in colour on terminals.

use anstream::{AutoStream, ColorChoice};
use anstyle::AnsiColor;

/// The label of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Label {
    /// `error:`, red.
    Error,
    /// `warning:`, yellow.
    Warning,
}

impl Label {
    /// The word, without colour.
    pub(super) fn word(self) -> &'static str {
        match self {
            Self::Error => "error:",
            Self::Warning => "warning:",
        }
    }

    /// The word for standard error: in colour if that is a terminal that shows colours and
    /// `NO_COLOR` is not set.
    pub(super) fn painted(self) -> String {
        let word = self.word();
        let colour = match self {
            Self::Error => AnsiColor::Red,
            Self::Warning => AnsiColor::Yellow,
        };
        let style = colour.on_default().bold();
        match AutoStream::choice(&std::io::stderr()) {
            ColorChoice::Never => word.to_owned(),
            _ => format!("{style}{word}{style:#}"),
        }
    }
}
