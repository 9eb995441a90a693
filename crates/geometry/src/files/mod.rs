//! Files that others have made: read only if they are regular files of a limited size, written and
//! locked never through a symbolic link, and printed with their names escaped.
//!
//! | subject | file |
//! | --- | --- |
//! | opening and reading of regular files | [`regular`] |
//! | numbers and names of binary files | [`binary`] |
//! | encodings of text files | [`encoding`] |
//! | numbers of JSON files | [`json`] |
//! | largest sizes of text files | [`limits`] |
//! | files of other kinds in place of a text | [`other_content`] |
//! | lines and columns of texts | [`place`] |
//! | files that are locked or appended to, and targets that may be replaced | [`targets`] |
//! | standard input as a file | [`standard_input`] |
//! | elements of XML files | [`xml`] |
//! | names and texts without control characters | [`printed()`] |

pub mod binary;
pub mod encoding;
pub mod json;
pub mod limits;
pub mod other_content;
pub mod place;
pub mod printed;
pub mod regular;
pub mod standard_input;
pub mod targets;
pub mod xml;

pub use binary::BinaryFile;
pub use encoding::decode_text;
pub use other_content::git_lfs_pointer;
pub use place::line_and_column;
pub use printed::{escape_controls, printed};
pub use regular::{open_regular, read_regular, read_text};
pub use standard_input::{is_standard_input, path_or_standard_input};
pub use targets::{check_replaceable_file, open_without_links, write_without_links};
