//! Parser of folders to write.

use clap::builder::{OsStringValueParser, TypedValueParser};
use std::path::PathBuf;

/// The parser of a folder to write; `-`, which is standard output elsewhere, is refused.
pub fn output_folder() -> impl TypedValueParser<Value = PathBuf> {
    OsStringValueParser::new().try_map(|word| match word == "-" {
        true => Err("several files are written, which standard output cannot hold; name a folder"),
        false => Ok(PathBuf::from(word)),
    })
}
