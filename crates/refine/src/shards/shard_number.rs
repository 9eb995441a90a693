//! A shard by its number, in words and in the names of files.

use serde::Serialize;
use std::fmt;
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// A shard by its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct ShardNumber {
    /// Its number, from 1.
    pub number: usize,
    /// Number of shards.
    pub of: usize,
}

impl ShardNumber {
    /// Name of what belongs to the shard.
    pub fn name(self) -> String {
        format!("shard-{}-of-{}", self.number, self.of)
    }

    /// Its file in a folder.
    pub fn file(self, folder: &Path) -> PathBuf {
        folder.join(format!("{}.state", self.name()))
    }

    /// The shard that a file is of, by its name.
    pub fn of_file(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?.strip_suffix(".state")?;
        let (number, of) = name.strip_prefix("shard-")?.split_once("-of-")?;
        let numbers = number.parse().ok().zip(of.parse().ok());
        numbers.map(|(number, of)| Self { number, of })
    }
}

impl fmt::Display for ShardNumber {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}/{}", self.number, self.of)
    }
}

impl FromStr for ShardNumber {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let numbers = text.split_once('/');
        let numbers = numbers.and_then(|(number, of)| number.parse().ok().zip(of.parse().ok()));
        match numbers {
            Some((number, of)) if (1..=of).contains(&number) => Ok(Self { number, of }),
            _ => Err("must be a number and how many there are, as 3/8".to_owned()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_named_by_their_numbers() {
        let shard: ShardNumber = "3/8".parse().unwrap();
        assert_eq!((shard.number, shard.of), (3, 8));
        assert_eq!(shard.to_string(), "3/8");
        let file = shard.file(Path::new("out"));
        assert_eq!(file, Path::new("out/shard-3-of-8.state"));
        assert_eq!(ShardNumber::of_file(&file), Some(shard));
        assert_eq!(
            ShardNumber::of_file(Path::new("out/shard-x-of-8.state")),
            None
        );
        for wrong in ["0/8", "9/8", "3", "a/b", "3/"] {
            assert!(wrong.parse::<ShardNumber>().is_err(), "{wrong}");
        }
    }
}
