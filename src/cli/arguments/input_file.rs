//! Parser of files to read, `-` for standard input among them.

use crate::files::path_or_standard_input;
use clap::builder::{OsStringValueParser, TypedValueParser};
use std::path::PathBuf;

/// The parser of a file to read; `-` is standard input, which is read once.
pub fn input_file() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|word| match word.is_empty() {
        true => Err("an empty name is no file; `-` is standard input"),
        false => Ok(path_or_standard_input(&word)),
    })
}
